"""What the commands that study a case share: lists, folders, progress, Ctrl-C. Knows the terminal; asks nothing."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from fvsolve.errors import FvsolveError, visible

NOW_AND_THEN = 10.0  # between two lines of progress where no terminal listens [s]

Out = Annotated[Path | None, typer.Option(metavar="DIR", help="folder of tables and pictures")]
Jobs = Annotated[int, typer.Option(metavar="N", help="runs at a time, each in a process of its own")]
Dask = Annotated[str | None, typer.Option(metavar="ADDRESS", help="scheduler whose workers run: tcp://10.0.0.1:8786")]
Seed = Annotated[int, typer.Option(metavar="N", help="which of all samples")]


def listed(text: str | None, option: str = "") -> list[str] | None:
    """`a,b,c` as its words, each once; None where nothing is said. Raises FvsolveError for a list without any."""
    if text is None:
        return None
    found = list(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
    if not found:
        raise FvsolveError(f'{option} "{text}" lists nothing; wanted names or numbers with commas between them')
    return found


def methods_of(text: str | None) -> list[str] | None:
    """`--method A,B` as names; a word that is a file holds a tableau, which is a method by the name of the file."""
    names = listed(text, "--method")
    return None if names is None else [method_from(name) for name in names]


def method_from(word: str) -> str:
    """The name of a method; of a file that holds its tableau as text, the file's own, known from then on."""
    from fvsolve.steppers.tableau import METHODS, method_of_file

    path = Path(word)
    return word if word in METHODS or not path.is_file() else method_of_file(path).name


def folder_of(case, study: str, out: Path | None) -> Path:
    """Where a study of a case leaves its files: runs/NAME.STUDY by default, created."""
    return writable(out or Path("runs") / f"{case.name}.{study}")


def replaced(folder: Path, name: str) -> None:
    """Say that an earlier result goes, whose file `name` stands in the folder."""
    if (folder / name).exists():
        print(f"{folder}: replaces the results of an earlier command there; --out DIR keeps them", file=sys.stderr)


def cleared(folder: Path, *patterns: str) -> Path:
    """The folder without the files that an earlier command of the kind wrote there: none may stand beside new ones."""
    for path in [one for pattern in patterns for one in folder.glob(pattern)]:
        path.unlink()
    return folder


def writable(folder: Path) -> Path:
    """The folder, created; raises FvsolveError where nothing can be written into it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise FvsolveError(f"{folder}: cannot be written: {error.strerror or error}; name another with --out") from None
    if not os.access(folder, os.W_OK):
        raise FvsolveError(f"{folder}: cannot be written: permission denied; name another with --out")
    return folder


@contextmanager
def told(kept: bool = True) -> Iterator[Callable[[int, int, str], None]]:
    """A `progress(done, total, next)` function: one line on a terminal, rewritten; elsewhere one every NOW_AND_THEN.

    Ctrl-C ends the command with exit code 130; points that are finished are on disk and the same command goes on,
    unless `kept` is False.
    """
    shows, seen, latest, over = sys.stderr.isatty(), [0, 0], [""], threading.Event()

    def progress(done: int, total: int, what: str) -> None:
        seen[:], latest[0] = (done, total), f"{done} of {total}: {visible(what)}"
        if shows:
            print(f"\r\033[K{latest[0]}", end="", file=sys.stderr, flush=True)

    def repeat() -> None:
        last = ""
        while not over.wait(NOW_AND_THEN):
            if latest[0] != last:
                last = latest[0]
                print(last, file=sys.stderr, flush=True)

    if not shows:
        threading.Thread(target=repeat, daemon=True).start()

    try:
        yield progress
    except KeyboardInterrupt:
        rest = "the same command goes on" if kept else "none of them is kept"
        print(f"\ninterrupted after {seen[0]} of {seen[1]} points; {rest}", file=sys.stderr)
        sys.exit(130)
    finally:
        over.set()
        if shows:
            print("\r\033[K", end="", file=sys.stderr, flush=True)

"""Options common to the commands that study a case: lists, output folders, progress lines, Ctrl-C."""

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

PROGRESS_INTERVAL = 10.0  # interval between lines of progress if the output is not a terminal [s]

Out = Annotated[
    Path | None,
    typer.Option(
        metavar="DIR", help="folder of tables and pictures (default runs/NAME.COMMAND, such as runs/main.sweep)"
    ),
]
Jobs = Annotated[int, typer.Option(metavar="N", help="number of runs at a time, each in its own process")]
Dask = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="address of a Dask scheduler whose workers make the runs, for example tcp://10.0.0.1:8786",
    ),
]
Seed = Annotated[int, typer.Option(metavar="N", help="seed of the random samples")]


def comma_list(text: str | None, option: str = "") -> list[str] | None:
    """Words of a list `a,b,c`, without duplicates; None for None. Raises FvsolveError for a list without words.

    option : name of the option, for the message
    """
    if text is None:
        return None
    words = list(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
    if not words:
        raise FvsolveError(f'{option} "{text}" is an empty list. Expected names or numbers separated by commas')
    return words


def method_names(text: str | None) -> list[str] | None:
    """Names of the methods in a list `A,B`; None for None.

    A word may also be the path of a tableau file, see `method_name`.
    """
    names = comma_list(text, "--method")
    return None if names is None else [method_name(name) for name in names]


def method_name(word: str) -> str:
    """Name of a method. If the word is the path of a tableau file, register it as a method named after the file."""
    from fvsolve.steppers.tableau import METHODS, method_of_file

    path = Path(word)
    return word if word in METHODS or not path.is_file() else method_of_file(path).name


def folder_of(case, study: str, out: Path | None) -> Path:
    """Create and return the folder for the files of a study: `out`, or runs/NAME.STUDY if `out` is None."""
    return writable_folder(out or Path("runs") / f"{case.name}.{study}")


def warn_replaced(folder: Path, name: str) -> None:
    """Print a notice that an earlier result will be replaced, if the folder contains the file `name`."""
    if (folder / name).exists():
        print(f"{folder}: the results of an earlier command are replaced; to keep them, use --out DIR", file=sys.stderr)


def clear_files(folder: Path, *patterns: str) -> Path:
    """Delete the files in a folder that match glob patterns, left by an earlier command; returns the folder."""
    for path in [file for pattern in patterns for file in folder.glob(pattern)]:
        path.unlink()
    return folder


def writable_folder(folder: Path) -> Path:
    """Create the folder and return it. Raises FvsolveError if it is not writable."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        text = f"{folder}: cannot be written: {error.strerror or error}"
        raise FvsolveError(f"{text}. Use another directory with --out DIR") from None
    if not os.access(folder, os.W_OK):
        raise FvsolveError(f"{folder}: cannot be written: permission denied. Use another directory with --out DIR")
    return folder


@contextmanager
def progress_line(resumable: bool = True) -> Iterator[Callable[[int, int, str], None]]:
    """Context manager that yields `progress(done, total, label)`; label : text on the next run.

    On a terminal it rewrites one line; otherwise it prints a line every `PROGRESS_INTERVAL`. Ctrl-C ends the command
    with exit code 130, and with a message that states whether finished runs are kept.
    resumable : True if finished runs are on disk and the same command continues from there
    """
    is_terminal, counts, text, finished = sys.stderr.isatty(), [0, 0], [""], threading.Event()

    def progress(done: int, total: int, label: str) -> None:
        counts[:], text[0] = (done, total), f"{done} of {total}: {visible(label)}"
        if is_terminal:
            print(f"\r\033[K{text[0]}", end="", file=sys.stderr, flush=True)

    def repeat() -> None:
        printed = ""
        while not finished.wait(PROGRESS_INTERVAL):
            if text[0] != printed:
                printed = text[0]
                print(printed, file=sys.stderr, flush=True)

    if not is_terminal:
        threading.Thread(target=repeat, daemon=True).start()

    try:
        yield progress
    except KeyboardInterrupt:
        rest = "the same command resumes from there" if resumable else "their results are lost"
        print(f"\ninterrupted after {counts[0]} of {counts[1]} points; {rest}", file=sys.stderr)
        sys.exit(130)
    finally:
        finished.set()
        if is_terminal:
            print("\r\033[K", end="", file=sys.stderr, flush=True)

"""Pictures drawn by a second process, which fetches matplotlib while the first computes. Knows figures; knows no run.

    python -m fvsolve.draw.beside

reads pictures from standard input, one pickle each, and answers with a pickle: why it is not there, or nothing.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import subprocess
import sys
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

from fvsolve.shown import save

PACKAGE = Path(__file__).resolve().parents[1]


class Picture(NamedTuple):
    """A file to be, and what draws it: a function of `fvsolve.draw.plot` that gives a Figure, its arguments by name."""

    path: Path
    function: str
    arguments: Mapping[str, Any]


def draw(picture: Picture) -> str:
    """Write a picture, whole or not at all; why it could not be drawn, "" where it could."""
    fresh = picture.path.with_name(f"fresh-{picture.path.name}")
    try:
        figure = getattr(import_module("fvsolve.draw.plot"), picture.function)(**picture.arguments)
        save(figure, fresh)
        os.replace(fresh, picture.path)
    except Exception as error:  # whatever it is, the numbers are there
        return f"{type(error).__name__}: {error}"
    finally:
        with contextlib.suppress(OSError):
            fresh.unlink()
    return ""


class Painter:
    """Draws pictures, `beside` this process in a second one that is begun at once, where that gains time.

    A context: it leaves no process behind, nor half a picture.
    """

    def __init__(self, beside: bool) -> None:
        self.process = None
        if not beside or "matplotlib.figure" in sys.modules or processors() < 2 or not sys.executable:
            return
        path = os.pathsep.join([str(PACKAGE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
        # A group of its own: Ctrl-C is for the run, which says what becomes of pictures.
        apart = {"start_new_session": True} if os.name == "posix" else {"creationflags": 0x200}
        with contextlib.suppress(OSError):  # no room for a second process
            self.process = subprocess.Popen(
                [sys.executable, "-P", "-m", "fvsolve.draw.beside"], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                env=os.environ | {"PYTHONPATH": path}, **apart,
            )  # fmt: skip

    def draw(self, pictures: Iterable[Picture]) -> dict[Path, str]:
        """Write pictures; of those that could not be drawn, why."""
        pictures = list(pictures)
        try:
            found = {one.path: self._drawn(one) for one in pictures}
        except BaseException:
            self.end()
            for one in pictures:
                with contextlib.suppress(OSError):
                    one.path.with_name(f"fresh-{one.path.name}").unlink()
            raise
        return {path: why for path, why in found.items() if why}

    def _drawn(self, picture: Picture) -> str:
        if self.process is None:
            return draw(picture)
        try:
            pickle.dump(picture, self.process.stdin, pickle.HIGHEST_PROTOCOL)
            self.process.stdin.flush()
            return pickle.load(self.process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError):
            self.end()
            return draw(picture)

    def end(self) -> None:
        """Leave no process behind."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            with contextlib.suppress(OSError):  # what was not written is lost with it
                self.process.stdin.close()
            self.process.stdout.close()
            self.process = None

    def __enter__(self) -> Painter:
        return self

    def __exit__(self, *_: Any) -> None:
        self.end()


def processors() -> int:
    """How many this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def serve() -> None:
    """Draw what comes until nothing more can."""
    from fvsolve.draw import style

    asked, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints is no answer
    axes = style.figure(1.0).subplots()  # what all pictures want is fetched before the first
    axes.plot([0.0, 1.0], label="x")
    axes.legend()
    axes.figure.canvas.draw()
    while True:
        try:
            picture = pickle.load(asked)
        except EOFError:
            return
        pickle.dump(draw(picture), answers)
        answers.flush()


if __name__ == "__main__":
    serve()

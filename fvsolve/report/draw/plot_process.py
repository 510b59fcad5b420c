"""Pictures drawn in a second process, which imports matplotlib while the first process computes.

    python -m fvsolve.report.draw.plot_process

reads pictures from standard input, one pickle each, and answers each with a pickle: the error text, or "".
"""

import contextlib
import os
import pickle
import subprocess
import sys
from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple, Self

from fvsolve.compile.child_process import python_command, python_environment
from fvsolve.display import save
from fvsolve.file_replacement import remove_unfinished


class Picture(NamedTuple):
    """Request for a picture: path of the file, name of a function of `draw.plot`, and its arguments by name."""

    path: Path
    function: str
    arguments: Mapping[str, Any]


def draw_picture(picture: Picture) -> str:
    """Write a picture so that its file is complete or missing; returns the error text, or "" on success."""
    try:
        figure = getattr(import_module("fvsolve.report.draw.plot"), picture.function)(
            **picture.arguments
        )
        save(figure, picture.path)
    except Exception as error:
        # a missing picture must not fail the run, whose numbers are complete
        return f"{type(error).__name__}: {error}"
    return ""


class PlotProcess:
    """Drawing of pictures in a second process, if `second_process` is true and it saves time, else in this process.

    The second process starts at once. As a context manager the object ends the process on exit, and no
    incomplete picture is left.
    """

    def __init__(self, second_process: bool) -> None:
        self.process = None
        if (
            not second_process
            or "matplotlib.figure" in sys.modules
            or processor_count() < 2
            or not sys.executable
        ):
            return
        # A process group of its own: Ctrl-C must interrupt only the run, which then reports on pictures.
        options = {"start_new_session": True} if os.name == "posix" else {"creationflags": 0x200}
        with contextlib.suppress(OSError):  # the system allows no second process
            self.process = subprocess.Popen(
                python_command("-m", "fvsolve.report.draw.plot_process"),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=python_environment(),
                **options,
            )

    def draw(self, pictures: Iterable[Picture]) -> dict[Path, str]:
        """Write pictures; returns the error text of each picture that could not be drawn, by its path."""
        pictures, process = list(pictures), None if self.process is None else self.process.pid
        try:
            faults = {picture.path: self._draw_by_process(picture) for picture in pictures}
        except BaseException:
            self.end()
            for folder in {picture.path.parent for picture in pictures} if process else ():
                remove_unfinished(folder, process)
            raise
        return {path: fault for path, fault in faults.items() if fault}

    def _draw_by_process(self, picture: Picture) -> str:
        if self.process is None:
            return draw_picture(picture)
        try:
            pickle.dump(picture, self.process.stdin, pickle.HIGHEST_PROTOCOL)
            self.process.stdin.flush()
            return pickle.load(self.process.stdout)
        except (OSError, EOFError, pickle.UnpicklingError):
            self.end()
            return draw_picture(picture)

    def end(self) -> None:
        """End the second process, if any."""
        if self.process is not None:
            self.process.kill()
            self.process.wait()
            with contextlib.suppress(OSError):  # unwritten requests are discarded
                self.process.stdin.close()
            self.process.stdout.close()
            self.process = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: Any) -> None:
        self.end()


def processor_count() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def draw_requests() -> None:
    """Draw the pictures that are requested on standard input, until the input ends."""
    from fvsolve.report.draw import style

    requests, answers = sys.stdin.buffer, os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # output of libraries must not mix with the answers
    axes = style.figure(1.0).subplots()  # imports what all pictures need before the first request
    axes.plot([0.0, 1.0], label="x")
    axes.legend()
    axes.figure.canvas.draw()
    while True:
        try:
            picture = pickle.load(requests)
        except EOFError:
            return
        pickle.dump(draw_picture(picture), answers)
        answers.flush()


if __name__ == "__main__":
    draw_requests()

"""Progress of runs and studies on standard error, and handling of Ctrl-C."""

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext

from fvsolve.errors import visible

PROGRESS_INTERVAL = 10.0  # interval between lines of progress if the output is not a terminal [s]


@contextmanager
def run_progress(case=None) -> Iterator[Callable[[float, float, int], None]]:
    """Context manager that yields a `progress` function for a run, which ends the run at Ctrl-C.

    The first Ctrl-C ends the run after a complete step; the second interrupts it at once.
    case : case whose progress is drawn as a bar on a terminal; None for no bar
    """
    stop = threading.Event()
    bar = RunBar(case) if case is not None and sys.stderr.isatty() else None

    def progress(t: float, seconds: float, steps: int) -> None:
        if bar:
            bar(t, seconds)
        if stop.is_set():
            raise KeyboardInterrupt

    def handle(number, frame) -> None:
        stop.set()
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, handle)
    try:
        with bar.shown if bar else nullcontext():
            yield progress
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def interrupt_message(words: str) -> Iterator[None]:
    """Context manager that, at Ctrl-C, prints `words` and exits with code 130."""
    try:
        yield
    except KeyboardInterrupt:
        print(f"\n{words}", file=sys.stderr)
        sys.exit(130)


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


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[int, int, str], None]]:
    """Context manager that yields `progress(done, total, next)`: a bar on a terminal, otherwise lines at intervals.

    label : text before the bar; next : text on the next item
    """
    if not sys.stderr.isatty():
        with progress_line() as progress:
            yield progress
        return
    from rich.progress import MofNCompleteColumn

    with _bar(MofNCompleteColumn()) as bar:
        task = bar.add_task(label, total=None)
        yield lambda done, total, text: bar.update(
            task, completed=done, total=total, description=f"{label}: {visible(text)}"
        )


class RunBar:
    """Progress bar of a run with simulated time, speed and remaining time."""

    def __init__(self, case):
        from rich.progress import TextColumn

        self.start, self.end, self.format_amount = case.numerics.start, case.numerics.end, case.amount
        self.first: tuple[float, float] | None = None
        self.shown = _bar(TextColumn("{task.fields[now]}"))
        self.task = self.shown.add_task(visible(case.name), total=self.end - self.start, now="")

    def __call__(self, t: float, seconds: float) -> None:
        self.first = self.first or (t, seconds)
        spent = seconds - self.first[1]
        speed = f", {(t - self.first[0]) / spent:.3g} s per s" if spent > 0.0 else ""
        self.shown.update(
            self.task,
            completed=t - self.start,
            now=f"{self.format_amount(t, 'time', 6)} of {self.format_amount(self.end, 'time', 6)}{speed}",
        )


def _bar(column):
    """Progress bar of rich on standard error, which disappears at the end; column : what stands after the bar."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}", markup=False), BarColumn(), column, TimeRemainingColumn()
    return Progress(*columns, console=Console(stderr=True), transient=True)

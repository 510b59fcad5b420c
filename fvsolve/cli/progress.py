"""Progress bars of runs, and handling of Ctrl-C."""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from fvsolve.errors import visible


@contextmanager
def run_progress(case) -> Iterator[Callable[[float, float, int], None]]:
    """Context manager that yields a `progress` function for a run, which draws a bar and ends the run at Ctrl-C.

    The first Ctrl-C ends the run after a complete step; the second interrupts it at once.
    """
    stop = threading.Event()
    bar = Bar(case) if sys.stderr.isatty() else None

    def progress(t: float, seconds: float, steps: int) -> None:
        if bar:
            bar(t, seconds)
        if stop.is_set():
            raise KeyboardInterrupt

    with _interrupt_sets(stop), bar.shown if bar else _no_bar():
        yield progress


@contextmanager
def interruptible() -> Iterator[Callable[[float, float, int], None]]:
    """Context manager that yields a silent `progress` function, which ends a run at Ctrl-C like `run_progress`."""
    stop = threading.Event()

    def progress(t: float, seconds: float, steps: int) -> None:
        if stop.is_set():
            raise KeyboardInterrupt

    with _interrupt_sets(stop):
        yield progress


@contextmanager
def _interrupt_sets(stop: threading.Event) -> Iterator[None]:
    def handle(number, frame) -> None:
        stop.set()
        signal.signal(signal.SIGINT, before)

    before = signal.signal(signal.SIGINT, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _no_bar() -> Iterator[None]:
    yield


@contextmanager
def progress_bar(label: str) -> Iterator[Callable[[int, int, str], None]]:
    """Context manager that yields `progress(done, total, next)`: a bar on a terminal, otherwise lines at intervals.

    label : text before the bar; next : text on the next item
    """
    if not sys.stderr.isatty():
        from fvsolve.cli.study_options import progress_line

        with progress_line() as progress:
            yield progress
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(label, total=None)
        yield lambda done, total, text: bar.update(
            task, completed=done, total=total, description=f"{label}: {visible(text)}"
        )


class Bar:
    """Progress bar with simulated time, speed and remaining time."""

    def __init__(self, case):
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        self.start, self.end, self.format_amount = case.numerics.start, case.numerics.end, case.amount
        self.first: tuple[float, float] | None = None
        self.shown = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(),
            TextColumn("{task.fields[now]}"),
            TimeRemainingColumn(),
            console=Console(stderr=True),
            transient=True,
        )
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

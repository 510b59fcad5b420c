"""Presentation of results on the terminal (JSON, or lines and tables), progress on standard error, and Ctrl-C."""

import json
import math
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

from fvsolve.core.output.result_table import ResultTable
from fvsolve.errors import visible

WIDTH = 160  # line width of output that does not go to a terminal


def present(as_json: bool, data: Any, items: Iterable, code: int = 0) -> None:
    """Print the result of a command, and end the program with the exit code `code` unless it is 0.

    as_json : True to print `data` as one JSON object, False to print `items`; see `print_json` and `show`
    """
    if as_json:
        print_json(data)
    else:
        show(items)
    if code:
        sys.exit(code)


def print_json(data: Any) -> None:
    """Print one JSON object on standard output, with unrounded numbers."""
    from fvsolve.core.output.summary_file import plain

    print(json.dumps(plain(data), allow_nan=False))


def show(items: Iterable) -> None:
    """Print lines and tables on standard output: texts, pairs (text, style), and objects `ResultTable`.

    Texts are printed literally: markup and control characters have no effect. Output that does not go to a terminal is
    wide and without color, and needs rich only for tables that are too wide or contain other characters than ASCII.
    """
    console = _console() if sys.stdout.isatty() else None
    for item in items:
        if isinstance(item, (str, tuple)):
            text, style = (item, None) if isinstance(item, str) else item
            if console:
                console.print(
                    visible(text), style=style, highlight=False, markup=False, soft_wrap=True
                )
            else:
                print(visible(text))
        else:
            lines = None if console else table_lines(item)
            if lines is None:
                (console or _console()).print(_grid(item))
            else:
                print("\n".join(lines))


def _console():
    from rich.console import Console

    return Console() if sys.stdout.isatty() else Console(width=WIDTH, no_color=True)


def table_lines(table: ResultTable) -> list[str] | None:
    """Lines of a table, as rich prints them without color; None if it is too wide or not of printable ASCII.

    Columns that contain a number or "-" are aligned to the right.
    """
    heads, texts = table.words()
    rows = [heads, *texts]
    widths = [max(1, *map(len, column)) for column in zip(*rows, strict=True)]
    text = "".join(cell for row in rows for cell in row)
    if sum(widths) + 2 * len(widths) - 2 > WIDTH or not (text.isascii() and text.isprintable()):
        return None
    left = _text_columns(heads, texts)
    cells = [
        [
            x.ljust(w) if is_left else x.rstrip().rjust(w)
            for x, w, is_left in zip(row, widths, left, strict=True)
        ]
        for row in rows
    ]
    return ["  ".join(row) for row in cells]


def _text_columns(heads: list[str], rows: list[list[str]]) -> list[bool]:
    """For each column True if none of its cells is a number."""
    return [not any(_is_numeric(row[i]) for row in rows) for i in range(len(heads))]


def _grid(table: ResultTable):
    from rich.table import Table as Grid
    from rich.text import Text

    grid = Grid(box=None, pad_edge=False, header_style="bold", show_edge=False)
    heads, rows = table.words()
    for header, is_left in zip(heads, _text_columns(heads, rows), strict=True):
        grid.add_column(
            Text(visible(header)), justify="left" if is_left else "right", overflow="fold"
        )
    for row in rows:
        grid.add_row(*(Text(visible(cell)) for cell in row))
    return grid


def _is_numeric(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return text == "-"
    return True


PROGRESS_INTERVAL = 10.0  # interval between lines of progress if the output is not a terminal [s]


@contextmanager
def run_progress(case=None) -> Iterator[Callable[[float, float, int], None]]:
    """Context manager that yields a `progress` function for a run, which ends the run at Ctrl-C.

    The first Ctrl-C ends the run after a complete step; the second interrupts it at once.
    case : case whose progress is drawn as a bar on a terminal, else told in a line every `PROGRESS_INTERVAL`; None for
    neither
    """
    stop = threading.Event()
    bar = RunBar(case) if case is not None and sys.stderr.isatty() else None
    show = bar or (RunLines(case) if case is not None else None)

    def progress(t: float, seconds: float, steps: int) -> None:
        if show:
            show(t, seconds, steps)
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
    is_terminal = sys.stderr.isatty()
    counts = [0, 0]
    text = [""]
    finished = threading.Event()

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


class RunLines:
    """Lines of progress of a run whose output is not a terminal: simulated time, steps, and time left at this pace."""

    def __init__(self, case):
        self.end, self.format_amount = case.numerics.end, case.amount
        self.last: tuple[float, float] | None = None

    def __call__(self, t: float, seconds: float, steps: int) -> None:
        self.last = self.last or (t, seconds)
        passed = seconds - self.last[1]
        if passed < PROGRESS_INTERVAL:
            return
        left = (self.end - t) * passed / (t - self.last[0]) if t > self.last[0] else math.inf
        times = (
            f"t = {self.format_amount(t, 'time', 6)} of {self.format_amount(self.end, 'time', 6)}"
        )
        print(
            f"{times}, {steps} steps; about {left:.2g} s left at this pace",
            file=sys.stderr,
            flush=True,
        )
        self.last = t, seconds


class RunBar:
    """Progress bar of a run with simulated time, speed and remaining time."""

    def __init__(self, case):
        from rich.progress import TextColumn

        self.start, self.end, self.format_amount = (
            case.numerics.start,
            case.numerics.end,
            case.amount,
        )
        self.first: tuple[float, float] | None = None
        self.shown = _bar(TextColumn("{task.fields[now]}"))
        self.task = self.shown.add_task(visible(case.name), total=self.end - self.start, now="")

    def __call__(self, t: float, seconds: float, steps: int) -> None:
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

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        column,
        TimeRemainingColumn(),
    )
    return Progress(*columns, console=Console(stderr=True), transient=True)

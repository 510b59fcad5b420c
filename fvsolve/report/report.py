"""Writing a report: the page of a run, and its workbook. Knows where a run lies and what it must hold."""

from __future__ import annotations

from pathlib import Path

from fvsolve.errors import FvsolveError, RunError, listing
from fvsolve.output.envelope import QUANTITIES
from fvsolve.run import open_run

PAGE, BOOK = "report.html", "report.xlsx"


def write_report(directory: str | Path, out: str | Path | None = None, xlsx: bool = False) -> list[Path]:
    """Write the page of a run directory, RUN/report.html by default, and with `xlsx` its tables beside it; their paths.

    Raises RunError where the directory holds no run that ended, FvsolveError where a library is missing or a file
    cannot be written.
    """
    from fvsolve.report.legs import ways
    from fvsolve.report.libraries import library
    from fvsolve.report.page import page
    from fvsolve.report.workbook import write_workbook

    for name in ("jinja2", "plotly", *["xlsxwriter"] * xlsx):
        library(name)
    path = Path(out) if out is not None else Path(directory) / PAGE
    result = opened(Path(directory))
    found = ways(result)
    text = page(result, found)
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FvsolveError(f"{path}: cannot be written: {error.strerror or error}; name another with --out") from None
    return [path, write_workbook(result, found, path.with_suffix(".xlsx"))] if xlsx else [path]


def opened(directory: Path):
    """The run in a directory, its tables looked at; RunError that says what is there instead."""
    if not directory.is_dir():
        what = "is a file" if directory.exists() else "does not exist"
        raise RunError(f"{directory} {what}; wanted a run directory, as fvsolve run CASE --out DIR writes it")
    if not (directory / "summary.json").is_file() and (directory / "restart.npz").is_file():
        resume = f"fvsolve run CASE --out {directory} --resume"
        raise RunError(f"{directory} holds an unfinished run: go on with it, {resume}, and report it then")
    result = open_run(directory)
    for pipe, arrays in result.envelope.items():
        if lacks := [name for name in QUANTITIES if name not in arrays]:
            raise RunError(f"{directory / 'envelope.csv'} lacks {listing(lacks)} of {pipe}; run again with --force")
    return result

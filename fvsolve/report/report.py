"""Writing a report: the page of a run, and its workbook. Knows where a run lies and what it must hold."""

from __future__ import annotations

from pathlib import Path

from fvsolve.errors import FvsolveError, RunError
from fvsolve.run import open_run

PAGE = "report.html"


def write_report(directory: str | Path, out: str | Path | None = None) -> Path:
    """Write the page of a run directory, RUN/report.html by default; its path.

    Raises RunError where the directory holds no run that ended, FvsolveError where a library is missing or the page
    cannot be written.
    """
    from fvsolve.report.legs import ways
    from fvsolve.report.page import page

    result = opened(Path(directory))
    path = Path(out) if out is not None else Path(directory) / PAGE
    text = page(result, ways(result))
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FvsolveError(f"{path}: cannot be written: {error.strerror or error}; name another file with --out") from None
    return path


def opened(directory: Path):
    """The run in a directory; RunError that says what is there instead."""
    if not directory.is_dir():
        what = "is a file" if directory.exists() else "does not exist"
        raise RunError(f"{directory} {what}; wanted a run directory, as fvsolve run CASE --out DIR writes it")
    return open_run(directory)

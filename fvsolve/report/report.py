"""Writing a report: the page of a run, and its workbook. Knows where a run lies and what it must hold."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import quote

import numpy as np

from fvsolve.errors import FvsolveError, RunError, listing
from fvsolve.output.envelope import QUANTITIES
from fvsolve.report.heads import in_units
from fvsolve.run import open_run
from fvsolve.studies.design import STUDY

PAGE = "report.html"
ASKED = ("fluid", "cells", "methods", "steps", "rejections", "rhs", "seconds", "events", "cavities")


def write_report(directory: str | Path, out: str | Path | None = None, xlsx: bool = False) -> list[Path]:
    """Write the page of a run directory, or of a study's, report.html there by default, and with `xlsx` its tables
    beside it; their paths.

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
    if (Path(directory) / STUDY).is_file():
        return _write_study(Path(directory), path, xlsx)
    result = opened(Path(directory))
    found = ways(result)
    written(path, page(result, found))
    return [path, write_workbook(result, found, path.with_suffix(".xlsx"))] if xlsx else [path]


def written(path: Path, text: str) -> None:
    """Write a page; FvsolveError where that cannot be."""
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise FvsolveError(f"{path}: cannot be written: {error.strerror or error}; name another with --out") from None


def _write_study(directory: Path, path: Path, xlsx: bool) -> list[Path]:
    """The page of a study, those of its runs to which it leads, and the workbook of its tables."""
    from fvsolve.report.legs import ways
    from fvsolve.report.page import page
    from fvsolve.report.study import study_page
    from fvsolve.report.workbook import study_tables, write_tables
    from fvsolve.studies.design import open_study

    said, runs = open_study(directory), []
    for row in said["runs"]:
        own, result = Path(row["directory"]) / PAGE, opened(Path(row["directory"]))
        written(own, page(result, ways(result)))
        runs.append((row | {"page": quote(os.path.relpath(own, path.parent).replace(os.sep, "/"))}, result))
    written(path, study_page(said, runs))
    return [path, write_tables(study_tables(runs), path.with_suffix(".xlsx"))] if xlsx else [path]


def opened(directory: Path):
    """The run in a directory, its tables looked at; RunError that says what is there instead."""
    if not directory.is_dir():
        what = "is a file" if directory.exists() else "does not exist"
        raise RunError(f"{directory} {what}; wanted a run directory, as fvsolve run CASE --out DIR writes it")
    if not (directory / "summary.json").is_file() and (directory / "restart.npz").is_file():
        resume = f"fvsolve run CASE --out {directory} --resume"
        raise RunError(f"{directory} holds an unfinished run: go on with it, {resume}, and report it then")
    result = open_run(directory)
    if lacks := [key for key in ASKED if key not in result.summary]:
        raise RunError(f"{directory / 'summary.json'} lacks {listing(lacks)}; run again with --force")
    pipes = {name: link.length for name, link in result.case.links.items() if link.kind == "pipe"}
    for pipe, length in pipes.items():
        arrays = result.envelope.get(pipe, {})
        if lacks := [name for name in QUANTITIES if name not in arrays]:
            raise RunError(f"{directory / 'envelope.csv'} lacks {listing(lacks)} of {pipe}; run again with --force")
        x = in_units(result, "distance").to_si(arrays["distance"])
        if length - x[-1] > max([2.0 * x[0], *np.diff(x)]):  # its last cell is not there
            raise RunError(f"{directory / 'envelope.csv'} ends within {pipe}; run again with --force")
    return result

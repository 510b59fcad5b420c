"""Report files of a run or study: HTML pages and workbook; checks that the run directory is complete."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import quote

import numpy as np

from fvsolve.errors import FvsolveError, RunError, listing
from fvsolve.output.envelope import ENVELOPE_QUANTITIES
from fvsolve.report.envelope_units import envelope_column
from fvsolve.run import open_run
from fvsolve.studies.scenarios import STUDY

PAGE_FILE = "report.html"
REQUIRED_KEYS = ("fluid", "cells", "methods", "steps", "rejections", "rhs", "seconds", "events", "cavities")


def write_report(directory: str | Path, out: str | Path | None = None, xlsx: bool = False) -> list[Path]:
    """Write the HTML report of the directory of a run or a study; returns the paths of the page and of the workbook.

    The report of a study also writes report.html into the directory of each of its runs; these paths are not returned.
    out : path of the page, by default report.html in the directory; xlsx : write also a workbook of the tables
    Raises RunError if the directory does not hold a finished run, FvsolveError if a library is missing or a file cannot
    be written.
    """
    from fvsolve.report.libraries import import_library
    from fvsolve.report.page import page
    from fvsolve.report.section_pipes import section_paths
    from fvsolve.report.workbook import write_workbook

    for name in ("jinja2", "plotly", *["xlsxwriter"] * xlsx):
        import_library(name)
    path = Path(out) if out is not None else Path(directory) / PAGE_FILE
    if (Path(directory) / STUDY).is_file():
        return _write_study(Path(directory), path, xlsx)
    result = open_checked_run(Path(directory))
    sections = section_paths(result)
    write_page(path, page(result, sections))
    return [path, write_workbook(result, sections, path.with_suffix(".xlsx"))] if xlsx else [path]


def write_page(path: Path, text: str) -> None:
    """Write the text of a page into a file; raises FvsolveError if it cannot be written."""
    try:
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        text = f"{path}: cannot be written: {error.strerror or error}"
        raise FvsolveError(f"{text}; choose another file with --out") from None


def _write_study(directory: Path, path: Path, xlsx: bool) -> list[Path]:
    """Write the page of a study, the pages of its runs, and with `xlsx` a workbook of the tables of the study.

    Returns the paths of the page of the study and of the workbook.
    directory : of the study; path : of its page, which links to the pages of the runs
    """
    from fvsolve.report.page import page
    from fvsolve.report.section_pipes import section_paths
    from fvsolve.report.study_report import study_page
    from fvsolve.report.workbook import study_tables, write_tables
    from fvsolve.studies.scenarios import open_study

    study, runs = open_study(directory), []
    for row in study["runs"]:
        own, result = Path(row["directory"]) / PAGE_FILE, open_checked_run(Path(row["directory"]))
        write_page(own, page(result, section_paths(result)))
        runs.append((row | {"page": quote(os.path.relpath(own, path.parent).replace(os.sep, "/"))}, result))
    write_page(path, study_page(study, runs))
    return [path, write_tables(study_tables(runs), path.with_suffix(".xlsx"))] if xlsx else [path]


def open_checked_run(directory: Path):
    """Open the run in a directory and check that its tables are complete; raises RunError otherwise."""
    if not directory.is_dir():
        problem = "is a file" if directory.exists() else "does not exist"
        raise RunError(f"{directory} {problem}. Expected a run directory, as written by fvsolve run CASE --out DIR")
    if not (directory / "summary.json").is_file() and (directory / "restart.npz").is_file():
        resume = f"fvsolve run CASE --out {directory} --resume"
        raise RunError(f"{directory} holds an unfinished run: continue it with {resume}, then report it")
    result, again = open_run(directory), f"run the case again with fvsolve run CASE --out {directory} --force"
    if gaps := [key for key in REQUIRED_KEYS if key not in result.summary]:
        raise RunError(f"{directory / 'summary.json'} lacks {listing(gaps)}; {again}")
    pipes = {name: link.length for name, link in result.case.links.items() if link.kind == "pipe"}
    for pipe, length in pipes.items():
        arrays = result.envelope.get(pipe, {})
        if gaps := [name for name in ENVELOPE_QUANTITIES if name not in arrays]:
            raise RunError(f"{directory / 'envelope.csv'} lacks {listing(gaps)} of {pipe}; {again}")
        x = envelope_column(result, "distance").to_si(arrays["distance"])
        if length - x[-1] > max([2.0 * x[0], *np.diff(x)]):  # the last cell is missing
            raise RunError(f"{directory / 'envelope.csv'} lacks the last rows of {pipe}; {again}")
    return result

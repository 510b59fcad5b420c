"""Report files of a run or study: HTML pages, and workbooks (.xlsx) of all tables with all rows.

Picture files of a run: long sections, histories of chosen probes, and phase planes.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from fvsolve.core.output.csv_files import ENVELOPE_QUANTITIES
from fvsolve.core.output.result_table import Column, ResultTable
from fvsolve.core.run import open_run
from fvsolve.core.run.result import not_valid
from fvsolve.display import save_if_path
from fvsolve.errors import FvsolveError, RunError, did_you_mean, listing, visible
from fvsolve.file_replacement import replacing, write_file
from fvsolve.report import import_library, page, tables
from fvsolve.report.dated_tables import all_with_dates
from fvsolve.report.draw.map_picture import map_figure, network_figure
from fvsolve.report.draw.plot import history_figure, phase_figure, section_figure
from fvsolve.report.long_section import (
    Section,
    SectionPath,
    envelope_column,
    head_window,
    section_of,
    section_paths,
)
from fvsolve.report.maps.flood_map import flood_map, mapped_basins
from fvsolve.report.maps.network_figure import extent_of
from fvsolve.report.maps.network_map import network_map
from fvsolve.report.tables import is_number
from fvsolve.studies.scenarios import STUDY, open_study
from fvsolve.units import show

PAGE_FILE = "report.html"
MAX_COLUMN_WIDTH = 60  # greatest initial width of a column [letters]
# greatest length of the name of a sheet [letters]; it must not contain these signs:
MAX_SHEET_NAME = 31
FORBIDDEN_SIGNS = "[]:*?/\\'"
SECTION_HEADERS = {
    "elevation": "elevation",
    "initial_head": "initial head",
    "min_head": "minimum head",
    "max_head": "maximum head",
    "min_pressure": "minimum pressure",
    "max_pressure": "maximum pressure",
    "t_min": "time of the minimum",
    "t_max": "time of the maximum",
}


def write_report(
    directory: str | Path, out: str | Path | None = None, xlsx: bool = False
) -> list[Path]:
    """Write the HTML report of the directory of a run or a study; returns the paths of the page and of the workbook.

    The report of a study also writes report.html into the directory of each of its runs; these paths are not returned.
    out : path of the page, by default report.html in the directory; xlsx : write also a workbook of the tables
    Raises RunError if the directory does not hold a finished run, FvsolveError if a library is missing or a file cannot
    be written.
    """
    for name in ("jinja2", "plotly", *["xlsxwriter"] * xlsx):
        import_library(name)
    path = Path(out) if out is not None else Path(directory) / PAGE_FILE
    if (Path(directory) / STUDY).is_file():
        return _write_study(Path(directory), path, xlsx)
    result = open_checked_run(Path(directory))
    sections = section_paths(result)
    write_page(path, page.page(result, sections))
    return (
        [path, write_tables(workbook_tables(result, sections), path.with_suffix(".xlsx"))]
        if xlsx
        else [path]
    )


def write_page(path: Path, text: str) -> None:
    """Write the text of a page into a file; raises FvsolveError if it cannot be written."""
    try:
        write_file(path, text)
    except OSError as error:
        text = f"{path}: cannot be written: {error.strerror or error}"
        raise FvsolveError(f"{text}; choose another file with --out") from None


def _write_study(directory: Path, path: Path, xlsx: bool) -> list[Path]:
    """Write the page of a study, the pages of its runs, and with `xlsx` a workbook of the tables of the study.

    Returns the paths of the page of the study and of the workbook.
    directory : of the study; path : of its page, which links to the pages of the runs
    """
    study, runs = open_study(directory), []
    for row in study["runs"]:
        own, result = Path(row["directory"]) / PAGE_FILE, open_checked_run(Path(row["directory"]))
        write_page(own, page.page(result, section_paths(result)))
        runs.append(
            (row | {"page": quote(os.path.relpath(own, path.parent).replace(os.sep, "/"))}, result)
        )
    write_page(path, page.study_page(study, runs))
    return [path, write_tables(study_tables(runs), path.with_suffix(".xlsx"))] if xlsx else [path]


def open_checked_run(directory: Path):
    """Open the run in a directory and check that its tables are complete; raises RunError otherwise."""
    if not directory.is_dir():
        problem = "is a file" if directory.exists() else "does not exist"
        raise RunError(
            f"{directory} {problem}; expected a run directory, as written by fvsolve run CASE --out DIR"
        )
    if not (directory / "summary.json").is_file() and (directory / "restart.npz").is_file():
        resume = f"fvsolve run CASE --out {directory} --resume"
        raise RunError(
            f"{directory} holds an unfinished run: continue it with {resume}, then report it"
        )
    result = open_run(directory)
    again = f"run the case again with fvsolve run CASE --out {directory} --force"
    pipes = {name: link.length for name, link in result.case.links.items() if link.kind == "pipe"}
    for pipe, length in pipes.items():
        arrays = result.envelope.get(pipe, {})
        if gaps := [name for name in ENVELOPE_QUANTITIES if name not in arrays]:
            raise RunError(f"{directory / 'envelope.csv'} lacks {listing(gaps)} of {pipe}; {again}")
        x = envelope_column(result, "distance").to_si(arrays["distance"])
        if length - x[-1] > max([2.0 * x[0], *np.diff(x)]):  # the last cell is missing
            raise RunError(f"{directory / 'envelope.csv'} lacks the last rows of {pipe}; {again}")
    return result


def write_tables(report_tables: list[ResultTable], path: Path) -> Path:
    """Write tables, one sheet each; returns the path. Raises FvsolveError if it cannot be written.

    Text is stored as text, never as a formula, link or number.
    """
    plain = {"strings_to_formulas": False, "strings_to_urls": False, "strings_to_numbers": False}
    taken: set[str] = set()
    with replacing(path) as fresh:
        book = import_library("xlsxwriter").Workbook(
            str(fresh), {**plain, "nan_inf_to_errors": True}
        )
        bold = book.add_format({"bold": True, "text_wrap": True, "valign": "bottom"})
        for table in report_tables:
            _write_sheet(book, table, _sheet_name(table.title, taken), bold)
        try:
            book.close()
        except Exception as error:  # XlsxWriter wraps errors of the operating system
            reason = getattr(error.args[0] if error.args else error, "strerror", None) or error
            raise FvsolveError(
                f"{path}: cannot be written: {reason}; choose another file with --out"
            ) from None
    return path


def workbook_tables(result, sections: list[SectionPath]) -> list[ResultTable]:
    """All tables of a run for a workbook; a table of a section has a row for each point."""
    words = ResultTable.of(
        "Summary", ("", ""), [[item.head, item.text] for item in tables.top_sentences(result)]
    )
    warnings = [[item.kind, item.place, item.text] for item in result.warnings]
    notes = ResultTable.of("Warnings", ("kind", "place", "text"), warnings)
    contents = [
        words,
        tables.verdict_table(result),
        *tables.worst_tables(result),
        tables.extremes_of_pipes(result, sections),
        *tables.ranked_pipes(result),
        tables.extremes_of_probes(result),
        *(_section_table(result, section_of(result, way)) for way in sections),
        tables.cavities(result),
        tables.events(result),
        *tables.model_tables(result),
        *tables.numerics_tables(result),
        notes,
        replace(tables.versions(result), title="Versions"),
    ]
    return all_with_dates(contents, result.start_time)


def study_tables(runs: list) -> list[ResultTable]:
    """Tables of a study with the long sections of all runs; runs : (row of study.json, `Result`) of each run."""
    contents = [page.run_matrix(runs), page.extreme_pressures(runs), page.failing_limits(runs)]
    contents = [table for table in contents if table]
    for row, result in runs:
        for way in section_paths(result):
            along = _section_table(result, section_of(result, way))
            title = f"{Path(row['directory']).name} {way.name}"
            rows = [[page.run_name(row), *cells] for cells in along.rows]
            contents.append(
                replace(
                    along, title=title, rows=rows, columns=[Column(header="run"), *along.columns]
                )
            )
    return contents


def _section_table(result, sec: Section) -> ResultTable:
    """Table of a long section, with a row for each point."""
    head = envelope_column(result, "min_head").unit
    columns = [
        sec.chainage,
        sec.pipe,
        *(sec.along[name] for name in SECTION_HEADERS),
        *sec.lines.values(),
    ]
    heads = ["chainage", "pipe", *SECTION_HEADERS.values(), *sec.lines]
    units = [envelope_column(result, "distance").unit, ""]
    units += [envelope_column(result, name).unit for name in SECTION_HEADERS]
    rows = [list(row) for row in zip(*(column.tolist() for column in columns), strict=True)]
    return ResultTable.of(
        f"Section {sec.way.name}", heads, rows, [*units, *[head] * len(sec.lines)]
    )


def _write_sheet(book, table: ResultTable, name: str, bold) -> None:
    sheet = book.add_worksheet(name)
    rows = table.values
    for k, head in enumerate(column.title for column in table.columns):
        sheet.write_string(0, k, visible(head), bold)
        letters = max([len(head), *(len(str(row[k])) for row in rows[:200])])
        sheet.set_column(k, k, min(letters + 2, MAX_COLUMN_WIDTH))
    for i, row in enumerate(rows, 1):
        for k, value in enumerate(row):
            if value is None or is_number(value) and not math.isfinite(value):
                continue
            if is_number(value):
                sheet.write_number(i, k, value)
            else:
                sheet.write_string(i, k, visible(str(value)))
    sheet.freeze_panes(1, 1)


def _sheet_name(title: str, taken: set[str]) -> str:
    """Valid name for a sheet, from a title; it differs from all names in `taken`, to which it is added."""
    plain = (
        "".join("-" if sign in FORBIDDEN_SIGNS else sign for sign in visible(title)).strip()
        or "table"
    )
    name, k = plain[:MAX_SHEET_NAME], 1
    while name.casefold() in taken:
        k += 1
        name = f"{plain[: MAX_SHEET_NAME - 1 - len(str(k))]} {k}"
    taken.add(name.casefold())
    return name


def write_pictures(
    directory: str | Path,
    probes: str = "",
    route: str = "",
    phases: Sequence[str] = (),
    out: str | Path | None = None,
    maps: bool = False,
) -> list[Path]:
    """Write pictures of a run into the folder `out` (default: the run directory); returns their paths.

    probes : names separated by commas, drawn in probes.png
    route : name of a section; all sections are drawn if probes, route and phases are empty, and maps is False
    phases : pairs of probes "X:Y", drawn in phase.png
    maps : True for maps of all basins, one for each quantity, in map-BASIN-QUANTITY.png
    Raises RunError if the directory holds no finished run, FvsolveError with all unknown names, or if there is nothing
    to draw.
    """
    result = open_checked_run(Path(directory))
    folder = Path(out) if out is not None else Path(directory)
    faults: list[str] = []
    picked = parse_probes(result, probes, faults)
    pairs = []
    for text in phases:
        names = [name.strip() for name in text.split(":")]
        pairs.append(names)
        if len(names) == 2:
            faults += [_unknown_probe(result, name) for name in names if name not in result.units]
        else:
            faults.append(f"--phase {show(text)}: expected two probes, X:Y")
    sections = _chosen_sections(
        section_paths(result), route, bool(picked or phases or maps), faults
    )
    if faults:
        raise FvsolveError("\n".join(faults))
    title, drawn = result.summary["title"], {}
    for k, way in enumerate(sections, 1):
        section = section_of(result, way)
        window = head_window([section], envelope_column(result, "max_head").unit)
        names = "\n".join(filter(None, [title, way.name]))
        figure = section_figure(section, window, result.summary["envelope_units"], names)
        drawn["section.png" if len(sections) == 1 else f"section-{k}.png"] = figure
    if picked:
        data = result.history_drawn()
        columns = [result.probes.index(name) for name in picked]
        measured = {name: series for name, series in data["measured"].items() if name in picked}
        drawn["probes.png"] = history_figure(
            **{
                **data,
                "values": data["values"][:, columns],
                "measured": measured,
                "probes": [data["probes"][k] for k in columns],
            }
        )
    if pairs:
        drawn["phase.png"] = phase_figure(
            [[(n, result.units[n], result[n]) for n in pair] for pair in pairs], title
        )
    if maps:
        drawn |= map_pictures(result)
    if not drawn:
        reason = f"run is {text}" if (text := not_valid(result.summary)) else "case has no pipes"
        raise FvsolveError(
            f"{directory}: the {reason}, so it has no long section; choose --probes or --phase X:Y"
        )
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in drawn.items():
        save_if_path(figure, folder / name)
    return [folder / name for name in drawn]


def map_pictures(result) -> dict[str, Any]:
    """Figures of all maps of a run by the names of their files. Raises FvsolveError if there is nothing to draw."""
    drawn = {}
    for basin in mapped_basins(result):
        plan = flood_map(result, basin)
        for layer in plan.layers:
            drawn[f"map-{basin}-{layer.key}.png"] = map_figure(plan, layer)
    plan = network_map(result)
    for layer in plan.layers if plan is not None else ():
        key = layer.name.replace(" ", "-")
        drawn[f"map-network-{key}.png"] = network_figure(plan, layer, extent_of(plan))
    if not drawn:
        basins = any(name not in result.case.links for name in result.case.meshes)
        reason = (
            "no greatest values and no frames were stored; set [output] maxima or fields, and run again"
            if basins
            else "the case has neither a basin nor a network with branches"
        )
        raise FvsolveError(f"{result.directory}: there is no map to draw: {reason}")
    return drawn


def parse_probes(result, text: str, faults: list[str]) -> list[str]:
    """Names of probes in a list such as `a.head,tank.depth@1,2`, in which a name may contain commas.

    Unknown names are added to `faults`.
    """
    names, pieces = [], [piece.strip() for piece in text.split(",")] if text else []
    while pieces:
        ends = [k for k in range(1, len(pieces) + 1) if ",".join(pieces[:k]) in result.units]
        n = ends[-1] if ends else 1
        name, pieces = ",".join(pieces[:n]), pieces[n:]
        if ends:
            names.append(name)
        else:
            faults.append(_unknown_probe(result, name))
    return list(dict.fromkeys(names))


def _unknown_probe(result, name: str) -> str:
    hint = did_you_mean(name, result.units) or f"; the run has {listing(result.units) or 'none'}"
    return f"{show(name)}: unknown probe{hint}"


def _chosen_sections(
    sections: list[SectionPath], route: str, others: bool, faults: list[str]
) -> list[SectionPath]:
    """Sections to draw: the section `route`, or all sections unless `others` (probes or phase planes) are drawn.

    Adds an unknown route to `faults`.
    """
    if not route:
        return [] if others else sections
    named = [way for way in sections if way.name == route]
    if not named:
        names = [way.name for way in sections]
        hint = did_you_mean(route, names) or f"; the run has {listing(names) or 'none'}"
        faults.append(f"{show(route)}: unknown route{hint}")
    return named

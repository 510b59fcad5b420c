"""Workbook (.xlsx) of the tables of a report, with all rows; numbers are stored as numbers, words as text."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from fvsolve.errors import FvsolveError, visible
from fvsolve.report import model_tables, numerics, reliability, study_report, worst_places
from fvsolve.report.envelope_units import envelope_column
from fvsolve.report.libraries import empty_workbook
from fvsolve.report.long_section import Section, section_of
from fvsolve.report.section_pipes import SectionPath, section_paths
from fvsolve.report.tables import ReportTable, is_number

MAX_COLUMN_WIDTH = 60  # greatest initial width of a column [letters]
MAX_SHEET_NAME = 31  # greatest length of the name of a sheet [letters]; it must not contain these signs:
FORBIDDEN_SIGNS = "[]:*?/\\'"
SECTION_HEADERS = {"elevation": "elevation", "initial_head": "initial head", "min_head": "minimum head",
         "max_head": "maximum head", "min_pressure": "minimum pressure",
         "max_pressure": "maximum pressure", "t_min": "time of the minimum",
         "t_max": "time of the maximum"}  # fmt: skip


def write_workbook(result, sections: list[SectionPath], path: Path) -> Path:
    """Write the tables of a run, one sheet each; returns the path. Raises FvsolveError if it cannot be written."""
    return write_tables(run_tables(result, sections), path)


def write_tables(report_tables: list[ReportTable], path: Path) -> Path:
    """Write tables, one sheet each; returns the path. Raises FvsolveError if it cannot be written."""
    book = empty_workbook(str(path))
    bold = book.add_format({"bold": True, "text_wrap": True, "valign": "bottom"})
    taken: set[str] = set()
    for table in report_tables:
        _write_sheet(book, table, _sheet_name(table.title, taken), bold)
    try:
        book.close()
    except Exception as error:  # XlsxWriter wraps errors of the operating system
        raise FvsolveError(f"{path}: cannot be written: {error}; choose another file with --out") from None
    return path


def run_tables(result, sections: list[SectionPath]) -> list[ReportTable]:
    """All tables of a run for a workbook; a table of a section has a row for each point."""
    words = ReportTable("Summary", ("", ""), [[item.head, item.text] for item in reliability.top_sentences(result)])
    notes = ReportTable(
        "Warnings", ("kind", "place", "text"), [[item.kind, item.place, item.text] for item in result.warnings]
    )
    versions = numerics.versions(result)
    contents = [
        words,
        reliability.verdict_table(result),
        *reliability.worst_tables(result),
        worst_places.extremes_of_pipes(result, sections),
        *worst_places.ranked_pipes(result),
        worst_places.extremes_of_probes(result),
        *(_section_table(result, section_of(result, way)) for way in sections),
        numerics.cavities(result),
        numerics.events(result),
        *model_tables.all_tables(result),
        numerics.settings(result),
        numerics.ledgers(result),
        reliability.claim_table(result),
        numerics.comparisons(result),
        notes,
        ReportTable("Versions", versions.headers, versions.rows),
    ]
    return [item for item in contents if item is not None and item.rows]


def study_tables(runs: list) -> list[ReportTable]:
    """Tables of a study with the long sections of all runs; runs : (row of study.json, `Result`) of each run."""
    contents = [study_report.run_matrix(runs), study_report.failing_limits(runs)]
    for row, result in runs:
        for way in section_paths(result):
            along = _section_table(result, section_of(result, way))
            title = f"{Path(row['directory']).name} {way.name}"
            rows = [[study_report.run_name(row), *cells] for cells in along.rows]
            contents.append(
                replace(along, title=title, headers=["run", *along.headers], units=["", *along.units], rows=rows)
            )
    return [table for table in contents if table is not None]


def _section_table(result, sec: Section) -> ReportTable:
    """Table of a long section, with a row for each point."""
    head = envelope_column(result, "min_head").unit
    columns = [
        sec.chainage,
        sec.pipe,
        *(sec.along[name] for name in SECTION_HEADERS),
        *sec.lines.values(),
    ]
    heads = ["chainage", "pipe", *SECTION_HEADERS.values(), *sec.lines]
    units = [
        envelope_column(result, "distance").unit,
        "",
        *(envelope_column(result, name).unit for name in SECTION_HEADERS),
    ]
    rows = [list(row) for row in zip(*(column.tolist() for column in columns), strict=True)]
    return ReportTable(f"Section {sec.way.name}", heads, rows, [*units, *[head] * len(sec.lines)])


def _write_sheet(book, table: ReportTable, name: str, bold) -> None:
    sheet = book.add_worksheet(name)
    heads = [f"{head} [{unit}]" if unit else head for head, unit in table.heads]
    for k, head in enumerate(heads):
        sheet.write_string(0, k, visible(head), bold)
        letters = max([len(head), *(len(str(row[k])) for row in table.rows[:200])])
        sheet.set_column(k, k, min(letters + 2, MAX_COLUMN_WIDTH))
    for i, row in enumerate(table.rows, 1):
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
    plain = "".join("-" if sign in FORBIDDEN_SIGNS else sign for sign in visible(title)).strip() or "table"
    name, k = plain[:MAX_SHEET_NAME], 1
    while name.casefold() in taken:
        k += 1
        name = f"{plain[: MAX_SHEET_NAME - 1 - len(str(k))]} {k}"
    taken.add(name.casefold())
    return name

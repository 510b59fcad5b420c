"""Workbook (.xlsx) of the tables of a report, with all rows; numbers are stored as numbers, words as text."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

from fvsolve.errors import FvsolveError, visible
from fvsolve.report import described, numerics, study, trust, worst
from fvsolve.report.heads import in_units
from fvsolve.report.legs import SectionWay, ways
from fvsolve.report.libraries import workbook
from fvsolve.report.section import Section, section
from fvsolve.report.tables import ReportTable, is_number

WIDEST = 60  # greatest initial width of a column [letters]
NAME = 31  # greatest length of the name of a sheet [letters]; it must not contain these signs:
SIGNS = "[]:*?/\\'"
ALONG = {"elevation": "elevation", "initial_head": "initial head", "min_head": "minimum head",
         "max_head": "maximum head", "min_pressure": "minimum pressure",
         "max_pressure": "maximum pressure", "t_min": "time of the minimum",
         "t_max": "time of the maximum"}  # fmt: skip


def write_workbook(result, sections: list[SectionWay], path: Path) -> Path:
    """Write the tables of a run, one sheet each; returns the path. Raises FvsolveError if it cannot be written."""
    return write_tables(tables(result, sections), path)


def write_tables(report_tables: list[ReportTable], path: Path) -> Path:
    """Write tables, one sheet each; returns the path. Raises FvsolveError if it cannot be written."""
    book = workbook(str(path))
    bold = book.add_format({"bold": True, "text_wrap": True, "valign": "bottom"})
    taken: set[str] = set()
    for table in report_tables:
        _sheet(book, table, _named(table.title, taken), bold)
    try:
        book.close()
    except Exception as error:  # XlsxWriter wraps errors of the operating system
        raise FvsolveError(f"{path}: cannot be written: {error}; choose another with --out") from None
    return path


def tables(result, sections: list[SectionWay]) -> list[ReportTable]:
    """All tables of a run; sections have a row for each point."""
    words = ReportTable("Summary", ("", ""), [[item.head, item.text] for item in trust.words(result)])
    notes = ReportTable(
        "Warnings", ("kind", "place", "text"), [[item.kind, item.place, item.text] for item in result.warnings]
    )
    versions = numerics.versions(result)
    contents = [
        words, trust.verdicts(result), *trust.worst(result),
        worst.of_all(result, sections), *worst.by_pipe(result), worst.of_probes(result),
        *(_along(result, section(result, way)) for way in sections), numerics.cavities(result), numerics.events(result),
        *described.model(result), numerics.settings(result),
        numerics.ledgers(result), trust.claims(result), numerics.comparisons(result), notes,
        ReportTable("Versions", versions.headers, versions.rows),
    ]  # fmt: skip
    return [item for item in contents if item is not None and item.rows]


def study_tables(runs: list) -> list[ReportTable]:
    """Tables of a study with the long sections of all runs; runs : (row, `Result`) of each."""
    contents = [study.matrix(runs), study.failing(runs)]
    for row, result in runs:
        for way in ways(result):
            along = _along(result, section(result, way))
            title = f"{Path(row['directory']).name} {way.name}"
            rows = [[study.name_of(row), *cells] for cells in along.rows]
            contents.append(
                replace(along, title=title, headers=["run", *along.headers], units=["", *along.units], rows=rows)
            )
    return [table for table in contents if table is not None]


def _along(result, sec: Section) -> ReportTable:
    """Table of a long section, with a row for each point."""
    head = in_units(result, "min_head").unit
    columns = [
        sec.chainage,
        sec.pipe,
        *(sec.along[name] for name in ALONG),
        *sec.lines.values(),
    ]
    heads = ["chainage", "pipe", *ALONG.values(), *sec.lines]
    units = [in_units(result, "distance").unit, "", *(in_units(result, name).unit for name in ALONG)]
    rows = [list(row) for row in zip(*(column.tolist() for column in columns), strict=True)]
    return ReportTable(f"Section {sec.way.name}", heads, rows, [*units, *[head] * len(sec.lines)])


def _sheet(book, table: ReportTable, name: str, bold) -> None:
    sheet = book.add_worksheet(name)
    heads = [f"{head} [{unit}]" if unit else head for head, unit in table.heads]
    for k, head in enumerate(heads):
        sheet.write_string(0, k, visible(head), bold)
        letters = max([len(head), *(len(str(row[k])) for row in table.rows[:200])])
        sheet.set_column(k, k, min(letters + 2, WIDEST))
    for i, row in enumerate(table.rows, 1):
        for k, value in enumerate(row):
            if value is None or is_number(value) and not math.isfinite(value):
                continue
            if is_number(value):
                sheet.write_number(i, k, value)
            else:
                sheet.write_string(i, k, visible(str(value)))
    sheet.freeze_panes(1, 1)


def _named(title: str, taken: set[str]) -> str:
    """Valid name of a sheet from a title, different from all in `taken`; adds it to `taken`."""
    plain = "".join("-" if sign in SIGNS else sign for sign in visible(title)).strip() or "table"
    name, k = plain[:NAME], 1
    while name.casefold() in taken:
        k += 1
        name = f"{plain[: NAME - 1 - len(str(k))]} {k}"
    taken.add(name.casefold())
    return name

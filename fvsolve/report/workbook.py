"""The tables of a report as a workbook: every row, numbers as numbers, words as words. Knows no page."""

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

WIDEST = 60  # letters of a column as it opens
NAME = 31  # letters of a sheet's name, and these not among them:
SIGNS = "[]:*?/\\'"
ALONG = {"elevation": "elevation", "initial_head": "initial head", "least_head": "least head",
         "greatest_head": "greatest head", "least_pressure": "least pressure",
         "greatest_pressure": "greatest pressure", "t_least": "time of the least",
         "t_greatest": "time of the greatest"}  # fmt: skip


def write_workbook(result, found: list[SectionWay], path: Path) -> Path:
    """Write the tables of a run, one sheet each; its path. FvsolveError where it cannot be written."""
    return write_tables(tables(result, found), path)


def write_tables(found: list[ReportTable], path: Path) -> Path:
    """Write tables, one sheet each; the path. FvsolveError where it cannot be written."""
    book = workbook(str(path))
    bold = book.add_format({"bold": True, "text_wrap": True, "valign": "bottom"})
    taken: set[str] = set()
    for table in found:
        _sheet(book, table, _named(table.title, taken), bold)
    try:
        book.close()
    except Exception as error:  # XlsxWriter wraps what the system says
        raise FvsolveError(f"{path}: cannot be written: {error}; name another with --out") from None
    return path


def tables(result, sections: list[SectionWay]) -> list[ReportTable]:
    """All tables of a run, sections with every cell."""
    words = ReportTable("Summary", ("", ""), [[one.head, one.text] for one in trust.words(result)])
    notes = ReportTable(
        "Warnings", ("kind", "place", "text"), [[one.kind, one.place, one.text] for one in result.warnings]
    )
    versions = numerics.versions(result)
    found = [
        words, trust.verdicts(result), *trust.worst(result),
        worst.of_all(result, sections), *worst.by_pipe(result), worst.of_probes(result),
        *(_along(result, section(result, way)) for way in sections), numerics.cavities(result), numerics.events(result),
        *described.model(result), numerics.settings(result),
        numerics.ledgers(result), trust.claims(result), numerics.comparisons(result), notes,
        ReportTable("Versions", versions.headers, versions.rows),
    ]  # fmt: skip
    return [one for one in found if one is not None and one.rows]


def study_tables(runs: list) -> list[ReportTable]:
    """The tables of a study, the long sections of all its runs among them; runs : (row, `Result`) of each."""
    found = [study.matrix(runs), study.failing(runs)]
    for row, result in runs:
        for way in ways(result):
            along = _along(result, section(result, way))
            title = f"{Path(row['directory']).name} {way.name}"
            rows = [[study.name_of(row), *cells] for cells in along.rows]
            found.append(
                replace(along, title=title, headers=["run", *along.headers], units=["", *along.units], rows=rows)
            )
    return [one for one in found if one is not None]


def _along(result, one: Section) -> ReportTable:
    """A long section, a row a cell."""
    head = in_units(result, "least_head").unit
    columns = [one.chainage, one.pipe, *(one.along[name] for name in ALONG), *one.lines.values()]
    heads = ["chainage", "pipe", *ALONG.values(), *one.lines]
    units = [in_units(result, "distance").unit, "", *(in_units(result, name).unit for name in ALONG)]
    rows = [list(row) for row in zip(*(column.tolist() for column in columns), strict=True)]
    return ReportTable(f"Section {one.way.name}", heads, rows, [*units, *[head] * len(one.lines)])


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
    """A name that a sheet may have, and none had before."""
    plain = "".join("-" if sign in SIGNS else sign for sign in visible(title)).strip() or "table"
    name, k = plain[:NAME], 1
    while name.casefold() in taken:
        k += 1
        name = f"{plain[: NAME - 1 - len(str(k))]} {k}"
    taken.add(name.casefold())
    return name

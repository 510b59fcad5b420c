"""Tables of a report with dates: each column of times of the run is followed by a column of their dates."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TYPE_CHECKING

from fvsolve import units
from fvsolve.core.output.result_table import Column, ResultTable

if TYPE_CHECKING:
    from fvsolve.parts.time_stamps import StartTime

TIMES = "time"  # header of a column of times of a run
DATES = Column(header="date")


def with_dates(table: ResultTable | None, start: StartTime | None) -> ResultTable | None:
    """Table with a column of dates after each column of times; unchanged without a start time, or without such columns.

    start : instant of t = 0, None without one
    """
    if not table or start is None:
        return table
    timed = [k for k, column in enumerate(table.columns) if column.name == TIMES and column.unit]
    if not timed:
        return table
    to_seconds = {k: units.find(table.columns[k].unit, "time").si for k in timed}
    columns: list[Column] = []
    for k, column in enumerate(table.columns):
        columns += [replace(column, key=""), DATES] if k in timed else [replace(column, key="")]
    rows = [dated_row(row, to_seconds, start) for row in table.values]
    return replace(table, columns=columns, rows=rows)


def dated_row(row: list, to_seconds: dict[int, Callable], start: StartTime) -> list:
    """Row of a table with the date after each time. to_seconds : index of a time -> its conversion to s"""
    cells = []
    for k, value in enumerate(row):
        cells.append(value)
        if k in to_seconds:
            known = isinstance(value, (int, float))
            cells.append(start.text(to_seconds[k](float(value))) if known else None)
    return cells


def all_with_dates(
    tables: Iterable[ResultTable | None], start: StartTime | None
) -> list[ResultTable]:
    """Tables that have rows, with dates, see `with_dates`."""
    return [dated for table in tables if (dated := with_dates(table, start))]

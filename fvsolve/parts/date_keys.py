"""Keys of a case file for dates: the instant of t = 0, order and zone of dates in files; texts of times with dates.

Dates are read by `time_stamps.py`, which only cases with dates load.
"""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING, Any

from fvsolve.parts.value import PROFILE, VALUE, Choice, ReadContext, Value
from fvsolve.units import show

if TYPE_CHECKING:
    from fvsolve.parts.time_stamps import StartTime

ORDERS = ("day-month-year", "month-day-year")  # of dates that begin with two small numbers
EXAMPLE = "2026-03-01T06:00:00Z"


class StartTimeValue(Value):
    """Value of a case file for the instant of t = 0: a date-time of TOML, or text in ISO 8601."""

    about = (
        "date and time of the day at t = 0, with or without a zone; results then have real times, and files of time "
        "series may have dates"
    )
    changes = PROFILE
    takes = f"date-time, `{EXAMPLE}`"
    schema = {"type": "string", "examples": [EXAMPLE]}

    def read(self, given: Any, setting: ReadContext) -> StartTime:
        from fvsolve.parts.time_stamps import StartTime, read_stamp

        if isinstance(given, StartTime):
            return given
        text = given
        if isinstance(given, datetime.datetime):
            text = given.isoformat()
        elif isinstance(given, datetime.date):
            text = given.isoformat()
        elif isinstance(given, datetime.time):
            raise ValueError(f"{show(str(given))} has no date; expected for example {EXAMPLE}")
        if not isinstance(text, str):
            raise ValueError(f"{show(given)} is not a date; expected for example {EXAMPLE}")
        stamp = read_stamp(text)
        if len(stamp.fraction) > 6:
            raise ValueError(
                f"{show(text)} has more than six digits after the seconds; expected at most six"
            )
        return StartTime(stamp)


class TimeColumns(Value):
    """Value of a case file for the header of the column of times, or of columns of dates and of times of the day."""

    about = (
        "header of the column of times, or headers of a column of dates and of a column of times of the day; the first "
        "column if left out"
    )
    changes = VALUE
    takes = '`"t"`, `["date", "time"]`'
    schema = {"type": ["string", "array"], "items": {"type": "string"}}

    def read(self, given: Any, setting: ReadContext) -> str | tuple[str, str]:
        if isinstance(given, str):
            return given
        texts = isinstance(given, (list, tuple)) and all(isinstance(item, str) for item in given)
        if not texts or len(given) != 2:
            text = f"{show(given)} is not the header of a column"
            raise ValueError(f'{text}; expected for example "t", or ["date", "time"]')
        return tuple(given)


class ZoneValue(Value):
    """Value of a case file for the offset of a zone from UTC: text such as "+01:00" or "UTC"."""

    about = "offset from UTC of the dates of the file that state none"
    changes = VALUE
    takes = '`"+01:00"`, `"UTC"`'
    schema = {"type": "string"}

    def read(self, given: Any, setting: ReadContext) -> str:
        if not isinstance(given, str):
            raise ValueError(f'{show(given)} is not text; expected for example "+01:00" or "UTC"')
        from fvsolve.parts.time_stamps import read_zone, zone_text

        return zone_text(read_zone(given))


DATE_KEYS: dict[str, tuple[Value, Any]] = {  # of a file of a time series
    "date_order": (
        Choice(
            "order of dates",
            ORDERS,
            "order of dates such as 01/02/2026; other forms of dates are unambiguous",
            changes=VALUE,
        ),
        None,
    ),
    "time_zone": (ZoneValue(), None),
}


def start_time_in(summary: dict[str, Any]) -> StartTime | None:
    """Instant of t = 0 in the summary of a run; None without one. Raises ValueError if its text is not a date."""
    if "start_time" not in summary:
        return None
    from fvsolve.parts.time_stamps import StartTime, read_stamp

    return StartTime(read_stamp(summary["start_time"]))


def moment_text(text: str, t: float, start: StartTime | None) -> str:
    """Text of a time with its date; text : the time in its unit, t : the time [s], start : None without dates"""
    return text if start is None else text + start.in_brackets(t)

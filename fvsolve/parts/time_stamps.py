"""Dates with times of the day: the instant of t = 0, its texts at other times, and stamps in columns of files."""

import datetime
import re
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from fvsolve.units import show

EXAMPLE = "2026-03-01T06:00:00"
DAY_FIRST = "day-month-year"
DAY, HOUR, MINUTE = 86400, 3600, 60  # [s]
MICRO = 1_000_000  # stamps are written to the microsecond
FIRST_HOURS = (
    4 * HOUR
)  # of a day: at the end of daylight saving time a local hour in them is repeated
EPOCH = datetime.date(1970, 1, 1).toordinal()
MONTHS = {
    name: number
    for number, names in enumerate(
        (
            "jan january,feb february,mar march,apr april,may,jun june,jul july,aug august,"
            "sep sept september,oct october,nov november,dec december"
        ).split(","),
        1,
    )
    for name in names.split()
}
DATE = (
    r"(?P<y>\d{4})(?P<mark>[-/.])(?P<m>\d{1,2})(?P=mark)(?P<d>\d{1,2})"
    r"|(?P<y8>\d{4})(?P<m8>\d{2})(?P<d8>\d{2})(?=T)"
    r"|(?P<dd>\d{1,2})\.(?P<dm>\d{1,2})\.(?P<dy>\d{4})"
    r"|(?P<a>\d{1,2})(?P<sign>[/-])(?P<b>\d{1,2})(?P=sign)(?P<ay>\d{4})"
    r"|(?P<nd>\d{1,2})[- ](?P<nm>[A-Za-z]{3,9})[- ,]+(?P<ny>\d{4})"
    r"|(?P<um>[A-Za-z]{3,9}) (?P<ud>\d{1,2}),? (?P<uy>\d{4})"
)
CLOCK = (
    r"(?P<h>\d{1,2}):(?P<min>\d{2})(?::(?P<s>\d{2})(?:[.,](?P<f>\d{1,18}))?)?(?: ?(?P<half>[AaPp][Mm]))?"
    r"|(?P<h4>\d{2})(?P<min4>\d{2})(?P<s4>\d{2})?"
)
ZONE = r"Z|z|UTC|GMT|(?:UTC|GMT)?[+-]\d{1,2}(?::?\d{2})?"
STAMP = re.compile(rf"(?P<date>{DATE})(?:(?:T|t| +)(?:{CLOCK}))?(?: *(?P<zone>{ZONE}))?")
OFFSET = re.compile(r"(?:UTC|GMT)?([+-])(\d{1,2})(?::?(\d{2}))?")
# begins as a date: such a text is not a mistyped number
PROBABLE = re.compile(
    r"\d{1,4}[-/.]\d{1,2}[-/.]\d{1,4}|\d{1,2}:\d{2}|\d{8}T|\d{1,2}[- ][A-Za-z]{3}|[A-Za-z]{3,9} \d"
)


class StampError(ValueError):
    """Fault of a text that is not a valid date."""


class Stamp(NamedTuple):
    """Instant.

    seconds : whole seconds since 1970-01-01T00:00, in UTC, or in local time without `offset`
    fraction : digits of the fraction of a second; offset : of its zone from UTC [s], None for a local time
    """

    seconds: int
    fraction: str = ""
    offset: int | None = None

    @property
    def exact(self) -> Decimal:
        """Seconds since 1970-01-01T00:00, as `seconds`, with their fraction."""
        return (
            Decimal(f"{self.seconds}.{self.fraction or 0}")
            if self.seconds >= 0
            else (Decimal(self.seconds) + Decimal(f"0.{self.fraction or 0}"))
        )

    @property
    def clock(self) -> int:
        """Whole seconds since 1970-01-01T00:00 on the clock of its zone."""
        return self.seconds + (self.offset or 0)

    @property
    def reference(self) -> str:
        """Text of the instant in UTC, or in local time, without zone, as the unit of times has it after CF-1.8."""
        text = str(self._replace(offset=None))
        return text.replace("T", " ")

    def __str__(self) -> str:
        day, rest = divmod(self.clock, DAY)
        text = datetime.date.fromordinal(EPOCH + day).isoformat()
        text += f"T{rest // HOUR:02d}:{rest // MINUTE % MINUTE:02d}:{rest % MINUTE:02d}"
        return text + (f".{self.fraction}" if self.fraction else "") + zone_text(self.offset)


@dataclass(frozen=True)
class StartTime:
    """Instant of t = 0 s; other times have the zone of this instant."""

    stamp: Stamp

    def table(self) -> str:
        """Text of the instant in a case file."""
        return str(self.stamp)

    def holds(self, start: float, end: float) -> bool:
        """True if all times from `start` to `end` [s] lie in the years 1 to 9999."""
        first, last = ((datetime.date(year, 1, 1).toordinal() - EPOCH) * DAY for year in (1, 9999))
        return first <= self.stamp.clock + start and self.stamp.clock + end < last + 365 * DAY

    def datetimes(self, t: Any) -> np.ndarray:
        """Instants of times t [s] on the clock of the zone, to the microsecond : datetime64[us]."""
        zero = self.stamp.clock * MICRO + int((self.stamp.fraction + "000000")[:6])
        steps = np.rint(np.asarray(t, float) * MICRO)
        known = np.isfinite(steps)
        instants = (zero + np.where(known, steps, 0.0).astype(np.int64)).astype("datetime64[us]")
        return np.where(known, instants, np.datetime64("NaT", "us"))

    def texts(self, t: Any) -> list[str]:
        """ISO 8601 texts of the instants of times t [s], all with six digits of seconds; "" for nan."""
        zone = zone_text(self.stamp.offset)
        texts = np.datetime_as_string(self.datetimes(t), unit="us").tolist()
        return ["" if text == "NaT" else f"{text}{zone}" for text in texts]

    def text(self, t: float) -> str:
        """ISO 8601 text of the instant of t [s], to the millisecond, without zeros at its end."""
        [instant] = self.datetimes([round(t, 3)])
        text = str(np.datetime_as_string(instant, unit="ms"))
        return text.removesuffix(".000") + zone_text(self.stamp.offset)

    def in_brackets(self, t: float | None) -> str:
        """Text of the instant of t [s] in brackets, which follows the text of t; "" for None and nan."""
        return "" if t is None or not np.isfinite(t) else f" ({self.text(t)})"

    @property
    def zone(self) -> str:
        """Zone of times on axes: "UTC", "UTC+01:00" or "local"."""
        if self.stamp.offset is None:
            return "local"
        return f"UTC{zone_text(self.stamp.offset)}".removesuffix("Z")

    def seconds(self, stamp: Stamp) -> float:
        """Time t [s] of a stamp. Raises StampError if only the stamp or only this instant has a zone."""
        if (stamp.offset is None) != (self.stamp.offset is None):
            has, lacks = (
                ("has a zone", "has none")
                if stamp.offset is not None
                else ("has no zone", "has a zone")
            )
            text = f"{str(stamp)} {has}, and numerics.start_time = {self.table()} {lacks}"
            remedy = (
                "a zone in both"
                if stamp.offset is not None
                else 'the key `time_zone = "+01:00"` of the file'
            )
            raise StampError(f"{text}; expected {remedy}, or no zone in both")
        return float(stamp.exact - self.stamp.exact)


def zone_text(offset: int | None) -> str:
    """Text of a zone: "" for a local time, "Z" for UTC, else such as "+01:00"."""
    if offset is None:
        return ""
    minutes = abs(offset) // MINUTE
    return (
        "Z" if not offset else f"{'-' if offset < 0 else '+'}{minutes // 60:02d}:{minutes % 60:02d}"
    )


def read_zone(text: str) -> int:
    """Offset of a zone from UTC [s]. Raises StampError for other texts, such as names of zones."""
    if text.upper() in ("Z", "UTC", "GMT"):
        return 0
    match = OFFSET.fullmatch(text)
    if match is None or int(match[2]) > 15 or int(match[3] or 0) > 59:
        raise StampError(
            f'{show(text)} is not an offset from UTC; expected for example "+01:00" or "UTC"'
        )
    return (int(match[2]) * HOUR + int(match[3] or 0) * MINUTE) * (-1 if match[1] == "-" else 1)


def begins_as_stamp(text: str) -> bool:
    """True if a text is a date or begins as a date."""
    return PROBABLE.match(text) is not None


def read_stamp(text: str, order: str | None = None, offset: int | None = None) -> Stamp:
    """Instant of the text of a date with or without a time of the day. Raises StampError for other texts.

    order : order of dates that begin with two small numbers, None if unknown
    offset : offset from UTC [s] of texts without a zone, None for local times
    """
    match = STAMP.fullmatch(text.strip())
    if match is None:
        raise StampError(f"{show(text)} is not a date; expected for example {EXAMPLE}")
    part = match.groupdict()
    day = _days(part["date"], order)
    hour, minute, second = (int(part[f"{key}4"] or part[key] or 0) for key in ("h", "min", "s"))
    if part["half"]:
        if not 1 <= hour <= 12:
            raise StampError(
                f"{show(text)}: the hour before AM or PM is not from 1 to 12; expected a clock of 12 hours"
            )
        hour = hour % 12 + 12 * (part["half"].upper() == "PM")
    end = hour == 24 and not minute and not second and not int(part["f"] or 0)
    if not (end or hour < 24) or minute > 59 or second > 59:
        raise StampError(
            f"{show(text)} is not a time of the day; expected 00:00:00 to 23:59:59, or 24:00"
        )
    zone = offset
    if part["zone"]:
        zone = read_zone(part["zone"])
        if offset is not None and zone != offset:
            raise StampError(
                f"{show(text)} has another zone than the file, {zone_text(offset)}; expected one of the two"
            )
    seconds = day * DAY + hour * HOUR + minute * MINUTE + second
    return Stamp(seconds - (zone or 0), (part["f"] or "").rstrip("0"), zone)


@lru_cache(maxsize=4096)
def _days(text: str, order: str | None) -> int:
    """Days from 1970-01-01 to the date of a text. Raises StampError. order : as for `read_stamp`"""
    part = STAMP.fullmatch(text + "T00:00").groupdict()
    if part["a"]:
        if order is None:
            words = f'"{DAY_FIRST}" or "month-day-year"'
            raise StampError(f"{show(text)} is ambiguous; expected the key `date_order`, {words}")
        day, month = (part["a"], part["b"]) if order == DAY_FIRST else (part["b"], part["a"])
        year = part["ay"]
    else:
        year = part["y"] or part["y8"] or part["dy"] or part["ny"] or part["uy"]
        day = part["d"] or part["d8"] or part["dd"] or part["nd"] or part["ud"]
        word = part["nm"] or part["um"]
        month = part["m"] or part["m8"] or part["dm"] or MONTHS.get((word or "").casefold())
        if month is None:
            raise StampError(
                f"{show(word)} is not the English name of a month; expected for example {EXAMPLE[:10]}"
            )
    try:
        return datetime.date(int(year), int(month), int(day)).toordinal() - EPOCH
    except ValueError:
        hint = f'; date_order is "{order}"' if part["a"] else ""
        raise StampError(
            f"{show(text)} is not a day of the calendar{hint}; expected an existing day"
        ) from None


def order_fault(stamps: list[Stamp], texts: list[str]) -> tuple[int, str] | None:
    """Index and message of the first stamp that is not after the stamp before it; None if all stamps rise.

    texts : texts of the stamps in the file
    """
    exact = [stamp.exact for stamp in stamps]
    for k in range(1, len(stamps)):
        after, back = stamps[k], exact[k - 1] - exact[k]
        if back < 0:
            continue
        state = (
            f"is the same time as {show(texts[k - 1])}"
            if not back
            else f"comes after {show(texts[k - 1])}"
        )
        text = f"{show(texts[k])} {state}"
        if after.offset is None and back < HOUR and after.clock % DAY < FIRST_HOURS:
            text += ", as in the local hour that is repeated at the end of daylight saving time"
            return (
                k,
                f"{text}; expected rising times: standard time all year, or an offset such as +01:00 in each row",
            )
        return k, f"{text}; expected rising times"
    return None

"""What a reader must know before any number: why a run stopped, what is not to be trusted, whether limits hold."""

from __future__ import annotations

from typing import NamedTuple

from fvsolve.output.column import column
from fvsolve.report.tables import ERROR, ReportTable, in_unit, worded
from fvsolve.run.result import FAILS, HOLDS, IN_WORDS, OPEN, not_valid
from fvsolve.units import span

BOUNDS = {"least": "at\u00a0least", "greatest": "at\u00a0most"}
LATER = 6  # marks named behind the first


class Word(NamedTuple):
    """A sentence at the top of the page; level : "bad", "doubt" or "good"; links : (name, place) of pages."""

    level: str
    head: str
    text: str
    links: tuple[tuple[str, str], ...] = ()


def words(result) -> list[Word]:
    """The sentences at the top: a stop first, then what is wrong, what is in doubt, and the verdict."""
    said = result.summary
    found = []
    if result.reason != "finished":
        reached, end = (result.case.amount(one, "time", 6) for one in (said["t"], result.case.numerics.end))
        reached = f"It reached t = {reached} of {end}"
        found.append(Word("bad", "This run stopped early.", f"{result.reason}. {reached}; the rest is not known."))
    found += [Word("bad", "Not to be trusted.", one.text) for one in result.warnings if not one.ok]
    found += [*_doubt(result), verdict(result)]
    for state, level, head in ((FAILS, "bad", "The case claims what this run does not show."),
                               (OPEN, "doubt", "Whether the case's claims hold is open.")):  # fmt: skip
        if those := [one for one in result.expectations if one.state == state]:
            more = f"; and {len(those) - 1} more, under Numerics" if len(those) > 1 else ""
            found.append(Word(level, head, claim(those[0]) + more))
    return found


def _doubt(result) -> list[Word]:
    """From when on results are not to be trusted: the first mark, and where others follow."""
    marks = sorted(result.marks, key=lambda one: one.time)
    if not marks:
        return []
    when = [result.case.amount(one.time, "time", 6) for one in marks]
    places = [f"{one.place.partition('.')[2]} at {t}" for one, t in zip(marks, when, strict=True)]
    later = ", ".join(places[1 : 1 + LATER])
    more = f", and {len(marks) - 1 - LATER} more places" if len(marks) > 1 + LATER else ""
    text = marks[0].text + (f". Later also {later}{more}" if later else "")
    return [Word("doubt", f"Results from {when[0]} on are not to be trusted.", text)]


def sound(result) -> bool:
    """Whether the run came to its end and nothing casts doubt on its numbers."""
    return result.reason == "finished" and result.ok and not result.marks


def verdict(result) -> Word:
    """Whether the limits of the case hold."""
    verdicts = result.verdicts
    if not verdicts:
        return Word("none", "No limits were stated.", "The case does not say what its parts may bear: this report says "
                    "what happens, not whether it is allowed.")  # fmt: skip
    states = [one.state for one in verdicts]
    failed = [one.name for one, how in zip(verdicts, states, strict=True) if how == FAILS]
    if failed:
        many = f"{len(failed)} of {len(verdicts)} limits" if len(verdicts) > 1 else "The limit"
        return Word("bad", f"{many} {'do' if len(failed) > 1 else 'does'} not hold.", ", ".join(failed))
    unsure = [one.name for one, how in zip(verdicts, states, strict=True) if how == OPEN]
    if unsure:
        return Word("doubt", f"Whether {'limits hold' if len(unsure) > 1 else 'a limit holds'} is open.",
                    f"{', '.join(unsure)}: {open_for(result)}.")  # fmt: skip
    every = f"All {len(verdicts)} limits hold" if len(verdicts) > 1 else "The limit holds"
    return Word("good", f"{every}.", "") if sound(result) else Word("doubt", f"{every}, as far as to be trusted.", "")


def open_for(result) -> str:
    """Why limits of a run are open."""
    if text := not_valid(result.summary):
        return f"the run is {text}"
    if not result.ok:
        return "the run is not sound"
    if result.marks:
        return "from a time on the numbers are not to be trusted"
    if any(one.kind == "end" for one in result.warnings):
        return "what is scheduled goes on after the end of the run"
    return "their margins are smaller than the error of the numbers"


def verdicts(result) -> ReportTable | None:
    """The table of verdicts, those that fail first; None where no limits were stated."""
    order = (FAILS, OPEN, HOLDS)
    found = sorted(result.verdicts, key=lambda one: order.index(one.state))
    length, height, time = (column("", what, result.case) for what in ("length", "head", "time"))
    asked = any(one.error is not None for one in found)
    rows = []
    for one in found:
        asks = f"{one.quantity.replace('_', ' ')} {BOUNDS[one.bound]} {worded(one.limit)} {one.unit}"
        apart = span(one.unit)
        said = one.unit if apart == one.unit else f"{one.unit}, margin {apart}"
        where = in_unit(length, one.chainage), in_unit(height, one.elevation), in_unit(time, one.time)
        margin = not_valid(result.summary) or None if one.margin is None else one.margin
        rows.append(
            [one.name, asks, IN_WORDS[one.state], one.value, *[one.error] * asked, margin, said, one.place, *where]
        )
    heads = ("limit", "asks for", "verdict", "value", *[ERROR] * asked, "margin", "unit", "worst at")
    heads += ("chainage", "elevation", "time")
    bad = frozenset(k for k, one in enumerate(found) if one.state == FAILS)
    units = ("",) * (7 + asked) + (length.unit, height.unit, time.unit)
    return ReportTable("Limits", heads, rows, units, bad, frozenset({3, 4, *[5] * asked})) if rows else None


def worst(result) -> list[ReportTable]:
    """Of each limit that more than one part has, its worst places."""
    length, height, time = (column("", what, result.case) for what in ("length", "head", "time"))
    made = []
    for one in result.verdicts:
        told = ((length, "chainage"), (height, "elevation"), (time, "time"))
        asked = any(row["error"] is not None for row in one.worst)
        rows = [[row["place"], *(in_unit(shown, row[key]) for shown, key in told), row["value"],
                 *[row["error"]] * asked, BOUNDS[row["bound"]], row["limit"], row["margin"], IN_WORDS[row["state"]]]
                for row in one.worst]  # fmt: skip
        bad = frozenset(k for k, row in enumerate(one.worst) if row["state"] == FAILS)
        apart = span(one.unit)
        units = ("", length.unit, height.unit, time.unit, one.unit, *[apart] * asked, "", one.unit, apart, "")
        heads = ("place", "chainage", "elevation", "time", one.quantity.replace("_", " "), *[ERROR] * asked)
        heads += ("", "limit", "margin", "verdict")
        made += [ReportTable(f"Limit {one.name}: worst places", heads, rows, units, bad)] if len(rows) > 1 else []
    return made


def claims(result) -> ReportTable | None:
    """What the case claims of its own results."""
    rows = [[one.text, one.claimed, one.found, one.tolerance, one.unit, IN_WORDS[one.state]]
            for one in result.expectations]  # fmt: skip
    bad = frozenset(k for k, one in enumerate(result.expectations) if one.state == FAILS)
    heads = ("claim", "claimed", "found", "tolerance", "unit", "verdict")
    return ReportTable("What the case claims", heads, rows, bad=bad, loose=frozenset({1, 2, 3})) if rows else None


def claim(one) -> str:
    """A claim in words."""
    return f"{one.text}: claimed {one.claimed:.6g}, found {worded(one.found)} {one.unit}"

"""Sentences and tables at the top of a report: early stop, unreliable results, verdicts of limits and expectations."""

from __future__ import annotations

from typing import NamedTuple

from fvsolve.output.unit_columns import column
from fvsolve.report.tables import ERROR_HEADER, ReportTable, in_unit, value_text
from fvsolve.run.result import FAILS, HOLDS, IN_WORDS, OPEN, not_valid
from fvsolve.units import span

BOUND_WORDS = {"minimum": "at\u00a0least", "maximum": "at\u00a0most"}
MAX_LATER_MARKS = 6  # greatest number of marks named after the first


class Sentence(NamedTuple):
    """Sentence at the top of a report.

    level : "bad", "doubt", "good" or "none"; head : first words, in bold; links : (name, address) of pages
    """

    level: str
    head: str
    text: str
    links: tuple[tuple[str, str], ...] = ()


def top_sentences(result) -> list[Sentence]:
    """Sentences at the top of a report: early stop, errors, doubts, verdict on limits, failed or open expectations."""
    summary = result.summary
    rows = []
    if result.reason != "finished":
        reached, end = (result.case.amount(item, "time", 6) for item in (summary["t"], result.case.numerics.end))
        reached = f"The run reached t = {reached} of {end}"
        rows.append(
            Sentence("bad", "This run stopped early.", f"{result.reason}. {reached}; later values are unknown.")
        )
    rows += [Sentence("bad", "Not to be trusted.", item.text) for item in result.warnings if not item.ok]
    rows += [*_mark_sentences(result), verdict_sentence(result)]
    for state, level, head in ((FAILS, "bad", "The run does not meet an expected value of the case."),
                               (OPEN, "doubt", "The verdict of an expected value is open.")):  # fmt: skip
        if claims := [item for item in result.expectations if item.state == state]:
            more = f"; and {len(claims) - 1} more, under Numerics" if len(claims) > 1 else ""
            rows.append(Sentence(level, head, claim_text(claims[0]) + more))
    return rows


def _mark_sentences(result) -> list[Sentence]:
    """List of one sentence on the time from which results are not valid, the first mark and the places of later marks.

    It is empty without marks.
    """
    marks = sorted(result.marks, key=lambda mark: mark.time)
    if not marks:
        return []
    when = [result.case.amount(mark.time, "time", 6) for mark in marks]
    places = [f"{mark.place.partition('.')[2]} at {t}" for mark, t in zip(marks, when, strict=True)]
    later = ", ".join(places[1 : 1 + MAX_LATER_MARKS])
    more = f", and {len(marks) - 1 - MAX_LATER_MARKS} more places" if len(marks) > 1 + MAX_LATER_MARKS else ""
    text = marks[0].text + (f". Later also {later}{more}" if later else "")
    return [Sentence("doubt", f"Results from {when[0]} on are not to be trusted.", text)]


def is_sound(result) -> bool:
    """True if a run reached its end, its results are ok and it has no marks."""
    return result.reason == "finished" and result.ok and not result.marks


def verdict_sentence(result) -> Sentence:
    """Sentence on the limits of the case: some are violated, some are open, all hold, or none is stated."""
    verdicts = result.verdicts
    if not verdicts:
        return Sentence(
            "none",
            "No limits were stated.",
            "The case has no [limits], so this report shows what happens, but not whether this is allowed.",
        )
    states = [item.state for item in verdicts]
    failed = [item.name for item, state in zip(verdicts, states, strict=True) if state == FAILS]
    if failed:
        text = f"{len(failed)} of {len(verdicts)} limits" if len(verdicts) > 1 else "The limit"
        return Sentence("bad", f"{text} {'do' if len(failed) > 1 else 'does'} not hold.", ", ".join(failed))
    unsure = [item.name for item, state in zip(verdicts, states, strict=True) if state == OPEN]
    if unsure:
        return Sentence("doubt", f"The verdict of {'limits' if len(unsure) > 1 else 'a limit'} is open.",
                    f"{', '.join(unsure)}: {open_reason(result)}.")  # fmt: skip
    summary = f"All {len(verdicts)} limits hold" if len(verdicts) > 1 else "The limit holds"
    return (
        Sentence("good", f"{summary}.", "")
        if is_sound(result)
        else Sentence("doubt", f"{summary}, as far as results are reliable.", "")
    )


def open_reason(result) -> str:
    """Reason for which the limits of a run are open (undecided), as a part of a sentence."""
    if text := not_valid(result.summary):
        return f"the run is {text}"
    if not result.ok:
        return "the run stopped early or its numbers are wrong"
    if result.marks:
        return "from some time on the results are not to be trusted"
    if any(notice.kind == "end" for notice in result.warnings):
        return "a schedule continues, or a trip occurs, after the end of the run"
    return "margins are smaller than the numerical errors"


def verdict_table(result) -> ReportTable | None:
    """Table of the verdicts on limits, violated limits first; None without limits."""
    order = (FAILS, OPEN, HOLDS)
    ordered = sorted(result.verdicts, key=lambda check: order.index(check.state))
    length, height, time = (column("", dimension, result.case) for dimension in ("length", "head", "time"))
    errors = any(check.error is not None for check in ordered)
    rows = []
    for check in ordered:
        requirement = (
            f"{check.quantity.replace('_', ' ')} {BOUND_WORDS[check.bound]} {value_text(check.limit)} {check.unit}"
        )
        margin_unit = span(check.unit)
        unit_text = check.unit if margin_unit == check.unit else f"{check.unit}, margin {margin_unit}"
        place = in_unit(length, check.chainage), in_unit(height, check.elevation), in_unit(time, check.time)
        margin = not_valid(result.summary) or None if check.margin is None else check.margin
        rows.append(
            [check.name, requirement, IN_WORDS[check.state], check.value, *[check.error] * errors, margin,
             unit_text, check.place, *place]
        )  # fmt: skip
    heads = ("limit", "requirement", "verdict", "value", *[ERROR_HEADER] * errors, "margin", "unit", "worst place")
    heads += ("chainage", "elevation", "time")
    bad = frozenset(k for k, check in enumerate(ordered) if check.state == FAILS)
    units = ("",) * (7 + errors) + (length.unit, height.unit, time.unit)
    return ReportTable("Limits", heads, rows, units, bad, frozenset({3, 4, *[5] * errors})) if rows else None


def worst_tables(result) -> list[ReportTable]:
    """Tables of the positions with the least margins, for each limit with more than one part or bound."""
    length, height, time = (column("", dimension, result.case) for dimension in ("length", "head", "time"))
    tables = []
    for check in result.verdicts:
        keys = ((length, "chainage"), (height, "elevation"), (time, "time"))
        errors = any(row["error"] is not None for row in check.worst)
        rows = [
            [
                row["place"],
                *(in_unit(shown, row[key]) for shown, key in keys),
                row["value"],
                *[row["error"]] * errors,
                BOUND_WORDS[row["bound"]],
                row["limit"],
                row["margin"],
                IN_WORDS[row["state"]],
            ]
            for row in check.worst
        ]
        bad = frozenset(k for k, row in enumerate(check.worst) if row["state"] == FAILS)
        margin_unit = span(check.unit)
        units = ("", length.unit, height.unit, time.unit, check.unit, *[margin_unit] * errors, "", check.unit,
                 margin_unit, "")  # fmt: skip
        heads = ("place", "chainage", "elevation", "time", check.quantity.replace("_", " "), *[ERROR_HEADER] * errors)
        heads += ("", "limit", "margin", "verdict")
        tables += [ReportTable(f"Limit {check.name}: worst places", heads, rows, units, bad)] if len(rows) > 1 else []
    return tables


def claim_table(result) -> ReportTable | None:
    """Table of the expected values of the case and of the computed values; None without expected values."""
    rows = [[item.text, item.claimed, item.found, item.tolerance, item.unit, IN_WORDS[item.state]]
            for item in result.expectations]  # fmt: skip
    bad = frozenset(k for k, item in enumerate(result.expectations) if item.state == FAILS)
    heads = ("expectation", "expected", "computed", "tolerance", "unit", "verdict")
    return (
        ReportTable("Expected values of the case", heads, rows, bad=bad, mixed_units=frozenset({1, 2, 3}))
        if rows
        else None
    )


def claim_text(item) -> str:
    """Text that compares an expected value of the case with the computed value."""
    return f"{item.text}: expected {item.claimed:.6g}, computed {value_text(item.found)} {item.unit}"

"""Controls and rules of EPANET: conditions as formulas of levels and of the time, relays and schedules of switches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

DAY = 86400.0
PULSE = 1.0  # time for which a condition holds that EPANET states for a moment [s]

Interval = tuple[float, float]


class Untranslatable(Exception):
    """Raised for a condition that has no form in a case; its text completes "not imported, because it ..."."""


@dataclass(frozen=True)
class Clause:
    """Condition of a control or rule.

    text : function (tank -> name of its level in the formula) -> formula that is 1 while it holds, else 0
    holds : function (levels of tanks [m]) -> True if it holds at the start
    tanks : EPANET's names of the tanks whose levels it reads
    intervals : times [s] between which it holds, for a condition of the time alone; else None
    level : (tank, True if it holds above, level [m]) of a condition on the level of one tank; else None
    """

    text: Callable[[dict[str, str]], str]
    holds: Callable[[dict[str, float]], bool]
    tanks: tuple[str, ...] = ()
    intervals: tuple[Interval, ...] | None = None
    level: tuple[str, bool, float] | None = None

    def at_start(self, network: Any) -> bool:
        """True if it holds at the start; network : network of WNTR"""
        return self.holds({name: tank.init_level for name, tank in network.tanks()})


@dataclass(frozen=True)
class Statement:
    """Action of a control or rule on a link.

    label : name of the control or rule; value : status (0 closed, 1 open), or a speed if `speed` is True
    """

    label: str
    clause: Clause
    value: float
    speed: bool


def clause_of(condition: Any, clock: float, end: float, tolerance: float) -> Clause:
    """Clause of a condition of WNTR; raises Untranslatable.

    clock : clock time at the start of the run [s after midnight]; end : end of the run [s]
    tolerance : of levels [m], by which EPANET's rules are early for > and <, and late for >= and <=
    """
    kind = type(condition).__name__
    if kind in ("AndCondition", "OrCondition"):
        return combined(
            kind == "AndCondition", *(clause_of(part, clock, end, tolerance) for part in parts_of(condition))
        )
    if kind == "SimTimeCondition":
        return time_clause(condition, [float(condition._threshold)], (2.0 * end, 2.0 * end), end)
    if kind == "TimeOfDayCondition":
        since = float(condition._threshold) % DAY  # midnight
        moments = [(since - clock) % DAY + k * DAY for k in range(-1, int(end // DAY) + 2)]
        return time_clause(condition, moments, (since, DAY - since), end)
    source = getattr(condition, "_source_obj", None)
    if getattr(source, "node_type", "") == "Tank" and condition._source_attr in ("level", "head", "pressure"):
        return level_clause(condition, source, tolerance)
    if getattr(source, "node_type", "") == "Junction":
        raise Untranslatable(
            f"acts by the {condition._source_attr} of a junction, which follows its own action at once"
        )
    if hasattr(source, "link_type"):
        raise Untranslatable(f"acts by the {condition._source_attr} of a link, which follows its own action at once")
    raise Untranslatable(f"acts by a condition without a key here ({kind})")


def parts_of(condition: Any) -> tuple[Any, Any]:
    """Both conditions that a condition of WNTR combines."""
    return condition._condition_1, condition._condition_2


def relation_of(condition: Any) -> tuple[bool, bool, bool]:
    """(True above the threshold, True for equality alone, True if the threshold belongs to it) of a relation."""
    name = condition._relation.name
    if name == "ne":
        raise Untranslatable("acts where a value differs from a number")
    return name in ("gt", "ge"), name == "eq", name in ("ge", "le", "eq")


def level_clause(condition: Any, tank: Any, tolerance: float) -> Clause:
    """Clause of a condition on the level of a tank; tolerance : as for `clause_of`"""
    above, equal, closed = relation_of(condition)
    if equal:
        raise Untranslatable("acts where a level equals a number")
    level = float(condition._threshold) - (tank.elevation if condition._source_attr == "head" else 0.0)
    level += tolerance if above == closed else -tolerance
    sign, name = (">" if above else "<") + "=" * closed, tank.name

    def holds(levels):
        value = levels[name]
        return value > level or (closed and value == level) if above else value < level or (closed and value == level)

    return Clause(lambda names: f"({names[name]} {sign} {level:.10g})", holds, (name,), None, (name, above, level))


def time_clause(condition: Any, moments: list[float], reach: tuple[float, float], end: float) -> Clause:
    """Clause of a condition on the time.

    moments : times at which its threshold is reached [s]; end : end of the run [s]
    reach : times before and after such a moment during which the time is below and above the threshold [s]
    """
    above, equal, _ = relation_of(condition)
    if equal:
        spans = [(at, at + PULSE) for at in moments]
    else:
        spans = [(at, at + reach[1]) if above else (at - reach[0], at) for at in moments]
    spans = [(begin, stop) for begin, stop in spans if stop > 0.0 and begin <= end]

    def text(names):
        terms = [f"(t >= {begin:.10g})*(t < {stop:.10g})" for begin, stop in spans]
        return "(" + (" + ".join(terms) or "0*t") + ")"

    return Clause(text, lambda levels: any(begin <= 0.0 < stop for begin, stop in spans), (), tuple(spans))


def combined(both: bool, first: Clause, second: Clause) -> Clause:
    """Clause that holds where both clauses hold, or where one of both holds."""
    spans = None
    if first.intervals is not None and second.intervals is not None:
        ends = sorted({at for span in (*first.intervals, *second.intervals) for at in span})
        pieces = zip(ends[:-1], ends[1:], strict=True)
        test = all if both else any
        spans = tuple(
            piece for piece in pieces if test(within(0.5 * sum(piece), part.intervals) for part in (first, second))
        )

    def text(names):
        a, b = first.text(names), second.text(names)
        return f"{a}*{b}" if both else f"(1 - (1 - {a})*(1 - {b}))"

    return Clause(
        text,
        lambda levels: (all if both else any)(part.holds(levels) for part in (first, second)),
        tuple(dict.fromkeys((*first.tanks, *second.tanks))), spans,
    )  # fmt: skip


def opposite(clause: Clause) -> Clause:
    """Clause that holds where another clause does not."""
    spans = None
    if clause.intervals is not None:
        ends = sorted({-DAY, 10.0 * DAY, *(at for span in clause.intervals for at in span)})
        pieces = zip(ends[:-1], ends[1:], strict=True)
        spans = tuple(piece for piece in pieces if not within(0.5 * sum(piece), clause.intervals))
    level = clause.level and (clause.level[0], not clause.level[1], clause.level[2])
    return Clause(
        lambda names: f"(1 - {clause.text(names)})", lambda levels: not clause.holds(levels), clause.tanks, spans, level
    )


def within(time: float, intervals: tuple[Interval, ...]) -> bool:
    """True if a time [s] lies in one of the intervals, which include their begin."""
    return any(begin <= time < stop for begin, stop in intervals)


def relay_keys(actions: list[tuple[Clause, bool]]) -> tuple[str, float, float] | None:
    """(tank, level at which it turns on, level at which it turns off) [m] if a relay does all actions; else None.

    actions : pairs (clause, True if it turns on)
    """
    if len(actions) != 2 or {on for _, on in actions} != {True, False}:
        return None
    on, off = (next(clause.level for clause, own in actions if own is side) for side in (True, False))
    if on is None or off is None or on[0] != off[0] or on[1] == off[1]:
        return None
    if (on[2] <= off[2]) if on[1] else (on[2] >= off[2]):
        return None
    return on[0], on[2], off[2]


def schedule_keys(actions: list[tuple[Clause, bool]], begins: bool, end: float) -> tuple[list[float], list[int]]:
    """Times [s] and states (0 or 1) of a switch by the time alone.

    actions : pairs (clause, state), of which the last that holds prevails; begins : state before any action
    """
    ends = {0.0, *(at for clause, _ in actions for span in clause.intervals for at in span if 0.0 < at < end)}
    times, states, state = [], [], begins
    for at in sorted(ends):
        for clause, on in actions:
            state = on if within(at, clause.intervals) else state
        if not states or int(state) != states[-1]:
            times.append(at)
            states.append(int(state))
    return times, states

"""Controls and rules of EPANET: conditions as formulas of levels, heads, flows and the time; relays and schedules."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from fvsolve.epanet.network_file import FOOT, EpanetNetwork, EpanetSolution

DAY = 86400.0
PULSE = 1.0  # time for which a condition holds that EPANET states for a moment [s]
RULE_TOLERANCE = 1e-3  # of values in EPANET's rules, in the unit of the file

Interval = tuple[float, float]
# Input of a condition: ("level", tank), ("head", junction), ("flow", link) or ("open", link), by EPANET's names
Source = tuple[str, str]
Values = dict[Source, float]
Level = tuple[str, bool, float]  # tank, True if a condition holds above, level [m]


class Untranslatable(Exception):
    """Raised for a condition that has no form in a case; its text completes "not imported, because it ..."."""


@dataclass(frozen=True)
class Clause:
    """Condition of a control or rule.

    text : function (source -> its name in the formula) -> formula that is 1 while it holds, else 0
    holds : function (values of sources) -> True if it holds at the start
    sources : what it reads
    intervals : times [s] between which it holds, for a condition of the time alone; else None
    level : of a condition on the level of one tank; else None
    levels : all comparisons with levels of tanks in it
    """

    text: Callable[[dict[Source, str]], str]
    holds: Callable[[Values], bool]
    sources: tuple[Source, ...] = ()
    intervals: tuple[Interval, ...] | None = None
    level: Level | None = None
    levels: tuple[Level, ...] = ()


@dataclass(frozen=True)
class Statement:
    """Action of a control or rule on a link.

    label : name of the control or rule; link : EPANET's name
    action : ("closed",), ("open",), ("active",) or ("setting", value in SI)
    """

    label: str
    clause: Clause
    link: str
    action: tuple[Any, ...]


def statements(network: EpanetNetwork, end: float) -> tuple[list[Statement], list[tuple[str, str]]]:
    """Actions of all controls and rules, and those that have no form in a case as (reason, name of the control).

    end : end of the run [s]. The last of all actions on a link that hold at one time prevails: EPANET applies controls
    in their order; rules act more often, that of the highest priority prevails, and the first of equal priority.
    """
    found, refused = [], []
    for number, control in enumerate(network.controls, start=1):
        label = f"control {number}"
        try:
            clause = control_clause(network, control, end)
            found.append(Statement(label, clause, control["link"], tuple(control["action"])))
        except Untranslatable as reason:
            refused.append((str(reason), label))
    for _, rule in sorted(enumerate(network.rules), key=lambda item: (item[1]["priority"], -item[0])):
        label = f"rule {rule['name']}"
        try:
            clause = rule_clause(network, rule["premises"], end)
        except Untranslatable as reason:
            refused.append((str(reason), label))
            continue
        for side, when in (("else", opposite(clause)), ("then", clause)):
            found += [Statement(label, when, link, tuple(action)) for link, action in reversed(rule[side])]
    return found, refused


def control_clause(network: EpanetNetwork, control: dict[str, Any], end: float) -> Clause:
    """Clause of a simple control; raises Untranslatable. A level equal to that of the control counts."""
    if control["kind"] == "time":
        return time_clause("=", [float(control["level"])], (0.0, 0.0), end)
    if control["kind"] == "clock":
        return time_clause("=", daily_moments(network, control["level"], end), (0.0, 0.0), end)
    relation = "<=" if control["kind"] == "below" else ">="
    node = network.nodes[control["node"]]
    if node.kind == "tank":  # EPANET states the level of a tank, or the pressure of a junction
        return value_clause(("level", node.name), relation, control["level"])
    if node.kind == "junction":
        head = node.elevation + control["level"] / network.options["gravity"]
        return value_clause(("head", node.name), relation, head)
    raise Untranslatable("acts by the level of a reservoir, which does not follow from the network")


def rule_clause(network: EpanetNetwork, premises: list[dict[str, Any]], end: float) -> Clause:
    """Clause of the premises of a rule; raises Untranslatable.

    EPANET reads the premises in their order: each `AND` begins a new group, and a rule holds if one premise of each
    group holds. So `A AND B OR C` is A AND (B OR C).
    """
    groups: list[list[Clause]] = []
    for premise in premises:
        clause = premise_clause(network, premise, end)
        if premise["or"] and groups:
            groups[-1].append(clause)
        else:
            groups.append([clause])
    return combined(True, [combined(False, group) for group in groups])


def premise_clause(network: EpanetNetwork, premise: dict[str, Any], end: float) -> Clause:
    """Clause of a premise of a rule; raises Untranslatable."""
    variable, relation, value, name = (premise[key] for key in ("variable", "relation", "value", "name"))
    if premise["object"] == "system":
        if variable == "time":
            return time_clause(relation, [float(value)], (float(value) + PULSE, 2.0 * end + PULSE), end)
        if variable == "clocktime":
            since = float(value) % DAY  # midnight
            return time_clause(relation, daily_moments(network, since, end), (since, DAY - since), end)
        raise Untranslatable(f"acts by the {variable} of the whole system")
    if premise["object"] == "node":
        return node_clause(network, network.nodes[name], variable, relation, value)
    if variable == "status" and value != "active":
        opens = (value == "open") == (relation == "=")
        source = ("open", name)
        return Clause(
            lambda names: f"({names[source]} {'>' if opens else '<'} 0.5)",
            lambda values: (values[source] > 0.5) == opens,
            (source,),
        )
    if variable == "flow":
        unit = network.options["flow_unit"]
        return value_clause(("flow", name), relation, value, RULE_TOLERANCE * unit)
    raise Untranslatable(f"acts by the {variable} of a link")


def node_clause(network: EpanetNetwork, node: Any, variable: str, relation: str, value: float) -> Clause:
    """Clause of a premise on a node, by its level or its head; raises Untranslatable."""
    gravity, length = network.options["gravity"], FOOT if network.us_units else 1.0
    tolerance = RULE_TOLERANCE * (network.options["pressure_unit"] / gravity if variable == "pressure" else length)
    if node.kind == "reservoir" or variable not in ("level", "head", "grade", "pressure"):
        raise Untranslatable(f"acts by the {variable} of a {node.kind}")
    above = value / gravity if variable == "pressure" else value  # the bottom of a tank, or the junction [m]
    if variable in ("head", "grade"):
        above -= node.elevation
    if node.kind == "tank":
        return value_clause(("level", node.name), relation, above, tolerance)
    if variable == "level":
        raise Untranslatable("acts by the level of a junction")
    return value_clause(("head", node.name), relation, node.elevation + above, tolerance)


COMPARE = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


def value_clause(source: Source, relation: str, threshold: float, tolerance: float = 0.0) -> Clause:
    """Clause of a comparison of a source with a threshold.

    tolerance : by which EPANET's rules are early for > and <, and late for >= and <=
    """
    if relation in ("=", "<>"):
        inside = combined(True, [_comparison(source, ">=", threshold - tolerance),
                                 _comparison(source, "<=", threshold + tolerance)])  # fmt: skip
        return inside if relation == "=" else opposite(inside)
    late = tolerance if relation in (">=", "<") else -tolerance
    return _comparison(source, relation, threshold + late)


def _comparison(source: Source, relation: str, threshold: float) -> Clause:
    shown = "abs({})" if source[0] == "flow" else "{}"
    level = (source[1], relation in (">", ">="), threshold) if source[0] == "level" else None

    def holds(values: Values) -> bool:
        value = values[source]
        return COMPARE[relation](abs(value) if source[0] == "flow" else value, threshold)

    return Clause(
        lambda names: f"({shown.format(names[source])} {relation} {threshold:.10g})", holds, (source,), None, level,
        (level,) if level else (),
    )  # fmt: skip


def daily_moments(network: EpanetNetwork, clock: float, end: float) -> list[float]:
    """Times of the run [s] at which a clock shows a time [s after midnight], from the day before the start."""
    first = (clock - network.times["start_clock"]) % DAY
    return [first + k * DAY for k in range(-1, int(end // DAY) + 2)]


def time_clause(relation: str, moments: list[float], reach: tuple[float, float], end: float) -> Clause:
    """Clause of a condition on the time.

    moments : times at which its threshold is reached [s]; end : end of the run [s]
    reach : times before and after such a moment during which the time is below and above the threshold [s]
    """
    if relation in ("=", "<>"):
        spans = [(at, at + PULSE) for at in moments]
    elif relation in (">", ">="):
        spans = [(at, at + reach[1]) for at in moments if at <= end]
    else:
        spans = [(at - reach[0], min(at, 2.0 * end + PULSE)) for at in moments]
    clause = interval_clause([(begin, stop) for begin, stop in spans if stop > 0.0 and begin <= end])
    return opposite(clause) if relation == "<>" else clause


def interval_clause(spans: Iterable[Interval]) -> Clause:
    """Clause that holds between times [s]."""
    kept = tuple(spans)

    def text(names: dict[Source, str]) -> str:
        terms = [f"(t >= {begin:.10g})*(t < {stop:.10g})" for begin, stop in kept]
        return "(" + (" + ".join(terms) or "0*t") + ")"

    return Clause(text, lambda values: within(0.0, kept), (), kept)


def combined(every: bool, clauses: list[Clause]) -> Clause:
    """Clause that holds where all clauses hold (every), or where one of them holds."""
    if len(clauses) == 1:
        return clauses[0]
    spans = None
    if all(clause.intervals is not None for clause in clauses):
        ends = sorted({at for clause in clauses for span in clause.intervals for at in span})
        pieces = zip(ends[:-1], ends[1:], strict=True)
        test = all if every else any
        spans = tuple(piece for piece in pieces if test(within(0.5 * sum(piece), part.intervals) for part in clauses))

    def text(names: dict[Source, str]) -> str:
        if every:
            return "*".join(clause.text(names) for clause in clauses)
        return f"(1 - {'*'.join(f'(1 - {clause.text(names)})' for clause in clauses)})"

    return Clause(
        text,
        lambda values: (all if every else any)(clause.holds(values) for clause in clauses),
        tuple(dict.fromkeys(source for clause in clauses for source in clause.sources)),
        spans,
        levels=tuple(level for clause in clauses for level in clause.levels),
    )


def opposite(clause: Clause) -> Clause:
    """Clause that holds where another clause does not."""
    spans = None
    if clause.intervals is not None:
        ends = sorted({-DAY, 1e4 * DAY, *(at for span in clause.intervals for at in span)})
        pieces = zip(ends[:-1], ends[1:], strict=True)
        spans = tuple(piece for piece in pieces if not within(0.5 * sum(piece), clause.intervals))
    level = clause.level and beyond(clause.level)
    return Clause(
        lambda names: f"(1 - {clause.text(names)})", lambda values: not clause.holds(values), clause.sources, spans,
        level, tuple(map(beyond, clause.levels)),
    )  # fmt: skip


def beyond(level: Level) -> Level:
    """Comparison that holds where another one does not."""
    return level[0], not level[1], level[2]


def within(time: float, intervals: tuple[Interval, ...]) -> bool:
    """True if a time [s] lies in one of the intervals, which include their begin."""
    return any(begin <= time < stop for begin, stop in intervals)


def values_at_start(network: EpanetNetwork, solution: EpanetSolution) -> Values:
    """Values of all sources at the start of the run, except the states of links, from EPANET's solution at hour 0."""
    values: Values = {("level", tank.name): tank.level for tank in network.tanks()}
    values |= {("head", name): head for name, head in solution.head.items()}
    return values | {("flow", name): flow for name, flow in solution.flow.items()}


def relay_keys(actions: list[tuple[Clause, Any]], on: Any) -> tuple[str, float, float] | None:
    """(tank, level at which it turns on, level at which it turns off) [m] if a relay does all actions; else None.

    actions : pairs (clause, value); on : value that counts as turned on
    """
    if len(actions) != 2 or {value == on for _, value in actions} != {True, False}:
        return None
    turns_on, turns_off = (next(clause.level for clause, value in actions if (value == on) is side)
                           for side in (True, False))  # fmt: skip
    if turns_on is None or turns_off is None or turns_on[0] != turns_off[0] or turns_on[1] == turns_off[1]:
        return None
    if (turns_on[2] <= turns_off[2]) if turns_on[1] else (turns_on[2] >= turns_off[2]):
        return None
    return turns_on[0], turns_on[2], turns_off[2]


def lacks_dead_band(actions: list[tuple[Clause, Any]]) -> bool:
    """True if actions with different values hold above and below levels of a tank without levels between them.

    Then each action may move the level to where the other one holds, without end. actions : pairs (clause, value)
    """
    reads = [(level, value) for clause, value in actions for level in clause.levels]
    return any(
        above and not below and tank == other and value != result and high >= low
        for (tank, above, low), value in reads
        for (other, below, high), result in reads
    )


def schedule_keys(actions: list[tuple[Clause, Any]], begins: Any, end: float) -> tuple[list[float], list[Any]]:
    """Times [s] and values of a quantity that is switched by the time alone.

    actions : pairs (clause, value), of which the last that holds prevails; begins : value before any action
    """
    ends = {0.0, *(at for clause, _ in actions for span in clause.intervals for at in span if 0.0 < at < end)}
    times, values, value = [], [], begins
    for at in sorted(ends):
        for clause, result in actions:
            value = result if within(at, clause.intervals) else value
        if not values or value != values[-1]:
            times.append(at)
            values.append(value)
    return times, values


def prevailing(actions: list[tuple[Clause, Any]], names: dict[Source, str]) -> dict[Any, str]:
    """Value -> formula that is 1 where an action sets the value and no later action sets another value.

    actions : pairs (clause, value) in the order of precedence, the last prevails
    """
    formulas: dict[Any, list[str]] = {}
    for k, (clause, value) in enumerate(actions):
        later = [other for other, result in actions[k + 1 :] if result != value]
        factors = [clause.text(names), *(f"(1 - {other.text(names)})" for other in later)]
        formulas.setdefault(value, []).append("*".join(factors))
    return {value: terms[0] if len(terms) == 1 else f"1 - {'*'.join(f'(1 - {term})' for term in terms)}"
            for value, terms in formulas.items()}  # fmt: skip

"""Controls and rules of EPANET: conditions as formulas of levels, heads, flows and the time; relays and schedules."""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import inf
from typing import Any

from fvsolve.exchange.epanet.network_file import FOOT, EpanetNetwork, EpanetSolution

DAY = 86400.0
PULSE = 1.0  # time for which a condition holds that EPANET states for a moment [s]
RULE_TOLERANCE = 1e-3  # of values in EPANET's rules, in the unit of the file

Interval = tuple[float, float]
ALWAYS: tuple[Interval, ...] = ((-inf, inf),)
# Input of a condition: ("level", tank), ("head", junction), ("flow", link) or ("open", link), by EPANET's names,
# or ("margin", steps of a threshold): the threshold at a time minus its source
Source = tuple[str, Any]
Values = dict[Source, float]
Level = tuple[str, bool, float]  # tank, True if a condition holds above, level [m]


class Untranslatable(Exception):
    """Raised for a condition that has no form in a case; its text completes "not imported, because it ..."."""


@dataclass(frozen=True)
class ThresholdSteps:
    """Threshold of a source that changes with the time.

    time, value : it has each value [m] from a time [s] on, and its first value before
    """

    source: Source
    time: tuple[float, ...]
    value: tuple[float, ...]


@dataclass(frozen=True)
class Clause:
    """Condition of a control or rule, which holds in intervals of time, while its sources satisfy a formula.

    formula : function (source -> its name in the formula) -> formula that is 1 while the sources satisfy it, else 0
    holds : function (values of sources) -> True if the clause holds at the start
    sources : inputs of the formula; none for a condition on the time alone
    intervals : times [s]; an interval is infinite on a side where it extends beyond the run
    compared : (source, relation, threshold) of a comparison of one level or head with a number [m]; else None
    levels : all comparisons with levels of tanks in it
    """

    formula: Callable[[dict[Source, str]], str]
    holds: Callable[[Values], bool]
    sources: tuple[Source, ...] = ()
    intervals: tuple[Interval, ...] = ALWAYS
    compared: tuple[Source, str, float] | None = None
    levels: tuple[Level, ...] = ()

    def text(self, names: dict[Source, str]) -> str:
        """Formula that is 1 while the clause holds, else 0; names : source -> its name in the formula"""
        factors = (
            [interval_text(self.intervals)] if self.intervals != ALWAYS or not self.sources else []
        )
        return "*".join([*factors, self.formula(names)] if self.sources else factors)


@dataclass(frozen=True)
class Statement:
    """Action of a control or rule on a link.

    label : name of the control or rule; of_rule : True for a rule; link : EPANET's name
    action : ("closed",), ("open",), ("active",) or ("setting", value in SI)
    """

    label: str
    clause: Clause
    link: str
    action: tuple[Any, ...]
    of_rule: bool = False


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
    for _, rule in sorted(
        enumerate(network.rules), key=lambda item: (item[1]["priority"], -item[0])
    ):
        label = f"rule {rule['name']}"
        try:
            clause = rule_clause(network, rule["premises"], end)
        except Untranslatable as reason:
            refused.append((str(reason), label))
            continue
        for side, when in (("else", opposite(clause)), ("then", clause)):
            found += [
                Statement(label, when, link, tuple(action), True)
                for link, action in reversed(rule[side])
            ]
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
    variable, relation, value, name = (
        premise[key] for key in ("variable", "relation", "value", "name")
    )
    if premise["object"] == "system":
        if variable == "time":
            return time_clause(
                relation, [float(value)], (float(value) + PULSE, 2.0 * end + PULSE), end
            )
        if variable == "clocktime":
            # 24:00 is after all times of EPANET's clock
            if float(value) >= DAY and relation not in ("=", "<>"):
                return interval_clause(ALWAYS if relation in ("<", "<=") else ())
            since = float(value) % DAY  # midnight
            return time_clause(
                relation, daily_moments(network, since, end), (since, DAY - since), end
            )
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


def node_clause(
    network: EpanetNetwork, node: Any, variable: str, relation: str, value: float
) -> Clause:
    """Clause of a premise on a node, by its level or its head; raises Untranslatable."""
    gravity, length = network.options["gravity"], FOOT if network.us_units else 1.0
    tolerance = RULE_TOLERANCE * (
        network.options["pressure_unit"] / gravity if variable == "pressure" else length
    )
    if node.kind == "reservoir" or variable not in ("level", "head", "grade", "pressure"):
        raise Untranslatable(f"acts by the {variable} of a {node.kind}")
    # the bottom of a tank, or the junction [m]
    above = value / gravity if variable == "pressure" else value
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
        inside = combined(
            True,
            [
                _comparison(source, ">=", threshold - tolerance),
                _comparison(source, "<=", threshold + tolerance),
            ],
        )
        return inside if relation == "=" else opposite(inside)
    late = tolerance if relation in (">=", "<") else -tolerance
    return _comparison(source, relation, threshold + late)


def _comparison(source: Source, relation: str, threshold: float) -> Clause:
    shown = "abs({})" if source[0] == "flow" else "{}"
    compared = None if source[0] == "flow" else (source, relation, threshold)

    def holds(values: Values) -> bool:
        value = values[source]
        return COMPARE[relation](abs(value) if source[0] == "flow" else value, threshold)

    levels = ((source[1], relation in (">", ">="), threshold),) if source[0] == "level" else ()
    return Clause(
        lambda names: f"({shown.format(names[source])} {relation} {threshold:.10g})",
        holds,
        (source,),
        ALWAYS,
        compared,
        levels,
    )


def daily_moments(network: EpanetNetwork, clock: float, end: float) -> list[float]:
    """Times of the run [s] at which a clock shows a time [s after midnight], from the day before the start."""
    first = (clock - network.times["start_clock"]) % DAY
    return [first + k * DAY for k in range(-1, int(end // DAY) + 2)]


def time_clause(
    relation: str, moments: list[float], reach: tuple[float, float], end: float
) -> Clause:
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
    clause = interval_clause(clipped(spans, end))
    return opposite(clause) if relation == "<>" else clause


def clipped(spans: Iterable[Interval], end: float) -> list[Interval]:
    """Intervals [s] that reach into a run, infinite on the sides where they extend beyond it; end : of the run [s]"""
    return [
        (begin if begin > 0.0 else -inf, stop if stop <= end else inf)
        for begin, stop in spans
        if stop > 0.0 and begin <= end
    ]


def interval_clause(spans: Iterable[Interval]) -> Clause:
    """Clause that holds between times [s]."""
    kept = tuple(spans)
    return Clause(lambda names: "1", lambda values: within(0.0, kept), (), kept)


def interval_text(spans: Iterable[Interval]) -> str:
    """Formula of the time that is 1 in intervals, else 0."""
    terms = []
    for begin, stop in spans:
        sides = [f"(t >= {begin:.10g})"] * (begin > -inf) + [f"(t < {stop:.10g})"] * (stop < inf)
        terms.append("*".join(sides) or "1")
    return terms[0] if len(terms) == 1 else f"({' + '.join(terms)})" if terms else "0"


def spans_where(
    parts: list[tuple[Interval, ...]], test: Callable[[float], bool]
) -> tuple[Interval, ...]:
    """Intervals in which a test of the time [s] is true; it changes only at the ends of intervals in `parts`."""
    ends = sorted({-inf, inf, *(at for spans in parts for span in spans for at in span)})
    found: list[Interval] = []
    for begin, stop in zip(ends[:-1], ends[1:], strict=True):
        if test(begin):
            joins = bool(found) and found[-1][1] == begin
            found[-1:] = [(found[-1][0], stop)] if joins else [*found[-1:], (begin, stop)]
    return tuple(found)


def combined(every: bool, clauses: list[Clause]) -> Clause:
    """Clause that holds where all clauses hold (every), or where one of them holds."""
    if not every:
        clauses = [clause for clause in clauses if clause.intervals] or clauses[:1]
    if len(clauses) == 1:
        return clauses[0]
    test = all if every else any
    parts = [clause.intervals for clause in clauses]
    spans = spans_where(parts, lambda time: test(within(time, part) for part in parts))
    reading = [clause for clause in clauses if clause.sources]

    def formula(names: dict[Source, str]) -> str:
        if every:
            return "*".join(clause.formula(names) for clause in reading)
        return f"(1 - {'*'.join(f'(1 - {clause.text(names)})' for clause in clauses)})"

    return Clause(
        formula,
        lambda values: test(clause.holds(values) for clause in clauses),
        tuple(dict.fromkeys(source for clause in clauses for source in clause.sources)),
        spans if every or not reading else ALWAYS,
        reading[0].compared if every and len(reading) == 1 else None,
        tuple(level for clause in clauses for level in clause.levels),
    )


OPPOSITE = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}


def opposite(clause: Clause) -> Clause:
    """Clause that holds where another clause does not."""
    if not clause.sources:
        outside = spans_where([clause.intervals], lambda time: not within(time, clause.intervals))
        return interval_clause(outside)
    compared = None
    if clause.compared is not None and clause.intervals == ALWAYS:
        source, relation, threshold = clause.compared
        compared = source, OPPOSITE[relation], threshold
    return Clause(
        lambda names: f"(1 - {clause.text(names)})",
        lambda values: not clause.holds(values),
        clause.sources,
        ALWAYS,
        compared,
        tuple(map(other_side, clause.levels)),
    )


def other_side(level: Level) -> Level:
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
    turns_on, turns_off = (
        next(clause for clause, value in actions if (value == on) is side) for side in (True, False)
    )
    if (
        turns_on.compared is None
        or turns_off.compared is None
        or {turns_on.intervals, turns_off.intervals} != {ALWAYS}
    ):
        return None
    (source, relation, upper), (other, against, lower) = turns_on.compared, turns_off.compared
    rises = relation in (">", ">=")
    if source[0] != "level" or source != other or rises == (against in (">", ">=")):
        return None
    if (upper <= lower) if rises else (upper >= lower):
        return None
    return source[1], upper, lower


def lacks_dead_band(actions: list[tuple[Clause, Any]]) -> bool:
    """True if actions with different values hold at one time above and below levels of a tank without a band between.

    Then each action may move the level to where the other one holds, without end. actions : pairs (clause, value)
    """
    reads = [(level, clause, value) for clause, value in actions for level in clause.levels]
    return any(
        above
        and not below
        and tank == other
        and value != result
        and high >= low
        and overlap(first, second)
        for (tank, above, low), first, value in reads
        for (other, below, high), second, result in reads
    )


def schedule_keys(
    actions: list[tuple[Clause, Any]], begins: Any, end: float
) -> tuple[list[float], list[Any]]:
    """Times [s] and values of a quantity that is switched by the time alone.

    actions : pairs (clause, value), of which the last that holds prevails; begins : value before any action
    """
    ends = {
        0.0,
        *(
            at
            for clause, _ in actions
            for span in clause.intervals
            for at in span
            if 0.0 < at < end
        ),
    }
    times = []
    values = []
    value = begins
    for at in sorted(ends):
        for clause, result in actions:
            value = result if within(at, clause.intervals) else value
        if not values or value != values[-1]:
            times.append(at)
            values.append(value)
    return times, values


def simplified(actions: list[tuple[Clause, Any]]) -> list[tuple[Clause, Any]]:
    """Actions with the same effect, fewer where several actions set the same value.

    actions : pairs (clause, value) in the order of precedence, the last prevails
    """
    runs: list[tuple[list[Clause], Any]] = []
    for clause, value in actions:
        if not clause.intervals:
            continue
        for clauses, result in reversed(runs):
            if result == value:
                clauses.append(clause)
                break
            # so that it prevails over an action between
            if not all(exclude(clause, other) for other in clauses):
                runs.append(([clause], value))
                break
        else:
            runs.append(([clause], value))
    return [(combined(False, joined(clauses)), value) for clauses, value in runs]


def overlap(first: Clause, second: Clause) -> bool:
    """True if intervals of two clauses have a common time."""
    return any(a < d and c < b for a, b in first.intervals for c, d in second.intervals)


def exclude(first: Clause, second: Clause) -> bool:
    """True if two clauses never hold at one time, as far as their intervals and thresholds show."""
    if not overlap(first, second):
        return True
    if first.compared is None or second.compared is None or first.compared[0] != second.compared[0]:
        return False
    sides = {relation[0]: threshold for _, relation, threshold in (first.compared, second.compared)}
    return len(sides) == 2 and sides["<"] < sides[">"]


def joined(clauses: list[Clause]) -> list[Clause]:
    """Clauses of which one holds where one of the given clauses holds, one for all thresholds of a source."""
    groups: dict[Any, list[Clause]] = {}
    for clause in clauses:
        groups.setdefault(
            clause.compared[:2] if clause.compared is not None else id(clause), []
        ).append(clause)
    return [group[0] if len(group) == 1 else varying(group) for group in groups.values()]


def varying(clauses: list[Clause]) -> Clause:
    """Clause that holds where one of several comparisons of a source with the same relation holds, each in its times.

    Its threshold is a table over the time, so that its formula does not grow with the number of intervals.
    """
    source, relation, _ = clauses[0].compared
    farthest = max if relation in ("<", "<=") else min
    parts = [clause.intervals for clause in clauses]
    spans = spans_where(parts, lambda time: any(within(time, part) for part in parts))
    times, values = [], []
    for begin in sorted(
        {span[0] for part in parts for span in part} | {span[1] for part in parts for span in part}
    ):
        active = [clause.compared[2] for clause in clauses if within(begin, clause.intervals)]
        # without a threshold, the last one remains
        if active and (not values or farthest(active) != values[-1]):
            times.append(max(begin, 0.0))
            values.append(farthest(active))
    if len(values) == 1:
        clause = _comparison(source, relation, values[0])
        return Clause(
            clause.formula,
            lambda found: any(item.holds(found) for item in clauses),
            (source,),
            spans,
            clause.compared,
        )
    margin = "margin", ThresholdSteps(source, tuple(times), tuple(values))
    sign = ">" if farthest is max else "<"
    return Clause(
        lambda names: f"({names[margin]} {sign} 0)",
        lambda found: any(item.holds(found) for item in clauses),
        (margin,),
        spans,
    )


def prevailing(actions: list[tuple[Clause, Any]], names: dict[Source, str]) -> dict[Any, str]:
    """Value -> formula that is 1 where an action sets the value and no later action sets another value.

    actions : pairs (clause, value) in the order of precedence, the last prevails
    """
    formulas: dict[Any, str] = {}
    for value in dict.fromkeys(value for _, value in actions):
        formula = ""
        for clause, result in actions:
            text = clause.text(names)
            if result != value:
                formula = formula and f"{formula}*(1 - {text})"
            else:
                formula = f"(1 - (1 - {formula})*(1 - {text}))" if formula else text
        formulas[value] = formula
    return formulas

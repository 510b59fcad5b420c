"""The value of a key at which all limits hold, by bracketing. Knows runs with verdicts; knows no physics."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.case import Case, load
from fvsolve.errors import CaseError, Fault, FvsolveError, did_you_mean, gathered
from fvsolve.parts.arithmetic import Arithmetic
from fvsolve.run import run
from fvsolve.run.result import FAILS
from fvsolve.run.verdicts import SIZES
from fvsolve.studies.peaks import peak_errors
from fvsolve.studies.plans import bare_unit, is_known, quantity_of
from fvsolve.units import UNITS, show

GOALS = ("least", "greatest")
LOOKS = 8  # places between two ends of which neither holds, where it is looked for
MOST_RUNS = 60
EDGE = 0.1  # of the bracket that a guess keeps from its ends
_VALUE = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")


@dataclass(frozen=True)
class SizeRun:
    """One run: the value of the key, whether all limits hold, the least margin over its limit, and of which limit.

    margin : less its error where that is known
    open : why a run that passes no limit holds none either, as what it schedules goes on after its end, its numbers
    are not to be trusted, or an error is more than its margin; else empty
    """

    value: float
    ok: bool
    margin: float | None
    limit: str
    reason: str
    open: str = ""


@dataclass(frozen=True)
class Size:
    """What was found: the value that holds, the bracket (what fails, what holds), the runs as they came.

    unit : that of the ends; of bare numbers that of the key, SI, "" where it has none

    value is None where the limits cannot be met between the ends; nearest is then the run that came nearest.
    """

    key: str
    unit: str
    goal: str
    value: float | None
    bracket: tuple[float, float] | None
    runs: list[SizeRun] = field(default_factory=list)
    ties: tuple[str, ...] = ()

    @property
    def nearest(self) -> SizeRun:
        """The run with the greatest margin."""
        return max(self.runs, key=lambda one: -math.inf if one.margin is None else one.margin)

    def plain(self) -> dict[str, Any]:
        """As JSON says it."""
        made = {"key": self.key, "unit": self.unit, "goal": self.goal, "value": self.value, "bracket": self.bracket,
                "ties": list(self.ties), "runs": [vars(one) for one in self.runs]}  # fmt: skip
        return made if self.value is not None else made | {"nearest": vars(self.nearest)}


def amount(given: Any) -> tuple[float, str]:
    """A number and its unit, "" of a bare one; ValueError where it is none."""
    if isinstance(given, (int, float)) and not isinstance(given, bool):
        return float(given), ""
    match = _VALUE.fullmatch(given) if isinstance(given, str) else None
    if match is None:
        raise ValueError(f'{show(given)} is no number; wanted one such as 2 or "2 m3"')
    return float(match[1]), match[2]


def ends(low: Any, high: Any) -> tuple[float, float, str]:
    """Both ends of a range in one unit; FvsolveError where they have none in common or do not rise."""
    try:
        (a, unit_a), (b, unit_b) = amount(low), amount(high)
    except ValueError as error:
        raise FvsolveError(str(error)) from None
    if unit_a != unit_b:
        one, other = UNITS.get(unit_a), UNITS.get(unit_b)
        if one is None or other is None or one.dimension != other.dimension or one.gauge != other.gauge:
            raise FvsolveError(f"{show(low)} and {show(high)} have not one unit; write both in the same")
        a = float(other.number(one.si(a)))
    if not a < b:
        raise FvsolveError(f"{show(low)} is not below {show(high)}; wanted LOW,HIGH")
    return a, b, unit_b


class Sizing:
    """One search while it lasts."""

    def __init__(self, case: Case, key: str, unit: str, ties: Mapping[str, str], progress: Callable | None,
                 error: bool = False) -> None:  # fmt: skip
        self.case, self.key, self.unit, self.progress, self.error = case, key, unit, progress, error
        self.runs: list[SizeRun] = []
        self.rules = {tied: Arithmetic(text) for tied, text in ties.items()}

    def keys(self, value: float) -> dict[str, Any]:
        """What is set for a value of the key; formulas take its SI value as x."""
        unit = UNITS.get(self.unit)
        x = value if unit is None else float(unit.si(value)) + (self.case.ambient_pressure if unit.gauge else 0.0)
        found: dict[str, Any] = {self.key: f"{value!r} {self.unit}" if self.unit else value}
        for tied, rule in self.rules.items():
            try:
                found[tied] = float(np.asarray(rule(np.array([x]), np.array([0.0])))[0])
            except ValueError as error:
                raise CaseError([Fault(f"--tie {tied}", str(error))], self.case.name) from None
        return found

    def __call__(self, value: float) -> SizeRun:
        """The run of a value."""
        known = next((one for one in self.runs if one.value == value), None)
        if known is not None:
            return known
        if self.progress is not None:
            self.progress(len(self.runs), f"{self.key} = {value:.6g} {self.unit}".rstrip())
        try:
            case = load(self.case, {**self.keys(value), "output.fields": 0, "output.lines": {}})
            result = run(case)
        except CaseError as error:
            if not self.runs:
                raise
            self.runs.append(SizeRun(value, False, None, "", f"refused: {error.faults[0].message}"))
            return self.runs[-1]
        if result.reason.startswith("interrupted"):
            raise KeyboardInterrupt
        if self.error and result.ok:
            peak_errors(result, case)
        self.runs.append(sized(value, result))
        return self.runs[-1]

    def search(self, low: float, high: float, goal: str, rtol: float) -> tuple[float | None, tuple | None]:
        """(the value that holds and is least or greatest, (what fails, what holds)); None where nothing holds."""
        best, other = (low, high) if goal == "least" else (high, low)
        if self(best).ok:
            return best, None
        good = other if self(other).ok else self.between()
        if good is None:
            return None, None
        bad = max((one.value for one in self.runs if not one.ok and (one.value - good) * (best - good) > 0.0),
                  key=lambda x: -abs(x - good))  # fmt: skip
        while abs(good - bad) > rtol * max(abs(good), abs(bad)) and len(self.runs) < MOST_RUNS:
            x = self.guess(bad, good)
            good, bad = (x, bad) if self(x).ok else (good, x)
        return good, (bad, good)

    def between(self) -> float | None:
        """A value that holds beside the runs so far, which do not: where the margin is greatest, ever closer."""
        for _ in range(LOOKS):
            runs = sorted(self.runs, key=lambda one: one.value)
            at = max(range(len(runs)), key=lambda k: -math.inf if runs[k].margin is None else runs[k].margin)
            gaps = [(runs[k + 1].value - runs[k].value, k) for k in (at - 1, at) if 0 <= k < len(runs) - 1]
            k = max(gaps)[1]
            x = 0.5 * (runs[k].value + runs[k + 1].value)
            if self(x).ok:
                return x
        return None

    def guess(self, bad: float, good: float) -> float:
        """Where the margin would vanish on a straight line, away from both ends; the middle where that is unknown."""
        margins = [self(x).margin for x in (bad, good)]
        share = 0.5
        if None not in margins and margins[1] > margins[0] and len(self.runs) % 2:
            share = min(max(-margins[0] / (margins[1] - margins[0]), EDGE), 1.0 - EDGE)
        return bad + share * (good - bad)


def sized(value: float, result: Any) -> SizeRun:
    """The run of a value in a row."""
    margins = [(relative(row, one.quantity), one.name) for one in result.verdicts for row in one.worst]
    margin, name = min(margins)
    ok, failed = all(one.ok for one in result.verdicts), any(one.state == FAILS for one in result.verdicts)
    doubts = [one.text for one in result.marks] + [one.text for one in result.warnings if one.kind == "end"]
    doubts += [f"{one.name}: its margin is smaller than its error" for one in result.verdicts if one.doubtful]
    why = "" if ok or failed or not result.ok else next(iter(doubts), f"{name}: its margin is not known")
    known = result.ok and (ok or margin < 0.0) and math.isfinite(margin)
    return SizeRun(value, result.ok and ok, margin if known else None, name, result.reason, why)


def relative(row: Mapping[str, Any], quantity: str) -> float:
    """The margin of a place, less its error, over its limit; of a pressure or head, over an atmosphere where its limit
    is less."""
    if row["margin"] is None:
        return -math.inf
    shown = UNITS.get(row["unit"])
    usual = SIZES.get(quantity, 0.0)
    least = usual / abs(float(shown.si(1.0) - shown.si(0.0))) if usual and shown is not None else usual
    return (row["margin"] - (row["error"] or 0.0)) / (max(abs(row["limit"]), least) or abs(row["value"]) or 1.0)


def size(
    case, key: str, low: Any, high: Any, goal: str = "least", ties: Mapping[str, str] | None = None,
    set: Mapping[str, Any] | None = None, rtol: float = 0.01, progress: Callable | None = None, error: bool = False,
) -> Size:  # fmt: skip
    """The least (or greatest) value of a key between `low` and `high` at which a case holds all its limits.

    Bracketed to `rtol` of itself; between two ends of which neither holds, places are tried where margins are greatest.
    ties : other keys as formulas of x, the value in SI. error : each limit holds by more than its error, from two more
    runs of each value. Raises FvsolveError where the case has no limits, CaseError for
    what is no case.
    """
    faults: list[Fault] = []
    made = None
    with gathered(faults):
        made = load(case, dict(set or {}))
    faults += asked(made, key, (low, high), goal, ties or {}, rtol)
    if faults:
        raise CaseError(faults, "case" if made is None else made.name)
    first, last, unit = ends(low, high)
    search = Sizing(made, key, unit, ties or {}, progress, error)
    value, bracket = search.search(first, last, goal, rtol)
    said = tuple(f"{tied} = {text}" for tied, text in (ties or {}).items())
    return Size(key, unit or bare_unit(made.raw, key), goal, value, bracket, search.runs, said)


def asked(
    case: Case | None, key: str, span: Sequence[Any], goal: str, ties: Mapping[str, str], rtol: float
) -> list[Fault]:
    """All that is wrong of a search before it runs; case : None where it is at fault itself, and so span, if empty."""
    faults: list[Fault] = []
    if goal not in GOALS:
        near = did_you_mean(str(goal), GOALS)
        faults.append(Fault("goal", f"{show(goal)} is none{near}; wanted {' or '.join(GOALS)}"))
    if not 0.0 < rtol < 1.0:
        faults.append(Fault("rtol", f"{rtol} is out of range; wanted a number between 0 and 1"))
    found = len(faults)
    with gathered(faults, f"--vary {key}"):
        low, high, unit = ends(*span) if span else (0.0, 1.0, "")
        if case is not None and is_known(case.raw, key) and quantity_of(case.raw, key) is None:
            raise ValueError("takes words or whole numbers, of which there are none between two; wanted a sweep of it")
    for name, text in ties.items():
        with gathered(faults, f"--tie {name}"):
            Arithmetic(text)
            if name == key:
                raise ValueError("is what is varied; wanted another key")
    if case is not None and not case.limits:
        text = 'states no [limits], which a size would hold; wanted for example { on = "pipes", greatest = "10 barg" }'
        faults.append(Fault("", f"{case.name} {text}"))
    if case is not None and span and len(faults) == found + (not case.limits):
        wrong: list[Fault] = []
        with gathered(wrong):
            load(case, Sizing(case, key, unit, ties, None).keys(high if goal == "greatest" else low))
        options = {key: "--vary", **dict.fromkeys(ties, "--tie")}
        faults += [Fault(f"{options[one.place]} {one.place}", one.message) if one.place in options else one
                   for one in wrong]  # fmt: skip
    return faults


def tied(texts: Sequence[str]) -> dict[str, str]:
    """`KEY = formula` of each as pairs; CaseError with all that are none."""
    found: dict[str, str] = {}
    faults = []
    for text in texts:
        key, equals, rule = (one.strip() for one in text.partition("="))
        if not (equals and key and rule):
            example = '"nodes.vessel.gas_volume = x / 2"'
            faults.append(Fault(f"--tie {text}", f'wanted "KEY = formula of x", for example {example}'))
        elif key in found:
            faults.append(Fault(f"--tie {text}", f"{key} is {found[key]} before; keep one"))
        found.setdefault(key, rule)
    if faults:
        raise CaseError(faults)
    return found

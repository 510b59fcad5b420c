"""Sizing: search by bracketing for the least or greatest value of a key at which all limits hold."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.case import Case, load
from fvsolve.core.output.result_table import PlainData
from fvsolve.core.output.summary_shape import FAILS, OPEN
from fvsolve.core.run import run
from fvsolve.core.run.verdicts import SIZES
from fvsolve.declarations import declared
from fvsolve.errors import CaseError, Fault, FvsolveError, collect_faults, did_you_mean
from fvsolve.parts.formula import Arithmetic
from fvsolve.studies.outcome import NO_FIELDS, checked_case, end_if_interrupted
from fvsolve.studies.peak_error import peak_errors
from fvsolve.studies.sampling import is_known, key_quantity, si_unit_of
from fvsolve.units import show, unit_of

GOALS = ("minimum", "maximum")
INTERIOR_TRIALS = 8  # greatest number of trials between two ends if limits fail at both
MOST_TRIALS = 30  # the same where the margins nearby allow a value with which all limits hold
MAX_RUNS = 60
# least distance of the next value from the ends of the bracket, as a fraction of its width
GUESS_MARGIN = 0.1
# of a text without blanks at its ends
_VALUE = re.compile(r"([+-]?(?:\d++\.?\d*+|\.\d++)(?:[eE][+-]?\d++)?)\s*+(.*+)")


@dataclass(frozen=True)
class SizeRun:
    """Result of a run with one value of the key that a sizing varies.

    value : value of the key in the unit of the search; ok : True if the run is ok and all limits hold
    limit : name of the limit with the least relative margin, "" if the case was refused
    margin : margin of that limit, minus its error if the error is known, relative to the limit [-]; None if not known
    reason : reason of the end of the run
    open : reason for which limits are undecided, or empty. Limits are undecided if a schedule continues after the end
    of the run, if results are not valid, or if an error is larger than the margin.
    """

    value: float
    ok: bool
    margin: float | None
    limit: str
    reason: str
    open: str = ""


@dataclass(frozen=True)
class Size(PlainData):
    """Result of a sizing.

    key : key whose value is searched; unit : unit of its values, for bare numbers the SI unit of the key, "" if it has
    none
    goal : "minimum" or "maximum"; value : least or greatest value at which all limits hold, None if none was found
    bracket : (value with which limits fail, value with which all limits hold), None without such a pair
    runs : all runs in order; ties : dependent keys as texts "KEY = formula"
    """

    key: str
    unit: str
    goal: str
    value: float | None
    bracket: tuple[float, float] | None
    runs: list[SizeRun] = field(default_factory=list)
    ties: tuple[str, ...] = ()

    json = "key unit goal value bracket ties runs"

    @property
    def nearest(self) -> SizeRun:
        """Run with the greatest margin."""
        return max(self.runs, key=lambda run: -math.inf if run.margin is None else run.margin)

    def plain(self) -> dict[str, Any]:
        """Plain values for JSON; if no value was found, also the run with the greatest margin as `nearest`."""
        return super().plain() | ({} if self.value is not None else {"nearest": vars(self.nearest)})


def number_and_unit(given: Any) -> tuple[float, str]:
    """Split a value such as "2 m3" into (number, unit); the unit of a bare number is "". Raises ValueError."""
    if isinstance(given, (int, float)) and not isinstance(given, bool):
        return float(given), ""
    match = _VALUE.fullmatch(given.strip()) if isinstance(given, str) else None
    if match is None:
        raise ValueError(f'{show(given)} is not a number; expected a value such as 2 or "2 m3"')
    return float(match[1]), match[2]


def parse_range(low: Any, high: Any) -> tuple[float, float, str]:
    """(low, high, unit) of a range in a common unit, that of `high`.

    Raises FvsolveError for unreadable values, different dimensions, or low >= high.
    """
    try:
        (a, unit_a), (b, unit_b) = number_and_unit(low), number_and_unit(high)
    except ValueError as error:
        raise FvsolveError(str(error)) from None
    if unit_a != unit_b:
        first, second = unit_of(unit_a), unit_of(unit_b)
        if (
            first is None
            or second is None
            or first.dimension != second.dimension
            or first.gauge != second.gauge
        ):
            text = f"{show(low)} and {show(high)} have different kinds of units"
            raise FvsolveError(f"{text}; use the same unit for both")
        a = float(second.number(first.si(a)))
    if not a < b:
        raise FvsolveError(f"{show(low)} is not below {show(high)}; expected LOW,HIGH")
    return a, b, unit_b


class SizeSearch:
    """Search for the least or greatest value of a key at which all limits hold; all its runs are stored.

    unit : unit of the values; ties : dependent key -> formula of x, the value in SI
    progress : called as progress(runs, text); estimate_error : as for `size`
    """

    def __init__(
        self,
        case: Case,
        key: str,
        unit: str,
        ties: Mapping[str, str],
        progress: Callable | None,
        estimate_error: bool = False,
    ) -> None:
        self.case, self.key, self.unit, self.progress = case, key, unit, progress
        self.estimate_error = estimate_error
        self.runs: list[SizeRun] = []
        self.formulas = {tied: Arithmetic(text) for tied, text in ties.items()}

    def keys(self, value: float) -> dict[str, Any]:
        """Overrides for a value of the key, and for dependent keys. Raises CaseError if a formula has no value."""
        unit = unit_of(self.unit)
        x = (
            value
            if unit is None
            else float(unit.si(value)) + (self.case.ambient_pressure if unit.gauge else 0.0)
        )
        overrides: dict[str, Any] = {self.key: f"{value!r} {self.unit}" if self.unit else value}
        for tied, rule in self.formulas.items():
            try:
                overrides[tied] = float(np.asarray(rule(np.array([x]), np.array([0.0])))[0])
            except ValueError as error:
                raise CaseError(
                    [Fault(f"--dependent {tied}", str(error))], self.case.name
                ) from None
        return overrides

    def __call__(self, value: float) -> SizeRun:
        """Run the case with a value of the key; a value that was run before is not run again.

        If the case is refused, the first run raises CaseError; later runs return the reason in their `SizeRun`.
        """
        earlier = next((entry for entry in self.runs if entry.value == value), None)
        if earlier is not None:
            return earlier
        if self.progress is not None:
            self.progress(len(self.runs), f"{self.key} = {value:.6g} {self.unit}".rstrip())
        try:
            case = load(self.case, {**self.keys(value), **NO_FIELDS})
            result = run(case)
        except CaseError as error:
            if not self.runs:
                raise
            self.runs.append(SizeRun(value, False, None, "", f"refused: {error.faults[0].message}"))
            return self.runs[-1]
        end_if_interrupted(result.reason)
        if self.estimate_error and result.ok:
            peak_errors(result, case)
        self.runs.append(size_run(value, result))
        return self.runs[-1]

    def search(
        self, low: float, high: float, goal: str, rtol: float
    ) -> tuple[float | None, tuple | None]:
        """Search between `low` and `high`; returns (value, bracket) as in `Size`, or (None, None) if no value is found.

        goal : "minimum" or "maximum"; rtol : relative width of the bracket at which the search ends
        The bracket is not shortened after `MAX_RUNS` runs.
        """
        best, opposite = (low, high) if goal == "minimum" else (high, low)
        if self(best).ok:
            return best, None
        good = opposite if self(opposite).ok else self.find_interior()
        if good is None:
            return None, None
        bad = max(
            (
                entry.value
                for entry in self.runs
                if not entry.ok and (entry.value - good) * (best - good) > 0.0
            ),
            key=lambda x: -abs(x - good),
        )
        while abs(good - bad) > rtol * max(abs(good), abs(bad)) and len(self.runs) < MAX_RUNS:
            x = self.next_value(bad, good)
            good, bad = (x, bad) if self(x).ok else (good, x)
        return good, (bad, good)

    def find_interior(self) -> float | None:
        """Search for a value at which all limits hold, beside the run with the greatest margin so far.

        Each trial is the highest peak of the margin by `peak_between`, or the middle of the wider interval where a
        margin is not known. Returns None after `INTERIOR_TRIALS` runs without such a value, or `MOST_TRIALS` as long as
        a peak above zero is possible.
        """
        for trial in range(MOST_TRIALS):
            runs = sorted(self.runs, key=lambda run: run.value)
            position = max(
                range(len(runs)),
                key=lambda k: -math.inf if runs[k].margin is None else runs[k].margin,
            )
            adjacent = [k for k in (position - 1, position) if 0 <= k < len(runs) - 1]
            peaks = [peak for k in adjacent if (peak := peak_between(runs, k)) is not None]
            x, height = max(peaks, key=lambda peak: peak[1], default=(math.nan, -math.inf))
            if trial >= INTERIOR_TRIALS and not height > 0.0:
                return None
            # peaks of a margin that is not concave may mislead
            if trial % 2 == 0 or not height > 0.0:
                k = max((runs[k + 1].value - runs[k].value, k) for k in adjacent)[1]
                x = 0.5 * (runs[k].value + runs[k + 1].value)
            if self(x).ok:
                return x
        return None

    def next_value(self, bad: float, good: float) -> float:
        """Next value to run between `bad`, with which limits fail, and `good`, with which they hold.

        It is alternately the midpoint and the zero of the linearly interpolated margin, at some distance from both
        ends. It is the midpoint if a margin is not known.
        """
        margins = [self(x).margin for x in (bad, good)]
        share = 0.5
        if None not in margins and margins[1] > margins[0] and len(self.runs) % 2:
            share = min(
                max(-margins[0] / (margins[1] - margins[0]), GUESS_MARGIN), 1.0 - GUESS_MARGIN
            )
        return bad + share * (good - bad)


def peak_between(runs: list[SizeRun], k: int) -> tuple[float, float] | None:
    """(value, margin) of the peak between runs k and k + 1: where the lines through the runs on either side meet.

    runs : sorted by value. No concave margin is greater. None without two runs with known margins on each side, and for
    lines that do not meet between the runs.
    """
    if k < 1 or k + 2 >= len(runs) or any(run.margin is None for run in runs[k - 1 : k + 3]):
        return None
    (a, b, c, d), (p, q, r, s) = zip(
        *((run.value, run.margin or 0.0) for run in runs[k - 1 : k + 3]), strict=True
    )
    rise, fall = (q - p) / (b - a), (s - r) / (d - c)
    if not rise > fall:
        return None
    x = (r - q + rise * b - fall * c) / (rise - fall)
    return (x, q + rise * (x - b)) if b < x < c else None


def size_run(value: float, result: Any) -> SizeRun:
    """`SizeRun` from the limit verdicts in the result of a run with this value of the key."""
    limits = result.verdicts
    margin, name = min(
        (relative_margin(row, limit.quantity), limit.name)
        for limit in limits
        for row in limit.worst
    )
    ok, failed = all(limit.ok for limit in limits), any(limit.state == FAILS for limit in limits)
    doubts = [mark.text for mark in result.marks] + [
        text.text for text in result.warnings if text.kind == "end"
    ]
    doubts += [
        f"{limit.name}: its margin is smaller than its error" for limit in limits if limit.doubtful
    ]
    doubts += [
        f"{limit.name}: its {'value' if limit.margin is None else 'error'} is not known"
        for limit in limits
        if limit.state == OPEN and not limit.doubtful
    ]
    reason = "" if ok or failed or not result.ok else next(iter(doubts), "")
    is_known = result.ok and (ok or margin < 0.0) and math.isfinite(margin)
    return SizeRun(
        value, result.ok and ok, margin if is_known else None, name, result.reason, reason
    )


def relative_margin(row: Mapping[str, Any], quantity: str) -> float:
    """Margin of a row of a limit verdict, minus its error, relative to the limit [-].

    The divisor is at least the usual size of the quantity, such as 1 bar for pressures. The result is -inf if the
    margin is not known.
    """
    if row["margin"] is None:
        return -math.inf
    unit = unit_of(row["unit"] or "")
    usual = SIZES.get(quantity, 0.0)
    least = usual / abs(float(unit.si(1.0) - unit.si(0.0))) if usual and unit is not None else usual
    return (row["margin"] - (row["error"] or 0.0)) / (
        max(abs(row["limit"]), least) or abs(row["value"]) or 1.0
    )


@declared("study")
def size(
    case,
    key: str,
    low: Any,
    high: Any,
    goal: str = "minimum",
    ties: Mapping[str, str] | None = None,
    set: Mapping[str, Any] | None = None,
    rtol: float = 0.01,
    progress: Callable | None = None,
    estimate_error: bool = False,
) -> Size:
    """Find the least (or greatest) value of a key between `low` and `high` at which all limits of a case hold.

    low, high : numbers, or texts with a unit; goal : "minimum" or "maximum"; set : key -> value for all runs
    ties : dependent key -> formula of x, the value in SI; rtol : relative tolerance of the bracket
    progress : called as progress(runs, text)
    estimate_error : True to require margins larger than their errors, which `peak_errors` finds by up to three more
    runs for each value
    If limits fail at both ends, values near the one with the greatest margin are tried. Raises CaseError for an invalid
    case, a case without limits, and wrong arguments.
    """
    loaded = checked_case(
        case, set, lambda known: find_faults(known, key, (low, high), goal, ties or {}, rtol)
    )
    first, last, unit = parse_range(low, high)
    search = SizeSearch(loaded, key, unit, ties or {}, progress, estimate_error)
    value, bracket = search.search(first, last, goal, rtol)
    tie_texts = tuple(f"{tied} = {text}" for tied, text in (ties or {}).items())
    return Size(
        key, unit or si_unit_of(loaded.raw, key), goal, value, bracket, search.runs, tie_texts
    )


def find_faults(
    case: Case | None,
    key: str,
    span: Sequence[Any],
    goal: str,
    ties: Mapping[str, str],
    rtol: float,
) -> list[Fault]:
    """Faults of the arguments of `size`, found before any run.

    case : None if the case itself has faults; span : (low, high), empty if the range itself has faults; other arguments
    as for `size`
    """
    faults: list[Fault] = []
    if goal not in GOALS:
        hint = did_you_mean(str(goal), GOALS) or f"; expected {' or '.join(GOALS)}"
        faults.append(Fault("goal", f"{show(goal)} is unknown{hint}"))
    if not 0.0 < rtol < 1.0:
        faults.append(Fault("rtol", f"{rtol} is out of range; expected a number between 0 and 1"))
    count = len(faults)
    with collect_faults(faults, f"--vary {key}"):
        low, high, unit = parse_range(*span) if span else (0.0, 1.0, "")
        if case is not None and is_known(case.raw, key) and key_quantity(case.raw, key) is None:
            raise ValueError(
                "has words or whole numbers as values, so it has no range; use `fvsolve sweep`"
            )
    for name, text in ties.items():
        with collect_faults(faults, f"--dependent {name}"):
            Arithmetic(text)
            if name == key:
                raise ValueError("is the key that is sized; expected another key")
    if case is not None and not case.limits:
        text = 'has no limits; expected a table under [limits], such as { on = "pipes", maximum = "10 barg" }'
        faults.append(Fault("", f"{case.name} {text}"))
    if case is not None and span and len(faults) == count + (not case.limits):
        run_faults: list[Fault] = []
        with collect_faults(run_faults):
            load(
                case,
                SizeSearch(case, key, unit, ties, None).keys(high if goal == "maximum" else low),
            )
        options = {key: "--vary", **dict.fromkeys(ties, "--dependent")}
        faults += [
            Fault(f"{options[run_fault.place]} {run_fault.place}", run_fault.message)
            if run_fault.place in options
            else run_fault
            for run_fault in run_faults
        ]
    return faults


def parse_ties(texts: Sequence[str]) -> dict[str, str]:
    """Formulas of dependent keys, from texts `KEY = formula` : key -> formula. Raises CaseError with all faults."""
    ties: dict[str, str] = {}
    faults = []
    for text in texts:
        key, equals, rule = (part.strip() for part in text.partition("="))
        if not (equals and key and rule):
            example = '"nodes.vessel.gas_volume = x / 2"'
            faults.append(
                Fault(
                    f"--dependent {text}", f'expected "KEY = formula of x", for example {example}'
                )
            )
        elif key in ties:
            faults.append(
                Fault(
                    f"--dependent {text}",
                    f"{key} is given before as {ties[key]}; give each key once",
                )
            )
        ties.setdefault(key, rule)
    if faults:
        raise CaseError(faults)
    return ties

"""The columns of a failure map: steps around the predicted limits, or values of a key. Knows rates; runs nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fvsolve.case import load
from fvsolve.case.sections import DEFAULT_CELLS
from fvsolve.errors import FvsolveError
from fvsolve.studies.failure.eigen_limit import spectrum
from fvsolve.studies.lines import cells_for_lines, lines
from fvsolve.studies.outcome import prepared

COURANTS = (0.25, 0.5, 0.75, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0)
COLUMNS = 10
STIFF = 8.0  # times the wave rate: a scene whose fastest rate is above
STIFF_STEPS = 1e5  # times the fastest rate that a run without pipes is long
TAKEN = tuple(f"numerics.{name}" for name in ("scheme", "method", "courant", "step", "rtol"))


@dataclass(frozen=True)
class Columns:
    """What the columns set; `rates` : fastest rate and wave rate [1/s] of each, or of all, delay lines as cells.

    wave_rate : cells that a wave crosses in a second [1/s], of the first column; None without any
    """

    name: str
    values: list
    sets: list[dict]
    rates: list[tuple[float, float | None]]
    span: float
    wave_rate: float | None

    def keys(self, k: int) -> dict:
        """What column k changes in the scene itself."""
        return {} if self.name == "step" else {self.name: self.values[k]}

    def stiff(self, k: int) -> bool:
        """Whether something is far faster than the waves of column k, or, without pipes, than the run is long."""
        fastest, waves = self.rates[min(k, len(self.rates) - 1)]
        return fastest > STIFF * waves if waves else fastest * self.span > STIFF_STEPS

    def label(self, k: int) -> str:
        """Column k in words."""
        value = self.values[k]
        return f"{self.name} = {value:.3g}" if isinstance(value, float) else f"{self.name} = {value}"


def columns(case, base: dict, courants, steps, key) -> Columns:
    """The columns asked for, or around the predicted limits; FvsolveError for what cannot be columns."""
    _check(courants, steps, key)
    span = case.numerics.end - case.numerics.start
    if key is not None:
        name, values = key
        control = _control(courants, steps)
        sets = [{name: value, **control} for value in values]
        rates = [_rates(case, {**base, name: value}) for value in values]
        return Columns(name, list(values), sets, rates, span, _wave_rate(case, {**base, name: values[0]}))
    rates, waves = _rates(case, base), _wave_rate(case, base)
    if courants is not None and waves is None:
        raise FvsolveError("Courant numbers are for pipes in cells, and this case has none; give --step")
    chosen = [c / waves for c in courants] if courants is not None else steps
    chosen = list(chosen if chosen is not None else _default_steps(case, rates, waves))
    return Columns("step", chosen, [{"numerics.step": h} for h in chosen], [rates], span, waves)


def _control(courants, steps) -> dict:
    if courants is not None:
        return {"numerics.courant": courants[0]}
    return {} if steps is None else {"numerics.step": steps[0]}


def _rates(case, set: dict) -> tuple[float, float | None]:
    """(fastest rate, wave rate) [1/s] of a case; of many states the fastest is taken as that of the waves."""
    set = set | as_cells(case, set)
    model = prepared(case, set)
    waves = float(model.wave_rates.max()) if model.cells else None
    found = spectrum(case, set)
    fastest = float(np.abs(found).max(initial=0.0)) if found is not None else (waves or math.inf)
    return fastest, waves


def _wave_rate(case, set: dict) -> float | None:
    """Cells that a wave crosses in a second [1/s], in pipes that are no delay lines; None without any."""
    model = prepared(case, set)
    return float(max(model.wave_rates[model.tables.pipes["delay"] < 0], default=0.0)) or None


def as_cells(case, set: dict) -> dict:
    """Keys by which delay lines of a case with keys set are cells, as many in the slowest as a case has by default."""
    case = load(case, set)
    travel = _travel(case)
    return cells_for_lines(case, travel / DEFAULT_CELLS) if travel else {}


def _travel(case) -> float:
    """The time that a wave takes along the slowest delay line [s]; 0 without any."""
    return max((case.links[name].length / case.wave_speed(name) for name in lines(case)), default=0.0)


def _default_steps(case, rates, waves: float | None) -> list[float]:
    """Around Courant 1 where waves are the fastest; else from below 2 / |lambda| to the longest of any use.

    Of delay lines alone from a hundredth of the slowest one, or where something stores less, to all of it.
    """
    fastest, span, travel = rates[0], case.numerics.end - case.numerics.start, _travel(case)
    if not waves and travel:
        quickest = float(np.abs(spectrum(case, {})).max(initial=0.0))
        shortest = min(travel / 100, 0.3 / quickest if quickest > 0.0 else math.inf)
        return [float(f"{h:.2g}") for h in np.geomspace(shortest, min(span / 10, travel), COLUMNS)]
    if waves and fastest <= STIFF * waves:
        return [c / waves for c in COURANTS]
    longest = min(span / 10, 1.5 / waves if waves else math.inf)
    shortest = min((1.5 if waves else 0.3) / fastest if fastest > 0 else longest, longest / 10)
    return [float(f"{h:.2g}") for h in np.geomspace(shortest, longest, COLUMNS)]


def default_schemes(case, columns: Columns) -> list[str]:
    """The case's own; where waves are the fastest, beside `upwind`, which shows what a scheme alone gets wrong."""
    own = case.numerics.scheme
    return [own] if columns.wave_rate is None or columns.stiff(0) else ["upwind", own]


def _check(courants, steps, key) -> None:
    if courants is not None and steps is not None:
        raise FvsolveError("--courant and --step both set the step; keep one")
    for what, given in (("--courant", courants), ("--step", steps)):
        if given is not None and not all(math.isfinite(one) and one > 0 for one in given):
            raise FvsolveError(f"{what} must be positive numbers")
        if given is not None and len(given) == 0:
            raise FvsolveError(f"{what} is empty; wanted at least one number")
    if key is not None and len(courants or steps or [0]) > 1:
        raise FvsolveError("with --key its values are the columns; give one --step or one --courant for all")
    if key is not None and not key[1]:
        raise FvsolveError("--key wants KEY=a,b,c with at least one value")
    if key is not None and key[0] in TAKEN:
        raise FvsolveError(f"--key {key[0]} is none: the map sets it by --scheme, --method, --courant and --step")

"""Columns of a failure map, and predicted limits of the step for its methods.

The columns are steps around the predicted limits, or values of a key. The limits are those of eigenvalue modes
(equation (13) of docs/course.md) and of waves between a node with storage (tank, chamber) and a delay line.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

from fvsolve.case import load
from fvsolve.case.sections import DEFAULT_CELLS
from fvsolve.core.schemes import LIMITED, SCHEMES
from fvsolve.core.step_limits.greatest_step import greatest_step, modes_limit
from fvsolve.core.steppers.tableau import method_named
from fvsolve.errors import FvsolveError
from fvsolve.features.delay_lines.growth import storing_nodes, wave_growth
from fvsolve.studies.outcome import study_model
from fvsolve.studies.resolution import cells_for_lines, delay_lines

VISIBLE_GROWTH = 1e3  # factor within the run; less growth is not visible
MAX_STATES = 1200  # greatest number for a dense spectrum


def eigenvalues_of(case, set: dict) -> np.ndarray | None:
    """Eigenvalues of the linearised rates about the initial steady state, in one array [1/s].

    They are computed twice, with the schedules at their values at the start and at the end of the run. A limited scheme
    has its weights in smooth flow (or is replaced by upwind), and waves that arrive from delay lines are constant.
    Returns None for more than 1200 states. set : changed keys of the case
    """
    from fvsolve.studies.outcome import study_model

    model = study_model(case, set)
    if (scheme := model.case.numerics.scheme) in LIMITED:
        twin = SCHEMES[scheme].twin  # the linear scheme that is equal in smooth flow
        linear = twin if twin in model.case.schemes else "upwind"
        model = study_model(case, {**set, "numerics.scheme": linear})
    if model.y_size > MAX_STATES:
        return None
    rest = np.zeros(model.y_size)
    times = (model.case.numerics.start, model.case.numerics.end)
    return np.concatenate(
        [np.linalg.eigvals(model.jacobian_without_delays(t, rest)) for t in times]
    )


def modes_step(method: str, eigenvalues: np.ndarray, span: float) -> float:
    """Greatest step [s] up to which no mode grows 1000 times more than the exact solution in a run of `span` [s].

    eigenvalues : complex128[n]  eigenvalues of the modes [1/s]
    Steps h are searched for which h times the greatest modulus of an eigenvalue is between 0.01 and 1000. Returns inf
    if no mode grows at these steps, and 0 if a mode grows at the shortest of them.
    """
    from fvsolve.core.steppers import method_named, stability_function

    r = stability_function(method_named(method))
    fastest = float(np.abs(eigenvalues).max(initial=0.0))
    if fastest == 0.0:
        return math.inf
    steps = np.geomspace(1e-2, 1e3, 1201) / fastest
    return modes_limit(r, eigenvalues, span, VISIBLE_GROWTH, steps, halvings=50).step


STEP_COUNT, HALVINGS = 33, 12  # number of steps tried, and of bisections between two of them
STEP_MARGIN = 4.0  # ratio of the limits of these steps to those of the map, up and down


class WaveGrowthLimit:
    """Callable that returns, for a method, the greatest step at which waves in delay lines do not grow visibly.

    The waves are those between a storing node and the far end of a delay line, see `wave_growth`. Growth is visible if
    it is 1000 times or more in the run.
    case, set : the case and its changed keys; steps : steps of the failure map [s], around which limits are searched
    The model depends on the step but not on the method, so that all methods use the stored model of a step.
    """

    def __init__(self, case, set: dict, steps: list[float]) -> None:
        self.case, self.set = case, set
        self.steps = [
            float(h)
            for h in np.geomspace(min(steps) / STEP_MARGIN, STEP_MARGIN * max(steps), STEP_COUNT)
        ]
        self.models: dict[float, object] = {}

    def model(self, h: float):
        """Model with delay lines divided into stretches for steps of h [s]."""
        if h not in self.models:
            self.models[h] = study_model(
                self.case, {**self.set, "numerics.step": h, "numerics.method": "euler"}
            )
        return self.models[h]

    def grows(self, method: str, h: float) -> bool:
        """True if waves between a storing node and a delay line grow 1000 times or more in a run of steps h [s]."""
        numerics = self.case.numerics
        return (
            wave_growth(self.model(h), method_named(method), h, numerics.end - numerics.start)[0]
            >= VISIBLE_GROWTH
        )

    def __call__(self, method: str) -> float | None:
        """Greatest step [s] up to which waves grow less than 1000 times in the run with a method.

        It is inf if they do so at all steps tried, and 0 if they grow more at the shortest of these steps. The result
        is None for Rosenbrock methods if delay lines end at storing nodes, as their growth is not known.
        """
        if method_named(method).kind == "linear" and any(
            storing_nodes(self.model(self.steps[0]), 1.0)
        ):
            return None
        grows = functools.partial(self.grows, method)
        return greatest_step(
            grows, self.steps, width=0.0, halvings=HALVINGS, mean=geometric_mean
        ).step


def geometric_mean(low: float, high: float) -> float:
    """Geometric mean of two positive numbers."""
    return math.sqrt(low * high)


COURANTS = (0.25, 0.5, 0.75, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0)
COLUMN_COUNT = 10  # default number of steps, if waves are not the fastest
STIFFNESS_RATIO = 8.0  # a case is stiff if its fastest rate is above this multiple of the wave rate
# without pipes a case is stiff if its fastest rate times the time span is above this
STIFF_STEPS = 1e5
MAP_KEYS = tuple(f"numerics.{name}" for name in ("scheme", "method", "courant", "step", "rtol"))


@dataclass(frozen=True)
class Columns:
    """Columns of a failure map: values of the step or of another key.

    name : "step" or the varied key; values : its value in each column; sets : keys that each column sets
    span : duration of the run [s]
    rates : fastest rate and wave rate [1/s] of each column, or one pair for all columns; delay lines count as cells
    wave_rate : greatest number of cells that a wave crosses per second in the first column [1/s]; None without cells
    """

    name: str
    values: list
    sets: list[dict]
    rates: list[tuple[float, float | None]]
    span: float
    wave_rate: float | None

    def keys(self, k: int) -> dict:
        """Keys and values of column k that change the case itself, not the step."""
        return {} if self.name == "step" else {self.name: self.values[k]}

    def stiff(self, k: int) -> bool:
        """True if column k is stiff: its fastest rate exceeds 8 wave rates or, without cells, 1e5 / duration."""
        fastest, waves = self.rates[min(k, len(self.rates) - 1)]
        return fastest > STIFFNESS_RATIO * waves if waves else fastest * self.span > STIFF_STEPS

    def label(self, k: int) -> str:
        """Key and value of column k in words."""
        value = self.values[k]
        return (
            f"{self.name} = {value:.3g}" if isinstance(value, float) else f"{self.name} = {value}"
        )


def map_columns(case, base: dict, courants, steps, key) -> Columns:
    """Columns of a failure map: the given Courant numbers or steps [s], values of a key, or default steps.

    base : keys of all runs; key : (name, values) of a varied key, or None
    Raises FvsolveError for options that exclude each other, for values out of range, and for Courant numbers without
    pipes with cells.
    """
    _check_options(courants, steps, key)
    span = case.numerics.end - case.numerics.start
    if key is not None:
        name, values = key
        control = {"numerics.courant": courants[0]} if courants is not None else {}
        control |= {"numerics.step": steps[0]} if steps is not None else {}
        sets = [{name: value, **control} for value in values]
        rates = [_fastest_and_wave_rate(case, {**base, name: value}) for value in values]
        return Columns(
            name, list(values), sets, rates, span, _wave_rate(case, {**base, name: values[0]})
        )
    rates, waves = _fastest_and_wave_rate(case, base), _wave_rate(case, base)
    if courants is not None and waves is None:
        raise FvsolveError(
            "Courant numbers need pipes with cells, but this case has no such pipe; use --step"
        )
    chosen = [c / waves for c in courants] if courants is not None else steps
    chosen = list(chosen if chosen is not None else _default_steps(case, rates, waves))
    return Columns("step", chosen, [{"numerics.step": h} for h in chosen], [rates], span, waves)


def _fastest_and_wave_rate(case, set: dict) -> tuple[float, float | None]:
    """(fastest rate, wave rate) of a case [1/s], with delay lines replaced by cells.

    The fastest rate is the greatest modulus of an eigenvalue; with too many states for eigenvalues it is the wave rate,
    or infinity without cells. The wave rate is the greatest of all pipes, None without cells.
    """
    set = set | cells_for_delay_lines(case, set)
    model = study_model(case, set)
    waves = float(model.wave_rates.max()) if model.cells else None
    eigenvalues = eigenvalues_of(case, set)
    fastest = (
        float(np.abs(eigenvalues).max(initial=0.0))
        if eigenvalues is not None
        else (waves or math.inf)
    )
    return fastest, waves


def _wave_rate(case, set: dict) -> float | None:
    """Greatest number of cells that a wave crosses per second in pipes with cells [1/s]; None without such pipes."""
    model = study_model(case, set)
    return float(max(model.wave_rates[model.tables.pipes["cells"] > 0], default=0.0)) or None


def cells_for_delay_lines(case, set: dict) -> dict:
    """Overrides that replace delay lines by cells, the default number in the slowest line; empty without lines."""
    case = load(case, set)
    travel = _slowest_travel_time(case)
    return cells_for_lines(case, travel / DEFAULT_CELLS) if travel else {}


def _slowest_travel_time(case) -> float:
    """Greatest travel time of a wave along a delay line of the case [s]; 0 without delay lines."""
    return max(
        (case.links[name].length / case.wave_speed(name) for name in delay_lines(case)), default=0.0
    )


def _default_steps(case, rates, waves: float | None) -> list[float]:
    """Default steps of a failure map [s], in three cases.

    With cells and a fastest rate up to 8 wave rates, the steps are around Courant number 1. With delay lines and no
    cells they go from a hundredth of the greatest travel time, or 0.3 over the fastest rate of storing parts if that is
    less, to a tenth of the run or that travel time, whichever is less. Otherwise they go from 1.5 over the fastest rate
    (0.3 without cells) to a tenth of the run or Courant number 1.5, whichever is less, and over a decade at least.
    rates : result of `_fastest_and_wave_rate`
    waves : wave rate of the cells of the case itself [1/s], None without cells
    """
    fastest = rates[0]
    span = case.numerics.end - case.numerics.start
    travel = _slowest_travel_time(case)
    if not waves and travel:
        quickest = float(np.abs(eigenvalues_of(case, {})).max(initial=0.0))
        shortest = min(travel / 100, 0.3 / quickest if quickest > 0.0 else math.inf)
        return [
            float(f"{h:.2g}") for h in np.geomspace(shortest, min(span / 10, travel), COLUMN_COUNT)
        ]
    if waves and fastest <= STIFFNESS_RATIO * waves:
        return [c / waves for c in COURANTS]
    longest = min(span / 10, 1.5 / waves if waves else math.inf)
    shortest = min((1.5 if waves else 0.3) / fastest if fastest > 0 else longest, longest / 10)
    return [float(f"{h:.2g}") for h in np.geomspace(shortest, longest, COLUMN_COUNT)]


def default_schemes(case, columns: Columns) -> list[str]:
    """Default schemes of a failure map: the scheme of the case, before it `upwind` if the first column is not stiff.

    Without cells it is the scheme of the case alone.
    """
    own = case.numerics.scheme
    return [own] if columns.wave_rate is None or columns.stiff(0) else ["upwind", own]


def _check_options(courants, steps, key) -> None:
    if courants is not None and steps is not None:
        raise FvsolveError("--courant and --step are given; keep one")
    for option, values in (("--courant", courants), ("--step", steps)):
        if values is not None and not all(math.isfinite(value) and value > 0 for value in values):
            raise FvsolveError(f"{option}: expected positive numbers")
        if values is not None and len(values) == 0:
            raise FvsolveError(f"{option} is empty; expected at least one number")
    if key is not None and len(courants or steps or [0]) > 1:
        text = "with --key, the values of the key are the columns"
        raise FvsolveError(f"{text}; expected at most one number in --step or --courant")
    if key is not None and not key[1]:
        raise FvsolveError("--key has no values; expected KEY=a,b,c with at least one value")
    if key is not None and key[0] in MAP_KEYS:
        raise FvsolveError(
            f"--key {key[0]} is impossible: the map sets it by --scheme, --method, --courant and --step"
        )

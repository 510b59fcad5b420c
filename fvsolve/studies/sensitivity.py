"""By which key an outcome varies how much: Sobol's indices and Morris's effects, by SALib. Knows sweeps."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.case import load
from fvsolve.doors import AMOUNT, CALL, COUNT, PATH, TABLE, TEXT, door
from fvsolve.errors import FvsolveError
from fvsolve.shown import Shown
from fvsolve.studies.plans import ranges
from fvsolve.studies.sheet import Column, Plain, Sheet
from fvsolve.studies.sweep import VARY, sweep
from fvsolve.units import show

COLUMNS = ("S1", "S1_conf", "ST", "ST_conf", "mu_star", "mu_star_conf", "mu", "sigma")
LEVELS = 4  # of Morris's grid
PATHS = 4  # of Morris's, at least
LEAST = 2  # points of Sobol's


@dataclass(frozen=True, repr=False)
class Sensitivity(Shown, Plain):
    """Indices of every key; confidence at 95 %.

    S1, ST : share of the variance of the outcome that goes with a key alone, and with it and all that it acts together
    with (Saltelli 2010, Jansen 1999); mu_star, mu, sigma : mean size, mean and spread of the effect of a move over the
    whole range (Morris 1991, Campolongo 2007), in the unit of the outcome; *_conf : half widths of their intervals
    """

    keys: tuple[str, ...]
    outcome: str
    runs: int
    S1: list[float]
    S1_conf: list[float]
    ST: list[float]
    ST_conf: list[float]
    mu_star: list[float]
    mu_star_conf: list[float]
    mu: list[float]
    sigma: list[float]

    picture = "fvsolve.draw.sweep:sensitivity_figure"

    def said(self) -> str:
        first = max(range(len(self.keys)), key=lambda k: self.ST[k])
        return f"of {self.outcome} over {len(self.keys)} keys by {self.runs} runs: most by {self.keys[first]}"

    @property
    def sheet(self) -> Sheet:
        """A row for each key."""
        rows = [{"key": key, **{name: getattr(self, name)[k] for name in COLUMNS}} for k, key in enumerate(self.keys)]
        return Sheet([Column("key"), *(Column(name, words=".4g") for name in COLUMNS)], rows)

    def listed(self) -> dict[str, list]:
        return self.sheet.listed()


@door(vary=VARY, outcome=TEXT, samples=COUNT, seed=AMOUNT, set=TABLE, jobs=COUNT, dask=TEXT, out=PATH, progress=CALL)
def sensitivity(
    case,
    vary: Mapping[str, Sequence[Any]],
    outcome: str | None = None,
    samples: int = 64,
    seed: int = 0,
    set: Mapping[str, Any] | None = None,
    jobs: int = 1,
    dask: str | None = None,
    out: str | Path | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Sensitivity:
    """Sobol's and Morris's indices of an outcome, such as "max(gate.pressure)", over the ranges of keys.

    case : what `run` takes, or a function of a dict of numbers, one a key; samples : Sobol's N (a power of two), which
    takes N (keys + 2) runs; Morris takes N / 4 (keys + 1) more. The rest as in `sweep`, which makes the runs and finds
    those again that were made before. Raises FvsolveError where a run has no such outcome.
    """
    if samples < LEAST:
        raise FvsolveError(f"samples = {samples}; wanted {LEAST} or more, a power of two")
    if callable(case):
        bounds = {key: (float(low), float(high)) for key, (low, high) in vary.items()}
    else:
        bounds = ranges(load(case, set), vary)
    if not bounds:
        raise FvsolveError("nothing varies; give the two ends of a key at least, links.main.length=900,1000")
    sobol, morris = planned(bounds, samples, seed)
    points = [dict(zip(bounds, row, strict=True)) for row in np.concatenate([sobol, morris]).tolist()]
    if callable(case):
        values = np.array([float(case(point)) for point in points])
        if not np.isfinite(values).all():
            raise FvsolveError("the function is not finite at some points; wanted ranges in which it is")
    else:
        if outcome is None:
            raise FvsolveError('no outcome; wanted one such as "max(gate.pressure)"')
        made = sweep(case, set=set, jobs=jobs, out=out, progress=progress, points=points, dask=dask)
        outcome, values = made.outcome(outcome), values_of(made, outcome)
    found = analysed(bounds, sobol, values[: len(sobol)], morris, values[len(sobol) :], seed)
    return Sensitivity(tuple(bounds), outcome or "the function", len(points), *found)


def values_of(made, outcome: str) -> np.ndarray:
    """A column of a sweep; FvsolveError where a run has nothing there."""
    name = made.outcome(outcome)
    lacks = [row for row in made.rows if row.get(name) is None]
    if lacks:
        where = ", ".join(f"{key} = {lacks[0][key]:.6g}" for key in made.keys)
        raise FvsolveError(f"{len(lacks)} of {len(made.rows)} runs have no {name}, the first at {where}: "
                           f"{lacks[0]['reason']}; wanted ranges in which all do")  # fmt: skip
    return np.array([float(row[name]) for row in made.rows])


def planned(bounds: Mapping[str, tuple[float, float]], samples: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of Sobol's and of Morris's method : float64[n, keys]."""
    _known()
    from SALib.sample import morris, sobol

    problem = problem_of(bounds)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of numbers that are no power of two
        first = sobol.sample(problem, samples, calc_second_order=False, seed=seed)
    return first, morris.sample(problem, max(PATHS, samples // 4), num_levels=LEVELS, seed=seed)


def analysed(bounds, sobol_points, sobol_values, morris_points, morris_values, seed: int) -> list[list[float]]:
    """Columns of COLUMNS."""
    from SALib.analyze import morris, sobol

    problem = problem_of(bounds)
    if np.ptp(sobol_values) == 0.0:
        raise FvsolveError(f"the outcome is {show(float(sobol_values[0]))} in all runs: no key moves it")
    scale = float(np.std(sobol_values))  # SALib's sums of squares keep their digits
    shares = sobol.analyze(problem, (sobol_values - sobol_values.mean()) / scale, calc_second_order=False, seed=seed)
    effects = morris.analyze(problem, morris_points, morris_values, num_levels=LEVELS, seed=seed)
    found = {**{name: shares[name] for name in COLUMNS[:4]}, **{name: effects[name] for name in COLUMNS[4:]}}
    return [np.asarray(found[name], dtype=float).tolist() for name in COLUMNS]


def problem_of(bounds: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    """As SALib says it."""
    return {"num_vars": len(bounds), "names": [*bounds], "bounds": [list(one) for one in bounds.values()]}


def _known() -> None:
    try:
        import SALib  # noqa: F401
    except ImportError:
        raise FvsolveError("sensitivity needs the package SALib: pip install fvsolve[study]") from None

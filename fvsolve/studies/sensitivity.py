"""Global sensitivity analysis: Sobol indices and Morris effects of keys of a case on a quantity, by SALib."""

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.argument_checks import COUNT, COUNT_FROM_ZERO, PATH, TEXT, validated
from fvsolve.case import load
from fvsolve.core.output.result_table import Column, PlainData, ResultTable
from fvsolve.declarations import declared
from fvsolve.display import Displayable
from fvsolve.errors import FvsolveError
from fvsolve.studies.outcome import STUDY_ARGUMENTS
from fvsolve.studies.sampling import key_ranges
from fvsolve.studies.sweep import VARY, sweep
from fvsolve.units import show

COLUMNS = ("S1", "S1_conf", "ST", "ST_conf", "mu_star", "mu_star_conf", "mu", "sigma")
LEVELS = 4  # levels of the Morris grid
MIN_PATHS = 4  # least number of Morris trajectories
MIN_SAMPLES = 2  # least base sample size of Sobol


@dataclass(frozen=True, repr=False)
class Sensitivity(Displayable, PlainData):
    """Sensitivity indices of every key, as lists in the order of `keys`.

    quantity : name of the quantity with its unit; runs : number of runs
    S1, ST : first-order and total index [-], the fraction of the variance of the quantity due to a key alone, and due
    to the key with all its interactions (Saltelli 2010, Jansen 1999)
    mu_star, mu, sigma : mean absolute value, mean and standard deviation of the elementary effect over the whole range
    (Morris 1991, Campolongo 2007), in the unit of the quantity
    *_conf : half widths of the 95 % confidence intervals
    """

    keys: tuple[str, ...]
    quantity: str
    runs: int
    S1: list[float]
    S1_conf: list[float]
    ST: list[float]
    ST_conf: list[float]
    mu_star: list[float]
    mu_star_conf: list[float]
    mu: list[float]
    sigma: list[float]

    picture = "fvsolve.report.draw.object_pictures:sensitivity_figure"

    def summary_line(self) -> str:
        strongest = max(range(len(self.keys)), key=lambda k: self.ST[k])
        return f"of {self.quantity} to {len(self.keys)} keys, {self.runs} runs: greatest for {self.keys[strongest]}"

    @property
    def sheet(self) -> ResultTable:
        """Table with a row for each key and a column for each index."""
        rows = [
            {"key": key, **{name: getattr(self, name)[k] for name in COLUMNS}}
            for k, key in enumerate(self.keys)
        ]
        return ResultTable([Column("key"), *(Column(name, words=".4g") for name in COLUMNS)], rows)

    def table_columns(self) -> dict[str, list]:
        return self.sheet.table_columns()


@declared("study")
@validated(
    vary=VARY, quantity=TEXT, samples=COUNT, seed=COUNT_FROM_ZERO, out=PATH, **STUDY_ARGUMENTS
)
def sensitivity(
    case,
    vary: Mapping[str, Sequence[Any]],
    quantity: str | None = None,
    samples: int = 64,
    seed: int = 0,
    set: Mapping[str, Any] | None = None,
    jobs: int = 1,
    dask: str | None = None,
    out: str | Path | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Sensitivity:
    """Compute Sobol and Morris indices of a quantity, such as "max(gate.pressure)", over the ranges of keys.

    case : as for `run`, or a function of a dict key -> number; vary : key -> (low, high)
    samples : base sample size N of Sobol (a power of two), which needs N (keys + 2) runs; Morris needs
    max(4, N / 4) (keys + 1) more. Other arguments as for `sweep`, which makes the runs and reuses earlier ones; a
    function is called in this process, and only `samples` and `seed` apply to it.
    Raises FvsolveError if a run does not have the quantity, if the quantity is constant, and if SALib is not installed.
    """
    if samples < MIN_SAMPLES:
        raise FvsolveError(
            f"samples = {samples} is too small; expected {MIN_SAMPLES} or more, a power of two"
        )
    if callable(case):
        bounds = {key: (float(low), float(high)) for key, (low, high) in vary.items()}
    else:
        bounds = key_ranges(load(case, set), vary)
    if not bounds:
        raise FvsolveError(
            "no key varies; give at least one key and its range: links.main.length=900,1000"
        )
    sobol, morris = sample_points(bounds, samples, seed)
    points = [
        dict(zip(bounds, row, strict=True)) for row in np.concatenate([sobol, morris]).tolist()
    ]
    if callable(case):
        values = np.array([float(case(point)) for point in points])
        if not np.isfinite(values).all():
            raise FvsolveError(
                "the function is not finite at some points; expected ranges in which it is finite"
            )
    else:
        if quantity is None:
            raise FvsolveError('no quantity; expected a quantity such as "max(gate.pressure)"')
        sweep_result = sweep(
            case, set=set, jobs=jobs, out=out, progress=progress, points=points, dask=dask
        )
        quantity, values = sweep_result.quantity(quantity), values_of(sweep_result, quantity)
    indices = analyse_values(
        bounds, sobol, values[: len(sobol)], morris, values[len(sobol) :], seed
    )
    return Sensitivity(tuple(bounds), quantity or "the function", len(points), *indices)


def values_of(result, quantity: str) -> np.ndarray:
    """Values of a quantity in all runs of a sweep : float64[runs]. Raises FvsolveError if a run has no value."""
    name = result.quantity(quantity)
    missing = [row for row in result.rows if row.get(name) is None]
    if missing:
        values = ", ".join(f"{key} = {missing[0][key]:.6g}" for key in result.keys)
        verb = "has" if len(missing) == 1 else "have"
        raise FvsolveError(
            f"{len(missing)} of {len(result.rows)} runs {verb} no {name}, the first at {values}: "
            f"{missing[0]['reason']}; expected ranges in which all runs have {name}"
        )
    return np.array([float(row[name]) for row in result.rows])


def sample_points(
    bounds: Mapping[str, tuple[float, float]], samples: int, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Sample points of the Sobol and the Morris method : float64[points, keys] each.

    bounds : key -> (low, high); samples : base sample size of Sobol; seed : equal seeds give equal points
    Raises FvsolveError if SALib is not installed.
    """
    try:
        from SALib.sample import morris, sobol
    except ImportError:
        raise FvsolveError(
            'sensitivity needs the package SALib: pip install "fvsolve[study]"'
        ) from None
    problem = salib_problem(bounds)
    with warnings.catch_warnings():
        # warnings on sample sizes that are not powers of two
        warnings.simplefilter("ignore", UserWarning)
        sobol_points = sobol.sample(problem, samples, calc_second_order=False, seed=seed)
    return sobol_points, morris.sample(
        problem, max(MIN_PATHS, samples // 4), num_levels=LEVELS, seed=seed
    )


def analyse_values(
    bounds, sobol_points, sobol_values, morris_points, morris_values, seed: int
) -> list[list[float]]:
    """Sensitivity indices from the values of a quantity : for each entry of `COLUMNS` a list over the keys.

    sobol_points, morris_points : sample points as from `sample_points`; sobol_values, morris_values : quantity at these
    points; bounds, seed : as for `sample_points`
    Raises FvsolveError if the quantity is constant.
    """
    from SALib.analyze import morris, sobol

    problem = salib_problem(bounds)
    if np.ptp(sobol_values) == 0.0:
        raise FvsolveError(
            f"the quantity is {show(float(sobol_values[0]))} in all runs: no key changes it"
        )
    # scaled values keep their digits in the sums of squares of SALib
    scale = float(np.std(sobol_values))
    shares = sobol.analyze(
        problem, (sobol_values - sobol_values.mean()) / scale, calc_second_order=False, seed=seed
    )
    effects = morris.analyze(problem, morris_points, morris_values, num_levels=LEVELS, seed=seed)
    indices = {
        **{name: shares[name] for name in COLUMNS[:4]},
        **{name: effects[name] for name in COLUMNS[4:]},
    }
    return [np.asarray(indices[name], dtype=float).tolist() for name in COLUMNS]


def salib_problem(bounds: Mapping[str, tuple[float, float]]) -> dict[str, Any]:
    """Problem definition for SALib; bounds : key -> (low, high)."""
    return {
        "num_vars": len(bounds),
        "names": [*bounds],
        "bounds": [list(limits) for limits in bounds.values()],
    }

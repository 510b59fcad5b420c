"""Stiff cylinder: error of the trajectory against wall time of fvsolve and its peers, printed and drawn."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numba
import numpy as np
from measure import Run, Solver, against, agree, chart
from peers_ode import Problem, explicit_reference, peers
from price import front, price

import fvsolve
from fvsolve.core.steppers.tableau import METHODS
from fvsolve.studies.validation import valve_controlled_cylinder as cylinder

TARGETS = (1e-3, 1e-5, 1e-6, 1e-7, 1e-9)
DEFAULT = "radau-iia-5"
# times slower, at 1e-6
GOALS = {"scikit-sundae CVODE": 15.0, "SciPy Radau": 90.0, "numbalsoda LSODA": 1 / 1.5}
PICTURE = Path(__file__).with_name("stiff.png")


def cylinder_table(quick: bool) -> None:
    """Print errors and wall times, and the results for the goals."""
    end = 0.01 * cylinder.END if quick else cylinder.END
    problem = Problem(cylinder.rhs, cylinder.start(), np.linspace(0.0, end, 201))
    truth = explicit_reference(problem)
    size = np.abs(truth).max(axis=0)

    def distance(found):
        return np.abs((found - truth) / size).max()

    own = returning(problem.rhs)
    other = fvsolve.integrate(own, problem.y0, problem.t, method="dormand-prince", rtol=1e-12)
    print(f"\nStiff cylinder, 6 states, {end:g} s, greatest eigenvalue ", end="")
    print(f"{cylinder.greatest_eigenvalue(problem.t, truth):.1e} 1/s; ", end="")
    print(
        f"the reference (DOP853, 1e-13) and Dormand-Prince at 1e-12 differ by {distance(other):.0e}"
    )
    agree("Dormand-Prince beside the reference", distance(other), 1e-6)
    tolerances = 10.0 ** -(np.array([3.0, 6.0]) if quick else np.arange(3.0, 11.0))
    methods = [*implicit_methods(quick), "auto", "dormand-prince"]
    solvers = [fvsolve_solver(problem, name) for name in methods] + peers(problem, quick)
    charts = chart(solvers, tolerances, distance, 0.0 if quick else 0.3, rounds=1 if quick else 3)
    if quick:
        reached(charts, 1e-3)
    for target in TARGETS:
        verdict(charts, target)
    with tempfile.TemporaryDirectory() as folder:
        draw(charts, Path(folder) / PICTURE.name if quick else PICTURE)


def reached(charts: dict[str, list[Run]], error: float) -> None:
    """Exit with a message unless every solver reaches an error."""
    for name, runs in charts.items():
        agree(f"least error of {name}", min((run.error for run in runs), default=np.nan), error)


def implicit_methods(quick: bool) -> list[str]:
    """Implicit methods with an error estimate, with `quick` only the default."""
    return (
        [DEFAULT] if quick else [m.name for m in METHODS.values() if m.adaptive and not m.explicit]
    )


def fvsolve_solver(problem: Problem, method: str) -> Solver:
    """Solver fvsolve.integrate with one method."""

    def solve(tolerance, counts=None):
        options = {"rtol": tolerance, "atol": tolerance, "counts": counts}
        return fvsolve.integrate(problem.rhs, problem.y0, problem.t, method=method, **options)

    def count(tolerance):
        counts = {}
        solve(tolerance, counts)
        return counts["steps"], counts["rhs"]

    return Solver(f"fvsolve {method}", solve, count)


def verdict(charts: dict[str, list[Run]], target: float) -> None:
    """Print the wall time of each solver at an error, relative to fvsolve's best method and to its default."""
    prices = {
        name: price(front([(r.wall, r.error) for r in runs]), target)
        for name, runs in charts.items()
        if runs
    }
    prices = {name: found for name, found in prices.items() if np.isfinite(found[0])}
    ours = {name: cost for name, (cost, _) in prices.items() if name.startswith("fvsolve")}
    quickest = min(ours, key=ours.get) if ours else "fvsolve"
    least, default = ours.get(quickest, np.nan), ours.get(f"fvsolve {DEFAULT}", np.nan)
    print(
        f"\n  error {target:.0e}: wall time, and how many times that of {quickest} and of {DEFAULT}"
    )
    for name, (cost, how) in sorted(prices.items(), key=lambda item: item[1]):
        said = against(GOALS[name], cost / least) if target == 1e-6 and name in GOALS else ""
        print(
            f"    {name:36} {how or ' '}{cost * 1e3:9.3f} ms {cost / least:8.2f} {cost / default:8.2f}  {said}"
        )


def draw(charts: dict[str, list[Run]], picture: Path) -> None:
    """Draw wall time against error of all solvers."""
    from fvsolve.report.draw import style

    made = style.figure(4.6)
    axes = made.subplots()
    for k, (name, runs) in enumerate(charts.items()):
        line = "-" if name.startswith("fvsolve") else "--"
        where = [r.error for r in runs], [r.wall * 1e3 for r in runs]
        again, colour = divmod(k, len(style.COLOURS))
        axes.loglog(
            *where, line, marker=".x+"[again], ms=5, lw=1.3, color=style.COLOURS[colour], label=name
        )
    axes.set_xlabel(
        "greatest error of the trajectory, in each state's range", fontsize=8.5, color=style.INK
    )
    axes.set_ylabel("wall time [ms]", fontsize=8.5, color=style.INK)
    axes.grid(True, color=style.HAIR, linewidth=0.5)
    axes.invert_xaxis()
    style.legend(axes)
    style.title(made, "Stiff cylinder: what an error costs")
    made.savefig(picture)
    print(f"\n  drawn: {picture.name}")


def returning(rhs):
    """Compiled function that returns dydt, from f(t, y, dydt)."""

    @numba.njit(error_model="numpy")
    def function(t, y):
        dydt = np.empty(y.size)
        rhs(t, y, dydt)
        return dydt

    return function

"""Stiff scenes beside their peers, in one process: `python benchmarks/stiff.py [cylinder] [pipe] [network] [start]`.

cylinder: error of a trajectory against wall time, tolerances 1e-3 to 1e-10; also drawn, into stiff.png.
pipe:     acoustics of 1 000 cells, explicit and implicit, beside peers on the same ordinary differential equations.
network:  what a step of Newton's method costs in networks of 1 000 and 10 000 cells.
start:    what the first implicit run of a machine, and every later one, takes longer than an explicit run.

`--quick` for fewer tolerances and repeats. One thread. Wall times are the best of several, everything compiled before.
"""

import argparse
import platform
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from time import perf_counter

import cylinder
import numpy as np
from peers_ode import Problem, Solver, explicit_reference, peers
from price import price

import fvsolve
from fvsolve.steppers.methods import METHODS

TARGETS = (1e-3, 1e-6, 1e-9)
DEFAULT = "radau-iia-5"
GOALS = {  # at error 1e-6: peer -> times that fvsolve must be faster
    "scikit-sundae CVODE": 15.0,
    "SciPy Radau": 90.0,
    "numbalsoda LSODA": 1 / 1.5,
}
PICTURE = Path(__file__).with_name("stiff.png")


@dataclass(frozen=True)
class Run:
    """One solver at one tolerance: error, wall time [s], steps and calls of f (nan: not told)."""

    tolerance: float
    error: float
    wall: float
    steps: float
    calls: float


def best(function, budget: float, least: int = 3, most: int = 200) -> float:
    """Wall time [s] of the quickest call, of as many as fit into a budget [s]."""
    walls, began = [], perf_counter()
    while len(walls) < least or (len(walls) < most and perf_counter() - began < budget):
        start = perf_counter()
        function()
        walls.append(perf_counter() - start)
    return min(walls)


def measured(solver: Solver, tolerances, distance, budget: float) -> list[Run]:
    """Runs of a solver; `distance(y)` is the error of a trajectory. Fails at a tolerance: no row, said so."""
    runs = []
    for tolerance in tolerances:
        try:
            found = solver.solve(tolerance)
        except (RuntimeError, ValueError, fvsolve.FvsolveError) as fault:
            print(f"    {tolerance:.0e} {type(fault).__name__}: {fault}")
            continue
        error = distance(found)
        if np.isfinite(error):
            wall = best(lambda: solver.solve(tolerance), budget)  # noqa: B023
            runs.append(Run(tolerance, error, wall, *solver.count(tolerance)))
    return runs


def table(name: str, runs: list[Run]) -> None:
    """Print the runs of one solver."""
    print(f"  {name}\n    {'tolerance':>9} {'error':>9} {'wall ms':>9} {'steps':>7} {'calls of f':>10}")
    for r in runs:
        print(f"    {r.tolerance:9.0e} {r.error:9.1e} {r.wall * 1e3:9.3f} {r.steps:7.0f} {r.calls:10.0f}")


# the cylinder -------------------------------------------------------------------------------------------------


def cylinder_table(quick: bool) -> None:
    """Work against precision on the stiff cylinder, and the goals."""
    problem = Problem(cylinder.rhs, cylinder.start(), np.linspace(0.0, cylinder.END, 201))
    truth = explicit_reference(problem)
    size = np.abs(truth).max(axis=0)

    def distance(found):
        return np.abs((found - truth) / size).max()

    other = fvsolve.integrate(in_place(problem.rhs), problem.y0, problem.t, method="dormand-prince", rtol=1e-12)
    print(f"\nStiff cylinder, 6 states, {cylinder.END} s, greatest eigenvalue ", end="")
    print(f"{cylinder.greatest_eigenvalue(problem.t, truth):.1e} 1/s; ", end="")
    print(f"the reference (DOP853, 1e-13) and Dormand-Prince at 1e-12 differ by {distance(other):.0e}")
    tolerances = 10.0 ** -(np.array((3, 5, 7, 9)) if quick else np.arange(3, 11))
    charts = {}
    for solver in [*implicit_solvers(problem), *peers(problem)]:
        charts[solver.name] = measured(solver, tolerances, distance, 0.05 if quick else 0.3)
        table(solver.name, charts[solver.name])
    verdict(charts)
    draw(charts)


def in_place(rhs):
    """f(t, y) -> dydt around f(t, y, dydt)."""
    import numba

    @numba.njit(error_model="numpy")
    def function(t, y):
        dydt = np.empty(y.size)
        rhs(t, y, dydt)
        return dydt

    return function


def implicit_solvers(problem: Problem) -> list[Solver]:
    """fvsolve.integrate by every implicit method that has an error estimate."""
    names = [m.name for m in METHODS.values() if m.adaptive and not getattr(m, "explicit", True)]
    return [own(problem, name) for name in names]


def own(problem: Problem, method: str) -> Solver:
    """fvsolve.integrate by one method."""

    def solve(tolerance):
        return fvsolve.integrate(problem.rhs, problem.y0, problem.t, method=method, rtol=tolerance, atol=tolerance)

    return Solver(f"fvsolve {method}", solve, lambda tolerance: (np.nan, np.nan))


def verdict(charts: dict[str, list[Run]]) -> None:
    """Print prices at the target errors, each peer beside fvsolve's best method and its default."""
    for target in TARGETS:
        prices = {name: price([(r.wall, r.error) for r in runs], target) for name, runs in charts.items() if runs}
        ours = {name: cost for name, (cost, _) in prices.items() if name.startswith("fvsolve")}
        quickest = min(ours, key=ours.get) if ours else ""
        least, default = ours.get(quickest, np.nan), ours.get(f"fvsolve {DEFAULT}", np.nan)
        print(f"\n  error {target:.0e}: wall time, and how many times that of {quickest or 'fvsolve'} and of {DEFAULT}")
        for name, (cost, how) in sorted(prices.items(), key=lambda item: item[1]):
            goal = GOALS.get(name) if target == 1e-6 else None
            said = "" if goal is None else f"  goal {goal:.2g}: {'met' if cost / least >= goal else 'missed'}"
            print(f"    {name:36} {how or ' '}{cost * 1e3:9.3f} ms {cost / least:8.2f} {cost / default:8.2f}{said}")


def draw(charts: dict[str, list[Run]]) -> None:
    """Error against wall time of all solvers, into PICTURE."""
    from fvsolve.draw import style

    made = style.figure(4.6)
    axes = made.subplots()
    ours = [name for name in charts if name.startswith("fvsolve")]
    for k, (name, runs) in enumerate(charts.items()):
        line = "-" if name in ours else "--"
        where = [r.error for r in runs], [r.wall * 1e3 for r in runs]
        axes.loglog(*where, line, marker=".", lw=1.3, color=style.COLOURS[k % len(style.COLOURS)], label=name)
    axes.set_xlabel("greatest error of the trajectory, in each state's range", fontsize=8.5, color=style.INK)
    axes.set_ylabel("wall time [ms]", fontsize=8.5, color=style.INK)
    axes.grid(True, color=style.HAIR, linewidth=0.5)
    axes.invert_xaxis()
    style.legend(axes)
    style.title(made, "Stiff cylinder: what an error costs")
    made.savefig(PICTURE)
    print(f"\n  drawn: {PICTURE.name}")


# --------------------------------------------------------------------------------------------------------------


def machine() -> str:
    """Processor and versions, in a line."""
    with open("/proc/cpuinfo") as lines:
        names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    packages = ", ".join(f"{p} {version(p)}" for p in ("numpy", "numba", "scipy", "numbalsoda", "scikit-sundae"))
    return f"{names[0] if names else platform.processor()}; Python {platform.python_version()}, {packages}"


TABLES = {"cylinder": cylinder_table}


def main() -> None:
    """Print the tables asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", nargs="*", help=f"{', '.join(TABLES)}; all if none is named")
    parser.add_argument("--quick", action="store_true", help="fewer tolerances and repeats")
    arguments = parser.parse_args()
    print(machine())
    for name in arguments.what or TABLES:
        TABLES[name](arguments.quick)


if __name__ == "__main__":
    main()

"""Cell-steps per second of each scheme on one acoustic pipe, compared with a STREAM triad and PyClaw.

    python benchmarks/kernels.py [--quick] [CELLS]...

A cell-step is one cell in one whole step of the method, in the time loop of fvsolve.run. The pipe without friction lies
between a reservoir and a closing gate; the loop records the envelope and searches for NaN, without rows in between.
The arrays of the STREAM triad have twice as many elements as there are cells: as many bytes as two fields with three
buffers each. `of triad` is the fraction of its bandwidth for the bytes that a cell-step must move, 80 for SSP-RK2: each
stage in one pass over both fields (the loop makes several). One thread.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import networks
import numba
import numpy as np
from measure import parser
from planes_pyclaw import pyclaw, riemann

from fvsolve.case import load
from fvsolve.core.model import build
from fvsolve.core.solve import initial_state
from fvsolve.core.solve.run_loop import NO_LIMIT, RunLoop

SIZES = (1_000, 10_000, 100_000, 1_000_000)  # [cells]
# per element: two reads, one write (the line fetched before writing is not counted)
TRIAD_BYTES = 24
BUDGET = 0.2  # time of one measurement [s]


@dataclass(frozen=True)
class Subject:
    """Program that steps cells: `prepare(cells)` returns `advance(steps)`, compiled and warm.

    bytes : least number of bytes that a cell-step reads and writes out of cache
    """

    name: str
    bytes: int
    prepare: Callable[[int], Callable[[int], None]]


SCHEMES = (  # scheme, limiter, Courant number
    ("upwind", "", 0.9),
    ("upwind3", "", 0.8),
    ("upwind5", "", 0.5),
    ("muscl", "minmod", 0.8),
    ("muscl", "van-leer", 0.8),
    ("muscl", "monotonized-central", 0.8),
    ("weno5", "", 0.5),
)
# Two stages, each in one pass: read y, write the stage; read y and the stage, write y; two fields.
STEP_BYTES = 16 * (2 + 3)


def schemes() -> list[Subject]:
    """fvsolve's schemes with SSP-RK2 and two fields, and upwind with Euler, whose steps are fused."""
    subjects = [Subject("upwind, Euler", 32, stepping("upwind", "", "euler", 1.0))]
    for scheme, limiter, courant in SCHEMES:
        title = f"{scheme} {limiter}".strip() + ", SSP-RK2"
        subjects.append(Subject(title, STEP_BYTES, stepping(scheme, limiter, "ssp-rk2", courant)))
    return subjects


def stepping(
    scheme: str, limiter: str, method: str, courant: float
) -> Callable[[int], Callable[[int], None]]:
    """Function that prepares fvsolve's time loop on one pipe."""

    def prepare(cells: int) -> Callable[[int], None]:
        case = networks.uniform_case(networks.UNIFORM, cells, 10**9, rows=1)
        case["links"]["main"]["friction"] = {"model": "none"}
        case["numerics"] |= {"scheme": scheme, "method": method, "courant": courant}
        case["numerics"] |= {"limiter": limiter} if limiter else {}
        model = build(load(case))
        loop = RunLoop(model)
        loop.now[:] = initial_state(model).y
        loop.begin(case["numerics"]["end"], NO_LIMIT)
        return lambda steps: loop.run(steps)

    return prepare


def of_pyclaw() -> list[Subject]:
    """PyClaw's classic Fortran solver if installed: Lax-Wendroff with the MC limiter, periodic, Courant 0.9."""
    if pyclaw is None:
        return []

    def prepare(cells: int) -> Callable[[int], None]:
        solver = pyclaw.ClawSolver1D(riemann.acoustics_1D)
        solver.limiters = pyclaw.limiters.tvd.MC
        solver.bc_lower[0] = solver.bc_upper[0] = pyclaw.BC.periodic
        domain = pyclaw.Domain(pyclaw.Dimension(0.0, 1.0, cells, name="x"))
        state = pyclaw.State(domain, 2)
        state.problem_data.update(rho=1.0, bulk=1.0, zz=1.0, cc=1.0)
        state.q[0, :] = np.exp(-100.0 * (domain.grid.x.centers - 0.5) ** 2)
        state.q[1, :] = 0.0
        solution = pyclaw.Solution(state, domain)
        solver.dt_variable, solver.max_steps = False, 10**9
        solver.dt = solver.dt_initial = 0.9 / cells
        solver.setup(solution)

        def advance(steps: int) -> None:
            solver.evolve_to_time(solution, solution.t + steps * solver.dt)

        return advance

    return [Subject("PyClaw, Lax-Wendroff MC", 32, prepare)]


@numba.njit(error_model="numpy")
def triad(a, b, c, s, times):
    """Compute a = b + s c `times` times; the arrays change places so that no pass can be left out."""
    for _ in range(times):
        for i in range(a.size):
            a[i] = b[i] + s * c[i]
        a, b, c = c, a, b
    return a[0]


def rate(
    advance: Callable[[int], object], elements: int, repeats: int = 5, budget: float = BUDGET
) -> float:
    """Elements per second, the best of `repeats` measurements, which together take about `budget` [s]."""
    advance(1)
    times, wall = 1, 0.0
    while wall < budget / 10.0:
        times *= 2
        start = time.perf_counter()
        advance(times)
        wall = time.perf_counter() - start
    times = max(1, int(times * budget / repeats / wall))
    walls = []
    for _ in range(repeats):
        start = time.perf_counter()
        advance(times)
        walls.append(time.perf_counter() - start)
    return times * elements / min(walls)


def bandwidth(elements: int, budget: float = BUDGET) -> float:
    """Memory traffic of the triad [bytes/s] on arrays of this many elements."""
    a, b, c = np.zeros(elements), np.ones(elements), np.ones(elements)
    return TRIAD_BYTES * rate(lambda times: triad(a, b, c, 0.0, times), elements, budget=budget)


def main() -> None:
    options = parser(__doc__)
    options.add_argument("cells", nargs="*", type=int, help=f"numbers of cells (default {SIZES})")
    given = options.parse_args()
    sizes, budget = (
        given.cells or (SIZES[:1] if given.quick else SIZES),
        0.01 if given.quick else BUDGET,
    )
    reached = {cells: bandwidth(2 * cells, budget) for cells in sizes}
    print("| million per second |" + "".join(f" {cells:.0e} cells |" for cells in sizes))
    print("|---|" + "---|" * len(sizes))
    cells_of_triad = (
        f" {reached[cells] / TRIAD_BYTES / 1e6:.0f} ({reached[cells] / 1e9:.0f} GB/s) |"
        for cells in sizes
    )
    print("| triad, elements (twice the cells) |" + "".join(cells_of_triad))
    for subject in schemes() + of_pyclaw():
        row = f"| {subject.name} |"
        for cells in sizes:
            speed = rate(subject.prepare(cells), cells, budget=budget)
            row += f" {speed / 1e6:.1f} ({speed * subject.bytes / reached[cells]:.0%} of triad) |"
        print(row, flush=True)


if __name__ == "__main__":
    main()

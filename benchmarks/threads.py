"""Speed-ups of basins by threads and ranks: two of each, weak scaling, speed by size, and a model of sixteen cores.

Wall times per step are the least of many, with both numbers of threads in turn, because cores are shared. If cores are
never free, even these are too long; therefore CPU times are printed as well: twice that of one thread over that of two
is the speed-up that free cores would allow, except for the memory that they share. `--quick` runs only a small grid,
`--large` also 4096^2, `--flat 64 256 1024` only speeds by these sizes.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from measure import against, agree, machine, parser, peer_module
from planes_scenes import BASINS, of_triangles, scene, square

from fvsolve.case import load
from fvsolve.core.assembly.model_draft import aligned_zeros
from fvsolve.core.kernels import band_exchange
from fvsolve.core.model import build
from fvsolve.core.run import mpi_run
from fvsolve.core.solve import initial_state
from fvsolve.core.solve.parallel_bands import yield_address
from fvsolve.core.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.jit import njit

END = 1e6  # end that no run here reaches [s]
WATER = "free surface with bed"
SIZES, GOAL_TWO, GOAL_SIXTEEN, GOAL_WEAK = (256, 512, 1024), 1.8, 12.0, 0.85
WEAK, MODELLED, BY_SIZE = 512, (512, 1024), (64, 128, 256, 512, 1024)  # cells along a side
GOAL_TRIANGLES = 1.7
FLAT = {"advection": 1.25, "liquid": 1.25, WATER: 1.2}
CHUNK, ROUNDS = 0.02, 60  # time of a call [s], number of calls of each loop


def model_of(name: str, nx: int, ny: int):
    """Model of a basin of nx by ny square cells."""
    basin = square(nx) | BASINS[name] | {"cells": [nx, ny], "size": [10.0, 10.0 * ny / nx]}
    return build(load(scene(basin, END)))


def begun(model, **team) -> RunLoop:
    """Time loop at the start of a model, warm."""
    loop = RunLoop(model, **team)
    loop.now[:] = initial_state(model).y
    loop.begin(END, NO_LIMIT)
    loop.run(2.0)
    return loop


def steps_of(loop: RunLoop) -> float:
    """Number of steps of a call, at least 2, that takes about CHUNK."""
    start = perf_counter()
    loop.run(2.0)
    return max(2.0, np.ceil(2.0 * CHUNK / (perf_counter() - start)))


def least(loops: list[RunLoop], rounds: int) -> list[np.ndarray]:
    """Wall and CPU time of a step of each loop [s], in turn, the least of many calls."""
    found, steps = [np.full(2, np.inf) for _ in loops], [steps_of(loop) for loop in loops]
    for _ in range(rounds):
        for k, loop in enumerate(loops):
            start = perf_counter(), process_time()
            loop.run(steps[k])
            took = perf_counter() - start[0], process_time() - start[1]
            found[k] = np.minimum(found[k], np.array(took) / steps[k])
    return found


def by_threads(models, counts, rounds: int) -> list[np.ndarray]:
    """Wall and CPU time of a step of each model with its number of threads [s]."""
    loops = [begun(model, threads=many) for model, many in zip(models, counts, strict=True)]
    found = least(loops, rounds)
    for loop in loops:
        loop.close()
    return found


def apart(model) -> float:
    """Greatest difference between the states after ten steps with one thread and with two."""
    states = []
    for many in (1, 2):
        loop = begun(model, threads=many)
        loop.run(10.0)
        states.append(loop.now.copy())
        loop.close()
    return np.abs(states[0] - states[1]).max()


@njit
def meet(own, times):
    """Wait at a barrier `times` times."""
    for _ in range(times):
        band_exchange.barrier(own)


def waiting(times: int = 2000, rounds: int = 200) -> float:
    """Least wall time of a barrier of two threads [s]."""
    best = np.inf
    for _ in range(rounds):
        board, owns = (
            aligned_zeros(2 * band_exchange.LINE),
            np.zeros((2, band_exchange.HEAD), dtype=np.int64),
        )
        (
            owns[:, band_exchange.BAND],
            owns[:, band_exchange.BAND_COUNT],
            owns[:, band_exchange.BOARD],
        ) = (
            (0, 1),
            2,
            board.ctypes.data,
        )
        owns[:, band_exchange.YIELD] = yield_address()
        threads = [threading.Thread(target=meet, args=(own, times)) for own in owns]
        start = perf_counter()
        for one in threads:
            one.start()
        for one in threads:
            one.join()
        best = min(best, (perf_counter() - start) / times)
    return best


def two_threads(sizes, rounds: int) -> None:
    """Print the speed-ups of two threads, by physics and size."""
    print(
        "\nWall time of a step [us] by one thread and by two: speed-up (by CPU time what free cores would allow)"
    )
    print("| |" + "".join(f" {n}^2 |" for n in sizes))
    print("|---|" + "---|" * len(sizes))
    for name in BASINS:
        row, ups = f"| {name} |", {}
        for n in sizes:
            model = model_of(name, n, n)
            agree("states of one thread beside those of two", apart(model), 0.0)
            (one, cpu), (two, both) = by_threads([model, model], (1, 2), rounds)
            ups[n] = one / two
            row += f" {1e6 * one:.0f}, {1e6 * two:.0f}: {ups[n]:.2f} ({2.0 * cpu / both:.2f}) |"
        print(row, flush=True)
        if 512 in ups:
            print(f"  {name} at 512^2: {ups[512]:.2f}, {against(GOAL_TWO, ups[512])}", flush=True)


def on_triangles(size: int, rounds: int) -> None:
    """Print the speed-up of two threads on about size^2 triangles."""
    with tempfile.TemporaryDirectory() as folder:
        basin = of_triangles(Path(folder) / "triangles.msh", size) | BASINS[WATER]
        model = build(load(scene(basin, END)))
        agree("states of one thread beside those of two", apart(model), 0.0)
        (one, cpu), (two, both) = by_threads([model, model], (1, 2), rounds)
        print(
            f"{WATER}, {model.all_cells} triangles: {1e6 * one:.0f} us, {1e6 * two:.0f} us by two: {one / two:.2f}, "
            f"{against(GOAL_TRIANGLES, one / two)}; by CPU time {2.0 * cpu / both:.2f}",
            flush=True,
        )


def weak(rounds: int) -> None:
    """Print the weak scaling: twice the rows with twice the threads."""
    models = [model_of(WATER, WEAK, rows) for rows in (WEAK // 2, WEAK)]
    (one, cpu), (two, both) = by_threads(models, (1, 2), rounds)
    print(
        f"\nWeak scaling, {WEAK} x {WEAK // 2} cells a thread: "
        f"{1e6 * one:.0f} us, {1e6 * two:.0f} us by two: {one / two:.2f}, "
        f"{against(GOAL_WEAK, one / two)}; by CPU time {2.0 * cpu / both:.2f}",
        flush=True,
    )


def by_size(sizes) -> None:
    """Print speeds per cell on one thread by CPU time, and those with stages formed after all rates."""
    print(
        "\nMillion cell-steps a second of CPU time, one thread (in brackets: stages formed apart from rates)"
    )
    print(
        "| |" + "".join(f" {n}^2 |" for n in sizes) + " spread |\n|---|" + "---|" * (len(sizes) + 1)
    )
    for name in BASINS:
        row, speeds = f"| {name} |", []
        for n in sizes:
            loop = begun(model_of(name, n, n))
            formed, steps, best = loop.stepper.structure, steps_of(loop), np.full(2, np.inf)
            for _ in range(20 if n < 2048 else 3):
                for k, shape in enumerate((formed, formed[:0])):
                    loop.stepper.structure, start = shape, process_time()
                    loop.run(steps)
                    best[k] = min(best[k], (process_time() - start) / steps)
            found = n * n / best / 1e6
            # small basins have one kind of stages
            speeds.append(found[0] if formed.size else found.max())
            row += f" {speeds[-1]:.1f}{f' ({found[1]:.1f})' if formed.size else ''} |"
        spread = max(speeds) / min(speeds)
        print(
            f"{row} {spread:.2f}, goal {FLAT[name]}: {'met' if spread <= FLAT[name] else 'missed'} |",
            flush=True,
        )


def sixteen(size: int, wait: float, many: int = 16, stages: int = 2) -> None:
    """Print the modelled speed-up of many cores: rates measured on one band after the other, waiting scaled up.

    A barrier of n threads reads n lines: n / 2 times the wait of two. The memory that cores share is not included.
    """
    model = model_of(WATER, size, size)
    loop, y, out = begun(model), initial_state(model).y, model.new_out()
    dydt, step = np.empty_like(y), least([loop], 20)[0][1]
    bands, cuts = loop.run_data.written.bands, np.arange(many + 1) * size // many

    def rates(begin: int, stop: int) -> float:
        bands[:], best = (begin, stop), np.inf
        for _ in range(60):
            start = process_time()
            model.functions.rhs(0.0, y, dydt, out, loop.run_data.handle)
            best = min(best, process_time() - start)
        return best

    slowest = max(rates(cuts[k], cuts[k + 1]) for k in range(many))
    rest = max(step - stages * rates(0, size), 0.0) / many
    rows = 2 * 5 * 3 * size * 8 / 5e9  # time to read rows of both neighbours at 5 GB/s [s]
    waits = (3 * stages + 1) * wait * many / 2.0
    found = stages * (slowest + rows) + rest + waits
    print(
        f"MODELLED, {many} cores, {WATER}, {size}^2: rates of the slowest band {1e6 * slowest:.0f} us (measured), "
        f"rows {1e6 * rows:.1f} us, waits {1e6 * waits:.1f} us a step (a wait of two {1e9 * wait:.0f} ns, measured): "
        f"{step / found:.1f} times one core, {against(GOAL_SIXTEEN, step / found)}",
        flush=True,
    )


def rank(sizes, rounds: int) -> None:
    """Run the steps of one rank of MPI; rank 0 prints its wall times of steps."""
    comm = mpi_run.world()
    for n in sizes:
        model = model_of(WATER, n, n)
        loop = RunLoop(model, comm=comm)
        if comm.rank > 0:
            loop.team.serve(*loop.functions)
            continue
        loop.now[:] = initial_state(model).y
        loop.begin(END, NO_LIMIT)
        loop.run(2.0)
        found = least([loop], rounds)[0][0]
        loop.close()
        print(f"{n} {found}", flush=True)


def two_ranks(sizes, rounds: int) -> None:
    """Print the speed-ups of two ranks."""
    if not peer_module("mpi4py", "mpi4py"):
        return
    start = Path(sys.executable).with_name("mpiexec")
    command = [start, "-n", "2", sys.executable, __file__, "--rank", *map(str, sizes)]
    found = subprocess.run(
        command, stdout=subprocess.PIPE, text=True, check=True, env=os.environ
    ).stdout
    print(
        f"\nTwo ranks, {WATER}: wall time of a step [us] by one process and by two ranks, speed-up"
    )
    for line in found.splitlines():
        n, two = int(line.split()[0]), float(line.split()[1])
        model = model_of(WATER, n, n)
        one = by_threads([model], (1,), rounds)[0][0]
        print(f"  {n}^2: {1e6 * one:.0f}, {1e6 * two:.0f}: {one / two:.2f}", flush=True)


def main() -> None:
    global BASINS, CHUNK, WEAK, MODELLED, BY_SIZE
    options = parser(__doc__)
    options.add_argument(
        "--large", action="store_true", help="also speeds of 2048^2 and 4096^2 cells"
    )
    options.add_argument(
        "--flat", nargs="+", type=int, metavar="SIZE", help="only speeds by these sizes"
    )
    options.add_argument(
        "--rank",
        nargs="+",
        type=int,
        metavar="SIZE",
        help="grids of one rank of MPI that the script starts",
    )
    given, sizes, rounds = options.parse_args(), SIZES, ROUNDS
    if given.quick:
        sizes, rounds, WEAK, MODELLED, BY_SIZE, BASINS, CHUNK = (
            (64,),
            2,
            64,
            (64,),
            (32, 64),
            {WATER: BASINS[WATER]},
            2e-3,
        )
    if given.rank:
        rank(given.rank, ROUNDS)
        return
    if given.flat:
        print(machine("fvsolve", "numba"))
        by_size(given.flat)
        return
    print(machine("fvsolve", "numba", "mpi4py"))
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} when this began")
    wait = waiting(*((200, 5) if given.quick else ()))
    print(f"least time of a barrier of two threads {1e9 * wait:.0f} ns")
    two_threads(sizes, rounds)
    on_triangles(64 if given.quick else 256, rounds)
    weak(rounds)
    two_ranks(sizes, rounds)
    print()
    for n in MODELLED:
        sixteen(n, wait)
    by_size((*BY_SIZE, *((2048, 4096) if given.large else ())))


if __name__ == "__main__":
    main()

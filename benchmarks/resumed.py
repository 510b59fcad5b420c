"""Dam break on a large grid, stopped by one process and resumed by two ranks: comparison of hashes.

    python benchmarks/resumed.py [--quick] [--back] [CELLS]

CELLS along a side are 4096 by default. Each rank then needs about 13 GiB while it builds its model, one after the
other, and up to 10 afterwards. `--back` also stops with two ranks and resumes with one process.
"""

from __future__ import annotations

import hashlib
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np
from measure import agree, machine, parser, peer_module
from planes_scenes import SIZE, scene, square

from fvsolve.case import load
from fvsolve.core.model import State, build
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.run import mpi_run
from fvsolve.core.solve import initial_state
from fvsolve.core.solve.run_loop import RunLoop
from fvsolve.core.solve.solve import Run

STEPS, STOP = 6, 3  # number of steps in total and before the stop


class Kept(MemorySink):
    """Sink that stores the last checkpoint."""

    def checkpoint(self, state) -> None:
        self.state = state


def model_of(cells: int):
    """Model of a dam break over a bed between walls, with a given step."""
    pool = square(cells) | {
        "level": 1.0,
        "bed": "0.3*sin(x)*cos(y)",
        "manning": 0.02,
        "start": {"level": f"where(x < {0.4 * SIZE}, 1.5, 1)"},
    }
    step = 0.05 * SIZE / cells
    numerics = scene(pool, STEPS * step)["numerics"] | {"step": step}
    del numerics["courant"]
    output = {"fields": 0, "every": STEPS * step}
    return build(load(scene(pool, STEPS * step) | {"numerics": numerics, "output": output}))


def stepped(model, state: State, parts: list[int], comm) -> list[State]:
    """States after each number of steps in `parts`, from a state, with all data that a resumed run needs."""
    run = Run(model, state, sink := Kept(model), None, comm=comm)
    if run.fresh:
        run.open()
    else:
        run.loop.resume(run.end, np.inf)
    found = []
    for steps in parts:
        run.loop.run(float(steps))
        run.save()
        found.append(sink.state)
    run.loop.close()
    return found


def part(cells: int, begin: str, end: str, *parts: str) -> None:
    """Step a checkpoint or the start, as one process or as a rank; rank 0 writes the state after the first part."""
    comm, start = mpi_run.world(), perf_counter()
    if comm is not None and comm.rank > 0:
        comm.bcast(None)  # rank 0 has its model: two models at a time would need more memory
        loop = RunLoop(model_of(cells), comm=comm)
        loop.team.serve(*loop.functions)
        return
    model = model_of(cells)
    if comm is not None:
        comm.bcast(0)
    state = initial_state(model)
    if begin != "-":
        with np.load(begin) as found:
            memory = {name: found[name] for name in found.files if name not in ("t", "y")}
            state = State(float(found["t"]), found["y"], memory)
    states = stepped(model, state, [int(one) for one in parts], comm)
    if end != "-":
        np.savez(end, t=states[0].t, y=states[0].y, **states[0].memory)
    said = " ".join(hashlib.sha256(one.y.tobytes()).hexdigest()[:16] for one in states)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"{said}; {perf_counter() - start:.0f} s, peak {peak:.1f} GiB", flush=True)


def asked(many: int, *words) -> list[str]:
    """Run a part with a number of processes, print its output, and return its hashes."""
    command = [sys.executable, __file__, "--part", *map(str, words)]
    if many > 1:
        command = [str(Path(sys.executable).with_name("mpiexec")), "-n", str(many), *command]
    found = subprocess.run(
        command, capture_output=True, text=True, check=True, env=os.environ
    ).stdout
    steps = " and ".join(map(str, words[3:]))
    print(
        f"  {many} {'ranks' if many > 1 else 'process'}, {steps} steps: {found.strip()}", flush=True
    )
    return found.partition(";")[0].split()


def main() -> None:
    options = parser(__doc__)
    options.add_argument(
        "cells",
        nargs="?",
        type=int,
        help="number of cells along a side (default 4096, with --quick 32)",
    )
    options.add_argument(
        "--back", action="store_true", help="also a stop by two ranks, resumed by one process"
    )
    options.add_argument(
        "--part", nargs="+", metavar="WORD", help="arguments of one process that the script starts"
    )
    given = options.parse_args()
    if given.part:
        part(int(given.part[0]), *given.part[1:])
        return
    cells = given.cells or (32 if given.quick else 4096)
    print(
        f"{machine('fvsolve', 'numba', 'mpi4py')}\ndam break on {cells}^2 cells; hashes of states",
        flush=True,
    )
    with tempfile.TemporaryDirectory(prefix="fvsolve-resumed-") as folder:
        one, two = Path(folder) / "one.npz", Path(folder) / "two.npz"
        half, whole = asked(1, cells, "-", one, STOP, STEPS - STOP)
        if not peer_module("mpi4py", "mpi4py"):
            return
        (again,) = asked(2, cells, one, "-", STEPS - STOP)
        print(
            f"stopped by one and resumed by two ranks: states are {'equal' if whole == again else 'NOT'}",
            flush=True,
        )
        agree("states that differ", whole != again, 0)
        if given.back:
            (other,) = asked(2, cells, "-", two, STOP)
            (back,) = asked(1, cells, two, "-", STEPS - STOP)
            same = half == other and whole == back
            print(f"stopped by two and resumed by one: states are {'equal' if same else 'NOT'}")
            agree("states that differ", not same, 0)


if __name__ == "__main__":
    main()

"""Cost of what a case adds to a basin, such as driven sides and rain; a driven flood beside PyClaw and ANUGA."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import planes_pyclaw as peer
from measure import SKIPPED, against
from planes_scenes import BED, SIZE, scene, square
from planes_speed import END, rate

from fvsolve.case import load
from fvsolve.core.model import build
from fvsolve.core.solve import initial_state
from fvsolve.core.solve.run_loop import NO_LIMIT, RunLoop

ROUNDS = 15  # in turns
FLOOD = {
    "up": {"side": "west", "discharge": {"formula": "5 + sin(t)"}},
    "down": {"side": "east", "stage": 1.0},
}
GREEN_AMPT = {
    "model": "green-ampt",
    "conductivity": "6.5 mm/h",
    "suction": "166.8 mm",
    "deficit": 0.34,
}
HORTON = {"model": "horton", "initial": "50 mm/h", "final": "5 mm/h", "decay": "2 1/h"}
# 10 cm under water that oscillates
WALL = {"bund": {"line": [[5.0, -1.0], [5.0, 11.0]], "crest": 0.9}}
SPRING = {"spring": {"at": [5.0, 5.0], "area": 0.01, "discharge": 0.01}}
ADDED = {  # what is added -> keys of the basin, goal for the added cost [%], None without a goal
    "two driven sides": ({"patches": FLOOD}, 5),
    "rain": ({"rain": "50 mm/h"}, 5),
    "rain and Horton": ({"rain": "50 mm/h", "infiltration": HORTON}, 15),
    "rain and Green-Ampt": ({"rain": "50 mm/h", "infiltration": GREEN_AMPT}, 15),
    "maxima": ({}, 15),
    "a wall": ({"walls": WALL}, None),
    "a section": ({}, None),
    "an interior patch": ({"patches": SPRING}, None),
}
TIMES_PYCLAW = 8.0


def water(cells: int, **more) -> dict:
    """Case of water with friction, 1 m deep over a bed."""
    start = {"level": "1 + 0.1*exp(-((x - 5)**2 + (y - 5)**2))", "u": 0.1}
    basin = square(cells) | {"level": 1.0, "bed": BED, "start": start, "manning": 0.03} | more
    return scene({key: value for key, value in basin.items() if value is not None}, END)


def stepping(case: dict) -> Callable[[float], object]:
    """Function run(steps) of a case."""
    model = build(load(case))
    loop = RunLoop(model)
    loop.now[:] = initial_state(model).y
    loop.begin(END, NO_LIMIT)
    return loop.run


def driven_table(quick: bool) -> None:
    """Print the cost of each addition, in turns with the same basin between walls, and peers on a driven flood."""
    cells, rounds = (32, 2) if quick else (256, ROUNDS)
    cases = {"walls": water(cells)} | {
        name: water(cells, **keys) for name, (keys, _) in ADDED.items()
    }
    cases["maxima"]["output"]["maxima"] = ["pool"]
    cases["a section"]["output"]["sections"] = {
        "cut": {"basin": "pool", "from": [5.0, 0.0], "to": [5.0, 10.0]}
    }
    cases["a section"]["output"]["probes"] = ["cut.flow"]
    cases["flood without friction"] = water(cells, patches=FLOOD, manning=None)
    runs, found = (
        {name: stepping(case) for name, case in cases.items()},
        {name: [] for name in cases},
    )
    for _ in range(rounds):
        for name, run in runs.items():
            found[name].append(rate(run, cells**2, 1, 0.1))
    best = {name: max(values) for name, values in found.items()}
    print(
        f"\nCost of a step on {cells}^2 cells, muscl van-leer, SSP-RK2, against the same basin between walls"
    )
    for name, (_, goal) in ADDED.items():
        cost = 100.0 * (best["walls"] / best[name] - 1.0)
        verdict = f", goal {goal} %: {'met' if cost <= goal else 'missed'}" if goal else ""
        print(f"  {name}: {cost:+.1f} %{verdict}")
    flood, free = best["two driven sides"], best["flood without friction"]
    print(
        f"  driven flood: {flood / 1e6:.1f} million cell-steps/s, without friction {free / 1e6:.1f}",
        flush=True,
    )
    if speed := of_pyclaw(cells, rounds):
        print(
            f"  PyClaw's augmented solver, without friction: {speed / 1e6:.2f} million cell-steps/s"
        )
        print(
            f"  fvsolve is {free / speed:.1f} times as fast, {against(TIMES_PYCLAW, free / speed)}"
        )
    if speed := of_anuga(cells):
        print(
            f"  ANUGA DE1: {speed / 1e6:.2f} million cell-steps/s; fvsolve is {flood / speed:.1f} times as fast"
        )


def of_pyclaw(cells: int, repeats: int) -> float:
    """Cell-steps per second of the augmented solver of GeoClaw (George 2008) in PyClaw; 0 if it is not installed.

    Inflow in the west by ghost cells, extrapolation in the east; no friction, which PyClaw leaves to the user.
    """
    if peer.pyclaw is None:
        return 0.0
    x, y = np.meshgrid(*[(np.arange(cells) + 0.5) * SIZE / cells] * 2)
    bed = 0.3 * np.sin(x) * np.cos(y)[None]
    q = np.zeros((3, cells, cells))
    q[0] = 1.0 - bed + 0.1 * np.exp(-((x - 5.0) ** 2 + (y - 5.0) ** 2))
    q[1] = 0.1 * q[0]

    def inflow(state, dim, t, qbc, auxbc, num_ghost):
        qbc[:, :num_ghost, :] = qbc[:, num_ghost : num_ghost + 1, :]
        qbc[1, :num_ghost, :] = (5.0 + np.sin(t)) / SIZE

    solver = peer.classic("sw_aug_2D", True)
    solver.bc_lower[0], solver.bc_upper[0], solver.user_bc_lower = (
        peer.pyclaw.BC.custom,
        peer.pyclaw.BC.extrap,
        inflow,
    )
    found = peer.solution(
        "sw_aug_2D", cells, SIZE, q, bed, grav=9.81, dry_tolerance=1e-3, sea_level=0.0
    )
    return rate(peer.stepping(solver, found, 0.4 * SIZE / cells / 4.5), cells**2, repeats)


ANUGA = """
import sys, time
import numpy as np, anuga
n, size = int(sys.argv[1]), 10.0
domain = anuga.rectangular_cross_domain(n // 2, n // 2, size, size)
domain.set_flow_algorithm("DE1")
domain.set_store(False)
domain.set_quantity("elevation", lambda x, y: 0.3 * np.sin(x) * np.cos(y))
domain.set_quantity("friction", 0.03)
domain.set_quantity("stage", 1.0)
closed, level = anuga.Reflective_boundary(domain), anuga.Dirichlet_boundary([1.0, 0.0, 0.0])
inflow = anuga.Dirichlet_boundary([1.0, 0.5, 0.0])
domain.set_boundary({"left": inflow, "right": level, "top": closed, "bottom": closed})
list(domain.evolve(yieldstep=0.05, finaltime=0.05))
steps, begin = domain.number_of_steps, time.process_time()
done = 0
for k in range(8):
    for t in domain.evolve(yieldstep=0.05, finaltime=0.05 * (k + 2), skip_initial_step=True):
        done += domain.number_of_steps
print(domain.number_of_triangles * done / (time.process_time() - begin))
"""


def of_anuga(cells: int) -> float:
    """Cell-steps per second of ANUGA's DE1 on as many triangles, in a process of the Python `FVSOLVE_ANUGA`, else 0."""
    python = os.environ.get("FVSOLVE_ANUGA")
    if not python or not Path(python).exists():
        print(f"ANUGA: FVSOLVE_ANUGA names no Python with anuga: {SKIPPED}", flush=True)
        return 0.0
    done = subprocess.run(
        [python, "-c", ANUGA, str(cells)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    if done.returncode:
        print(f"ANUGA failed: {done.stderr.strip().splitlines()[-1]}", file=sys.stderr)
        return 0.0
    return float(done.stdout.split()[-1])

"""Million cell-steps per second of basins, fvsolve compared with PyClaw."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from time import process_time

import numpy as np
import planes_pyclaw as peer
from kernels import bandwidth
from measure import against
from planes_scenes import BASINS, SIZE, of_triangles, scene, square

from fvsolve.case import load
from fvsolve.core.model import Model, build
from fvsolve.core.solve import initial_state
from fvsolve.core.solve.run_loop import NO_LIMIT, RunLoop

SIZES = (64, 128, 256, 512, 1024)  # cells along a side
LARGEST = {"triangles": 256, "PyClaw": 512}
AT, WATER = 256, "free surface with bed"  # size of the goals; physics of `--quick` and of triangles
# [million/s]
GOALS = {"advection": 400.0, "free surface with bed": 80.0, "free surface, triangles": 25.0}
TIMES_PYCLAW, FLAT = 8.0, 1.3
END = 1e6  # end that no run here reaches [s]
PEERS = {  # PyClaw: Riemann solver, wave speed [m/s], data of the problem
    "advection": ("vc_advection_2D", 1.0, {}),
    "free surface with bed": (
        "shallow_bathymetry_fwave_2D",
        4.5,
        dict(grav=9.81, dry_tolerance=1e-3, sea_level=0.0),
    ),
    "liquid": ("acoustics_2D", 1.0, dict(rho=1.0, bulk=1.0, zz=1.0, cc=1.0)),
}
COURANT = 0.4  # of PyClaw's steps; the cost of a step does not depend on it


def rate(
    advance: Callable[[int], object], elements: int, repeats: int = 20, chunk: float = 0.02
) -> float:
    """Elements per second of CPU time, best of `repeats`."""
    advance(1)
    times, spent = 1, 0.0
    while spent < chunk / 3.0:
        times *= 2
        start = process_time()
        advance(times)
        spent = process_time() - start
    times, found = max(1, round(times * chunk / spent)), []
    for _ in range(repeats):
        start = process_time()
        advance(times)
        found.append(process_time() - start)
    return times * elements / min(found)


def rates(model: Model, repeats: int) -> tuple[int, float, float]:
    """Number of cells, cell-steps per second, and evaluations of the right-hand side per second times cells."""
    cells, y, out = model.meshed[0].mesh.area.size, initial_state(model).y, model.new_out()
    dydt, loop = np.empty_like(y), RunLoop(model)

    def evaluate(times: int) -> None:
        for _ in range(times):
            model.functions.rhs(0.0, y, dydt, out, loop.run_data.handle)

    loop.now[:] = y
    loop.begin(END, NO_LIMIT)
    return cells, rate(loop.run, cells, repeats), rate(evaluate, cells, repeats)


def of_pyclaw(name: str, cells: int, split: bool, repeats: int) -> float:
    """Cell-steps per second of PyClaw's classic solver."""
    flux, speed, given = PEERS[name]
    x, y = np.meshgrid(*[(np.arange(cells) + 0.5) * SIZE / cells] * 2)
    hump, aux = np.exp(-((x - 5.0) ** 2 + (y - 5.0) ** 2)), None
    q = np.zeros((peer.FIELDS.get(flux, 3), cells, cells))
    q[0] = hump
    if name == "advection":
        aux = swirl_faces(cells)
    elif name == "free surface with bed":
        aux = 0.3 * np.sin(x) * np.cos(y)[None] - 1.0
        q[0] = 0.2 * hump - aux[0]
    found = peer.solution(flux, cells, SIZE, q, aux, **given)
    step = COURANT * SIZE / cells / speed
    return rate(peer.stepping(peer.classic(flux, split), found, step), cells**2, repeats)


def swirl_faces(cells: int, size: float = SIZE) -> np.ndarray:
    """Velocities through the western and southern faces of cells, by differences of LeVeque's stream function."""
    s = np.sin(np.pi * np.arange(cells + 1) / cells) ** 2
    psi = size / np.pi * np.outer(s, s)  # [y, x]
    return np.array([np.diff(psi, axis=0)[:, :-1], -np.diff(psi, axis=1)[:-1]]) * cells / size


def speed_table(quick: bool) -> None:
    """Print cell-steps per second of every physics and size, with ratios to PyClaw and between sizes."""
    sizes, repeats, basins, table, each = SIZES, 30, BASINS, {}, {}
    if quick:
        sizes, repeats, basins = (32,), 3, {WATER: BASINS[WATER]}
    print(
        "\nMillion cell-steps/s (in brackets: evaluations of the right-hand side), muscl van-leer, SSP-RK2"
    )
    print("| cells |" + "".join(f" {n}^2 |" for n in sizes) + "\n|---|" + "---|" * len(sizes))
    moved = "".join(f" {bandwidth(n * n) / 1e9:.0f} |" for n in sizes)
    print(f"| triad on arrays of as many [GB/s] |{moved}", flush=True)
    with tempfile.TemporaryDirectory(prefix="fvsolve-planes-") as folder:
        cases = {
            name: lambda n, b=basin: scene(square(n) | b, END) for name, basin in basins.items()
        }
        water = BASINS[WATER]
        cases["free surface, triangles"] = lambda n: scene(
            of_triangles(Path(folder) / f"{n}.msh", n) | water, END
        )
        for name, case in cases.items():
            row = f"| {name} |"
            for n in sizes:
                if name.endswith("triangles") and n > LARGEST["triangles"]:
                    row += " |"
                    continue
                cells, table[name, n], each[name, n] = rates(build(load(case(n))), repeats)
                row += f" {table[name, n] / 1e6:.1f} ({each[name, n] / 1e6:.0f}) |"
            print(row, flush=True)
    for name in basins if peer.pyclaw else ():
        for split in (True, False) if name != WATER else (True,):
            row = f"| PyClaw, {name}, {'directions in turn' if split else 'transverse waves'} |"
            for n in sizes:
                if n > LARGEST["PyClaw"]:
                    row += " |"
                    continue
                table[name, n, split] = of_pyclaw(name, n, split, repeats // 3)
                row += f" {table[name, n, split] / 1e6:.1f} |"
            print(row, flush=True)
    verdict(table, sizes)


def verdict(table: dict, sizes) -> None:
    """Print the results for the goals, on the largest grid if the grid of the goals is left out."""
    at = AT if AT in sizes else sizes[-1]
    for name in dict.fromkeys(key[0] for key in table):
        reached = [table[name, n] for n in sizes if (name, n) in table]
        said = [f"{name} at {at}^2: {table[name, at] / 1e6:.0f} million/s"]
        if name in GOALS:
            said.append(against(GOALS[name], table[name, at] / 1e6))
        peers = [
            table[name.replace(", triangles", " with bed"), at, split]
            for split in (True, False)
            if (name.replace(", triangles", " with bed"), at, split) in table
        ]
        if peers:
            factor = table[name, at] / max(peers)
            said.append(f"{factor:.1f} times PyClaw's quicker, {against(TIMES_PYCLAW, factor)}")
        spread = max(reached) / min(reached)
        said.append(
            f"quickest over slowest size {spread:.2f}, goal {FLAT}: {'met' if spread <= FLAT else 'missed'}"
        )
        print("  " + "; ".join(said))

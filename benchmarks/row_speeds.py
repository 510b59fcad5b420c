"""Greatest velocity in rows and frames of basins over that of all accepted steps: shipped cases, random dry fronts.

    python benchmarks/row_speeds.py [--fronts 50] [--cases bowl catchment ...] [--seed 0]

Between steps a velocity lies between those of the steps, so the bar is 1.01. The random fronts break over dry, rough
beds on grids and on triangles with Manning or Darcy friction, of all explicit methods, with rows much closer than
steps.
"""

import sys
import tempfile
from pathlib import Path

import meshio
import numpy as np
from measure import parser

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from reference.meshes import triangles, write

import fvsolve

BAR, WET = 1.01, 1e-6  # [m]
METHODS = ("ssp-rk2", "ssp-rk3", "euler", "rk4", "heun", "dormand-prince")
CASES = Path(__file__).parents[1] / "cases"
SHIPPED = (
    "bowl",
    "catchment",
    "dam-break",
    "flooding",
    "levee",
    "rain-on-a-plane",
    "river-reach",
    "road-culvert",
    "street-and-sewer",
    "tidal-creek",
)


def random_front(random: np.random.Generator, folder: Path) -> dict:
    """Scene of a dam that breaks over a dry, rough bed."""
    depth, slope, spacing = 10.0 ** random.uniform(-1.0, 1.0), random.uniform(-0.02, 0.05), 2.0
    friction = (
        {"manning": 10.0 ** random.uniform(-2.0, -0.8)}
        if random.random() < 0.7
        else {"factor": 0.1}
    )
    bumps = f"{0.1 * depth * random.random():.4g}*sin({random.uniform(0.1, 2.0):.3g}*x)"
    basin = {
        "type": "basin",
        "level": -100.0,
        "bed": f"{slope:.4g}*(100 - x) + {bumps}",
        **friction,
        "start": {"level": f"where(x < 40, {depth:.5g} + {slope:.4g}*(100 - x) + {bumps}, -100)"},
    }
    if random.random() < 0.5:
        points, cells = triangles((100.0, 8.0), spacing)
        basin["mesh"] = {"file": str(write(folder / "front.vtk", points, cells.tolist()))}
    else:
        basin |= {"size": [100.0, 8.0], "cells": [50, 4]}
    method = str(random.choice(METHODS))
    control = {"rtol": 1e-5} if method == "dormand-prince" else {"courant": 0.8}
    end = 40.0 / np.sqrt(9.8 * depth)
    return {
        "fluid": {"name": "Water"},
        "nodes": {"b": basin},
        "numerics": {
            "end": end,
            "scheme": str(random.choice(["muscl", "upwind"])),
            "method": method,
            **control,
        },
        "output": {
            "every": end / 2000.0,
            "fields": 100,
            "maxima": ["b"],
            "wet_depth": WET,
            "probes": [f"b.speed@{x},4" for x in range(41, 100, 2)],
        },
    }


def fastest(case, folder: Path, **more) -> tuple[float, float]:
    """(greatest velocity in rows and frames, that of all accepted steps) [m/s] of the basins of a run."""
    run = fvsolve.run(case, out=folder / "run", force=True, pictures=False, **more)
    steps = max(float(np.nanmax(fields["max_speed"])) for fields in run.maxima.values())
    shown = max((float(run[name].max()) for name in run.units if ".speed@" in name), default=0.0)
    for name in run.maxima:
        for path in (folder / "run" / "fields").glob(f"{name}-*.vtu"):
            for velocity in meshio.read(path).cell_data["velocity"]:
                shown = max(shown, float(np.hypot(*velocity.T[:2]).max()))
    return shown, steps


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--fronts", type=int, default=50, help="number of random fronts, 50")
    options.add_argument(
        "--cases", nargs="*", default=SHIPPED, help="shipped cases, all with water"
    )
    options.add_argument("--seed", type=int, default=0, help="first random number, 0")
    given = options.parse_args()
    if given.quick:
        given.fronts, given.cases = 1, []
    worst = 0.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for case in given.cases:
            loaded = fvsolve.load(CASES / f"{case}.toml")
            basins = [
                n
                for n, node in loaded.nodes.items()
                if getattr(node, "physics", "") == "free-surface"
            ]
            more = {"output.maxima": basins, "output.fields": 100, "output.wet_depth": WET}
            shown, steps = fastest(CASES / f"{case}.toml", folder, set=more)
            worst = max(worst, shown / steps)
            print(
                f"{case}: {shown:.4g} m/s in rows and frames, {steps:.4g} m/s in steps, ratio {shown / steps:.4f}"
            )
        for k in range(given.fronts):
            shown, steps = fastest(
                random_front(np.random.default_rng([given.seed, k]), folder), folder
            )
            worst = max(worst, shown / steps)
            print(f"front {k}: {shown:.4g}, {steps:.4g} m/s, ratio {shown / steps:.4f}", flush=True)
    print(f"greatest ratio {worst:.4f}: {'meets' if worst <= BAR else 'misses'} the bar of {BAR}")


if __name__ == "__main__":
    main()

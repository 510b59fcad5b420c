"""Random streets on noisy beds, with gullies, shafts and conduits: each runs to its end at the steps of the waves.

python benchmarks/random_streets.py [--quick] [--count 200] [--seed 0]

The crests of gullies lie from 1 m below to 1 m above their bed. Beds are grids or triangles; rain falls and stops, and
soils may take its water, so that films dry out around the gullies. Prints a street whose run does not finish, whose
mass ledger leaves more than 1e-10 of its largest term, or which takes more than MORE_STEPS times the steps of the same
street with gullies that pass nothing.
"""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from measure import agree, parser

from fvsolve.core.run import run
from fvsolve.errors import FvsolveError

FLUID = {
    "name": "user",
    "density": 1000.0,
    "bulk_modulus": "2.2 GPa",
    "viscosity": "1 mPa s",
    "law": "linear",
}
SCHEMES = ("muscl", "upwind", "muscl", "weno5")
METHODS = (None, None, "ssp-rk3", "euler")
SOILS = (
    None,
    None,
    {"model": "constant", "rate": "12 mm/h"},
    {"model": "horton", "initial": "60 mm/h", "final": "6 mm/h", "decay": "4 1/h"},
    {"model": "green-ampt", "conductivity": "5 mm/h", "suction": "110 mm", "deficit": 0.25},
)
BASE = 10.0  # height of the lower end of a street above datum [m]
SHUT = 50.0  # rise of crests by which gullies pass nothing [m]
MORE_STEPS = 4.0
LEDGER = 1e-10


class Street(NamedTuple):
    """Run of a street: its number, reason of its end, remainder over the largest term, steps, steps of its twin."""

    seed: int
    reason: str
    remainder: float
    steps: int
    still: int

    @property
    def fault(self) -> str:
        if self.reason != "finished":
            return self.reason
        if not self.remainder <= LEDGER:
            return f"ledger {self.remainder:.2g}"
        return (
            f"{self.steps} steps for {self.still}" if self.steps > MORE_STEPS * self.still else ""
        )


def random_street(seed: int, folder: Path, rise: float = 0.0) -> dict[str, Any]:
    """Case of a random street; `rise` is added to the crests of its gullies [m]."""
    rng = np.random.default_rng(seed)
    long, wide = float(rng.uniform(20.0, 60.0)), float(rng.uniform(6.0, 12.0))
    slope, cross = rng.uniform(0.0, 0.02), rng.uniform(-0.03, 0.03)
    noise, kx, ky = (
        rng.choice([0.0, 0.005, 0.02, 0.05]),
        rng.uniform(1.0, 8.0),
        rng.uniform(1.0, 8.0),
    )
    bed = (
        f"{BASE} + {slope}*({long}-x) + {cross}*(y-{0.5 * wide}) + {noise}*sin({kx}*x)*cos({ky}*y)"
    )
    street: dict[str, Any] = {
        "type": "basin",
        "elevation": 0.0,
        "bed": bed,
        "level": 0.0,
        "patches": {},
    }
    street["manning"] = float(rng.uniform(0.012, 0.04))
    size = float(rng.uniform(1.2, 2.5))
    if rng.random() < 0.4:
        street["mesh"] = triangles_of(rng, folder / f"{seed}.msh", long, wide, size)
    else:
        street |= {
            "size": [long, wide],
            "cells": [max(6, round(long / size)), max(4, round(wide / size))],
        }
    rain = float(rng.choice([0.0, 30.0, 90.0, 200.0], p=[0.1, 0.3, 0.4, 0.2]))
    minutes = np.cumsum(rng.uniform(0.5, 4.0, 3))
    street["rain"] = {
        "time": [0.0, *(60.0 * minutes)],
        "value": [0.0, rain / 3.6e6, rain / 3.6e6, 0.0],
    }
    if (soil := SOILS[int(rng.integers(len(SOILS)))]) is not None:
        street["infiltration"] = soil
    if rng.random() < 0.3 or rain == 0.0:
        street["start"] = {"level": BASE + 0.5 * slope * long + float(rng.uniform(-0.1, 0.15))}
    nodes: dict[str, Any] = {"street": street}
    links: dict[str, Any] = {}
    river = {
        "type": "reservoir",
        "elevation": 7.0,
        "head": float(rng.choice([7.5, 9.5, BASE + 0.4])),
    }
    ends = ({"normal_slope": 0.01}, {"boundary": "critical"}, None)
    if "mesh" not in street and (end := ends[int(rng.integers(3))]) is not None:
        street["patches"]["end"] = {"side": "east"} | end
    count = int(rng.integers(1, 4))
    for k in range(count):  # each in its own part of the street
        at = [
            float(long * (k + rng.uniform(0.35, 0.65)) / count),
            float(rng.uniform(1.0, wide - 1.0)),
        ]
        x, y = at
        height = BASE + slope * (long - x) + cross * (y - 0.5 * wide)
        add_gully(rng, f"{k}", at, height, rise, street, nodes, links)
    if any("river" in (link["from"], link["to"]) for link in links.values()):
        nodes["river"] = river
    numerics = {
        "scheme": SCHEMES[seed % 4],
        "end": float(60.0 * (minutes[-1] + rng.uniform(5.0, 25.0))),
    }
    if (method := METHODS[int(rng.integers(4))]) is not None:
        numerics["method"] = method
    return {
        "schema": 1,
        "fluid": FLUID,
        "nodes": nodes,
        "links": links,
        "numerics": numerics,
        "output": {"every": 30.0, "fields": 0, "probes": ["street.volume", "m0.flow"]},
    }


def triangles_of(
    rng: np.random.Generator, path: Path, long: float, wide: float, size: float
) -> dict[str, Any]:
    """Mesh of a rectangle cut into triangles at random places : keys of `mesh`; its file is written to `path`."""
    import meshio
    from scipy.spatial import Delaunay

    nx, ny = max(6, round(long / size)), max(4, round(wide / size))
    i, j = (one.ravel() for one in np.meshgrid(np.arange(nx + 1), np.arange(ny + 1)))
    within = (i > 0) & (i < nx) & (j > 0) & (j < ny)
    x = (i + np.where(within, rng.uniform(-0.25, 0.25, i.size), 0.0)) * long / nx
    y = (j + np.where(within, rng.uniform(-0.25, 0.25, i.size), 0.0)) * wide / ny
    points = np.column_stack([x, y])
    cells = Delaunay(points).simplices
    a, b, c = (points[cells[:, k]] for k in range(3))
    area = 0.5 * np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    cells = cells[area > 1e-6 * size * size]
    tags = {
        f"gmsh:{kind}": [np.ones(len(cells), dtype=int)] for kind in ("physical", "geometrical")
    }
    mesh = meshio.Mesh(
        np.column_stack([points, np.zeros(x.size)]), [("triangle", cells)], cell_data=tags
    )
    mesh.write(path, file_format="gmsh22", binary=False)
    return {"file": str(path)}


def add_gully(
    rng, name: str, at: list[float], height: float, rise: float, street, nodes, links
) -> None:
    """Add a patch with a manhole above a shaft with a conduit, above the river, or above a closed shaft."""
    street["patches"][f"g{name}"] = {"at": at, "area": float(rng.choice([0.5, 1.0, 4.0]))}
    crest = height + float(rng.choice([-1.0, 1.0]) * rng.choice([0.0, 0.01, 0.05, 0.3, 1.0])) + rise
    below = ("shaft with conduit", "shaft with conduit", "river", "shaft")[int(rng.integers(4))]
    to = "river" if below == "river" else f"s{name}"
    links[f"m{name}"] = {
        "type": "manhole",
        "from": f"street.g{name}",
        "to": to,
        "crest": crest,
        "area": float(rng.uniform(0.05, 0.5)),
        "perimeter": float(rng.uniform(0.8, 3.0)),
    }
    if below != "river":
        nodes[to] = {
            "type": "tank",
            "area": float(rng.uniform(0.3, 2.0)),
            "elevation": 7.5,
            "level": float(rng.choice([0.05, 1.0, 2.4])),
        }
    if below == "shaft with conduit":
        links[f"p{name}"] = {
            "type": "conduit",
            "from": to,
            "to": "river",
            "diameter": float(rng.uniform(0.25, 0.6)),
            "length": float(rng.uniform(20.0, 80.0)),
            "inverts": [7.5, 7.2],
            "manning": 0.013,
            "cells": int(rng.integers(5, 16)),
        }


def run_street(seed: int, folder: Path) -> Street:
    """`Street` of a seed, run with its gullies and with gullies that pass nothing."""
    try:
        result = run(random_street(seed, folder), pictures=False)
        still = run(random_street(seed, folder, SHUT), pictures=False)
    except FvsolveError as error:
        return Street(seed, str(error), 0.0, 0, 0)
    remainder = abs(result.summary["ledgers"]["mass"]["relative"])
    ended = result.summary["reason"]
    return Street(seed, ended, remainder, result.summary["steps"], still.summary["steps"])


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--count", type=int, default=200, help="number of streets (default 200)")
    options.add_argument("--seed", type=int, default=0, help="seed of the first street (default 0)")
    asked, began = options.parse_args(), time.process_time()
    count = 2 if asked.quick else asked.count
    with tempfile.TemporaryDirectory() as folder:
        streets = [run_street(seed, Path(folder)) for seed in range(asked.seed, asked.seed + count)]
    faults = [one for one in streets if one.fault]
    for one in faults:
        print(f"street {one.seed}: {one.fault}")
    ratios = np.array([one.steps / max(one.still, 1) for one in streets])
    print(
        f"{count} streets, {len(faults)} faults; greatest ledger {max(one.remainder for one in streets):.2g};"
        f" steps over those with shut gullies: median {np.median(ratios):.3g}, greatest {ratios.max():.3g};"
        f" {time.process_time() - began:.0f} s"
    )
    agree("streets that fail", len(faults), 0)


if __name__ == "__main__":
    main()

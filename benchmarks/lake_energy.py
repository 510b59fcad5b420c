"""Energy of lakes over rough beds on triangles and mixed meshes, greatest over that at the start.

    python benchmarks/lake_energy.py [--beds 40] [--end 3000] [--seed 0]

Random beds of 0.6 to 2.4 m depth, rough from cell to cell or smooth; ripples of 0.1 mm, 1 cm or 5 cm at the start, and
noise in a liquid between walls; every scheme that meshes support. Nothing drives the water and nothing brakes it, so
the energy can only fall: the bar is 1.001.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
from measure import parser

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from reference.meshes import corner_lists, write

from fvsolve.core.kernels.dtypes import MUSCL, UPWIND
from fvsolve.core.mesh import Mesh, read, rectangle
from fvsolve.core.schemes import LIMITERS
from fvsolve.features.basins.cell_sides import STEEPEST
from fvsolve.features.basins.free_surface import surface_mesh
from fvsolve.features.basins.free_surface.surface_rates import water_mesh_rates
from fvsolve.features.basins.liquid import liquid_mesh
from fvsolve.features.basins.liquid.liquid_rates import mesh_rates
from fvsolve.features.basins.liquid.liquid_sides import LiquidScheme
from fvsolve.features.basins.lower_motion import lower_mesh
from fvsolve.features.basins.mesh_blocks import work_size
from fvsolve.jit import njit

BAR, G, C, COURANT = 1.001, 9.80665, 10.0, 0.45
SCHEMES = {
    "upwind": (UPWIND, 2.0),
    **{f"muscl {name}": (MUSCL, LIMITERS[name].overshoot) for name in ("minmod", "van-leer")},
}
RIPPLES = (1e-4, 0.01, 0.05)  # [m]


def random_mesh(random: np.random.Generator, folder: Path, mixed: bool) -> Mesh:
    """Distorted rectangle of about 100 triangles, or triangles and quadrilaterals if `mixed` is True."""
    columns, rows = random.integers(8, 12), random.integers(4, 7)
    size, spacing = np.array([0.5 * columns, 0.5 * rows]), 0.5
    mesh = rectangle(tuple(size), (columns, rows))
    points = mesh.points.copy()
    inside = ((points > 1e-9) & (points < size - 1e-9)).all(axis=1)
    points[inside] += spacing * random.uniform(-0.3, 0.3, (inside.sum(), 2))
    cells = []
    for p, q, r, s in corner_lists(mesh):
        if mixed and random.random() < 0.4:
            cells.append([p, q, r, s])
        else:
            cells += [[p, q, r], [p, r, s]] if random.random() < 0.5 else [[p, q, s], [q, r, s]]
    return read(write(folder / "mesh.vtk", points, cells))


def random_bed(random: np.random.Generator, mesh: Mesh) -> np.ndarray:
    """Depth of the lake at rest : float64[n] [m]."""
    x, y = mesh.centre.T
    if random.random() < 0.5:
        return 1.5 + random.uniform(0.2, 0.9) * random.uniform(-1.0, 1.0, x.size)
    a, b, c, d = random.uniform(0.5, 4.0, 4)
    return 1.5 + random.uniform(0.1, 0.9) * np.sin(a * x + c) * np.cos(b * y + d)


@njit
def march(rates, fluid, floats, integers, y, spare, none, end, work):
    """Integrate the states y on a mesh by SSP-RK2 to about `end` [s] at the Courant number COURANT.

    rates : `water_mesh_rates` or `mesh_rates`; spare : float64[3, 3, n]; none : an empty array
    """
    n, t = y.shape[1], 0.0
    one, first, second, band = spare[0], spare[1], spare[2], (0, n)
    while t < end:
        rate = rates(
            fluid,
            floats,
            integers,
            none,
            (y[0], y[1], y[2]),
            none,
            none,
            work,
            (first[0], first[1], first[2]),
            band,
            None,
            None,
        )
        step = COURANT / rate
        for q in range(3):
            for i in range(n):
                one[q, i] = y[q, i] + step * first[q, i]
        rates(
            fluid,
            floats,
            integers,
            none,
            (one[0], one[1], one[2]),
            none,
            none,
            work,
            (second[0], second[1], second[2]),
            band,
            None,
            None,
        )
        for q in range(3):
            for i in range(n):
                y[q, i] += 0.5 * step * (first[q, i] + second[q, i])
        t += step


@njit
def march_water(water, floats, integers, y, spare, none, end, work):
    march(water_mesh_rates, water, floats, integers, y, spare, none, end, work)


@njit
def march_liquid(liquid, floats, integers, y, spare, none, end, work):
    march(mesh_rates, liquid, floats, integers, y, spare, none, end, work)


def greatest_energy(
    advance, module, fluid, lowered, start: np.ndarray, end: float, energy
) -> float:
    """Greatest energy at 30 times of a run, over that at the start; infinite if a number is not finite."""
    y, spare, work = (
        start.copy(),
        np.zeros((3, *start.shape)),
        np.zeros(work_size(module, lowered[1])),
    )
    first = most = energy(y)
    for _ in range(30):
        advance(fluid, *lowered, y, spare, np.zeros(0), end / 30.0, work)
        most = max(most, energy(y)) if np.isfinite(y).all() else np.inf
    return most / first


def main() -> None:
    options = parser(__doc__)
    options.add_argument("--beds", type=int, default=40, help="number of beds, 40")
    options.add_argument(
        "--end", type=float, default=3000.0, help="time of a run of water [s], 3000"
    )
    options.add_argument("--seed", type=int, default=0, help="first random number, 0")
    given = options.parse_args()
    if given.quick:
        given.beds, given.end = 1, 10.0
    worst: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        for bed in range(given.beds):
            random = np.random.default_rng([given.seed, bed])
            mesh = random_mesh(random, Path(folder), mixed=bed % 2 == 1)
            depth, (floats, integers) = random_bed(random, mesh), lower_mesh(mesh)
            bounded, _ = lower_mesh(mesh, STEEPEST)  # of liquids
            start, ripple = np.zeros((3, depth.size)), RIPPLES[bed % 3]
            start[0] = ripple * random.standard_normal(depth.size)
            start[0] -= start[0] @ mesh.area / mesh.area.sum()
            noise = random.standard_normal((3, depth.size)) * np.array([1.0 / C, 1.0, 1.0])[:, None]
            area = mesh.area

            def of_water(y, depth=depth, area=area):
                return float(
                    0.5 * area @ (G * y[0] ** 2 + (y[1] ** 2 + y[2] ** 2) / (depth + y[0]))
                )

            def of_liquid(y, area=area):
                return float(area @ ((C * y[0]) ** 2 + y[1] ** 2 + y[2] ** 2))

            for name, (scheme, wide) in SCHEMES.items():
                most, plan = min(wide, surface_mesh.MOST_OVERSHOOT), np.stack([depth, 0.0 * depth])
                water = surface_mesh.MeshWater(
                    G, scheme, most, plan, surface_mesh.kerbs_of(mesh, -depth), None
                )
                liquid = LiquidScheme(C, 1000.0, None, False, scheme, 0, 0.0, wide)
                ratios = {
                    "water": greatest_energy(
                        march_water,
                        surface_mesh,
                        water,
                        (floats, integers),
                        start,
                        given.end,
                        of_water,
                    ),
                    "liquid": greatest_energy(
                        march_liquid,
                        liquid_mesh,
                        liquid,
                        (bounded, integers),
                        noise,
                        0.3 * given.end,
                        of_liquid,
                    ),
                }
                for kind, ratio in ratios.items():
                    worst[f"{kind}, {name}"] = max(worst.get(f"{kind}, {name}", 0.0), ratio)
            print(
                f"bed {bed}: {depth.size} cells, greatest energy so far {max(worst.values()):.6f}",
                flush=True,
            )
    for name, ratio in sorted(worst.items()):
        print(f"{name:24s} {ratio:.6f}  {'meets' if ratio <= BAR else 'misses'} the bar of {BAR}")


if __name__ == "__main__":
    main()

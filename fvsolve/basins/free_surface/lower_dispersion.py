"""Whether the waves of a free surface are long: shallow water knows no others. Knows surfaces; knows no run.

Waves of wavenumber k run at sqrt(g tanh(k h) / k), in shallow water at sqrt(g h). Of a surface e over that at rest,
less its mean, k is that of a single wave with the same ratio of e^2 to |grad psi|^2, -div grad psi = e and no slope at
walls: the mean of 1 / k^2 over its waves, each as its square counts, so that a steep front is no short wave.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fvsolve.basins.free_surface.lower_watch import Watch
from fvsolve.case.sloshing import slowest
from fvsolve.errors import Notice

WRONG = 0.01  # share of the speed from which a word is due
SEEN, MATTERS = 1e-6, 1e-3  # of the depth, root mean square of a surface: given at the start, come about in a run


class SurfaceWaves(NamedTuple):
    """Of a surface: share by which real waves run slower, wavenumber [1/m], mean depth of wet cells [m]."""

    wrong: float
    k: float
    depth: float


NONE = SurfaceWaves(0.0, math.nan, math.nan)


def waves(basin, y: np.ndarray, seen: float = SEEN) -> SurfaceWaves:
    """Waves of a basin at deviations y; `NONE` where the root mean square of the surface is below a share of depth."""
    depth, area = basin.depth + y[0], basin.mesh.area
    wet = depth > 0.0
    if not wet.any():
        return NONE
    mean, reached = float(np.average(depth[wet], weights=area[wet])), wet | (basin.depth > 0.0)
    surface = np.where(reached, y[0] - np.average(y[0][reached], weights=area[reached]), 0.0)
    with np.errstate(over="ignore"):  # of a run that blows up
        square = float(np.average(surface**2, weights=area))
    if not seen * mean < math.sqrt(square) < math.inf:
        return NONE
    inverse = on_grid(basin, surface) if is_even(basin) else on_mesh(basin, surface)
    k = math.sqrt(square / inverse)
    return SurfaceWaves(1.0 - math.sqrt(math.tanh(k * mean) / (k * mean)), k, mean)


def waves_in_run(basin, y: np.ndarray) -> SurfaceWaves:
    """Waves of a basin that come about in a run."""
    return waves(basin, y, MATTERS)


def is_even(basin) -> bool:
    """Whether its cells are a grid of equal rectangles."""
    grid = basin.mesh.grid
    return basin.is_grid and all(np.ptp(np.diff(one)) < 1e-9 * (one[-1] - one[0]) for one in (grid.x, grid.y))


def on_grid(basin, surface: np.ndarray) -> float:
    """Mean of |grad psi|^2, by cosines."""
    from scipy.fft import dctn

    grid = basin.mesh.grid
    square = dctn(surface.reshape(grid.ny, grid.nx), norm="ortho") ** 2 / surface.size
    kx, ky = (np.pi * np.arange(n) / (one[-1] - one[0]) for n, one in ((grid.nx, grid.x), (grid.ny, grid.y)))
    k = kx**2 + ky[:, None] ** 2
    square[0, 0], k[0, 0] = 0.0, 1.0
    return float(np.sum(square / k))


def on_mesh(basin, surface: np.ndarray) -> float:
    """The same on any mesh, by differences across faces."""
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import spsolve

    mesh, inner = basin.mesh, basin.mesh.inner
    left, right, n = mesh.left[:inner], mesh.right[:inner], basin.n
    apart = np.abs(np.sum((mesh.centre[right] - mesh.centre[left]) * mesh.normal[:inner], axis=1))
    per = mesh.length[:inner] / apart
    rows, columns = np.concatenate([left, right, left, right]), np.concatenate([left, right, right, left])
    matrix = coo_array((np.concatenate([per, per, -per, -per]), (rows, columns)), shape=(n, n)).tocsc()
    own = mesh.area * (surface - np.average(surface, weights=mesh.area))
    psi = np.zeros(n)
    psi[1:] = spsolve(matrix[1:, 1:], own[1:])
    return float(own @ psi / mesh.area.sum())


def notice(basin, found: tuple[float, float, float], when: str = "") -> Notice:
    """Notice that waves are too short, with the time; found : as `SurfaceWaves`."""
    wrong, k, depth = found
    long, deep = (basin.case.amount(one, "length", 3) for one in (2.0 * math.pi / k, depth))
    text = (
        f"{basin.name}: waves about {long} long in {deep} of water (k h = {k * depth:.2g}): real ones run "
        f"{100.0 * wrong:.2g} % slower than shallow water has them{when and ','}{when}"
    )
    return Notice("dispersion", f"nodes.{basin.name}", text, None, wrong, WRONG)


def notices(basin, y: np.ndarray) -> list[Notice]:
    """Notice that waves of a basin are too short at deviations y."""
    found = waves(basin, y)
    return [notice(basin, found)] if found.wrong > WRONG else []


def watches(basin, y: np.ndarray) -> list[Watch]:
    """Watch of a run for waves that are too short; none where those at deviations y are."""
    return [] if notices(basin, y) else [Watch(basin, waves_in_run, notice, WRONG)]


def deep(basin) -> list[Notice]:
    """That water which rides on a body is too deep for shallow water, and which rung knows better."""
    found = slowest(basin.part, basin.mesh) if basin.part.on else None
    if found is None or found.fast <= 100.0 * WRONG:
        return []
    text = (
        f"{basin.name}: shallow water has its slowest wave {found.fast:.2g} % too fast (k h = {found.deep:.2g}); "
        'sloshing = "modes" has it right while waves are small'
    )
    return [Notice("dispersion", f"nodes.{basin.name}", text, "sloshing", 0.01 * found.fast, WRONG)]

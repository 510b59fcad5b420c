"""Check that waves of a free surface are long enough for shallow-water theory.

Waves of wavenumber k [1/m] in water of depth h have the speed sqrt(g tanh(k h) / k), in shallow-water theory
sqrt(g h). The wavenumber of a surface follows from its elevation e above that at rest, minus the mean:
1 / k^2 = mean |grad psi|^2 / mean e^2, where -div grad psi = e with zero normal slope at walls. This is the mean of
1 / k^2 over the waves of the surface, weighted by the squares of their amplitudes, so a steep front does not count as
a short wave.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fvsolve.basins.free_surface.lower_watch import ErrorWatch
from fvsolve.case.sloshing import slowest
from fvsolve.errors import Notice

NOTICE_ERROR = 0.01  # relative error of the speed above which there is a notice
LEAST_AT_START, LEAST_IN_RUN = (
    1e-6,
    1e-3,
)  # least root mean square of the surface over depth: at the start, during a run


class SurfaceWaves(NamedTuple):
    """Properties of the waves on the free surface of a basin, see `surface_waves`.

    speed_error : fraction by which real waves are slower than in shallow-water theory; k : wavenumber [1/m]
    depth : mean depth of wet cells [m]
    """

    speed_error: float
    k: float
    depth: float


NO_WAVES = SurfaceWaves(0.0, math.nan, math.nan)


def surface_waves(basin, y: np.ndarray, seen: float = LEAST_AT_START) -> SurfaceWaves:
    """Properties of the waves of a basin at deviations y of its cells from rest.

    They are `NO_WAVES` if the root mean square of the surface is not above `seen` times the mean depth, or not finite,
    or if all cells are dry.
    y : float64[quantities, n]
    """
    depth, area = basin.depth + y[0], basin.mesh.area
    wet = depth > 0.0
    if not wet.any():
        return NO_WAVES
    mean, reached = float(np.average(depth[wet], weights=area[wet])), wet | (basin.depth > 0.0)
    surface = np.where(reached, y[0] - np.average(y[0][reached], weights=area[reached]), 0.0)
    with np.errstate(over="ignore"):  # in an unstable run
        square = float(np.average(surface**2, weights=area))
    if not seen * mean < math.sqrt(square) < math.inf:
        return NO_WAVES
    inverse = on_grid(basin, surface) if is_even(basin) else on_mesh(basin, surface)
    k = math.sqrt(square / inverse)
    return SurfaceWaves(1.0 - math.sqrt(math.tanh(k * mean) / (k * mean)), k, mean)


def waves_in_run(basin, y: np.ndarray) -> SurfaceWaves:
    """Properties of the waves of a basin at deviations y in a run: `surface_waves` with the threshold LEAST_IN_RUN."""
    return surface_waves(basin, y, LEAST_IN_RUN)


def is_even(basin) -> bool:
    """True if the mesh is a full rectangle of equal rectangular cells."""
    grid = basin.mesh.grid
    return basin.is_grid and all(np.ptp(np.diff(lines)) < 1e-9 * (lines[-1] - lines[0]) for lines in (grid.x, grid.y))


def on_grid(basin, surface: np.ndarray) -> float:
    """Area mean of |grad psi|^2 with -div grad psi = surface, on a grid of equal rectangles, by a cosine transform."""
    from scipy.fft import dctn

    grid = basin.mesh.grid
    square = dctn(surface.reshape(grid.ny, grid.nx), norm="ortho") ** 2 / surface.size
    kx, ky = (np.pi * np.arange(n) / (lines[-1] - lines[0]) for n, lines in ((grid.nx, grid.x), (grid.ny, grid.y)))
    k = kx**2 + ky[:, None] ** 2
    square[0, 0], k[0, 0] = 0.0, 1.0
    return float(np.sum(square / k))


def on_mesh(basin, surface: np.ndarray) -> float:
    """Area mean of |grad psi|^2 with -div grad psi = surface, on a mesh of any cells, by differences across faces."""
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import spsolve

    mesh, inner = basin.mesh, basin.mesh.inner
    left, right, n = mesh.left[:inner], mesh.right[:inner], basin.n
    distance = np.abs(np.sum((mesh.centre[right] - mesh.centre[left]) * mesh.normal[:inner], axis=1))
    per = mesh.length[:inner] / distance
    rows, columns = np.concatenate([left, right, left, right]), np.concatenate([left, right, right, left])
    matrix = coo_array((np.concatenate([per, per, -per, -per]), (rows, columns)), shape=(n, n)).tocsc()
    own = mesh.area * (surface - np.average(surface, weights=mesh.area))
    psi = np.zeros(n)
    psi[1:] = spsolve(matrix[1:, 1:], own[1:])
    return float(own @ psi / mesh.area.sum())


def notice(basin, waves: tuple[float, float, float], when: str = "") -> Notice:
    """Notice that waves are too short for shallow-water theory. waves : a `SurfaceWaves`; when : text of the time"""
    wrong, k, depth = waves
    long, deep = (basin.case.amount(value, "length", 3) for value in (2.0 * math.pi / k, depth))
    text = (
        f"{basin.name}: waves about {long} long in {deep} of water (k h = {k * depth:.2g}): real waves are "
        f"{100.0 * wrong:.2g} % slower than in shallow-water theory{when and ','}{when}"
    )
    return Notice("dispersion", f"nodes.{basin.name}", text, None, wrong, NOTICE_ERROR)


def notices(basin, y: np.ndarray) -> list[Notice]:
    """List with the notice that waves at deviations y are too short for shallow-water theory; empty if they are not."""
    state = surface_waves(basin, y)
    return [notice(basin, state)] if state.speed_error > NOTICE_ERROR else []


def watches(basin, y: np.ndarray) -> list[ErrorWatch]:
    """List with a check (`ErrorWatch`) of a run for waves that are too short; empty if `notices` reports them at y."""
    return [] if notices(basin, y) else [ErrorWatch(basin, waves_in_run, notice, NOTICE_ERROR)]


def body_notices(basin) -> list[Notice]:
    """List with the notice that water in a basin on a body is too deep for shallow-water theory; empty if it is not."""
    mode = slowest(basin.part, basin.mesh) if basin.part.on else None
    if mode is None or mode.excess <= 100.0 * NOTICE_ERROR:
        return []
    text = (
        f"{basin.name}: in shallow-water theory the slowest wave is {mode.excess:.2g} % too fast "
        f'(k h = {mode.kh:.2g}); sloshing = "modes" is correct for small waves'
    )
    return [Notice("dispersion", f"nodes.{basin.name}", text, "sloshing", 0.01 * mode.excess, NOTICE_ERROR)]

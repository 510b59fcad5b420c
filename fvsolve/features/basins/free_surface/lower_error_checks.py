"""Checks of water with a free surface for effects that shallow-water theory or a scheme lacks: short waves, thin films.

Waves of wavenumber k [1/m] in water of depth h have the speed sqrt(g tanh(k h) / k), in shallow-water theory sqrt(g h).
The wavenumber of a surface follows from its elevation e above that at rest, minus the mean: 1 / k^2 = mean |grad psi|^2
/ mean e^2, where -div grad psi = e with zero normal slope at walls. This is the mean of 1 / k^2 over the waves of the
surface, weighted by the squares of their amplitudes, so a steep front does not count as a short wave. Thin films of
water have a wrong speed with `upwind` on steep beds, or with a cap on friction.
"""

import math
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from fvsolve.case.sloshing import slowest
from fvsolve.errors import Notice
from fvsolve.features.basins.lower_friction import (
    DRY_DEPTH,
    FILM_ERROR,
    ErrorWatch,
    cap_checks,
    run_checks,
    start_notices,
)

WAVE_ERROR = 0.01  # relative error of the speed of waves above which there is a notice
LEAST_AT_START = 1e-6  # least root mean square of the surface over depth at the start,
LEAST_IN_RUN = 1e-3  # and during a run


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


def is_even(basin) -> bool:
    """True if the mesh is a full rectangle of equal rectangular cells."""
    grid = basin.mesh.grid
    return basin.is_grid and all(
        np.ptp(np.diff(lines)) < 1e-9 * (lines[-1] - lines[0]) for lines in (grid.x, grid.y)
    )


def on_grid(basin, surface: np.ndarray) -> float:
    """Area mean of |grad psi|^2 with -div grad psi = surface, on a grid of equal rectangles, by a cosine transform."""
    from scipy.fft import dctn

    grid = basin.mesh.grid
    square = dctn(surface.reshape(grid.ny, grid.nx), norm="ortho") ** 2 / surface.size
    kx, ky = (
        np.pi * np.arange(n) / (lines[-1] - lines[0])
        for n, lines in ((grid.nx, grid.x), (grid.ny, grid.y))
    )
    k = kx**2 + ky[:, None] ** 2
    square[0, 0], k[0, 0] = 0.0, 1.0
    return float(np.sum(square / k))


def on_mesh(basin, surface: np.ndarray) -> float:
    """Area mean of |grad psi|^2 with -div grad psi = surface, on a mesh of any cells, by differences across faces."""
    from scipy.sparse import coo_array
    from scipy.sparse.linalg import spsolve

    mesh, inner = basin.mesh, basin.mesh.inner
    left = mesh.left[:inner]
    right = mesh.right[:inner]
    n = basin.n
    distance = np.abs(
        np.sum((mesh.centre[right] - mesh.centre[left]) * mesh.normal[:inner], axis=1)
    )
    per = mesh.length[:inner] / distance
    rows = np.concatenate([left, right, left, right])
    columns = np.concatenate([left, right, right, left])
    matrix = coo_array(
        (np.concatenate([per, per, -per, -per]), (rows, columns)), shape=(n, n)
    ).tocsc()
    own = mesh.area * (surface - np.average(surface, weights=mesh.area))
    psi = np.zeros(n)
    psi[1:] = spsolve(matrix[1:, 1:], own[1:])
    return float(own @ psi / mesh.area.sum())


def wave_notice(basin, waves: tuple[float, float, float], when: str = "") -> Notice:
    """Notice that waves are too short for shallow-water theory. waves : a `SurfaceWaves`; when : text of the time"""
    wrong, k, depth = waves
    long, deep = (basin.case.amount(value, "length", 3) for value in (2.0 * math.pi / k, depth))
    text = (
        f"{basin.name}: waves about {long} long in {deep} of water (k h = {k * depth:.2g}): real waves are "
        f"{100.0 * wrong:.2g} % slower than in shallow-water theory{when and ','}{when}"
    )
    return Notice("dispersion", f"nodes.{basin.name}", text, None, wrong, WAVE_ERROR)


def wave_notices(basin, y: np.ndarray) -> list[Notice]:
    """List with the notice that waves at deviations y are too short for shallow-water theory; empty if they are not."""
    state = surface_waves(basin, y)
    return [wave_notice(basin, state)] if state.speed_error > WAVE_ERROR else []


def body_notices(basin) -> list[Notice]:
    """List with the notice that water in a basin on a body is too deep for shallow-water theory; empty if it is not."""
    mode = slowest(basin.part, basin.mesh) if basin.part.on else None
    if mode is None or mode.excess <= 100.0 * WAVE_ERROR:
        return []
    text = (
        f"{basin.name}: in shallow-water theory the slowest wave is {mode.excess:.2g} % too fast "
        f'(k h = {mode.kh:.2g}); sloshing = "modes" is correct for small waves'
    )
    return [
        Notice(
            "dispersion", f"nodes.{basin.name}", text, "sloshing", 0.01 * mode.excess, WAVE_ERROR
        )
    ]


def slow_film_error(basin, y: np.ndarray) -> tuple[float, float, float]:
    """Error of the deepest film that is too slow at deviations y, as three numbers; (0, nan, nan) without such a film.

    They are 1 - speed / correct speed, depth [m], and fall of the bed to the next cell [m]. Both sides of a face use
    the higher bed. So the force on a film of depth h above a fall d > h is g h^2 / 2 instead of g h d, and its speed is
    sqrt(h / (2 d)) of the correct one (Delestre et al. 2012, arXiv 1206.4986).
    """
    mesh, depth = basin.mesh, basin.depth_of(y)
    left, right = mesh.left[: mesh.inner], mesh.right[: mesh.inner]
    down = basin.bed[left] > basin.bed[right]
    upper, lower = np.where(down, left, right), np.where(down, right, left)
    fall, deep = basin.bed[upper] - basin.bed[lower], depth[upper]
    film = (
        (deep > DRY_DEPTH)
        & (depth[lower] > DRY_DEPTH)
        & (fall > deep)
        & (fall + deep - depth[lower] > deep)
    )
    if not film.any():
        return 0.0, math.nan, math.nan
    at = int(np.argmax(np.where(film, deep, 0.0)))
    return 1.0 - math.sqrt(deep[at] / (2.0 * fall[at])), float(deep[at]), float(fall[at])


def slow_film_notice(basin, error: tuple[float, float, float], when: str = "") -> Notice:
    """Notice that films are too slow. error : result of `slow_film_error`; when : text of the time"""
    deep, fall = (basin.case.amount(value, "length", 3) for value in error[1:])
    text = (
        f"{basin.name}: with upwind, a film {deep} deep flows {100.0 * error[0]:.2g} % too slowly{when} down a slope "
        f'where the bed falls by {fall} from cell to cell; use scheme = "muscl", or cells so small that the bed '
        "falls by less than the depth"
    )
    return Notice("film", f"nodes.{basin.name}", text, "scheme", error[0], FILM_ERROR)


def film_checks(basin) -> list[tuple]:
    """(function for the error, function for its notice) of each check for films that applies to a basin."""
    pairs = [(slow_film_error, slow_film_notice)] if basin.scheme == "upwind" else []
    return [*pairs, *cap_checks(basin)]


def error_notices(basin, y: np.ndarray) -> list[Notice]:
    """Notices of short waves and thin films at deviations y."""
    return [
        *wave_notices(basin, y),
        *body_notices(basin),
        *start_notices(basin, y, film_checks(basin)),
    ]


def error_watches(basin, y: np.ndarray) -> list[Any]:
    """Check for short waves, unless `wave_notices` reports them at y, and one check for each pair of `film_checks`."""
    waves = ErrorWatch(basin, partial(surface_waves, seen=LEAST_IN_RUN), wave_notice, WAVE_ERROR)
    films = run_checks(basin, y, film_checks(basin))
    return films if wave_notices(basin, y) else [waves, *films]

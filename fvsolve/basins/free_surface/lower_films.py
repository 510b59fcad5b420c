"""Films of water that run at a wrong speed: under `upwind` down steep beds, under a cap on friction. Knows surfaces."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.basins.free_surface.friction import FASTEST, add_friction
from fvsolve.basins.free_surface.lower_watch import Watch
from fvsolve.errors import Notice
from fvsolve.kernels.records import DARCY, MANNING

DRY = 1e-4  # depth [m] below which water counts for nothing here
WRONG = 0.005  # share of the speed from which a word is due
WORSE = 1.2  # times what was wrong at the start: said once more


def too_slow(basin, y: np.ndarray) -> tuple[float, float, float]:
    """(1 less speed over the right one, depth, fall of the bed between cells [m]) of the deepest film at deviations y.

    Both sides of a face see the higher bed, so that a film of depth h above a fall d > h is pushed by g h^2 / 2 in
    place of g h d: its speed is sqrt(h / (2 d)) of the right one (Delestre et al. 2012, arXiv 1206.4986).
    """
    mesh, depth = basin.mesh, basin.depth_of(y)
    one, other = mesh.left[: mesh.inner], mesh.right[: mesh.inner]
    down = basin.bed[one] > basin.bed[other]
    upper, lower = np.where(down, one, other), np.where(down, other, one)
    fall, deep = basin.bed[upper] - basin.bed[lower], depth[upper]
    film = (deep > DRY) & (depth[lower] > DRY) & (fall > deep) & (fall + deep - depth[lower] > deep)
    if not film.any():
        return 0.0, math.nan, math.nan
    at = int(np.argmax(np.where(film, deep, 0.0)))
    return 1.0 - math.sqrt(deep[at] / (2.0 * fall[at])), float(deep[at]), float(fall[at])


def too_fast(basin, y: np.ndarray) -> tuple[float, float, float]:
    """(speed over the right one less 1, mean over the flow; its mean depth [m] and rate of friction [1/s]).

    Friction that balances a slope at r (u) = C u is held to r / (1 + r / FASTEST): u^2 is 1 + r / FASTEST times too
    great.
    """
    depth, part = basin.depth_of(y), basin.part
    flow = np.where(depth > DRY, np.hypot(y[1], y[2]) * basin.mesh.area, 0.0)
    if not flow.any():
        return 0.0, math.nan, math.nan
    law, value = (DARCY, part.factor) if part.manning is None else (MANNING, part.manning)
    rate, none, gravity = np.zeros(depth.size), np.zeros(depth.size), basin.case.gravity
    add_friction(law, gravity, np.array([value]), depth, none, y[1], y[2], none - 1.0, none, rate, none)
    error = np.sqrt(1.0 + rate / FASTEST) - 1.0
    return tuple(float(np.average(one, weights=flow)) for one in (error, depth, rate))


def film(basin, found: tuple[float, float, float], when: str = "") -> Notice:
    """Notice that films are too slow, with the time."""
    deep, fall = (basin.case.amount(one, "length", 3) for one in found[1:])
    text = (
        f"{basin.name}: films down a slope{when}: under upwind {deep} of water, where the bed falls by {fall} from "
        f'cell to cell, runs {100.0 * found[0]:.2g} % too slowly; give scheme = "muscl", or cells so small that '
        "the bed falls by less than the depth"
    )
    return Notice("film", f"nodes.{basin.name}", text, "scheme", found[0], WRONG)


def friction(basin, found: tuple[float, float, float], when: str = "") -> Notice:
    """Notice that films are too fast, with the time."""
    remedy = 'method = "rodas-5p"' if basin.part.on is not None else 'method = "ssp-rk3" or "ssp-rk2"'
    deep, method = basin.case.amount(found[1], "length", 3), basin.case.numerics.method
    text = (
        f"{basin.name}: water runs {100.0 * found[0]:.2g} % too fast{when}: {method} holds the rate of friction, "
        f"{found[2]:.2g} 1/s in {deep} of water, below {FASTEST:g} 1/s; give {remedy}, which does not"
    )
    return Notice("friction", f"nodes.{basin.name}", text, "method", found[0], WRONG)


def watches(basin, y: np.ndarray) -> list[Watch]:
    """Watches of a run for films that are worse than at the deviations y."""
    return [Watch(basin, look, notice, max(WRONG, WORSE * look(basin, y)[0])) for look, notice in kinds(basin)]


def notices(basin, y: np.ndarray) -> list[Notice]:
    """Notices of films at deviations y."""
    return [notice(basin, found) for look, notice in kinds(basin) if (found := look(basin, y))[0] > WRONG]


def kinds(basin) -> list[tuple]:
    """Kinds of films at a wrong speed in a basin: (function that finds the worst, function that makes its notice)."""
    found = [(too_slow, film)] if basin.scheme == "upwind" else []
    return [*found, (too_fast, friction)] if basin.capped else found

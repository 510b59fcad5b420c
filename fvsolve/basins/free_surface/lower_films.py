"""Checks for thin films of water with a wrong speed: with `upwind` on steep beds, or with a cap on friction."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.basins.free_surface.bed_friction import RATE_CAP, add_friction
from fvsolve.basins.free_surface.lower_watch import ErrorWatch
from fvsolve.errors import Notice
from fvsolve.kernels.dtypes import DARCY, MANNING

DRY_DEPTH = 1e-4  # depth [m] below which water is ignored here
NOTICE_ERROR = 0.005  # relative error of the speed above which there is a notice
REPEAT_FACTOR = 1.2  # factor on the error at the start above which a run gives another notice


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
    film = (deep > DRY_DEPTH) & (depth[lower] > DRY_DEPTH) & (fall > deep) & (fall + deep - depth[lower] > deep)
    if not film.any():
        return 0.0, math.nan, math.nan
    at = int(np.argmax(np.where(film, deep, 0.0)))
    return 1.0 - math.sqrt(deep[at] / (2.0 * fall[at])), float(deep[at]), float(fall[at])


def fast_film_error(basin, y: np.ndarray) -> tuple[float, float, float]:
    """Mean error of films that are too fast at deviations y, as three numbers; (0, nan, nan) without flow.

    They are speed / correct speed - 1, depth [m], and decay rate of the flow by friction [1/s], all averaged with unit
    flow times cell area as weight. If friction at the rate r = C u balances a slope and is capped as
    r / (1 + r / RATE_CAP), then u^2 is too great by the factor 1 + r / RATE_CAP.
    """
    depth, part = basin.depth_of(y), basin.part
    flow = np.where(depth > DRY_DEPTH, np.hypot(y[1], y[2]) * basin.mesh.area, 0.0)
    if not flow.any():
        return 0.0, math.nan, math.nan
    law, value = (DARCY, part.factor) if part.manning is None else (MANNING, part.manning)
    rate, zeros, gravity = np.zeros(depth.size), np.zeros(depth.size), basin.case.gravity
    add_friction(law, gravity, np.array([value]), depth, zeros, y[1], y[2], zeros - 1.0, zeros, rate, zeros)
    error = np.sqrt(1.0 + rate / RATE_CAP) - 1.0
    return tuple(float(np.average(values, weights=flow)) for values in (error, depth, rate))


def slow_film_notice(basin, error: tuple[float, float, float], when: str = "") -> Notice:
    """Notice that films are too slow. error : result of `slow_film_error`; when : text of the time"""
    deep, fall = (basin.case.amount(value, "length", 3) for value in error[1:])
    text = (
        f"{basin.name}: with upwind, a film {deep} deep flows {100.0 * error[0]:.2g} % too slowly{when} down a slope "
        f'where the bed falls by {fall} from cell to cell; use scheme = "muscl", or cells so small that the bed '
        "falls by less than the depth"
    )
    return Notice("film", f"nodes.{basin.name}", text, "scheme", error[0], NOTICE_ERROR)


def fast_film_notice(basin, error: tuple[float, float, float], when: str = "") -> Notice:
    """Notice that films are too fast. error : result of `fast_film_error`; when : text of the time"""
    remedy = 'method = "rodas-5p"' if basin.part.on is not None else 'method = "ssp-rk3" or "ssp-rk2"'
    deep, method = basin.case.amount(error[1], "length", 3), basin.case.numerics.method
    text = (
        f"{basin.name}: water runs {100.0 * error[0]:.2g} % too fast{when}: with {method} the decay rate by friction, "
        f"{error[2]:.2g} 1/s in {deep} of water, is capped below {RATE_CAP:g} 1/s; "
        f"use {remedy}, where the rate has no cap"
    )
    return Notice("friction", f"nodes.{basin.name}", text, "method", error[0], NOTICE_ERROR)


def watches(basin, y: np.ndarray) -> list[ErrorWatch]:
    """Checks (`ErrorWatch`) of a run for films with a wrong speed, one for each pair of `film_checks`.

    A check reports errors above NOTICE_ERROR and above REPEAT_FACTOR times the error at the start, at deviations y.
    """
    return [
        ErrorWatch(basin, look, notice, max(NOTICE_ERROR, REPEAT_FACTOR * look(basin, y)[0]))
        for look, notice in film_checks(basin)
    ]


def notices(basin, y: np.ndarray) -> list[Notice]:
    """Notices of films whose speed is wrong at deviations y."""
    return [notice(basin, error) for look, notice in film_checks(basin) if (error := look(basin, y))[0] > NOTICE_ERROR]


def film_checks(basin) -> list[tuple]:
    """(function for the error, function for its notice) of each check for films that applies to a basin."""
    pairs = [(slow_film_error, slow_film_notice)] if basin.scheme == "upwind" else []
    return [*pairs, (fast_film_error, fast_film_notice)] if basin.has_rate_cap else pairs

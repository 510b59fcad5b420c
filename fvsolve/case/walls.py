"""What must hold between walls of basins that move and the rest of a case. Knows no network."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.errors import did_you_mean, listing
from fvsolve.exact.schedule import value
from fvsolve.parts.formula import Formula
from fvsolve.units import show

SAMPLES = 1001  # of a travel
NEAR = 1e-9  # of a size, or of a normal, what counts as none of it
FLAT = 1e-12  # of the height of a bed, what counts as none of it


def moving(basin: Any) -> dict[str, Any]:
    """The patches of a basin that are walls that move, by name."""
    return {patch: one for patch, one in basin.patches.items() if one.moves}


def axis_of(basin: Any, mesh: Any) -> int:
    """Along which axis its walls move: 0 of x, 1 of y."""
    return outward(mesh, next(iter(moving(basin))))[0]


def outward(mesh: Any, patch: str) -> tuple[int, float]:
    """(axis, 1 or -1) of the normal of a patch that lies across one."""
    normal = mesh.normal[mesh.patch(patch)].mean(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    return axis, float(np.sign(normal[axis]))


def weights(basin: Any, mesh: Any, patch: str, at: np.ndarray) -> np.ndarray:
    """How far lines at places along the axis [m] go with a wall: 1 on it, 0 where its zone ends : float64[...]."""
    axis, side = outward(mesh, patch)
    low, high = mesh.points[:, axis].min(), mesh.points[:, axis].max()
    zone = basin.patches[patch].zone or high - low
    return np.clip(1.0 - (high - at if side > 0.0 else at - low) / zone, 0.0, 1.0)


def widened(mesh: Any, axis: int, goes: np.ndarray) -> np.ndarray:
    """By how much the area of cells grows per travel, over that as drawn : float64[n] [1/m].

    goes : float64[p]  how far corners go with the wall
    """
    swept = mesh.length * mesh.normal[:, axis] * goes[mesh.ends].mean(axis=1)
    inner = mesh.inner
    found = np.bincount(mesh.left, swept, mesh.area.size)
    return (found - np.bincount(mesh.right[:inner], swept[:inner], mesh.area.size)) / mesh.area


def misfits(
    name: str,
    basin: Any,
    mesh: Any,
    nodes: dict[str, Any],
    joined: set[str],
    times: tuple[float, float],
    named: Any,
) -> Iterator[tuple[tuple, str]]:
    """Faults of walls that move; times : of start and end [s]."""
    key = ("nodes", name, "patches")
    for patch, one in basin.patches.items():
        if one.zone is not None and not one.moves:
            yield (*key, patch, "zone"), "goes with a wall that moves; give it body or travel"
    walls = {patch: one for patch, one in moving(basin).items() if patch in mesh.patches[:-1]}
    for patch, one in walls.items():
        yield from (
            ((*key, patch, *below), text) for below, text in wall_faults(basin, mesh, patch, one, nodes, times, named)
        )
        if f"{name}.{patch}" in joined:
            yield (*key, patch), "a link joins here, and it is a wall that moves; join a patch that stands still"
    yield from (((*key, *below), text) for below, text in faults_between(basin, mesh, walls, times))
    if walls and basin.holes:
        yield ("nodes", name, "holes"), "would be drawn out where lines move; wanted none beside a wall that moves"


def wall_faults(
    basin: Any, mesh: Any, patch: str, one: Any, nodes: dict, times: tuple, named: Any
) -> Iterator[tuple[tuple, str]]:
    """Faults of one wall, as keys below it."""
    if not basin.own.moves:
        yield (), f"walls do not move in physics {show(basin.physics)}"
    for other in ("boundary", "impedance", "scalars"):
        if getattr(one, other):
            yield (other,), "goes with what waves or water pass, and this is a wall that moves; leave it out"
    if one.span is not None:
        yield ("span",), "a wall that moves is all of a side; leave span out"
    if one.body is not None and (one.body in nodes or one.body not in named):  # else at fault itself
        yield from ((("body",), text) for text in body_faults(one.body, nodes, outward(mesh, patch)[0]))
    normals = mesh.normal[mesh.patch(patch)]
    if np.ptp(normals, axis=0).max() > 1e-9 or np.abs(normals[0]).max() < 1.0 - 1e-9:
        yield (), "is not straight across x or y; wanted a wall that is, to move along that axis"
        return
    axis, side = outward(mesh, patch)
    at = mesh.points[:, axis]
    end = at.max() if side > 0.0 else at.min()
    if np.abs(at[mesh.ends[mesh.patch(patch)]] - end).max() > NEAR * np.ptp(at):
        yield (), f"does not lie where the basin ends along {'xy'[axis]}, at {end:g} m; wanted a wall that does"
        return
    size, zone = float(np.ptp(at)), one.zone or float(np.ptp(at))
    if zone > size * (1.0 + 1e-9):
        yield ("zone",), f"{zone:g} m is more than there is along {'xy'[axis]}, {size:g} m"
    if one.travel is not None:
        per = widened(mesh, axis, weights(basin, mesh, patch, at))
        yield from ((("travel",), text) for text in travel_faults(one.travel, side, zone, times, mesh, per))
    if isinstance(getattr(basin, "bed", None), Formula):
        yield from bed_faults(basin, mesh, patch)
    yield from outline_faults(basin, mesh, patch)


def body_faults(name: str, nodes: dict[str, Any], axis: int) -> Iterator[str]:
    """Faults of the body that a wall names, which moves along an axis."""
    known = [one for one, node in nodes.items() if getattr(node, "kind", "") in ("mass", "body")]
    node = nodes.get(name)
    if node is None:
        yield f"no mass or body named {show(name)}; there are {listing(known) or 'none'}{did_you_mean(name, known)}"
    elif node.kind == "body":
        yield from slider_faults(name, node, nodes, axis)
    elif node.kind != "mass":
        still = "a frame, which stands still" if node.kind == "frame" else f"a {node.kind}"
        yield f"{name} is {still}; wanted a mass, a body on a prismatic joint, or travel in its place"


def slider_faults(name: str, node: Any, nodes: dict[str, Any], axis: int) -> Iterator[str]:
    """Faults of a body that is to take a wall along."""
    up = nodes.get((node.joint.on or "").partition(".")[0])
    if node.joint.kind != "prismatic" or getattr(up, "kind", "frame") != "frame":
        yield f"{name} does not slide on the world; wanted a prismatic joint on it, or travel in its place"
    elif abs(direction(node)[axis]) < 1.0 - 1e-9:
        yield f"{name} does not slide along {'xy'[axis]}, as the wall does; turn its axis"


def direction(body: Any) -> np.ndarray:
    """Along what a body on a prismatic joint slides, in the world : float64[3]."""
    return body.joint.attitude.rotation @ body.joint.unit_axis


def travel_faults(travel: Any, side: float, zone: float, times: tuple, mesh: Any, per: np.ndarray) -> Iterator[str]:
    """Faults of how far a wall is to move: jumps, all of its zone used up, and a cell in which it ends turned over.

    per : float64[n]  what cells grow by per travel, over their areas [1/m]
    """
    if travel.kind == "step":
        yield "jumps, and a wall has a speed; wanted one without jumps, for example a ramp"
    inside = travel.time[(travel.time > times[0]) & (travel.time < times[1])]
    places = value(travel, np.concatenate([np.linspace(*times, SAMPLES), inside]))
    inward = float((side * (places[0] - places)).max())
    if inward >= zone:
        yield f"comes {inward:g} m inward, and the zone behind it is {zone:g} m wide; wanted less, or a wider zone"
        return
    least = np.minimum((places.min() - places[0]) * per, (places.max() - places[0]) * per)
    if least.min() <= -1.0:
        x, y = mesh.centre[np.argmin(least)]
        yield f"turns over the cell at {x:.6g},{y:.6g} m, in which the zone ends; wanted less, or another zone"


def outline_faults(basin: Any, mesh: Any, patch: str) -> Iterator[tuple[tuple, str]]:
    """Boundaries that a wall would take along or shear: all beside it must run along its way."""
    axis, _ = outward(mesh, patch)
    outer = np.arange(mesh.inner, mesh.left.size)
    own = mesh.patch(patch)
    goes = (weights(basin, mesh, patch, mesh.points[:, axis])[mesh.ends[outer]] > 0.0).any(axis=1)
    leans = (np.abs(mesh.normal[outer, axis]) > NEAR) & goes & ~((outer >= own.start) & (outer < own.stop))
    if leans.any() and not basin.holes:
        x, y = mesh.middle[outer[np.flatnonzero(leans)[0]]]
        text = f"would take along the outline at {x:.6g},{y:.6g} m, which does not run along {'xy'[axis]}"
        yield (), f"{text}; wanted an outline that does where lines move, or a shorter zone"


def bed_faults(basin: Any, mesh: Any, patch: str) -> Iterator[tuple[tuple, str]]:
    """A bed that is not flat where lines move."""
    axis, _ = outward(mesh, patch)
    corners = np.where(mesh.cells < 0, mesh.cells[:, :1], mesh.cells)
    goes = weights(basin, mesh, patch, mesh.points[:, axis]) > 0.0
    cells = goes[corners].any(axis=1)
    x, y = mesh.points[np.unique(corners[cells])].T
    heights = np.append(basin.bed.at(x, y), basin.bed.at(*mesh.centre[cells].T))
    if np.ptp(heights) > FLAT * max(np.abs(heights).max(), 1.0):
        zone = f"from {x.min():g} to {x.max():g} m" if axis == 0 else f"from {y.min():g} to {y.max():g} m"
        text = f"the bed is not flat where lines move, {'xy'[axis]} {zone}; wanted a flat one, or a shorter zone"
        yield ("zone",), text


def faults_between(basin: Any, mesh: Any, walls: dict[str, Any], times: tuple) -> Iterator[tuple[tuple, str]]:
    """Faults of several walls, and of other patches that lie on one."""
    yield from crossing_faults(basin, mesh, walls, times)
    axes = {patch: outward(mesh, patch) for patch in walls}
    first = next(iter(axes), None)
    for patch, (axis, _) in axes.items():
        if axis != axes[first][0]:
            text = f"moves along {'xy'[axis]} and {first} along {'xy'[1 - axis]}; all walls of a basin move along one"
            yield (patch,), text
    for patch in basin.patches:
        if patch in walls or patch not in mesh.patches[:-1]:
            continue
        for wall, (axis, side) in axes.items():
            end = mesh.points[:, axis].max() if side > 0.0 else mesh.points[:, axis].min()
            lies = np.abs(mesh.middle[mesh.patch(patch), axis] - end) < 1e-9 * np.ptp(mesh.points[:, axis])
            if lies.any():
                yield (patch,), f"lies on {wall}, a wall that moves; wanted on a side that stands still"


def crossing_faults(basin: Any, mesh: Any, walls: dict[str, Any], times: tuple) -> Iterator[tuple[tuple, str]]:
    """Faults of walls with a travel that leave a cell between them no room, though each alone does."""
    driven = {patch: one.travel for patch, one in walls.items() if one.travel is not None}
    if len(driven) < 2 or len({outward(mesh, patch)[0] for patch in driven}) > 1:
        return
    inside = np.concatenate([one.time for one in driven.values()])
    at = np.unique([*np.linspace(*times, SAMPLES), *inside[(inside > times[0]) & (inside < times[1])]])
    wide, alone = np.ones((mesh.area.size, at.size)), np.ones(len(driven), bool)
    for k, (patch, travel) in enumerate(driven.items()):
        axis, _ = outward(mesh, patch)
        places = value(travel, at)
        grown = np.outer(widened(mesh, axis, weights(basin, mesh, patch, mesh.points[:, axis])), places - places[0])
        wide += grown
        alone[k] = grown.min() > -1.0
    if alone.all() and wide.min() <= 0.0:
        last, first = list(driven)[-1], next(iter(driven))
        when = at[np.argmax(wide.min(axis=0) <= 0.0)]
        text = f"meets {first}: together they leave a cell no room from t = {when:.4g} s on"
        yield (last, "travel"), f"{text}; expected less travel, or a wider basin"

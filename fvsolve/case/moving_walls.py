"""Moving walls of basins: the motion of mesh points, and checks of walls against the rest of a case."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.errors import article, did_you_mean, listing
from fvsolve.exact.solution import value
from fvsolve.parts.formula import SpatialField
from fvsolve.units import show

SAMPLES = 1001  # number of samples of a travel
NEAR = 1e-9  # tolerance of a length or of a normal, relative
FLAT = 1e-12  # tolerance of the elevation of a bed, relative


def moving_walls(basin: Any) -> dict[str, Any]:
    """Patches of a basin that are moving walls, by name."""
    return {patch: options for patch, options in basin.patches.items() if options.moves}


def axis_of(basin: Any, mesh: Any) -> int:
    """Axis along which the walls of a basin move: 0 for x, 1 for y."""
    return outward(mesh, next(iter(moving_walls(basin))))[0]


def outward(mesh: Any, patch: str) -> tuple[int, float]:
    """Axis and sign of the outward normal of a patch : (0 for x or 1 for y, 1 or -1).

    The patch must be perpendicular to this axis.
    """
    normal = mesh.normal[mesh.patch(patch)].mean(axis=0)
    axis = int(np.argmax(np.abs(normal)))
    return axis, float(np.sign(normal[axis]))


def weights(basin: Any, mesh: Any, patch: str, at: np.ndarray) -> np.ndarray:
    """Displacement of mesh points divided by the travel of a wall [-]: 1 at the wall, 0 at the end of its zone.

    at : float64[n]  coordinates of the points along the axis of motion [m]; the result is float64[n]
    """
    axis, side = outward(mesh, patch)
    low, high = mesh.points[:, axis].min(), mesh.points[:, axis].max()
    zone = basin.patches[patch].zone or high - low
    return np.clip(1.0 - (high - at if side > 0.0 else at - low) / zone, 0.0, 1.0)


def area_growth(mesh: Any, axis: int, share: np.ndarray) -> np.ndarray:
    """Relative growth of cell areas per travel of a wall : float64[n] [1/m]. The initial areas are the base.

    axis : axis of motion, 0 for x, 1 for y
    share : float64[p]  displacement of mesh points divided by the travel of the wall [-], see `weights`
    """
    swept = mesh.length * mesh.normal[:, axis] * share[mesh.ends].mean(axis=1)
    inner = mesh.inner
    result = np.bincount(mesh.left, swept, mesh.area.size)
    return (result - np.bincount(mesh.right[:inner], swept[:inner], mesh.area.size)) / mesh.area


def moving_wall_faults(
    name: str,
    basin: Any,
    mesh: Any,
    nodes: dict[str, Any],
    joined: set[str],
    times: tuple[float, float],
    named: Any,
) -> Iterator[tuple[tuple, str]]:
    """Faults (key path, message) of the moving walls of a basin.

    joined : full names of patches that links join; times : start and end of the run [s]
    named : tables of all nodes, also of faulty nodes
    """
    key = ("nodes", name, "patches")
    for patch, options in basin.patches.items():
        if options.zone is not None and not options.moves:
            yield (
                (*key, patch, "zone"),
                "applies only to a moving wall; give `body` or `travel` too",
            )
    walls = {
        patch: options
        for patch, options in moving_walls(basin).items()
        if patch in mesh.patches[:-1]
    }
    for patch, options in walls.items():
        for below, text in wall_faults(basin, mesh, patch, options, nodes, times, named):
            yield (*key, patch, *below), text
        if f"{name}.{patch}" in joined:
            yield (
                (*key, patch),
                "a link joins here, and this is a moving wall; join the link to a fixed patch",
            )
    yield from (((*key, *below), text) for below, text in faults_between(basin, mesh, walls, times))
    if walls and basin.holes:
        text = (
            "would be deformed by the moving mesh; expected no holes in a basin with a moving wall"
        )
        yield ("nodes", name, "holes"), text


def wall_faults(
    basin: Any, mesh: Any, patch: str, options: Any, nodes: dict, times: tuple, named: Any
) -> Iterator[tuple[tuple, str]]:
    """Faults (key path within the patch, message) of one moving wall.

    patch, options : name and keys of the patch; other arguments as for `find_faults`
    """
    if not basin.physics_type.moves:
        yield (
            (),
            f"physics {show(basin.physics)} does not support moving walls; leave out `body` or `travel`",
        )
    for other in (*options.boundary_keys, "scalars"):
        if getattr(options, other):
            yield (
                (other,),
                "applies only to an open boundary, and this is a moving wall; leave this key out",
            )
    if options.span is not None:
        yield ("span",), "a moving wall is a whole side; leave out `span`"
    if options.body is not None and (
        options.body in nodes or options.body not in named
    ):  # otherwise the body itself is faulty
        yield from (
            (("body",), text) for text in body_faults(options.body, nodes, outward(mesh, patch)[0])
        )
    normals = mesh.normal[mesh.patch(patch)]
    if np.ptp(normals, axis=0).max() > 1e-9 or np.abs(normals[0]).max() < 1.0 - 1e-9:
        text = "is not perpendicular to x or y; expected a straight wall perpendicular to the axis along which it moves"
        yield (), text
        return
    axis, side = outward(mesh, patch)
    at = mesh.points[:, axis]
    end = at.max() if side > 0.0 else at.min()
    if np.abs(at[mesh.ends[mesh.patch(patch)]] - end).max() > NEAR * np.ptp(at):
        yield (
            (),
            f"does not lie where the basin ends along {'xy'[axis]}, at {end:g} m; expected a wall there",
        )
        return
    size, zone = float(np.ptp(at)), options.zone or float(np.ptp(at))
    if zone > size * (1.0 + 1e-9):
        text = f"{zone:g} m is more than the length of the basin along {'xy'[axis]}, {size:g} m"
        yield ("zone",), f"{text}; expected a narrower zone"
    if options.travel is not None:
        per = area_growth(mesh, axis, weights(basin, mesh, patch, at))
        yield from (
            (("travel",), text)
            for text in travel_faults(options.travel, side, zone, times, mesh, per)
        )
    if isinstance(getattr(basin, "bed", None), SpatialField):
        yield from bed_faults(basin, mesh, patch)
    yield from outline_faults(basin, mesh, patch)


def body_faults(name: str, nodes: dict[str, Any], axis: int) -> Iterator[str]:
    """Yield a fault text if the node `name` cannot move a wall.

    The node must be a mass, or a body that slides along the axis of the wall.
    axis : axis of motion of the wall, 0 for x, 1 for y
    """
    known = [
        other for other, node in nodes.items() if getattr(node, "kind", "") in ("mass", "body")
    ]
    node = nodes.get(name)
    if node is None:
        yield f"no mass or body named {show(name)}; the case has {listing(known) or 'none'}{did_you_mean(name, known)}"
    elif node.kind == "body":
        yield from slider_faults(name, node, nodes, axis)
    elif node.kind != "mass":
        still = "a frame, which is fixed" if node.kind == "frame" else article(node.kind)
        yield f"{name} is {still}; expected a mass, a body on a prismatic joint, or `travel` instead of `body`"


def slider_faults(name: str, node: Any, nodes: dict[str, Any], axis: int) -> Iterator[str]:
    """Yield a fault text if a body does not slide on the world along the axis of a wall.

    name, node : name of the body, and the body; axis : 0 for x, 1 for y
    """
    up = nodes.get((node.joint.on or "").partition(".")[0])
    if node.joint.kind != "prismatic" or getattr(up, "kind", "frame") != "frame":
        remedy = "expected a prismatic joint to the world, or `travel` instead of `body`"
        yield f"{name} does not slide on the world; {remedy}"
    elif abs(slide_direction(node)[axis]) < 1.0 - 1e-9:
        text = f"{name} does not slide along {'xy'[axis]}, the direction in which the wall moves"
        yield f"{text}; change the axis of the joint of {name}"


def slide_direction(body: Any) -> np.ndarray:
    """Unit vector in world axes along which a body on a prismatic joint to the world slides : float64[3]."""
    return body.joint.attitude.rotation @ body.joint.unit_axis


def travel_faults(
    travel: Any, side: float, zone: float, times: tuple, mesh: Any, per: np.ndarray
) -> Iterator[str]:
    """Yield fault texts for the travel of a wall: jumps, travel beyond its zone, and inverted cells.

    travel : schedule [m]; side : sign of the outward normal; zone : width of the deformed zone [m]
    times : start and end of the run [s]; per : float64[n]  relative growth of cell areas per travel [1/m]
    """
    if travel.kind == "step" or (travel.kind == "formula" and travel.program.has_jump(*times)):
        yield "jumps, and a wall has a finite speed; expected a schedule without jumps, for example a ramp"
    inside = travel.time[(travel.time > times[0]) & (travel.time < times[1])]
    places = value(travel, np.concatenate([np.linspace(*times, SAMPLES), inside]))
    inward = float((side * (places[0] - places)).max())
    if inward >= zone:
        yield f"moves the wall {inward:g} m inward in a zone {zone:g} m wide; expected less travel, or a wider zone"
        return
    least = np.minimum((places.min() - places[0]) * per, (places.max() - places[0]) * per)
    if least.min() <= -1.0:
        x, y = mesh.centre[np.argmin(least)]
        yield f"inverts the cell at {x:.6g},{y:.6g} m, in which the zone ends; expected less travel, or another zone"


def outline_faults(basin: Any, mesh: Any, patch: str) -> Iterator[tuple[tuple, str]]:
    """Yield a fault (key path within the patch, message) if a moving wall would deform the boundary.

    Within the zone of the wall the boundary must be parallel to the motion.
    """
    axis, _ = outward(mesh, patch)
    outer = np.arange(mesh.inner, mesh.left.size)
    own = mesh.patch(patch)
    goes = (weights(basin, mesh, patch, mesh.points[:, axis])[mesh.ends[outer]] > 0.0).any(axis=1)
    leans = (
        (np.abs(mesh.normal[outer, axis]) > NEAR)
        & goes
        & ~((outer >= own.start) & (outer < own.stop))
    )
    if leans.any() and not basin.holes:
        x, y = mesh.middle[outer[np.flatnonzero(leans)[0]]]
        text = f"would move the outline at {x:.6g},{y:.6g} m, which is not parallel to {'xy'[axis]}"
        yield (), f"{text}; expected a parallel outline in the zone, or a shorter zone"


def bed_faults(basin: Any, mesh: Any, patch: str) -> Iterator[tuple[tuple, str]]:
    """Yield a fault (key path within the patch, message) if the bed is not flat in the deformed zone of a wall."""
    axis, _ = outward(mesh, patch)
    corners = np.where(mesh.cells < 0, mesh.cells[:, :1], mesh.cells)
    goes = weights(basin, mesh, patch, mesh.points[:, axis]) > 0.0
    cells = goes[corners].any(axis=1)
    x, y = mesh.points[np.unique(corners[cells])].T
    heights = np.append(basin.bed.at(x, y), basin.bed.at(*mesh.centre[cells].T))
    if np.ptp(heights) > FLAT * max(np.abs(heights).max(), 1.0):
        zone = (
            f"from {x.min():g} to {x.max():g} m"
            if axis == 0
            else f"from {y.min():g} to {y.max():g} m"
        )
        text = f"the bed is not flat in the zone, {'xy'[axis]} {zone}; expected a flat bed, or a shorter zone"
        yield ("zone",), text


def faults_between(
    basin: Any, mesh: Any, walls: dict[str, Any], times: tuple
) -> Iterator[tuple[tuple, str]]:
    """Faults of several walls together: different axes, inverted cells, fixed patches on the side of a moving wall.

    walls : name of a patch -> its keys, of moving walls; times : start and end of the run [s]
    """
    yield from crossing_faults(basin, mesh, walls, times)
    axes = {patch: outward(mesh, patch) for patch in walls}
    first = next(iter(axes), None)
    for patch, (axis, _) in axes.items():
        if axis != axes[first][0]:
            text = f"moves along {'xy'[axis]} and {first} along {'xy'[1 - axis]}; expected the same axis for all walls"
            yield (patch,), text
    for patch in basin.patches:
        if patch in walls or patch not in mesh.patches[:-1]:
            continue
        for wall, (axis, side) in axes.items():
            end = mesh.points[:, axis].max() if side > 0.0 else mesh.points[:, axis].min()
            lies = np.abs(mesh.middle[mesh.patch(patch), axis] - end) < 1e-9 * np.ptp(
                mesh.points[:, axis]
            )
            if lies.any():
                yield (
                    (patch,),
                    f"lies on the side of the moving wall {wall}; expected a patch on a fixed side",
                )


def crossing_faults(
    basin: Any, mesh: Any, walls: dict[str, Any], times: tuple
) -> Iterator[tuple[tuple, str]]:
    """Yield a fault if the motions of several walls together invert a cell, although each motion alone does not.

    walls, times : as for `faults_between`
    """
    driven = {patch: item.travel for patch, item in walls.items() if item.travel is not None}
    if len(driven) < 2 or len({outward(mesh, patch)[0] for patch in driven}) > 1:
        return
    inside = np.concatenate([item.time for item in driven.values()])
    at = np.unique(
        [*np.linspace(*times, SAMPLES), *inside[(inside > times[0]) & (inside < times[1])]]
    )
    wide, alone = np.ones((mesh.area.size, at.size)), np.ones(len(driven), bool)
    for k, (patch, travel) in enumerate(driven.items()):
        axis, _ = outward(mesh, patch)
        places = value(travel, at)
        grown = np.outer(
            area_growth(mesh, axis, weights(basin, mesh, patch, mesh.points[:, axis])),
            places - places[0],
        )
        wide += grown
        alone[k] = grown.min() > -1.0
    if alone.all() and wide.min() <= 0.0:
        last, first = list(driven)[-1], next(iter(driven))
        when = at[np.argmax(wide.min(axis=0) <= 0.0)]
        text = (
            f"collides with {first}: their motions together invert a cell from t = {when:.4g} s on"
        )
        yield (last, "travel"), f"{text}; expected less travel, or a wider basin"

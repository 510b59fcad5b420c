"""Checks of basins on bodies, and the mass that their water adds to bodies."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.case import sloshing
from fvsolve.case.bodies import carrier_of, point_inertia, poses
from fvsolve.case.cell_means import means, samples
from fvsolve.errors import article, did_you_mean, listing
from fvsolve.parts.basin import Physics
from fvsolve.parts.body import Body
from fvsolve.parts.node import PlaceOnBody
from fvsolve.units import show

Faults = Iterator[tuple[tuple, str]]


def find_faults(name: str, basin: Any, nodes: dict[str, Any], named: Any) -> Faults:
    """Faults (key path, message) of the keys of a basin that place it on a body, or apply only on a body.

    named : tables of all nodes, also of faulty nodes
    """
    key = ("nodes", name)
    yield from place_faults(name, basin, nodes, named)
    if basin.on is None:
        if basin.sloshing != "cells":
            text = "applies only to water on a body; give the body as `on = BODY`, or remove this key"
            yield (*key, "sloshing"), text
        return
    if not basin.physics_type.on_bodies:
        kinds = " or ".join(show(name) for name, patch_options in Physics.kinds.items() if patch_options.on_bodies)
        yield (*key, "on"), f"physics {show(basin.physics)} cannot be on a body; expected {kinds}"
    if basin.sloshing != "cells" and not basin.physics_type.has_modes:
        yield (*key, "sloshing"), f'needs a free surface; physics {show(basin.physics)} on a body has only "cells"'
    if any(patch_options.moves for patch_options in basin.patches.values()):
        yield (
            (*key, "on"),
            "a basin on a body cannot have moving walls; leave out `on`, or `body` and `travel` of its patches",
        )
    free = next(free_joints(basin.on, nodes), None)
    for patch, patch_options in basin.patches.items():
        opened = (
            "impedance"
            if patch_options.impedance is not None
            else "boundary"
            if patch_options.boundary == "open"
            else None
        )
        if opened is not None and free is not None and not basin.lumped:
            text = (
                f"{free} moves freely, and the reaction to outflow is not modelled; expected a wall or a driven joint"
            )
            yield (*key, "patches", patch, opened), text


def place_faults(name: str, node: PlaceOnBody, nodes: dict[str, Any], named: Any) -> Faults:
    """Faults (key path, message) of the keys that place a node on a body: `on`, `at`, `attitude`, `elevation`.

    named : tables of all nodes, also of faulty nodes
    """
    key = ("nodes", name)
    if node.on is None:
        for other in ("at", "attitude"):
            if getattr(node, other, None) is not None:
                yield (*key, other), "has no effect without a body; give the body as `on = BODY`, or remove this key"
        return
    if node.on in nodes or node.on not in named:  # otherwise the body itself is faulty
        yield from (((*key, "on"), text) for text in body_faults(node.on, nodes, named))
    if node.elevation is not None:
        text = f"has no effect on a body; give the position in the axes of {node.on} as `at`, and remove this key"
        yield (*key, "elevation"), text


def overturned(nodes: dict[str, Any], poses: dict[str, Any]) -> Faults:
    """Faults of tanks and free-surface basins that are tilted by 90 degrees or more, so that the water runs out.

    Frozen water is not checked. A tank or basin is checked only if all joints from its body to the world are fixed.
    poses : name of a body -> `Pose`
    """
    for name, node in nodes.items():
        on = getattr(node, "on", None)
        wet = node.kind == "tank" or (
            node.kind == "basin" and node.physics_type.has_modes and node.sloshing != "frozen"
        )
        if not wet or on not in poses or any(nodes[body].joint.kind != "fixed" for body in carriers(on, nodes)):
            continue
        turn = poses[on].attitude @ getattr(node, "rotation", np.eye(3))
        if turn[2, 2] <= 0.0:
            angle = np.degrees(np.arccos(turn[2, 2]))
            text = f"the bottom of {name} is inclined by {angle:.3g} deg on {on}, which is fixed"
            yield ("nodes", name, "on"), f"{text}: the contents would run out; expected less than 90 deg"


def body_faults(on: str, nodes: dict[str, Any], named: Any) -> Iterator[str]:
    """Yield a fault text if the name `on` is not that of a body.

    named : tables of all nodes, also of faulty nodes
    """
    bodies = [body for body, node in nodes.items() if isinstance(node, Body)]
    bodies += [body for body in named if body not in nodes and getattr(named[body], "get", {}.get)("type") == "body"]
    if not isinstance(nodes.get(on), Body):
        state = f"is {article(nodes[on].kind)}" if on in nodes else "is not a node"
        expected = f"expected a body: {listing(bodies)}" if bodies else "the case has no body"
        yield f"{show(on)} {state}; {expected}{did_you_mean(on, bodies)}"
        return


def free_joints(on: str, nodes: dict[str, Any]) -> Iterator[str]:
    """Yield the names of the bodies, from `on` to the world, whose joints move freely (neither fixed nor driven)."""
    for body in carriers(on, nodes):
        joint = nodes[body].joint
        if joint.kind != "fixed" and joint.drive_schedule is None:
            yield body


def carriers(on: str, nodes: dict[str, Any]) -> Iterator[str]:
    """Yield the names of the body `on` and of all bodies that carry it, from `on` to the world."""
    seen: set[str] = set()
    while isinstance(nodes.get(on), Body) and on not in seen:
        seen.add(on)
        yield on
        on = carrier_of(nodes[on])[0]


def nodes_with_water(
    nodes: dict[str, Any], lumped: dict[str, Any], density: float, gravity: float, t: float
) -> dict[str, Any]:
    """Copy of `nodes` with the water of basins without cells as masses.

    The water is added to the mass, centre of mass and inertia of its body; sloshing modes are additional bodies.
    lumped : basin -> mesh, of the basins without cells; density of the water [kg/m3]; gravity [m/s2]
    t : start time [s]
    """
    result = dict(nodes)
    for name, mesh in lumped.items():
        basin, body = nodes[name], result[nodes[name].on]
        mass_of = frozen_water if basin.sloshing == "frozen" else sloshing.held_water
        mass, centre, inertia = mass_of(basin, mesh, density)
        turn = basin.rotation
        centre = np.array(basin.place) + turn @ centre
        both, own = body.mass + mass, np.array(body.centre_of_mass)
        middle = (body.mass * own + mass * centre) / both
        total = (
            body.inertia_matrix()
            + point_inertia(body.mass, own - middle)
            + turn @ inertia @ turn.T
            + point_inertia(mass, centre - middle)
        )
        change = {"mass": both, "centre_of_mass": tuple(middle.tolist()), "inertia": tuple(map(tuple, total.tolist()))}
        result[nodes[name].on] = body.model_copy(update=change)
    swinging = {name: mesh for name, mesh in lumped.items() if nodes[name].sloshing == "modes"}
    stand = poses(result, t) if swinging else {}
    for name, mesh in swinging.items():
        result |= sloshing.mode_bodies(name, nodes[name], mesh, stand[nodes[name].on], density, gravity)
    return result


def frozen_water(basin: Any, mesh: Any, density: float) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass [kg], centre [m] and inertia about the centre [kg m2] of water at rest, in the axes of the basin.

    The water is the sum of prisms over the cells. centre : float64[3]; inertia : float64[3, 3]
    """
    bed = means(samples(basin.bed, mesh))
    depth = np.maximum(basin.level - bed, 0.0)
    mass = density * mesh.area * depth
    places = np.column_stack([mesh.centre, bed + 0.5 * depth])
    total, wide = float(mass.sum()), mesh.area / 12.0
    centre = mass @ places / total
    if mesh.grid is not None and len(mesh.cells) == mesh.grid.nx * mesh.grid.ny:
        along, across = np.diff(mesh.grid.x) ** 2 / 12.0, np.diff(mesh.grid.y) ** 2 / 12.0
        along, across = np.tile(along, mesh.grid.ny), np.repeat(across, mesh.grid.nx)
    else:
        along = across = wide
    high = depth**2 / 12.0
    inertia = np.diag([mass @ (across + high), mass @ (along + high), mass @ (along + across)])
    for m, place in zip(mass, places - centre, strict=True):
        inertia += point_inertia(float(m), place)
    return total, centre, inertia

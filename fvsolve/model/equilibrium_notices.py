"""Results of the search for static equilibrium: bodies and masses in their new positions, notices, faults."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve import attitude, units
from fvsolve.case.bodies import joint_coordinate
from fvsolve.errors import Notice
from fvsolve.kernels import dtypes as rec
from fvsolve.model.bodies_start import EQUILIBRIUM_SHARE
from fvsolve.model.configuration import Configuration
from fvsolve.parts.attitude_keys import Attitude
from fvsolve.parts.schedule import constant

MOVE_TOLERANCE = 1e-15  # smaller changes of a length or an angle count as none, relative


def moved_nodes(at: Configuration, y: np.ndarray) -> dict[str, Any]:
    """Bodies and masses that moved in the search, with their new positions : name -> part; y : state vector found."""
    draft, nodes = at.draft, {}
    for name, row in zip(draft.body_names, at.bodies, strict=True):
        body, first = draft.case.nodes.get(name), int(row["y"])
        count = {rec.BALL: 4, rec.FREE: 7}.get(int(row["joint"]), int(row["freedoms"]))
        if body is not None and np.any(
            np.abs(y[first : first + count]) > MOVE_TOLERANCE * (1.0 + np.abs(row["start"][:count]))
        ):
            change = joint_keys(body.joint, row, row["start"][:count] + y[first : first + count])
            nodes[name] = body.model_copy(update={"joint": body.joint.model_copy(update=change)})
    distance = np.abs(y[at.masses["y"][at.free]])
    for i in at.free[distance > MOVE_TOLERANCE * (1.0 + np.abs(at.masses["position"][at.free]))]:
        name, place = draft.mass_names[i], at.masses["position"][i] + y[at.masses["y"][i]]
        nodes[name] = draft.case.nodes[name].model_copy(update={"initial_position": float(place)})
    return nodes


def joint_keys(joint: Any, row, q: np.ndarray) -> dict[str, Any]:
    """Keys of a joint with the values that follow from its coordinates q : key -> value."""
    if row["joint"] in (rec.REVOLUTE, rec.PRISMATIC):
        return {"angle" if row["joint"] == rec.REVOLUTE else "travel": constant(float(q[0]))}
    turn = attitude.of_euler_parameters(q[-4:])
    if row["joint"] == rec.FREE:
        place = q[:3] - turn @ row["centre"]
        return {"at": tuple(place.tolist()), "attitude": attitude_from(turn)}
    return {"attitude": attitude_from(joint.attitude.rotation @ turn)}


def attitude_from(rotation: np.ndarray) -> Attitude:
    """Attitude keys with the Euler parameters of a rotation matrix."""
    return Attitude().model_copy(update={"euler_parameters": tuple(attitude.euler_parameters(rotation).tolist())})


def position_notices(case) -> Iterator[Notice]:
    """Yield notices of bodies and masses whose equilibrium position differs from the stated position."""
    for name, node in case.equilibrium_nodes.items():
        before = case.nodes[name]
        if node.kind == "mass":
            yield coordinate_notice(
                case, name, "initial_position", before.initial_position, node.initial_position, "position"
            )
        elif node.joint.kind in ("revolute", "prismatic"):
            key, dimension = ("angle", "angle") if node.joint.kind == "revolute" else ("travel", "position")
            yield coordinate_notice(
                case, name, f"joint.{key}", *(joint_coordinate(part.joint, 0.0) for part in (before, node)), dimension
            )
        else:
            yield from attitude_notices(
                case, name, node.joint.kind == "free", case.poses[name], case.as_stated.poses[name]
            )


def attitude_notices(case, name: str, free: bool, pose, before) -> Iterator[Notice]:
    """Yield a notice of the equilibrium attitude of a body with a ball or free joint.

    A free body gives a second notice, of its position.
    free : True for a free body; pose, before : pose in equilibrium, and as stated
    """
    turn = attitude.axis_angle(attitude.deviation(pose.attitude, before.attitude))[1]
    roll, pitch, yaw = np.degrees(attitude.roll_pitch_yaw(pose.attitude))
    text = f"roll {roll:.6g}, pitch {pitch:.6g}, yaw {yaw:.6g} deg, turned by {math.degrees(turn):.4g} deg"
    yield Notice("start", f"nodes.{name}", f"{name}: forces balance at {text}", "joint.attitude", turn, 0.0)
    if free:
        own, far = case.unit_of("position"), float(np.linalg.norm(pose.place - before.place))
        x, y, z = units.convert(pose.place, "position", own)
        text = f"[{x:.6g}, {y:.6g}, {z:.6g}] {own}, {case.amount(far, 'position')} from the stated position"
        yield Notice("start", f"nodes.{name}", f"{name}: forces balance at {text}", "joint.at", far, 0.0)


def coordinate_notice(case, name: str, key: str, before: float, now: float, dimension: str) -> Notice:
    """Notice of a coordinate whose equilibrium value `now` differs from its stated value `before`."""
    result, stated = (case.amount(value, dimension, 6) for value in (now, before))
    text = f"{name}: forces balance at {key.removeprefix('joint.')} {result}, stated {stated}"
    return Notice("start", f"nodes.{name}", text, key, now, before)


def owner_name(at: Configuration, unknown: int) -> str:
    """Name of the body or mass to which an unknown belongs; for a sloshing mode the name of its basin."""
    if unknown >= at.freedoms:
        return at.draft.mass_names[at.free[unknown - at.freedoms]]
    ends = at.bodies["freedom"] + at.bodies["freedoms"]
    return at.draft.body_names[int(np.searchsorted(ends, unknown, side="right"))].partition(" ")[0]


def report_unbalanced(at: Configuration, force: np.ndarray, scale: np.ndarray) -> None:
    """Add a fault for every body and mass with an unbalanced force at the end of the search.

    force, scale : float64[size]  forces on the unknowns, and sums of their magnitudes
    """
    angular, unbalanced = at.angular(), np.abs(force) > EQUILIBRIUM_SHARE * scale
    for name in dict.fromkeys(owner_name(at, int(i)) for i in np.flatnonzero(unbalanced)):
        own = np.array([owner_name(at, i) == name for i in range(at.size)])
        residuals = [f"{np.linalg.norm(force[own & part]):.4g} {unit}"
                for part, unit in ((~angular, "N"), (angular, "N m")) if np.any(unbalanced & own & part)]  # fmt: skip
        text = f'"equilibrium" finds no position where the forces on {name} balance: {" and ".join(residuals)} remain'
        remedy = (
            "add a spring, a cylinder or a driven joint as support, state a position nearer to equilibrium, "
            'or use initial = "steady"'
        )
        at.draft.fault(f"nodes.{name}", f"{text}; {remedy}")


def refuse_overturned(at: Configuration, y: np.ndarray) -> None:
    """Add a fault if a tank or basin on a body is overturned in the equilibrium found."""
    at.out[rec.STATUS] = rec.OK
    at.force(y)
    if at.out[rec.STATUS] != rec.NO_WEIGHT:
        return
    where = int(at.out[rec.WHERE]) - len(at.draft.basins)
    name = list(at.draft.case.places)[where] if where >= 0 else at.draft.basins[where].name
    text = f"{name} is turned over in the equilibrium found, and its contents would run out"
    at.draft.fault(f"nodes.{name}", f'{text}; hold the body upright, state another position, or use initial = "steady"')

"""Equivalent descriptions of a mechanism; each function returns a changed copy of a case."""

import copy
import math
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from invariance.result_comparison import Outcome

AXIAL = ("w", "joint_t", "angular_momentum_")  # axial vectors; POLAR: polar vectors
POLAR = ("", "v", "a", "joint_f", "momentum_")


def part(probe: str) -> tuple[str, str, str]:
    """(part, vector, axis) of a probe of a vector component along a world axis; (probe, "-", "") of other probes."""
    name, _, what = probe.rpartition(".")
    found = (what[:-1], what[-1:])
    return (
        (name, *found)
        if found[1] in "xyz" and found[0] in (*AXIAL, *POLAR) and "@" not in what
        else (probe, "-", "")
    )


def otherwise(case: dict) -> dict:
    """Case with its parts in reverse order, so that bodies precede their carriers."""
    restated = copy.deepcopy(case)
    return restated | {
        table: dict(reversed(restated[table].items())) for table in ("nodes", "links")
    }


def later(value: Any, wait: float) -> Any:
    """Value with all schedules delayed by `wait`, harmonic schedules by their phase."""
    if not isinstance(value, dict):
        return value
    if "period" in value:
        return value | {"phase": value.get("phase", 0.0) - 2.0 * math.pi * wait / value["period"]}
    if "value" in value:
        key = "time" if "time" in value else "start"
        return value | {key: [t + wait for t in value[key]] if key == "time" else value[key] + wait}
    return {key: later(one, wait) for key, one in value.items()}


def at_a_later_time(case: dict, wait: float) -> dict:
    restated = later(copy.deepcopy(case), wait)
    restated["numerics"] |= {"start": wait, "end": case["numerics"]["end"] + wait}
    return restated


TEXT = {
    "mass": (1e-3, "t"),
    "inertia": (1e4, "kg cm2"),
    "centre_of_mass": (1e3, "mm"),
    "points": (100.0, "cm"),
    "at": (1e-3, "km"),
    "velocity": (3.6, "km/h"),
    "axis": None,
    "attitude": (180.0 / math.pi, "deg"),
    "closed_length": (1e3, "mm"),
    "stroke": (100.0, "cm"),
    "area_A": (1e4, "cm2"),
    "area_B": (1e6, "mm2"),
    "dead_volume_A": (1e3, "l"),
    "dead_volume_B": (1e6, "ml"),
    "stiffness": (1e-3, "kN/m"),
    "free_length": (1e3, "mm"),
    "preload": (1e-3, "kN"),
    "maximum": (1e3, "mm"),
    "force": (1e-3, "kN"),
    "torque": (1e-3, "kN m"),
    "level": (1e3, "mm"),
    "zone": (100.0, "cm"),
    "length": (1e3, "mm"),
    "diameter": (100.0, "cm"),
    "initial_position": (1e3, "mm"),
    "initial_velocity": (3.6, "km/h"),
    "travel": (1e3, "mm"),
    "rotational_stiffness": (1e-3, "kN m"),
    "thickness": (1e3, "mm"),
}


def in_other_units(value: Any, key: str = "", kind: str = "") -> Any:
    """Tables with every quantity of `TEXT` as text with a unit; of waves the mean, amplitude and period."""
    if isinstance(value, dict):
        kind = value.get("kind", kind)
        if "period" in value:
            other = dict(value)
            for one in ("mean", "amplitude"):
                other[one] = restated_value(
                    value[one],
                    "travel" if key == "travel" else "attitude" if key == "angle" else key,
                )
            return other | {"period": f"{1e3 * value['period']!r} ms"}
        if key in ("points", "attitude"):
            return {
                name: restated_value(one, key) if name != "matrix" else one
                for name, one in value.items()
            }
        return {name: in_other_units(one, name, kind) for name, one in value.items()}
    if key == "angle":
        return restated_value(value, "attitude")
    if key == "rate" and kind in ("revolute", "ball", "free"):
        return (
            [f"{60.0 / (2.0 * math.pi) * x!r} rpm" for x in value]
            if isinstance(value, list)
            else value
        )
    return restated_value(value, key)


def restated_value(value: Any, key: str) -> Any:
    factor = TEXT.get(key)
    if isinstance(value, list):
        return [restated_value(one, key) for one in value]
    return (
        value
        if factor is None or not isinstance(value, (int, float))
        else f"{factor[0] * value!r} {factor[1]}"
    )


def swapped(case: dict) -> dict:
    """Case with exchanged ends of links between points."""
    other = copy.deepcopy(case)
    for link in other["links"].values():
        if (
            link["type"] in ("spring", "damper", "end-stop", "pin", "bushing", "force")
            and "from" in link
        ):
            link["from"], link["to"] = link["to"], link["from"]
        if link["type"] == "cylinder":
            link["ports"] = {"rod": link["ports"]["case"], "case": link["ports"]["rod"]}
    return other


def negative(value: Any) -> Any:
    if isinstance(value, dict):
        return {
            key: negative(one) if key in ("mean", "amplitude", "value") else one
            for key, one in value.items()
        }
    return [negative(one) for one in value] if isinstance(value, list) else -value


def reversed_axes(case: dict) -> dict:
    """Case with reversed axes of joints and forces, and the opposite sign of values along them.

    The sense of the axis of a pin has no effect.
    """
    other = copy.deepcopy(case)
    for node in other["nodes"].values():
        joint = node.get("joint", {})
        if "axis" in joint:
            joint |= {
                key: negative(joint[key])
                for key in ("axis", "angle", "travel", "rate")
                if key in joint
            }
    for link in other["links"].values():
        for key, what in (("direction", "force"), ("axis", "torque")):
            if key in link:
                link[key] = negative(link[key])
                link |= {what: negative(link[what])} if what in link else {}
    return other


def rotation(given: dict | None) -> np.ndarray:
    """Rotation matrix of an attitude given by roll, pitch and yaw, or by a matrix."""
    given = given or {}
    if "matrix" in given:
        return np.array(given["matrix"])
    return Rotation.from_euler(
        "ZYX", [given.get(one, 0.0) for one in ("yaw", "pitch", "roll")]
    ).as_matrix()


def each_attitude(case: dict):
    """Yield the tables that may contain an attitude: joints, and basins on bodies."""
    for node in case["nodes"].values():
        if "joint" in node:
            yield node["joint"]
        if node["type"] == "basin" and "on" in node:
            yield node


FORMS = {
    "roll, pitch, yaw": lambda r: dict(
        zip(("yaw", "pitch", "roll"), r.as_euler("ZYX").tolist(), strict=True)
    ),
    "zyz": lambda r: {"zyz": r.as_euler("ZYZ").tolist()},
    "axis and angle": lambda r: {
        "axis": (
            r.as_rotvec() / max(r.magnitude(), 1e-300) if r.magnitude() else np.array([0, 0, 1.0])
        ).tolist(),
        "angle": float(r.magnitude()),
    },
    "Euler parameters": lambda r: {"euler_parameters": np.roll(r.as_quat(), 1).tolist()},
    "Euler parameters, negative": lambda r: {
        "euler_parameters": (-np.roll(r.as_quat(), 1)).tolist()
    },
    "matrix": lambda r: {"matrix": r.as_matrix().tolist()},
}


def attitudes(case: dict, form: str) -> dict:
    """Case with every attitude in the form `form`, converted by SciPy."""
    other = copy.deepcopy(case)
    for table in each_attitude(other):
        if table.get("attitude"):
            table["attitude"] = FORMS[form](Rotation.from_matrix(rotation(table["attitude"])))
    return other


def grounded(case: dict):
    """Yield the joints whose carrier is the world or a frame."""
    frames = [name for name, node in case["nodes"].items() if node["type"] == "frame"]
    for node in case["nodes"].values():
        if "joint" in node and node["joint"].get("on", "").split(".")[0] in ("", *frames):
            yield node["joint"]


def turned(case: dict, angle: float) -> dict:
    """Case turned about the vertical axis by `angle` [rad]."""
    other, turn = copy.deepcopy(case), Rotation.from_euler("Z", angle).as_matrix()

    def spun(vector):
        return (turn @ vector).tolist()

    for node in other["nodes"].values():
        if node["type"] == "frame":
            node["points"] = {name: spun(place) for name, place in node["points"].items()}
    for joint in grounded(other):
        joint["attitude"] = {"matrix": (turn @ rotation(joint.get("attitude"))).tolist()}
        joint |= {key: spun(joint[key]) for key in ("at", "velocity") if key in joint}
    for link in other["links"].values():
        link |= {"direction": spun(link["direction"])} if "direction" in link else {}
    return other


def as_turned(one: Outcome, angle: float):
    """Function that returns the expected values of a probe in the turned case, with turned vectors."""
    turn = Rotation.from_euler("Z", angle).as_matrix()

    def change(probe, values):
        name, vector, axis = part(probe)
        if vector == "-":
            return values
        return sum(
            turn["xyz".index(axis), k] * one.rows[f"{name}.{vector}{'xyz'[k]}"] for k in range(3)
        )

    return change


def shifted(case: dict, by: list[float]) -> dict:
    """Case displaced by the vector `by` [m]."""
    other = copy.deepcopy(case)

    def there(place):
        return (np.array(place) + by).tolist()

    for node in other["nodes"].values():
        if node["type"] == "frame":
            node["points"] = {name: there(place) for name, place in node["points"].items()}
    for joint in grounded(other):
        if "on" not in joint:
            joint["at"] = there(joint.get("at", [0.0, 0.0, 0.0]))
    return other


def mirrored(case: dict, axis: int) -> dict:
    """Case mirrored across x (axis 0) or y (axis 1).

    Polar vectors change their sign along the axis, axial vectors across it.
    """
    other, mirror = copy.deepcopy(case), np.eye(3)
    mirror[axis, axis] = -1.0

    def polar(vector):
        return (mirror @ vector).tolist()

    def axial(vector):
        return (-mirror @ vector).tolist()

    for node in other["nodes"].values():
        if "points" in node:
            node["points"] = {name: polar(place) for name, place in node["points"].items()}
        if "centre_of_mass" in node:
            node["centre_of_mass"] = polar(node["centre_of_mass"])
        if np.ndim(node.get("inertia")) == 2:
            node["inertia"] = (mirror @ node["inertia"] @ mirror).tolist()
        if node["type"] == "basin" and "on" in node:  # the mirror exchanges its corners
            corner = rotation(node.get("attitude")) @ (np.eye(3)[axis] * node["size"][axis])
            node["at"] = (np.array(node["at"]) + corner).tolist()
        if "at" in node:
            node["at"] = polar(node["at"])
    for table in each_attitude(other):
        table["attitude"] = {"matrix": (mirror @ rotation(table.get("attitude")) @ mirror).tolist()}
    for joint in (node["joint"] for node in other["nodes"].values() if "joint" in node):
        slides = joint["kind"] == "prismatic"
        for key, call in (("at", polar), ("velocity", polar), ("axis", polar if slides else axial)):
            if key in joint:
                joint[key] = call(joint[key])
        if isinstance(joint.get("rate"), list):
            joint["rate"] = axial(joint["rate"])
    for link in other["links"].values():
        link |= {"direction": polar(link["direction"])} if "direction" in link else {}
        link |= {"axis": axial(link["axis"])} if "axis" in link else {}
    sizes = {name: node["size"] for name, node in other["nodes"].items() if node["type"] == "basin"}
    other["output"]["probes"] = [
        in_mirror(probe, axis, sizes) for probe in other["output"]["probes"]
    ]
    return other


def in_mirror(probe: str, axis: int, sizes: dict) -> str:
    """Probe at the mirrored point of a basin."""
    what, _, place = probe.partition("@")
    name = what.partition(".")[0]
    if name not in sizes or not place:
        return probe
    at = [float(x) for x in place.split(",")]
    at[axis] = sizes[name][axis] - at[axis]
    return f"{what}@{at[0]!r},{at[1]!r}"


def as_mirrored(axis: int):
    """Function that returns the expected values of a probe in the mirrored case."""

    def change(probe, values):
        _, vector, along = part(probe)
        if vector == "-":
            return -values if probe.partition("@")[0].endswith(".uv"[0] + "uv"[axis]) else values
        flips = (along == "xyz"[axis]) == (vector in POLAR)
        return -values if flips else values

    return change


def split(case: dict, name: str) -> dict:
    """Case with a body divided into a third of its mass with all points, and the rest on a fixed joint at an angle."""
    other, whole = copy.deepcopy(case), case["nodes"][name]
    inertia = np.array(whole["inertia"])
    inertia = np.diag(inertia) if inertia.ndim == 1 else inertia
    centre, turn = (
        np.array(whole.get("centre_of_mass", [0.0, 0.0, 0.0])),
        Rotation.from_euler("ZYX", [0.5, -0.3, 0.8]).as_matrix(),
    )
    at = np.array([0.2, -0.1, 0.3])
    other["nodes"][name] |= {"mass": whole["mass"] / 3.0, "inertia": (inertia / 3.0).tolist()}
    other["nodes"][f"{name}-rest"] = {
        "type": "body",
        "mass": whole["mass"] / 1.5,
        "inertia": (turn.T @ inertia @ turn / 1.5).tolist(),
        "centre_of_mass": (turn.T @ (centre - at)).tolist(),
        "joint": {
            "kind": "fixed",
            "on": name,
            "at": at.tolist(),
            "attitude": {"matrix": turn.tolist()},
        },
    }
    return other

"""Scalars in a velocity that is given. Knows how it is said; computes nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve.errors import listing
from fvsolve.parts.basin.part import File, Physics
from fvsolve.parts.formula import Formula, Shaped
from fvsolve.parts.table import read_keys
from fvsolve.parts.value import PROFILE, Misfit, Quantity, Rows, Setting, Text, Value, positive
from fvsolve.units import show


@dataclass(frozen=True)
class Velocity:
    """A given velocity: `way` "u, v" | "stream" | "expression" | "file", what it takes, and when it turns back [s].

    given : {"u": Formula, "v": Formula} | {"stream": Formula} | {"expression": name, its parameters} | {"file": path}
    """

    way: str
    given: dict[str, Any]
    period: float | None
    said: dict[str, Any]

    def table(self) -> dict[str, Any]:
        """What the file would say."""
        return self.said


PARAMETERS: dict[str, Value] = {  # of velocities by name
    "expression": Text(),
    **dict.fromkeys(("u", "v", "speed"), Quantity("velocity")),
    **dict.fromkeys(("size", "width", "height", "y0", "south", "north"), Quantity("length")),
    **dict.fromkeys(("centre", "origin"), Rows("length", length=2)),
    "angular_velocity": Quantity("angular_velocity"),
    "rate": Quantity("rate"),
}


class Flowing(Value):
    """A velocity: { u, v } or { stream }, formulas of x and y, { expression, ... } or { file }."""

    about = "{ u, v } or { stream }, formulas of x and y in SI, { expression, its parameters } or { file }; and period"
    takes = "`{ u, v }`, `{ stream }`, `{ expression, ... }` or `{ file }`, and `period`"
    changes = PROFILE

    def read(self, given: Any, setting: Setting) -> Velocity:
        if isinstance(given, Velocity):
            return given
        ways = [way for way in ("u", "v", "stream", "expression", "file") if isinstance(given, dict) and way in given]
        if "expression" in ways and not {"stream", "file"} & {*ways}:
            ways = ["expression"]  # which may have parameters u and v
        if not ways or (len(ways) > 1 and ways != ["u", "v"]):
            has = f"has {listing(given) or 'nothing'}" if isinstance(given, dict) else f"{show(given)} is no velocity"
            raise ValueError(f"{has}; wanted {self.about}")
        found = {key: value for key, value in given.items() if key != "period"}
        period, said = None, dict(given)
        if "period" in given:
            period = said["period"] = Quantity("time", positive).read(given["period"], setting)
        way = "u, v" if ways[0] in "uv" else ways[0]
        known = {"u, v": ("u", "v"), "stream": ("stream",), "file": ("file",)}.get(way, tuple(found))
        faults = [((key,), f"unknown key; wanted {listing([*known, 'period'])}") for key in found if key not in known]
        if faults:
            raise Misfit(faults)
        if way in ("u, v", "stream"):
            of = "number" if way == "stream" else "velocity"
            found = {key: Shaped(of).read(found.get(key, 0.0), setting) for key in known}
        elif way == "expression":
            own = {key: one for key, one in found.items() if key in PARAMETERS}
            found |= read_keys(own, {key: (PARAMETERS[key], None) for key in own}, setting)
        elif way == "file":
            said["file"] = File("").read(found["file"], setting)
            found = {"file": setting.files[said["file"]]}
        return Velocity(way, found, period, said)


class Transport(Physics, name="transport"):
    """(d phi)_t + div(d w phi) = div(d D grad phi), velocity w given."""

    joined: ClassVar[bool] = False

    velocity: Annotated[Any, Flowing()]
    thickness: Annotated[
        float | None, Quantity("length", positive, "across the plane [m]; needed by a liquid, in transport 1")
    ] = None

    @classmethod
    def shapes(cls, basin, mesh) -> Iterator[tuple[tuple[str, ...], Formula, np.ndarray]]:
        for what, shape in basin.velocity.given.items():
            if isinstance(shape, Formula):
                yield ("velocity", what), shape, mesh.points if what == "stream" else mesh.middle

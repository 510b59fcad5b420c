"""Keys of the case file for scalars in a given velocity."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from fvsolve.errors import listing
from fvsolve.parts.basin import File, Physics
from fvsolve.parts.formula import SpatialField, SpatialFieldKey
from fvsolve.parts.table_model import read_keys
from fvsolve.parts.value import (
    PROFILE,
    Quantity,
    ReadContext,
    Rows,
    Text,
    Value,
    ValueFault,
    positive,
)
from fvsolve.units import show


@dataclass(frozen=True)
class Velocity:
    """Given velocity of a basin, as stated by the key `velocity`.

    form : "u, v", "stream", "expression" or "file"
    given : {"u": formula, "v": formula}, {"stream": formula}, {"expression": name, and its parameters}
        or {"file": path, "sheet": name of the sheet, if stated}
    period : period of the factor cos(pi t / period) on the velocity [s], None for a constant velocity
    stated : the table of the case file, with the period in seconds and the file as the name of its copy
    """

    form: str
    given: dict[str, Any]
    period: float | None
    stated: dict[str, Any]

    def table(self) -> dict[str, Any]:
        """Table of the case file, see `stated`."""
        return self.stated


PARAMETERS: dict[str, Value] = {  # of velocities by name
    "expression": Text(),
    **dict.fromkeys(("u", "v", "speed"), Quantity("velocity")),
    **dict.fromkeys(("size", "width", "height", "y0", "south", "north"), Quantity("length")),
    **dict.fromkeys(("centre", "origin"), Rows("length", length=2)),
    "angular_velocity": Quantity("angular_velocity"),
    "rate": Quantity("rate"),
}


class VelocityValue(Value):
    """Value of the key `velocity`: { u, v } or { stream } as formulas of x and y, { expression, ... } or { file }."""

    about = (
        "velocity field: { u, v } or { stream } as formulas of x and y in SI, { expression } with its parameters, or "
        "{ file }; and an optional period"
    )
    takes = "`{ u, v }`, `{ stream }`, `{ expression, ... }` or `{ file }`, and `period`"
    changes = PROFILE

    def read(self, given: Any, setting: ReadContext) -> Velocity:
        if isinstance(given, Velocity):
            return given
        forms = [
            way
            for way in ("u", "v", "stream", "expression", "file")
            if isinstance(given, dict) and way in given
        ]
        if "expression" in forms and not {"stream", "file"} & {*forms}:
            forms = ["expression"]  # which may have parameters u and v
        if not forms or (len(forms) > 1 and forms != ["u", "v"]):
            has = (
                f"has {listing(given) or 'nothing'}"
                if isinstance(given, dict)
                else f"{show(given)} is not a velocity"
            )
            raise ValueError(f"{has}; expected {self.about}")
        keys = {key: value for key, value in given.items() if key != "period"}
        period, stated = None, dict(given)
        if "period" in given:
            period = stated["period"] = Quantity("time", positive).read(given["period"], setting)
        way = "u, v" if forms[0] in "uv" else forms[0]
        known = {"u, v": ("u", "v"), "stream": ("stream",), "file": ("file", "sheet")}.get(
            way, tuple(keys)
        )
        faults = [
            ((key,), f"unknown key; expected {listing([*known, 'period'])}")
            for key in keys
            if key not in known
        ]
        if faults:
            raise ValueFault(faults)
        if way in ("u, v", "stream"):
            of = "number" if way == "stream" else "velocity"
            keys = {key: SpatialFieldKey(of).read(keys.get(key, 0.0), setting) for key in known}
        elif way == "expression":
            own = {key: entry for key, entry in keys.items() if key in PARAMETERS}
            keys |= read_keys(own, {key: (PARAMETERS[key], None) for key in own}, setting)
        elif way == "file":
            stated["file"] = File("").read(keys["file"], setting)
            keys |= read_keys(keys, {key: (Text(), None) for key in keys}, setting)
            keys["file"] = setting.files[stated["file"]]
        return Velocity(way, keys, period, stated)


class Transport(Physics, name="transport"):
    """Scalars phi in a given velocity w, depth d: (d phi)_t + div(d w phi) = div(d D grad phi), diffusivity D."""

    joined: ClassVar[bool] = False

    velocity: Annotated[Any, VelocityValue()]
    thickness: Annotated[
        float | None,
        Quantity(
            "length",
            positive,
            "thickness normal to the plane [m]; required for a liquid, else default 1",
        ),
    ] = None

    @classmethod
    def formulas(cls, basin, mesh) -> Iterator[tuple[tuple[str, ...], SpatialField, np.ndarray]]:
        for key, formula in basin.velocity.given.items():
            if isinstance(formula, SpatialField):
                yield ("velocity", key), formula, mesh.points if key == "stream" else mesh.middle

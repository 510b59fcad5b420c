"""What of a model can be held at a value: schedules, by the names of their keys. Knows tables; holds nothing."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from fvsolve.model.lowering import lowering_of

if TYPE_CHECKING:
    from fvsolve.model.model import Model


class Sort(NamedTuple):
    """What a value is: its unit, what is wanted of it, its range, and what counts as a small change [SI]."""

    unit: str
    wanted: str
    least: float = -math.inf
    greatest: float = math.inf
    small: float = 1.0

    @property
    def bounded(self) -> bool:
        return self.least > -math.inf or self.greatest < math.inf


OPENING = Sort("-", "a number from 0, shut, to 1, open", 0.0, 1.0)
POSITION = Sort("-", "a number from -1 to 1", -1.0, 1.0)
SPEED = Sort("-", "a relative speed of at least 0", 0.0)
TURNING = Sort("rad/s", "a finite number [rad/s]")
PRESSURE = Sort("Pa", "an absolute pressure above 0 [Pa]", small=1e5)
HEAD = Sort("m", "a head whose pressure is above 0 Pa absolute [m]", small=1e5)  # [Pa]
SET_PRESSURE = Sort("Pa", "an absolute pressure [Pa]")
FLOW = Sort("m3/s", "a finite number [m3/s]", small=1e-3)
FORCE = Sort("N", "a finite number [N]", small=1e3)
TORQUE = Sort("N m", "a finite number [N m]")
VALUE = Sort("-", "a finite number")


class Input(NamedTuple):
    """A schedule that can be held: what kernels read is scale * value + offset."""

    sort: Sort
    schedule: int
    scale: float = 1.0
    offset: float = 0.0
    node: int = -1  # whose pressure or head it is
    other: int = -1  # of a value with a sign, the schedule of what lies below zero
    scalar: int = -1  # whose value flows in


def inputs_of(model: Model) -> dict[str, Input]:
    """Input name, PART.KEY -> what it holds: what every part has to drive it by, see `Lowering.inputs`."""
    case = model.case
    parts = {**case.places, **{name: case.conduits[name] for name in model.valve_names}}
    parts |= {name: link for name, link in case.links.items() if name not in parts}
    found: dict[str, Input] = {}
    for name, part in parts.items():
        own = lowering_of(type(part)).of(part).inputs(model, name, part)
        found |= {f"{name}.{key}": one for key, one in own.items()}
    return found


def opening(model: Model, name: str) -> dict[str, Input]:
    """That of a restriction, by its schedule."""
    return {"opening": Input(OPENING, int(model.tables.valves[model.valve_names.index(name)]["schedule"]))}


def values_in(model: Model, name: str) -> dict[str, Input]:
    """Values of scalars that flow in from a place, by their names."""
    i, found = model.node_names.index(name), {}
    for q, (scalar, one) in enumerate(zip(model.case.scalars, model.tables.scalars, strict=True)):
        place = int(model.tables.integers[one["places"] + i])
        if place >= 0:
            found[scalar] = Input(VALUE, place, scalar=q)
    return found

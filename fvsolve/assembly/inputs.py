"""Inputs of a model: schedules that can be held at a value, named `PART.KEY`."""

import math
from typing import NamedTuple


class InputKind(NamedTuple):
    """Kind of an input: unit, expected value in words, range of values, and size of a small change [SI].

    For HEAD the small change is that of the pressure [Pa].
    """

    unit: str
    expected: str
    least: float = -math.inf
    greatest: float = math.inf
    small: float = 1.0

    @property
    def bounded(self) -> bool:
        return self.least > -math.inf or self.greatest < math.inf


OPENING = InputKind("-", "a number from 0, shut, to 1, open", 0.0, 1.0)
POSITION = InputKind("-", "a number from -1 to 1", -1.0, 1.0)
SPEED = InputKind("-", "a relative speed of at least 0", 0.0)
ANGULAR_SPEED = InputKind("rad/s", "a finite number [rad/s]")
PRESSURE = InputKind("Pa", "an absolute pressure above 0 [Pa]", small=1e5)
HEAD = InputKind("m", "a head whose pressure is above 0 Pa absolute [m]", small=1e5)  # [Pa]
SET_PRESSURE = InputKind("Pa", "an absolute pressure [Pa]")
FLOW = InputKind("m3/s", "a finite number [m3/s]", small=1e-3)
FORCE = InputKind("N", "a finite number [N]", small=1e3)
TORQUE = InputKind("N m", "a finite number [N m]")
VALUE = InputKind("-", "a finite number")


class Input(NamedTuple):
    """Schedule that can be held at a value; kernels read scale * value + offset.

    Under density laws other than `linear`, kernels read the value itself for pressures and heads.
    sort : kind of the input; schedule : its index in the table of schedules
    """

    sort: InputKind
    schedule: int
    scale: float = 1.0
    offset: float = 0.0
    node: int = -1  # node, for a pressure or head
    other: int = -1  # for a value with a sign, the schedule of its negative part
    scalar: int = -1  # scalar whose value flows in


def opening_input(model, name: str) -> dict[str, Input]:
    """Input "opening" of a restriction : key -> input."""
    return {"opening": Input(OPENING, int(model.tables.valves[model.valve_names.index(name)]["schedule"]))}


def scalar_inputs(model, name: str) -> dict[str, Input]:
    """Inputs for the values of scalars that flow in from a node : name of the scalar -> input."""
    i, inputs = model.node_names.index(name), {}
    for q, (scalar, row) in enumerate(zip(model.case.scalars, model.tables.scalars, strict=True)):
        place = int(model.tables.integers[row["places"] + i])
        if place >= 0:
            inputs[scalar] = Input(VALUE, place, scalar=q)
    return inputs

"""One stretch of time for controllers and co-simulation: state in, state out. Knows no sink."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from numbers import Real
from typing import NamedTuple

import numpy as np

from fvsolve.errors import FvsolveError, nearest
from fvsolve.model import Model, State
from fvsolve.model.model import flags_of
from fvsolve.solve.loop import NO_LIMIT, Loop
from fvsolve.steppers import automatic, slots
from fvsolve.units import show


def advance(model: Model, state: State, until: float, inputs: dict[str, float] | None = None) -> State:
    """The state at `until` [s]; `inputs` hold named schedules at a value meanwhile.

    inputs : {"valve.opening": 0.3, "spool.position": -0.1, "lake.head": 12.0, "gate.demand": 0.1}, SI. Raises
    FvsolveError for an input that names nothing or is out of range, a time before the state's, and a run that
    cannot go on.
    """
    if not isinstance(model, Model) or not isinstance(state, State):
        raise FvsolveError(f"advance takes a Model and a State, not {type(model).__name__} and {type(state).__name__}")
    if inputs is not None and not isinstance(inputs, Mapping):
        raise FvsolveError(f"inputs = {show(inputs)} is no table; wanted names with a number each")
    if isinstance(until, bool) or not isinstance(until, Real):
        raise FvsolveError(f"until = {show(until)} is no time; wanted a finite number of seconds")
    if not math.isfinite(until):
        raise FvsolveError(f"until = {until} is no time; wanted a finite number of seconds")
    if not until >= state.t:
        raise FvsolveError(f"until = {until:g} s lies before the state's time, {state.t:g} s")
    model.given(state.t, state.y)
    held = hold(model, inputs or {})
    loop = Loop(held, lambda: model.structure)  # which does not depend on what is held
    loop.now[:] = state.y
    loop.memory[slots.T] = state.t
    loop.armed[:] = flags_of(state, model)
    loop.on_switch = lambda: loop.stop_columns(loop.orders[slots.END])
    adaptive = loop.orders[slots.CONTROL] == slots.TOLERANCE
    for end in [*(t for t, _ in model.breaks if state.t < t < until), until]:
        if end == loop.t:
            continue
        first = loop.t == state.t
        loop.stop_columns(end)
        loop.begin(end, NO_LIMIT)
        if first and adaptive and state.memory.size == 2 + loop.armed.size:
            loop.memory[[slots.STEP, slots.ERROR_OLD]] = state.memory[:2]
        code = loop.run(NO_LIMIT)
        while code == slots.CHUNK and automatic.wants_change(loop.stepper):
            automatic.change(loop.stepper)
            code = loop.run(NO_LIMIT)
        if code != slots.DONE:
            raise FvsolveError(f"advance stopped at t = {loop.t:.6g} s; try a smaller step")
    return State(loop.t, loop.now.copy(), np.append(loop.memory[[slots.STEP, slots.ERROR_OLD]], loop.armed))


class Input(NamedTuple):
    """A schedule that can be held: what kernels read is scale * value + offset, of the kind that is named."""

    kind: str  # "opening" | "position" | "pressure" | "head" | "flow" | "force"
    schedule: int
    scale: float = 1.0
    offset: float = 0.0
    node: int = -1  # of a reservoir
    other: int = -1  # of a spool, the schedule of its edges below zero
    scalar: int = -1  # whose value flows in


def hold(model: Model, inputs: dict[str, float]) -> Model:
    """The same model with schedules held at constant values."""
    if not inputs:
        return model
    tables = model.tables
    schedules, pieces, nodes = tables.schedules.copy(), tables.pieces, tables.nodes.copy()
    scalars = tables.scalars.copy()
    known = input_schedules(model)
    linear = model.case.law.linear
    rows = []
    for name, value in inputs.items():
        if name not in known:
            near = nearest(str(name), known)
            hint = f'; did you mean "{near}"?' if near else f"; inputs are {', '.join(known)}"
            raise FvsolveError(f"no input named {show(name)}{hint}")
        one = known[name]
        found = checked(name, value, one)
        if one.node >= 0 and not linear:  # what is linear in it is made one of pressure, else it stays a head
            nodes["head_given"][one.node] = one.kind == "head"
        else:
            found = one.scale * found + one.offset
        parts = [(one.schedule, found)]
        if one.other >= 0:
            parts = [(one.schedule, max(found, 0.0)), (one.other, max(-found, 0.0))]
        for schedule, part in parts:
            schedules[schedule] = (len(pieces) + len(rows), 1)
            rows.append([-np.inf, 0.0, 0.0, part, 0.0, 0.0, 0.0])
        if one.scalar >= 0:  # which no value may leave
            bounds = scalars[one.scalar]
            bounds["least"], bounds["greatest"] = min(bounds["least"], found), max(bounds["greatest"], found)
    pieces = np.vstack([pieces, rows])
    return replace(model, tables=tables._replace(schedules=schedules, nodes=nodes, scalars=scalars, pieces=pieces))


def checked(name: str, value: float, one: Input) -> float:
    """The value of an input [SI]; FvsolveError where it is no number or none that the part can have."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real):
        raise FvsolveError(f"{name} = {show(value)} is no number; wanted {WANTED[one.kind]}")
    found = float(value)
    if not math.isfinite(found):
        raise FvsolveError(f"{name} = {found} is not finite; wanted {WANTED[one.kind]}")
    if one.kind == "opening" and not 0.0 <= found <= 1.0:
        raise FvsolveError(f"{name} = {found:g} is out of range; wanted {WANTED[one.kind]}")
    if one.kind == "speed" and not found >= 0.0:
        raise FvsolveError(f"{name} = {found:g} is out of range; wanted {WANTED[one.kind]}")
    if one.kind == "position" and not -1.0 <= found <= 1.0:
        raise FvsolveError(f"{name} = {found:g} is out of range; wanted {WANTED[one.kind]}")
    pressure = one.scale * found + one.offset
    if one.node >= 0 and not pressure > 0.0:
        said = f"{name} = {found:g}" + (f" is {pressure:.4g} Pa absolute" if one.kind == "head" else " is a vacuum")
        raise FvsolveError(f"{said}; wanted {WANTED[one.kind]}")
    return found


def torques(model: Model, pump: str, row) -> dict[str, Input]:
    """Torques given to the shaft of a pump."""
    from fvsolve.parts.pump.law import OWN_NUMBERS

    names = [name for name, link in model.case.links.items() if link.kind == "torque" and link.to == f"{pump}.shaft"]
    schedules = model.tables.floats[row["data"] + OWN_NUMBERS :: 2]
    return {f"{name}.torque": Input("torque", int(k)) for name, k in zip(names, schedules, strict=False)}


WANTED = {
    "opening": "a number from 0, shut, to 1, open",
    "pressure": "an absolute pressure above 0 [Pa]",
    "head": "a head whose pressure is above 0 Pa absolute [m]",
    "flow": "a finite number [m3/s]",
    "speed": "a relative speed of at least 0",
    "set pressure": "an absolute pressure [Pa]",
    "position": "a number from -1 to 1",
    "value": "a finite number",
    "force": "a finite number [N]",
    "torque": "a finite number [N m]",
}


def input_schedules(model: Model) -> dict[str, Input]:
    """Input name -> what it holds."""
    rho, weight = model.case.properties.density, model.case.properties.density * model.case.gravity
    found = {}
    nodes = zip(model.node_names, model.case.places.values(), model.tables.nodes, strict=True)
    for i, (name, node, row) in enumerate(nodes):
        index = int(row["schedule"])
        if node.kind == "reservoir":
            ground = model.case.ambient_pressure - weight * float(row["elevation"])
            found[f"{name}.pressure"] = Input("pressure", index, node=i)
            found[f"{name}.head"] = Input("head", index, weight, ground, node=i)
        elif node.kind == "junction":
            found[f"{name}.demand"] = Input("flow", index, rho)
        elif node.kind == "inflow":
            found[f"{name}.flow"] = Input("flow", index, -rho)
        if node.kind in ("reservoir", "inflow"):
            for q, (scalar, one) in enumerate(zip(model.case.scalars, model.tables.scalars, strict=True)):
                place = int(model.tables.integers[one["places"] + i])
                if place >= 0:
                    found[f"{name}.{scalar}"] = Input("value", place, scalar=q)
    for name, row in zip(model.valve_names, model.tables.valves, strict=True):
        if row["schedule"] < 0:
            continue
        if model.case.conduits[name].kind != "spool-valve":
            found[f"{name}.opening"] = Input("opening", int(row["schedule"]))
        elif f"{name}.position" not in found:
            found[f"{name}.position"] = Input("position", int(row["schedule"]))
        elif found[f"{name}.position"].other < 0:
            found[f"{name}.position"] = found[f"{name}.position"]._replace(other=int(row["schedule"]))
    for (name, *_), row in zip(model.devices, model.tables.devices, strict=True):
        link = model.case.conduits.get(name)
        if link is not None and link.kind == "pump":
            found[f"{name}.speed"] = Input("speed", int(row["schedule"]))
            found |= torques(model, name, row)
        elif row["schedule"] >= 0 and hasattr(link, "set_pressure"):
            found[f"{name}.set_pressure"] = Input("set pressure", int(row["schedule"]))
        elif row["schedule"] >= 0 and hasattr(link, "set_flow"):
            found[f"{name}.set_flow"] = Input("flow", int(row["schedule"]), rho)
    pushed = zip((name for name, link in model.case.links.items() if link.kind == "force"),
                 (row for row in model.tables.braces if row["schedule"] >= 0), strict=True)  # fmt: skip
    for name, row in pushed:
        found[f"{name}.force"] = Input("force", int(row["schedule"]))
    return found

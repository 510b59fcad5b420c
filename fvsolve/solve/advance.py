"""One stretch of time for controllers and co-simulation: state in, state out. Knows no sink."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fvsolve.errors import FvsolveError, nearest
from fvsolve.kernels import records as rec
from fvsolve.model import Model, State
from fvsolve.solve.loop import NO_LIMIT, Loop
from fvsolve.steppers import erk


def advance(model: Model, state: State, until: float, inputs: dict[str, float] | None = None) -> State:
    """The state at `until` [s]; `inputs` hold named schedules at a value meanwhile.

    inputs : {"valve.opening": 0.3, "lake.head": 12.0, "gate.demand": 0.1}, SI. Raises FvsolveError for an
    input that names nothing, a time before the state's, and a run that cannot go on.
    """
    if not until >= state.t:
        raise FvsolveError(f"until = {until:g} s lies before the state's time, {state.t:g} s")
    held = hold(model, inputs or {})
    loop = Loop(held)
    loop.now[:] = state.y
    loop.memory[erk.T] = state.t
    adaptive = loop.orders[erk.CONTROL] == erk.TOLERANCE
    for end in [*(t for t, _ in model.breaks if state.t < t < until), until]:
        if end == loop.t:
            continue
        first = loop.t == state.t
        loop.begin(end, NO_LIMIT)
        if first and adaptive and state.memory.size == 2:
            loop.memory[[erk.STEP, erk.ERROR_OLD]] = state.memory
        if loop.run(NO_LIMIT) != erk.DONE:
            raise FvsolveError(f"advance stopped at t = {loop.t:.6g} s; try a smaller step")
    return State(loop.t, loop.now.copy(), loop.memory[[erk.STEP, erk.ERROR_OLD]].copy())


def hold(model: Model, inputs: dict[str, float]) -> Model:
    """The same model with schedules held at constant values."""
    if not inputs:
        return model
    tables = list(model.tables)
    schedules, pieces = tables[rec.I_SCHEDULES].copy(), tables[rec.I_PIECES]
    known = input_schedules(model)
    rows = []
    for name, value in inputs.items():
        if name not in known:
            near = nearest(name, known)
            hint = f'; did you mean "{near}"?' if near else f"; inputs are {', '.join(known)}"
            raise FvsolveError(f'no input named "{name}"{hint}')
        index, scale, offset = known[name]
        schedules[index] = (len(pieces) + len(rows), 1)
        rows.append([-np.inf, 0.0, 0.0, scale * float(value) + offset, 0.0, 0.0, 0.0])
    tables[rec.I_SCHEDULES] = schedules
    tables[rec.I_PIECES] = np.vstack([pieces, rows])
    return replace(model, tables=tuple(tables))


def input_schedules(model: Model) -> dict[str, tuple[int, float, float]]:
    """Input name -> (schedule, scale, offset) from its SI value to what kernels read."""
    rho, weight = model.case.properties.density, model.case.properties.density * model.case.gravity
    found = {}
    for name, node, row in zip(model.node_names, model.case.nodes.values(), model.tables[rec.I_NODES], strict=True):
        index = int(row["schedule"])
        if node.kind == "reservoir":
            found[f"{name}.pressure"] = index, 1.0, 0.0
            found[f"{name}.head"] = index, weight, model.case.ambient_pressure - weight * row["elevation"]
        elif node.kind == "junction":
            found[f"{name}.demand"] = index, rho, 0.0
        elif node.kind == "inflow":
            found[f"{name}.flow"] = index, -rho, 0.0
    for name, row in zip(model.valve_names, model.tables[rec.I_VALVES], strict=True):
        found[f"{name}.opening"] = int(row["schedule"]), 1.0, 0.0
    return found

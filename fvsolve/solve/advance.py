"""Advance a state over an interval of time, for controllers and co-simulation."""

import math
from collections.abc import Mapping
from dataclasses import replace
from numbers import Real

import numpy as np

from fvsolve.assembly.lowering import HEAD, Input
from fvsolve.errors import FvsolveError, nearest
from fvsolve.model import Model, State
from fvsolve.model.model import flags_of, inputs_of
from fvsolve.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.steppers import automatic, loop_records
from fvsolve.units import show


def advance(model: Model, state: State, until: float, inputs: dict[str, float] | None = None) -> State:
    """Advance `state` to the time `until` [s], with named inputs held at constant values; returns the new state.

    inputs : SI values, such as {"valve.opening": 0.3, "spool.position": -0.1, "lake.head": 12.0, "gate.demand": 0.1}
    Raises FvsolveError for a state that does not fit the model, an unknown input or a value out of range, a time before
    the time of the state, and a run that cannot continue.
    """
    if not isinstance(model, Model) or not isinstance(state, State):
        raise FvsolveError(f"advance takes a Model and a State, not {type(model).__name__} and {type(state).__name__}")
    if inputs is not None and not isinstance(inputs, Mapping):
        raise FvsolveError(f"inputs = {show(inputs)} is not a dict. Expected a number for each name of an input")
    if isinstance(until, bool) or not isinstance(until, Real):
        raise FvsolveError(f"until = {show(until)} is not a time. Expected a finite number of seconds")
    if not math.isfinite(until):
        raise FvsolveError(f"until = {until} is not a time. Expected a finite number of seconds")
    if not until >= state.t:
        text = f"until = {until:g} s is before the time of the state, {state.t:g} s"
        raise FvsolveError(f"{text}. Expected at least {state.t:g} s")
    model.checked(state.t, state.y)
    held = hold(model, inputs or {})
    loop = RunLoop(held, lambda: model.structure)  # the structure does not depend on the held inputs
    loop.now[:] = state.y
    loop.state["t"] = state.t
    loop.armed[:] = flags_of(state, model)
    loop.run_data.discrete[:] = state.memory.get("discrete", model.discrete)
    loop.run_data.restore_history(state)
    loop.on_switch = lambda: loop.stop_columns(loop.control["end"])
    adaptive = loop.control["mode"] == loop_records.TOLERANCE
    for end in [*(t for t, _ in model.breaks if state.t < t < until), until]:
        if end == loop.t:
            continue
        first = loop.t == state.t
        loop.stop_columns(end)
        loop.begin(end, NO_LIMIT)
        if first and adaptive and "step" in state.memory:
            loop.state["step"], loop.state["error_old"] = state.memory["step"]
        code = loop.run(NO_LIMIT)
        while code == loop_records.BUDGET_SPENT and automatic.is_change_due(loop.stepper):
            automatic.change(loop.stepper)
            code = loop.run(NO_LIMIT)
        if code != loop_records.DONE:
            raise FvsolveError(f"advance stopped: {loop.failure_text(code)}")
    memory = {"step": np.array([loop.state["step"], loop.state["error_old"]]), "armed": loop.armed.copy()}
    if len(model.discrete):
        memory["discrete"] = loop.run_data.discrete.copy()
    if len(model.tables.delays):
        memory["past"] = loop.run_data.past.copy()
    if loop.run_data.histories.size:
        memory["histories"] = loop.run_data.histories.copy()
    return State(loop.t, loop.now.copy(), memory)


def hold(model: Model, inputs: dict[str, float]) -> Model:
    """Copy of a model with some inputs held at constant values: name of the input -> SI value.

    Raises FvsolveError for an unknown input and for a value out of range.
    """
    if not inputs:
        return model
    tables = model.tables
    schedules, pieces, nodes = tables.schedules.copy(), tables.pieces, tables.nodes.copy()
    scalars, known, linear, rows = tables.scalars.copy(), inputs_of(model), model.case.law.linear, []
    controls = tables.controls.copy()
    for name, value in inputs.items():
        if name not in known:
            near = nearest(str(name), known)
            hint = f'; did you mean "{near}"?' if near else f"; expected one of {', '.join(known)}"
            raise FvsolveError(f"no input named {show(name)}{hint}")
        target = known[name]
        converted = checked(name, value, target)
        if target.control >= 0:
            controls["held"][target.control] = converted
            continue
        if target.node >= 0 and not linear:  # under the linear law a head becomes a pressure, else it stays a head
            nodes["head_given"][target.node] = target.sort is HEAD
        else:
            converted = target.scale * converted + target.offset
        parts = [(target.schedule, converted), *((k, max(0.0, a * converted + b)) for k, a, b in target.parts)]
        for schedule, part in parts:
            schedules[schedule] = (len(pieces) + len(rows), 1)
            rows.append([-np.inf, 0.0, 0.0, part, 0.0, 0.0, 0.0])
        if target.scalar >= 0:  # values of a scalar are limited to its bounds
            bounds = scalars[target.scalar]
            bounds["least"], bounds["greatest"] = min(bounds["least"], converted), max(bounds["greatest"], converted)
    pieces = np.vstack([pieces, *([rows] if rows else [])])
    changed = {"schedules": schedules, "nodes": nodes, "scalars": scalars, "pieces": pieces, "controls": controls}
    return replace(model, tables=tables._replace(**changed))


def checked(name: str, value: float, target: Input) -> float:
    """Value of an input as a float; raises FvsolveError if it is not a number or out of the range of the input."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real):
        raise FvsolveError(f"{name} = {show(value)} is not a number. Expected {target.sort.expected}")
    number = float(value)
    if not math.isfinite(number):
        raise FvsolveError(f"{name} = {number} is not finite. Expected {target.sort.expected}")
    if not target.sort.least <= number <= target.sort.greatest:
        raise FvsolveError(f"{name} = {number:g} is out of range. Expected {target.sort.expected}")
    pressure = target.scale * number + target.offset
    if target.node >= 0 and not pressure > 0.0:
        text = f"{name} = {number:g}" + (f" is {pressure:.4g} Pa absolute" if target.sort is HEAD else " is a vacuum")
        raise FvsolveError(f"{text}. Expected {target.sort.expected}")
    return number

"""Advance a state over an interval of time, for controllers and co-simulation."""

import math
from bisect import bisect_left, bisect_right
from collections.abc import Mapping
from numbers import Real
from operator import itemgetter

import numpy as np

from fvsolve.core.model import Model, State
from fvsolve.core.solve.reused_loop import reused_loop
from fvsolve.core.solve.run_loop import NO_LIMIT
from fvsolve.core.steppers import automatic, loop_records
from fvsolve.errors import FvsolveError
from fvsolve.units import show


def advance(
    model: Model, state: State, until: float, inputs: dict[str, float] | None = None
) -> State:
    """Advance `state` to the time `until` [s], with named inputs held at constant values; returns the new state.

    inputs : SI values, such as {"valve.opening": 0.3, "spool.position": -0.1, "lake.head": 12.0, "gate.demand": 0.1}
    Raises FvsolveError for a state that does not fit the model, an unknown input or a value out of range, a time before
    the time of the state, and a run that cannot continue.
    """
    if not isinstance(model, Model) or not isinstance(state, State):
        raise FvsolveError(
            f"advance takes a Model and a State, not {type(model).__name__} and {type(state).__name__}"
        )
    if inputs is not None and not isinstance(inputs, Mapping):
        raise FvsolveError(
            f"inputs = {show(inputs)} is not a dict; expected a number for each name of an input"
        )
    if isinstance(until, bool) or not isinstance(until, Real):
        raise FvsolveError(
            f"until = {show(until)} is not a time; expected a finite number of seconds"
        )
    if not math.isfinite(until):
        raise FvsolveError(f"until = {until} is not a time; expected a finite number of seconds")
    if not until >= state.t:
        text = f"until = {until:g} s is before the time of the state, {state.t:g} s"
        raise FvsolveError(f"{text}; expected at least {state.t:g} s")
    model.checked(state.t, state.y)
    reused = reused_loop(model, inputs or {})
    loop = reused.start(state)
    adaptive = loop.control["mode"] == loop_records.TOLERANCE
    first_break = bisect_right(model.breaks, state.t, key=itemgetter(0))
    breaks = model.breaks[first_break : bisect_left(model.breaks, until, key=itemgetter(0))]
    for end in [*(t for t, _ in breaks), until]:
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
    memory = {
        "step": np.array([loop.state["step"], loop.state["error_old"]]),
        "armed": loop.armed.copy(),
    }
    memory |= {name: array.copy() for name, array in loop.run_data.arrays().items() if array.size}
    end = State(loop.t, loop.now.copy(), memory)
    if reused.is_reusable:
        reused.state = end
        model.idle_loops.append(reused)
    return end


def observe(model: Model, state: State, inputs: Mapping[str, float]) -> np.ndarray:
    """Values of all probes in a state, as `Model.observe`, with named inputs held at constant values [SI]."""
    reused = reused_loop(model, inputs)
    values = reused.observe(state)
    model.idle_loops.append(reused)
    return values

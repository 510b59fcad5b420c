"""Loop of `advance` that later calls use again; each call starts with the arrays of a new loop."""

from collections.abc import Mapping

import numpy as np

from fvsolve.core.model import Model, State
from fvsolve.core.model.model import flags_of
from fvsolve.core.solve.held_inputs import HeldModel
from fvsolve.core.solve.run_loop import RunLoop
from fvsolve.core.steppers.integrator import all_arrays
from fvsolve.core.steppers.run_handle import RunArrays

# Handles, made anew where an array is replaced, and rows of output, which `advance` neither writes nor reads.
HANDLES, UNUSED = ("features", "memory"), ("calls", "spare", "rows", "coefficients", "dense")


class ReusedLoop:
    """Loop of a model with named inputs held at constant values.

    A new loop takes about 0.3 ms; with `start` a used loop equals a new loop, since all its arrays are reset.
    Raises FvsolveError for an unknown input and for a value out of range.
    """

    def __init__(self, model: Model, inputs: Mapping[str, float]) -> None:
        self.held = HeldModel(model, inputs)
        self.inputs = dict(inputs)
        self.held.write(inputs)
        self.model = self.held.model if inputs else model
        # the structure of the Jacobian does not depend on values of inputs
        self.loop = loop = RunLoop(self.model, lambda: model.structure)
        loop.on_switch = lambda: loop.stop_columns(loop.control["end"])
        written = loop.run_data.written
        stepper = dict(zip(RunArrays._fields, all_arrays(loop.stepper), strict=True))
        arrays = [array for name, array in written._asdict().items() if name not in HANDLES]
        arrays += [array for name, array in stepper.items() if name not in UNUSED]
        pairs = zip(loop.run_data.tables, self.model.tables, strict=True)
        # a run changes its own copies
        arrays += [own for own, shared in pairs if own is not shared]
        # words of 8 bytes of all arrays
        words = [
            array.reshape(-1).view(np.int64)
            for array in arrays
            if array.size and array.flags.writeable
        ]
        uniform = [bool((word == word[0]).all()) for word in words]
        self.fills = [
            (word, int(word[0])) for word, alike in zip(words, uniform, strict=True) if alike
        ]
        self.copies = [
            (word, word.copy()) for word, alike in zip(words, uniform, strict=True) if not alike
        ]
        self.histories = {name: array.copy() for name, array in loop.run_data.arrays().items()}
        self.state: State | None = None  # state in which the loop is, as `advance` returned it

    @property
    def is_reusable(self) -> bool:
        """True if the loop has still the arrays of its start: `auto` replaces them where it changes the method."""
        return self.loop.state["switches"] == 0.0

    def accepts(self, inputs: Mapping[str, float]) -> bool:
        """True if the loop can hold these inputs, whose values are then written. Raises FvsolveError as `__init__`."""
        if self.held.names != tuple(inputs) or self.held.fixed and self.inputs != inputs:
            return False
        self.held.write(inputs)
        return True

    def start(self, state: State) -> RunLoop:
        """Loop at a state, equal to a new loop. Raises ValueError if the state has no history that the model needs."""
        loop, run_data, self.state = self.loop, self.loop.run_data, None
        for words, value in self.fills:
            words.fill(value)
        for words, values in self.copies:
            words[:] = values
        loop.switched, loop.at_once, loop.last_switch, loop.event_fault = [], 0, np.nan, ""
        loop.recent_events.clear()
        run_data.use_flags(run_data.armed)
        for name, first in self.histories.items():
            if first.size and not state.memory:
                run_data.set_array(name, first.copy())
        loop.now[:] = state.y
        loop.state["t"] = state.t
        loop.armed[:] = flags_of(state, self.model)
        run_data.restore_history(state)
        return loop

    def observe(self, state: State) -> np.ndarray:
        """Values of all probes in a state, equal to `Model.observe`."""
        if self.state is not state:
            self.model.checked(state.t, state.y)
            self.start(state)
        run_data, self.state = self.loop.run_data, None  # flags may change
        return run_data.observe(
            state.t, state.y, run_data.evaluate_checked(state.t, state.y, np.inf)[1]
        )


def reused_loop(model: Model, inputs: Mapping[str, float]) -> ReusedLoop:
    """Loop of a model with these inputs: one that no call uses at present, or a new loop."""
    try:
        reused = model.idle_loops.pop()  # atomic: no other thread gets the same object
    except IndexError:
        return ReusedLoop(model, inputs)
    return reused if reused.accepts(inputs) else ReusedLoop(model, inputs)

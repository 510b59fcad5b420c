"""Model of a case, the state that a run advances, and the inputs of a model."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.core.assembly.lowering import Input, lowering_of
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.compiled_case import CompiledCase, as_numbers, as_time
from fvsolve.core.model.run_data import RunData
from fvsolve.display import Displayable
from fvsolve.errors import FvsolveError
from fvsolve.units import show


@dataclass(repr=False)
class State(Displayable):
    """Time [s], flat state vector y, and memory of the run as arrays by name (empty at a fresh start).

    memory : data of step control, event flags, and with delay lines the history of their waves
    """

    t: float
    y: np.ndarray
    memory: dict[str, np.ndarray] = field(default_factory=dict)

    picture = "fvsolve.report.draw.object_pictures:state_figure"

    def __post_init__(self) -> None:
        self.t = as_time(self.t)
        self.y = as_numbers("y", self.y)
        if self.y.ndim != 1:
            raise FvsolveError(
                f"y has shape {self.y.shape}; expected a one-dimensional array of numbers"
            )
        if not isinstance(self.memory, dict):
            raise FvsolveError(
                f"memory is of type {type(self.memory).__name__}; expected a dict of arrays by name"
            )

    def summary_line(self) -> str:
        return f"at t = {self.t:g} s: {self.y.size} numbers"

    def table_columns(self) -> dict[str, np.ndarray]:
        return {"y": self.y}


def flags_of(state: State, model: Model) -> np.ndarray:
    """Event flags (as `RunData.armed`) of a state that `advance` returned; those of a start for any other state."""
    flags = state.memory["armed"] if "step" in state.memory else None
    return flags if flags is not None and flags.size == model.shapes.armed else model.flags


def as_limit(limit: Any) -> float:
    """Time from which on schedules keep their left limit, as a float [s]; may be infinite.

    Raises FvsolveError if the argument is not a time.
    """
    value = as_numbers("limit", limit)
    if value.ndim or np.isnan(value):
        raise FvsolveError(
            f"limit = {show(value)} is not a time; expected a number of seconds, or infinity"
        )
    return float(value)


@dataclass(frozen=True, eq=False, repr=False)
class Model(CompiledCase, Displayable):
    """Compiled case whose right-hand side and probes can be evaluated at any state."""

    # idle run data for evaluating single states
    idle_run_data: deque[RunData] = field(default_factory=deque, init=False)
    # loops of `advance` that no call uses
    idle_loops: deque = field(default_factory=deque, init=False)

    picture = "fvsolve.report.draw.object_pictures:model_figure"

    def summary_line(self) -> str:
        cells = f", {self.all_cells} cells" if self.all_cells else ""
        return f"of {self.case.name!r}: {self.y_size} states{cells}, {len(self.probes)} probes"

    def table_columns(self) -> dict[str, Any]:
        return {"state": self.state_names, "start": self.start, "scale": self.scale}

    @property
    def wave_rate(self) -> float:
        """Greatest of `wave_rates` [1/s]; with meshes at least the step-limiting rate of all parts at the start."""
        rate = float(self.wave_rates.max(initial=0.0))
        if not self.meshed:
            return rate
        return max(rate, float(self.evaluate(self.case.numerics.start, self.start)[1][rec.RATE]))

    def rhs(self, t: float | State, y: np.ndarray | None = None) -> np.ndarray:
        """Right-hand side dy/dt = f(t, y) : float64[n].

        Schedules take their right limit at t; devices are in the position in which a run would start at (t, y).
        With delay lines the argument must be a `State`, whose memory contains their history (without memory no waves
        arrive); otherwise FvsolveError is raised.
        """
        if isinstance(t, State) and y is None:
            with self.run_data() as run_data:
                run_data.restore_history(t)
                return run_data.evaluate(t.t, t.y, np.inf)[0]
        self.refuse_histories("rhs")
        return self.evaluate(t, y)[0]

    def refuse_histories(self, function: str) -> None:
        """Raise FvsolveError if the model has delay lines or blocks with a delay: their history is not part of y."""
        for feature in self.features:
            if text := feature.refusal(function):
                raise FvsolveError(text)

    def evaluate(
        self, t: float, y: np.ndarray, limit: float = np.inf
    ) -> tuple[np.ndarray, np.ndarray]:
        """Right-hand side and further values at (t, y), see `rhs` : (dydt, out).

        From time `limit` [s] on, schedules keep their left limit at `limit`. Delay lines are allowed, but no waves
        arrive from them.
        """
        limit = as_limit(limit)
        with self.run_data() as run_data:
            return run_data.evaluate(t, y, limit)

    @contextmanager
    def run_data(self, armed: np.ndarray | None = None) -> Iterator[RunData]:
        """Context with run data for evaluating single states, which later calls use again.

        armed : event flags; None for those of a start. First occurrences and extremes in these data have no meaning.
        """
        try:
            run_data = self.idle_run_data.pop()  # atomic: no other thread gets the same object
        except IndexError:
            run_data = RunData(self)
        run_data.reset(armed)
        yield run_data
        self.idle_run_data.append(run_data)

    def jacobian(self, t: float, y: np.ndarray) -> np.ndarray:
        """Jacobian df/dy : float64[n, n], by central differences with steps of 1e-6 (scale + |y|).

        Raises FvsolveError if the model has delay lines.
        """
        self.refuse_histories("jacobian")
        return self.jacobian_without_delays(t, y)

    def jacobian_without_delays(self, t: float, y: np.ndarray) -> np.ndarray:
        """Jacobian as `jacobian`, where delay lines are allowed, but no waves arrive from them."""
        (t, y), n = self.checked(t, y), self.y_size
        jacobian = np.empty((n, n))
        for j in range(n):
            step = 1e-6 * (self.scale[j] + abs(y[j]))
            high, low = y.copy(), y.copy()
            high[j] += step
            low[j] -= step
            jacobian[:, j] = (self.evaluate(t, high)[0] - self.evaluate(t, low)[0]) / (
                high[j] - low[j]
            )
        return jacobian

    def observe(
        self, t: float | State, y: np.ndarray | None = None, limit: float = np.inf
    ) -> np.ndarray:
        """Values of all probes, in the order of `.probes`, at a `State` or at (t, y) : float64[probes] [SI].

        Devices are in the position of a start at (t, y), or as stored in a state that `advance` returned. Delay lines
        contain the waves in the memory of the `State`; at (t, y) they are empty. From time `limit` [s] on, schedules
        keep their left limit at `limit`.
        """
        armed = None
        limit = as_limit(limit)
        past = None
        if isinstance(t, State) and y is None:
            t, y, armed, past = t.t, t.y, flags_of(t, self), t
        t, y = self.checked(t, y)
        with self.run_data(armed) as run_data:
            run_data.restore_history(past)
            return run_data.observe(t, y, run_data.evaluate(t, y, limit)[1])

    @property
    def checks(self) -> dict[str, Any]:
        """Facts about the compiled case, for `fvsolve check`."""
        from fvsolve.core.model.model_facts import checks

        return checks(self)


def inputs_of(model: Model) -> dict[str, Input]:
    """Inputs of all parts : name `PART.KEY` -> input."""
    case = model.case
    parts = {**case.places, **{name: case.conduits[name] for name in model.valve_names}}
    parts |= {name: link for name, link in case.links.items() if name not in parts}
    inputs: dict[str, Input] = {}
    of_features = {
        name: value for feature in model.features for name, value in feature.inputs(model).items()
    }
    for name, part in parts.items():
        own = lowering_of(type(part)).of(part).inputs(model, name, part)
        inputs |= {f"{name}.{key}": value for key, value in own.items()}
        inputs |= {
            key: value for key, value in of_features.items() if key.rpartition(".")[0] == name
        }
    return inputs | of_features

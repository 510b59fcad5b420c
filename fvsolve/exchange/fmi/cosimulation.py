"""Case as a co-simulation slave: the part of an FMU that runs in the Python of its host."""

import io
import sys
from pathlib import Path

import numpy as np

from fvsolve.case import load
from fvsolve.core.model import State, build
from fvsolve.core.solve import advance, initial_state
from fvsolve.core.solve.advance import observe
from fvsolve.core.solve.held_inputs import checked
from fvsolve.errors import FvsolveError
from fvsolve.exchange.fmi.variables import free_inputs, variables_of

CASE_FOLDER = "case"  # folder of the case and its files in the resources of an FMU
WARNING, ERROR = 1, 3  # status of a log message (FMI 2.0.4, section 2.1.3)
TIME_TOLERANCE = 1e-6  # difference of the times of host and FMU, over the step


class CoSimulation:
    """Methods that PythonFMU's binary calls, for a class that also derives from its `Fmi2Slave`.

    Variables are those of `variables_of`, by value reference. An input that the host has not set follows the case; from
    the first value on it is held at its last value.
    """

    resources: str
    instance_name: str

    def start(self) -> None:
        """Build the model of the case in the resources, and set its initial state."""
        (path,) = Path(self.resources, CASE_FOLDER).glob("*.toml")
        try:
            self.model = build(load(path))
        except FvsolveError as error:  # such as a part that is registered in another place
            self.refuse(str(error))
        self.targets, self.variables = free_inputs(self.model), variables_of(self.model)
        names = [probe.text for probe in self.model.probes]
        self.places = [None if item.is_input else names.index(item.name) for item in self.variables]
        # other names of the same key, such as the head and the pressure of a reservoir
        self.aliases = {
            name: [
                other
                for other, its in self.targets.items()
                if other != name and its.schedule == target.schedule
            ]
            for name, target in self.targets.items()
        }
        self.state, self.held, self.observed = initial_state(self.model), {}, None

    def report(self, status: int, text: str) -> None:
        """Print a message on standard error, and log it; without debug logging hosts show no log."""
        print(f"fvsolve FMU {self.instance_name}: {text}", file=sys.stderr, flush=True)
        self.log(text, status, "logStatusWarning" if status == WARNING else "logStatusError")

    def setup_experiment(
        self, start_time: float, stop_time: float | None, tolerance: float | None
    ) -> None:
        """Check the times of the host against those of the case."""
        numerics = self.model.case.numerics
        if start_time != numerics.start:
            text = (
                f"the start time is {start_time:g} s, but the case starts at {numerics.start:g} s"
            )
            self.refuse(f"{text}; expected startTime = {numerics.start:g}")
        if stop_time is not None and stop_time > numerics.end:
            text = f"the stop time is {stop_time:g} s; kinks of schedules after numerics.end = {numerics.end:g} s"
            self.report(WARNING, f"{text} are not located. Export the case with a later end")

    def refuse(self, text: str) -> None:
        """Report an error and raise FvsolveError."""
        self.report(ERROR, text)
        raise FvsolveError(text)

    def do_step(self, current_time: float, step_size: float) -> bool:
        """Advance to the end of a communication step; False if the run cannot continue, and the state is as before."""
        if abs(current_time - self.state.t) > max(
            TIME_TOLERANCE * step_size, 1e-12 * abs(current_time)
        ):
            text = f"the host is at t = {current_time:.9g} s, and the FMU at {self.state.t:.9g} s"
            self.refuse(
                f"{text}; expected equal times; fmi2SetFMUstate goes back to an earlier time"
            )
        try:
            self.state = advance(self.model, self.state, current_time + step_size, self.held)
        except FvsolveError as error:
            self.report(ERROR, str(error))
            return False
        self.observed = None
        return True

    def get_real(self, references: list[int]) -> list[float]:
        """Values of variables [SI]; outputs belong to the present state and to the values of inputs."""
        if self.observed is None:
            self.observed = observe(self.model, self.state, self.held).tolist()
        return [self.value(k) for k in references]

    def value(self, reference: int) -> float:
        """Value of a variable [SI]: of a probe, or of an input as last set, or as at the start."""
        place = self.places[reference]
        if place is not None:
            return self.observed[place]
        variable = self.variables[reference]
        return self.held.get(variable.name, variable.start)

    def set_real(self, references: list[int], values: list[float]) -> None:
        """Hold inputs at values [SI]."""
        for reference, value in zip(references, values, strict=True):
            name = self.variables[reference].name
            if name not in self.targets:
                self.refuse(
                    f"{name} is an output of the FMU, which cannot be set; expected an input"
                )
            try:
                number = checked(name, value, self.targets[name])
            except FvsolveError as error:
                self.refuse(str(error))
            for other in self.aliases[name]:
                self.held.pop(other, None)
            self.held[name] = number
        self.observed = None

    def _get_fmu_state(self) -> tuple[State, dict[str, float]]:
        return self.state, dict(self.held)

    def _set_fmu_state(self, state: tuple[State, dict[str, float]]) -> None:
        self.state, self.held, self.observed = state[0], dict(state[1]), None

    @staticmethod
    def _fmu_state_to_bytes(state: tuple[State, dict[str, float]]) -> bytes:
        (now, held), file = state, io.BytesIO()
        arrays = {f"memory {name}": array for name, array in now.memory.items()}
        arrays |= {f"input {name}": np.float64(value) for name, value in held.items()}
        np.savez(file, t=np.float64(now.t), y=now.y, **arrays)
        return file.getvalue()

    @staticmethod
    def _fmu_state_from_bytes(data: bytes) -> tuple[State, dict[str, float]]:
        with np.load(io.BytesIO(data), allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        parts = {
            kind: {
                name.removeprefix(kind): array
                for name, array in arrays.items()
                if name.startswith(kind)
            }
            for kind in ("memory ", "input ")
        }
        state = State(float(arrays["t"]), arrays["y"], parts["memory "])
        return state, {name: float(value) for name, value in parts["input "].items()}

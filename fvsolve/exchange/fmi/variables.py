"""Variables of an FMU: inputs that a host can hold, and outputs, which are the probes."""

import math
from dataclasses import dataclass

from fvsolve import units
from fvsolve.core.assembly.lowering import Input
from fvsolve.core.model import Model
from fvsolve.core.model.model import inputs_of
from fvsolve.core.solve.held_inputs import input_value
from fvsolve.errors import CaseError, Fault


@dataclass(frozen=True)
class Variable:
    """Variable of an FMU; its value reference is its index in the list of all variables.

    unit : SI unit, "" for none; description : text for the user
    start, least, greatest : value at the start and range, of inputs; start is None for outputs
    display : (unit of `[output]`, factor, offset) with number = factor * SI value + offset, or None
    """

    name: str
    unit: str
    description: str
    start: float | None = None
    least: float = -math.inf
    greatest: float = math.inf
    display: tuple[str, float, float] | None = None

    @property
    def is_input(self) -> bool:
        return self.start is not None


def free_inputs(model: Model) -> dict[str, Input]:
    """Inputs that a host can hold : name -> input.

    These are all keys that take a schedule and all setpoints, except those that a control drives.
    """
    schedules = model.tables.schedules
    return {
        name: target
        for name, target in inputs_of(model).items()
        if target.held is None and schedules[target.schedule]["pieces"] != 0  # 0: follows a control
    }


def variables_of(model: Model) -> list[Variable]:
    """Variables of the FMU of a model: inputs, then the probes in the order of `model.probes`.

    A probe that only `[expect]` or `[compare]` names is left out if an input has its name. Raises CaseError for each
    probe of `[output]` with the name of an input.
    """
    start, inputs = model.case.numerics.start, []
    for name, target in free_inputs(model).items():
        value, sort = input_value(model, start, model.start, target), target.sort
        if math.isfinite(value):  # without gravity there is no head
            inputs.append(
                Variable(
                    name, unit_name(sort.unit), sort.expected, value, sort.least, sort.greatest
                )
            )
    taken = {variable.name for variable in inputs}
    stated = {probe.text for probe in model.case.output.probes}
    faults = [
        shared_name(probe) for probe in model.probes if probe.text in taken and probe.text in stated
    ]
    if faults:
        raise CaseError(faults, f"{model.case.name}.toml")
    outputs = [
        output_variable(model.case, probe) for probe in model.probes if probe.text not in taken
    ]
    return inputs + list({variable.name: variable for variable in outputs}.values())


def shared_name(probe) -> Fault:
    """Fault of a probe with the name of an input."""
    text = f'"{probe.text}" is the name of an input and of a probe, and variables of an FMU cannot share a name'
    return Fault(
        "output.probes",
        f'{text}; expected "{probe.part}.{probe.text}" for the probe, or no such probe',
    )


def unit_name(si: str) -> str:
    """Name of an SI unit in an FMU: "1" for numbers without unit."""
    return "1" if si == "-" else si


def output_variable(case, probe) -> Variable:
    """Output with the value of a probe."""
    unit = probe.unit or unit_name(units.DIMENSIONS[probe.dimension].si)
    text = f"{probe.quantity.replace('_', ' ')} of {probe.name}"
    stated, display = case.unit_of(probe.dimension), None
    if not probe.unit and stated != unit and probe.dimension != "number":
        offset, unity = (
            units.convert(value, probe.dimension, stated, case.ambient_pressure)
            for value in (0.0, 1.0)
        )
        display = stated, float(unity - offset), float(offset)
    return Variable(probe.text, unit, text, display=display)

"""All inputs of a model."""

from __future__ import annotations

from fvsolve.assembly.inputs import Input
from fvsolve.assembly.lowering import lowering_of
from fvsolve.model.model import Model


def inputs_of(model: Model) -> dict[str, Input]:
    """Inputs of all parts : name `PART.KEY` -> input."""
    case = model.case
    parts = {**case.places, **{name: case.conduits[name] for name in model.valve_names}}
    parts |= {name: link for name, link in case.links.items() if name not in parts}
    inputs: dict[str, Input] = {}
    for name, part in parts.items():
        own = lowering_of(type(part)).of(part).inputs(model, name, part)
        inputs |= {f"{name}.{key}": value for key, value in own.items()}
    return inputs

"""Inputs of a model held at constant values."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from numbers import Real

import numpy as np

from fvsolve.core.assembly.lowering import HEAD, PRESSURE, Input
from fvsolve.core.assembly.schedule_tables import value_at
from fvsolve.core.model import Model
from fvsolve.core.model.model import inputs_of
from fvsolve.errors import FvsolveError, nearest
from fvsolve.units import show


class HeldModel:
    """Copy of a model with some inputs held at constant values; the values can be changed.

    model : the copy; names : names of the inputs
    fixed : True if a loop of the copy depends on the values from its start: bounds of values, step limits of meshes
    Raises FvsolveError for an unknown input.
    """

    def __init__(self, model: Model, names: Iterable[str]) -> None:
        self.names, self.linear, known = tuple(names), model.case.law.linear, inputs_of(model)
        for name in self.names:
            if name not in known:
                near = nearest(str(name), known)
                hint = (
                    f'; did you mean "{near}"?' if near else f"; expected one of {', '.join(known)}"
                )
                raise FvsolveError(f"no input named {show(name)}{hint}")
        self.targets, tables = [known[name] for name in self.names], model.tables
        self.fixed = bool(self.targets) and (
            bool(model.meshed) or any(target.bounds is not None for target in self.targets)
        )
        schedules = tables.schedules.copy()
        nodes = tables.nodes.copy()
        first = len(tables.pieces)
        used = [
            at
            for target in self.targets
            if target.held is None
            for at in (target.schedule, *(part[0] for part in target.parts))
        ]
        pieces = np.vstack([tables.pieces, *[[-np.inf, *[0.0] * 6]] * len(used)])
        for row, schedule in enumerate(used, first):
            schedules[schedule] = row, 1
        for target in self.targets:
            # under the linear law a head becomes a pressure
            if target.node >= 0 and not self.linear:
                nodes["head_given"][target.node] = target.sort is HEAD
        features = [feature.to_hold() for feature in model.features]
        changed = {"schedules": schedules, "nodes": nodes, "pieces": pieces}
        self.values = pieces[first:, 3]  # a view that stays writable, while tables are read-only
        self.of_features = {feature.slot: values for feature, values in features}
        self.model = replace(
            model, tables=tables._replace(**changed), features=[feature for feature, _ in features]
        )

    def write(self, inputs: Mapping[str, float]) -> None:
        """Write the values of all inputs [SI], in the order of `names`; raises FvsolveError for one out of range."""
        row = 0
        for target, (name, value) in zip(self.targets, inputs.items(), strict=True):
            number = checked(name, value, target)
            if target.held is not None:
                slot, place = target.held
                self.of_features[slot][place] = number
                continue
            if target.node < 0 or self.linear:
                number = target.scale * number + target.offset
            values = [number, *(max(0.0, a * number + b) for _, a, b in target.parts)]
            self.values[row : row + len(values)] = values
            row += len(values)
            if target.bounds is not None:
                slot, place = target.bounds
                bounds = self.of_features[slot][place]
                bounds["least"], bounds["greatest"] = (
                    min(bounds["least"], number),
                    max(bounds["greatest"], number),
                )


def hold(model: Model, inputs: Mapping[str, float]) -> Model:
    """Copy of a model with some inputs held at constant values: name of the input -> SI value.

    Raises FvsolveError for an unknown input and for a value out of range.
    """
    if not inputs:
        return model
    held = HeldModel(model, inputs)
    held.write(inputs)
    return held.model


def checked(name: str, value: float, target: Input) -> float:
    """Value of an input as a float; raises FvsolveError if it is not a number or out of the range of the input."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.item()
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, Real):
        raise FvsolveError(
            f"{name} = {show(value)} is not a number; expected {target.sort.expected}"
        )
    number = float(value)
    if not math.isfinite(number):
        raise FvsolveError(f"{name} = {number} is not finite; expected {target.sort.expected}")
    if not target.sort.least <= number <= target.sort.greatest:
        raise FvsolveError(f"{name} = {number:g} is out of range; expected {target.sort.expected}")
    pressure = target.scale * number + target.offset
    if target.node >= 0 and not pressure > 0.0:
        text = f"{name} = {number:g}" + (
            f" is {pressure:.4g} Pa absolute" if target.sort is HEAD else " is a vacuum"
        )
        raise FvsolveError(f"{text}; expected {target.sort.expected}")
    return number


def input_value(model: Model, t: float, y: np.ndarray, target: Input) -> float:
    """Value [SI] of an input that is no output of a control, at time t [s] in the state y."""
    if target.node >= 0:
        pressure = float(
            model.tables.nodes[target.node]["pressure"]
            + model.evaluate(t, y)[1][model.layout["pressure"] + target.node]
        )
        place = model.node_names[target.node]
        return (
            pressure
            if target.sort is PRESSURE
            else float(model.head(pressure, model.elevation[place]))
        )
    return float(value_at(model.tables, target.schedule, t, np.inf) / target.scale)

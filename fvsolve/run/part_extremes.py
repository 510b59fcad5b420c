"""Extremes over all steps in the parts of an extent (parts and a quantity that a limit or claim names)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fvsolve.case.probe import OF_PRESSURE
from fvsolve.output.envelope import with_initial_heads

ENVELOPE_KEYS = ("distance", "elevation", "min_pressure", "t_min", "max_pressure", "t_max")


@dataclass(frozen=True)
class PartExtremes:
    """Extremes at the n recorded positions of a part : float64[n] each; n is 1 except for pipes.

    distance : from the `from` end of a pipe [m], nan for other parts; elevation [m]
    minimum, maximum : extremes over all steps [SI, pressures absolute]; t_min, t_max : their times [s]
    """

    group: str
    part: str
    distance: np.ndarray
    elevation: np.ndarray
    minimum: np.ndarray
    t_min: np.ndarray
    maximum: np.ndarray
    t_max: np.ndarray


def part_extremes(model, summary, extent) -> list[PartExtremes]:
    """Extremes of every part of an extent; quantities of pressure as absolute pressures.

    Extremes from the time at which a diverged run is not valid are nan.
    """
    is_pressure = extent.quantity in OF_PRESSURE
    pipes = {pipe.name: pipe for pipe in model.pipes}
    envelope = with_initial_heads(summary, model) if is_pressure else {}
    quantity = "pressure" if is_pressure else extent.quantity
    rows: dict[str, list] = {}  # watched probes along pipes
    for probe in model.watched:
        if probe.straight and probe.quantity == quantity:
            rows.setdefault(probe.name, []).append(probe)
    parts = []
    for group, name in extent.parts:
        if group == "links" and name in envelope:
            parts.append(PartExtremes(group, name, *(np.asarray(envelope[name][key]) for key in ENVELOPE_KEYS)))
        elif group == "links" and name in rows:
            parts.append(along_pipe(summary, pipes[name], rows[name]))
        else:
            z = model.elevation.get(name, np.nan) if group == "nodes" else np.nan
            extremes = summary.watched[f"{group}.{name}.{quantity}"]
            parts.append(PartExtremes(group, name, np.array([np.nan]), np.array([z]), *np.array([extremes]).T))
    return parts if np.isinf(summary.invalid_from) else [valid(probe, summary.invalid_from) for probe in parts]


def valid(part: PartExtremes, until: float) -> PartExtremes:
    """Copy of the extremes of a part, with nan for those that occurred at the time `until` [s] or later."""
    sides = {side: np.where(getattr(part, f"t_{side[:3]}") < until, getattr(part, side), np.nan)
             for side in ("minimum", "maximum")}  # fmt: skip
    return replace(part, **sides)


def along_pipe(summary, pipe, rows: list) -> PartExtremes:
    """Extremes along a pipe, from the probes `rows` of which only extremes are recorded."""
    distance = np.array([probe.fraction for probe in rows]) * pipe.length
    extremes = np.array([summary.watched[probe.text] for probe in rows])
    return PartExtremes("links", pipe.name, distance, pipe.height(distance), *extremes.T)


def in_quantity(model, quantity: str, pressure, elevation):
    """Convert absolute pressures [Pa] to the quantity "pressure", "gauge_pressure", "head" or "pressure_head" [SI].

    elevation : elevation of the points [m]
    """
    if quantity == "pressure":
        return pressure
    if quantity == "gauge_pressure":
        return pressure - model.case.ambient_pressure
    head = model.head(pressure, elevation)
    return head if quantity == "head" else head - elevation


def pressure_of(model, quantity: str, value: float, elevation):
    """Absolute pressure [Pa] from a value of "pressure", "gauge_pressure", "head" or "pressure_head" [SI].

    elevation : elevation of the points [m]. The result is nan below the minimum pressure of the fluid.
    """
    if quantity == "pressure":
        return value
    if quantity == "gauge_pressure":
        return value + model.case.ambient_pressure
    return model.case.law.pressure_under(value - elevation if quantity == "head" else value)

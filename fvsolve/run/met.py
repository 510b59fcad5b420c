"""Extremes over all steps of what an extent names, place by place. Knows what a run kept; starts no run."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fvsolve.case.extent import OF_PRESSURE
from fvsolve.output.envelope import with_start

ALONG = ("distance", "elevation", "least_pressure", "t_least", "greatest_pressure", "t_greatest")


@dataclass(frozen=True)
class Met:
    """Places of one part: distance from a pipe's `from` end (nan of others), elevation [m], extremes [SI], pressures
    absolute, and their times [s] : float64[places]."""

    group: str
    part: str
    distance: np.ndarray
    elevation: np.ndarray
    least: np.ndarray
    t_least: np.ndarray
    greatest: np.ndarray
    t_greatest: np.ndarray


def met(model, summary, extent) -> list[Met]:
    """Of every part of an extent what its places met."""
    pressed = extent.quantity in OF_PRESSURE
    pipes = {pipe.name: pipe for pipe in model.pipes}
    whole = with_start(summary, model) if pressed else {}
    quantity = "pressure" if pressed else extent.quantity
    rows: dict[str, list] = {}  # of what is watched along pipes
    for one in model.watched:
        if one.straight and one.quantity == quantity:
            rows.setdefault(one.name, []).append(one)
    made = []
    for group, name in extent.parts:
        if group == "links" and name in whole:
            made.append(Met(group, name, *(np.asarray(whole[name][key]) for key in ALONG)))
        elif group == "links" and name in rows:
            made.append(along(summary, pipes[name], rows[name]))
        else:
            z = model.elevation.get(name, np.nan) if group == "nodes" else np.nan
            found = summary.watched[f"{group}.{name}.{quantity}"]
            made.append(Met(group, name, np.array([np.nan]), np.array([z]), *np.array([found]).T))
    return made if np.isinf(summary.invalid_from) else [valid(one, summary.invalid_from) for one in made]


def valid(part: Met, until: float) -> Met:
    """Places of a part, with nan for extremes from a time on."""
    sides = {side: np.where(getattr(part, f"t_{side}") < until, getattr(part, side), np.nan)
             for side in ("least", "greatest")}  # fmt: skip
    return replace(part, **sides)


def along(summary, pipe, rows: list) -> Met:
    """Of what is watched along a pipe."""
    distance = np.array([one.fraction for one in rows]) * pipe.length
    found = np.array([summary.watched[one.text] for one in rows])
    return Met("links", pipe.name, distance, pipe.height(distance), *found.T)


def in_quantity(model, quantity: str, pressure, elevation):
    """Absolute pressures [Pa] as a quantity of pressure [SI], rising with it."""
    if quantity == "pressure":
        return pressure
    if quantity == "gauge_pressure":
        return pressure - model.case.ambient_pressure
    head = model.head(pressure, elevation)
    return head if quantity == "head" else head - elevation


def pressure_of(model, quantity: str, value: float, elevation):
    """The absolute pressure [Pa] of a quantity of pressure [SI]; nan below what the fluid can have."""
    if quantity == "pressure":
        return value
    if quantity == "gauge_pressure":
        return value + model.case.ambient_pressure
    return model.case.law.pressure_under(value - elevation if quantity == "head" else value)

"""Extremes over all steps of what an extent names, place by place. Knows what a run kept; starts no run."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fvsolve.case.extent import OF_PRESSURE
from fvsolve.output.envelope import with_start


@dataclass(frozen=True)
class Met:
    """Places of one part: distance from a pipe's `from` end (nan of others), elevation [m], extremes [SI] and their
    times [s], absolute pressures where `pressed`: float64[places]."""

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
    whole = with_start(summary, model) if extent.quantity in OF_PRESSURE else {}
    return [part_of(model, summary, extent, whole, group, name) for group, name in extent.parts]


def part_of(model, summary, extent, whole: dict, group: str, name: str) -> Met:
    if group == "links" and name in whole:
        one = whole[name]
        keys = ("distance", "elevation", "least_pressure", "t_least", "greatest_pressure", "t_greatest")
        return Met(group, name, *(np.asarray(one[key]) for key in keys))
    quantity = "pressure" if extent.quantity in OF_PRESSURE else extent.quantity
    pipe = next((one for one in model.pipes if group == "links" and one.name == name), None)
    pipe = pipe if pipe is None or quantity in model.case.links[name].along else None
    if pipe is None:
        found = [summary.watched[f"{group}.{name}.{quantity}"]]
        z = model.elevation.get(name, np.nan) if group == "nodes" else np.nan
        return Met(group, name, np.array([np.nan]), np.array([z]), *np.array(found).T)
    rows = [one for one in model.watched if one.name == name and one.part == group and one.quantity == quantity]
    distance = np.array([one.fraction for one in rows]) * pipe.length
    found = np.array([summary.watched[one.text] for one in rows])
    return Met(group, name, distance, pipe.height(distance), *found.T)


def in_quantity(model, quantity: str, pressure, elevation):
    """Absolute pressures [Pa] as a quantity of pressure [SI], rising with it."""
    if quantity == "pressure":
        return pressure
    if quantity == "gauge_pressure":
        return pressure - model.case.ambient_pressure
    head = model.head(pressure, elevation)
    return head if quantity == "head" else head - elevation

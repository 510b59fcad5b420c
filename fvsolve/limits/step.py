"""A model's step against the limits of its scheme and method: a notice for each room beyond. Knows no run.

Proved, for linear schemes where waves do not depend on the state: von Neumann's limit. Limited schemes count as what
they are where all is smooth, and waves that depend on the state by the quickest one: these are estimates.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fvsolve.errors import FvsolveError, Notice
from fvsolve.kernels import records as rec
from fvsolve.limits.grid import advection_limit, growth_of
from fvsolve.limits.plane import holds_well, plane_limit
from fvsolve.limits.symbol import weights_of
from fvsolve.model.schemes import FROZEN_AS, QUICKER
from fvsolve.steppers import automatic
from fvsolve.steppers.tableau import method_named

SLACK = 1e-9  # by which a Courant number may exceed its limit through rounding
SHARE = 0.05  # of an estimate: up to here beyond it a step is doubtful, from there on wrong
GROWS = 10.0  # times that the worst wave grows in a run: less is not seen, where no step is without growth
SHORTEST = 5  # cells from which on a pipe has the scheme between its ends
END_TESTED = "ssp-rk3"  # method by which `QUICKER` was measured, at Courant 0.9


class Room(NamedTuple):
    """A pipe or a basin: its Courant number, and up to which it holds, both as `numerics.courant` counts."""

    place: str
    courant: float
    limit: float
    scheme: str  # that the limit is of
    proved: bool
    where: str


def step_limits(model, rates: dict[str, float] | None = None) -> list[Notice]:
    """A notice for the pipe and for every basin whose step is beyond its limit; nothing under error control.

    rates : of basins by name, the greatest in a run so far [1/s]; those of the start by default.
    """
    numerics = model.case.numerics
    method = method_named(automatic.first_method(numerics.method))
    if numerics.rtol is not None or not method.explicit:
        return []
    try:
        rooms = [*pipe_rooms(model, method.name), *basin_rooms(model, method.name, rates or {})]
    except FvsolveError:  # a method whose stability function is not to be had
        return []
    beyond = [room for room in rooms if room.courant > room.limit * (1.0 + SLACK)]
    return [found for room in beyond if (found := notice(model, room, method.name)) is not None]


def pipe_rooms(model, method: str) -> list[Room]:
    """The pipe that is farthest beyond its limit, if there are any."""
    if not model.cells:
        return []
    numerics, waves = model.case.numerics, model.wave_rates
    scheme, limited = frozen(numerics.scheme)
    fixed = numerics.step is not None
    quicker = model.tables[rec.I_PIPES]["quicker"]
    fastest = float(numerics.step * waves.max() if fixed else numerics.courant)
    if not (fixed and quicker.max() > 1.0) and holds_well(scheme, method, fastest):
        return []
    one = advection_limit(scheme, method)
    cells = np.array([pipe.cells for pipe in model.pipes])
    if not fixed:
        courant = numerics.courant * waves / (waves * quicker).max()
        short = np.full(waves.size, math.inf)  # the step minds their ends
    else:
        courant, share = numerics.step * waves, 1.0
        if scheme in QUICKER:
            share = one.limit / advection_limit(scheme, END_TESTED).limit
        short = np.where(quicker > 1.0, 0.9 * share / quicker, math.inf)
    limits = np.minimum(one.limit, short)
    worst = int(np.argmax(courant / np.maximum(limits, 1e-300)))
    proved = one.proved and not limited and model.case.fluid.law == "linear" and cells[worst] >= SHORTEST
    proved = proved and courant[worst] > one.limit
    where = "on a long pipe" if short[worst] >= one.limit else f"between the ends of {cells[worst]} cells"
    name = model.pipes[worst].name
    return [Room(f"links.{name}", float(courant[worst]), float(limits[worst]), scheme, bool(proved), where)]


def basin_rooms(model, method: str, rates: dict[str, float]) -> list[Room]:
    """All basins, water's Courant numbers by parts of a cell as its steps count them."""
    numerics, rooms = model.case.numerics, []
    for basin, row in zip(model.basins, model.tables[rec.I_BASINS], strict=True):
        rate, share = basin.pace(model.start)
        parts = float(row["unsplit"]) or 1.0
        rate = max(rate, rates.get(basin.name, 0.0))
        if numerics.step is not None:
            courant = numerics.step * rate * parts
        else:
            courant = numerics.courant
        scheme, limited = frozen(basin.scheme)
        share = round(share, 2) if basin.is_grid else 1.0
        if holds_well(scheme, method, courant / parts, share, basin.is_grid and basin.waving):
            continue
        if basin.is_grid:
            limit = plane_limit(scheme, method, share, basin.waving)
        else:
            limit = advection_limit(scheme, method).limit
        fixed = basin.is_grid and basin.part.physics == "liquid" and model.case.fluid.law == "linear"
        rooms.append(Room(f"nodes.{basin.name}", courant, limit * parts, scheme, fixed and not limited,
                          "in a wide basin"))  # fmt: skip
    return rooms


def frozen(scheme: str) -> tuple[str, bool]:
    """The linear scheme that a scheme is where all is smooth, and whether it is another."""
    return FROZEN_AS.get(scheme, scheme), scheme in FROZEN_AS


def notice(model, room: Room, method: str) -> Notice | None:
    """What is to be said of a room beyond its limit; None where what grows is too slow to be seen in the run."""
    numerics = model.case.numerics
    scheme = model.case.numerics.scheme
    about = f", where it is {room.scheme}," if room.scheme != scheme else ""
    known = "proved" if room.proved else "an estimate"
    size = numerics.step if numerics.step is not None else numerics.courant
    key, unit = ("step", " s") if numerics.step is not None else ("courant", "")
    if room.limit > 0.0:
        sound = not room.proved and room.courant <= room.limit * (1.0 + SHARE)
        limit = f"{room.limit:.6g} is the limit {room.where} ({known})"
        remedy = f"give numerics.{key} = {rounded_down(size * room.limit / room.courant):.4g}{unit} or less"
    else:
        grows = growth(room, method, steps_of(model, room.courant))
        if grows < GROWS:
            return None
        sound = not room.proved and grows < GROWS**2
        limit = f"there is none that does not grow {room.where} ({known})"
        remedy = f"{room.scheme} wants another method, ssp-rk3 for example"
    text = (f"{room.place}: Courant number {room.courant:.6g}: with {scheme}{about} and {method} {limit}; "
            f"{'it may be wrong' if sound else 'the numbers are not to be trusted'}; {remedy}")  # fmt: skip
    return Notice("step-limit", room.place, text, key, room.courant, room.limit, sound)


def growth(room: Room, method: str, steps: float) -> float:
    """By how much the fastest wave grows in so many steps."""
    most = growth_of(weights_of(room.scheme), method, room.courant)[0]
    return math.exp(min(700.0, steps * math.log1p(max(most, 0.0))))


def steps_of(model, courant: float) -> float:
    """Number of steps of the run, by the waves of its pipes or basins."""
    numerics = model.case.numerics
    span = numerics.end - numerics.start
    return span / numerics.step if numerics.step is not None else span * model.wave_rate / courant


def rounded_down(x: float) -> float:
    """A number to four digits, never above it."""
    scale = 10.0 ** (3 - math.floor(math.log10(x)))
    return math.floor(x * scale * (1.0 + 1e-12)) / scale

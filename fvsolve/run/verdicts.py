"""Limits of a design, held against a run. Knows extremes over all steps; starts no run."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from fvsolve.case import horizon
from fvsolve.case.extent import OF_PRESSURE
from fvsolve.case.limits import VACUUM
from fvsolve.case.routes import Leg, alone, is_cut, legs
from fvsolve.output.column import UnitColumn, column
from fvsolve.run.met import Met, in_quantity, met

ROUNDING = 1e-9  # of a limit and of what its quantity usually is, within which it holds
SIZES = {"pressure": 1e5, "gauge_pressure": 1e5, "head": 10.0, "pressure_head": 10.0}
MAGNITUDES = ("velocity", "force")  # of which a limit counts the magnitude
WORST = 10  # places that a limit lists


class Nearest(NamedTuple):
    """Where a limit is nearest, or passed most [SI]."""

    margin: float
    value: float
    limit: float
    bound: str
    time: float
    met: Met
    at: int


def verdicts(model, summary) -> list[dict[str, Any]]:
    """One verdict of every limit of the case, in units of `[output]`, with the worst place of each part."""
    chainage, whole = Chainages(model.case), not summary.marks and not horizon.notices(model.case)
    return [verdict(model, summary, limit, chainage, whole) for limit in model.case.limits.values()]


def verdict(model, summary, limit, chainage: Chainages, whole: bool) -> dict[str, Any]:
    """Whether a limit holds, and where and when it is nearest, or passed most; see `verdicts`.

    One that is not passed is open all the same where the run is not ok, and where it is not `whole`: from a mark on not
    to be trusted, or at its end while a schedule goes on.
    """
    extent = limit.extent
    places = [one for part in met(model, summary, extent) for one in nearest(model, limit, part)]
    places.sort(key=lambda one: one.margin if math.isfinite(one.margin) else -math.inf)
    shown = column(extent.quantity, "head" if extent.quantity == "pressure_head" else extent.dimension, model.case)
    rows = [row_of(one, shown, chainage, extent) for one in places]
    first = places[0]
    slack = ROUNDING * (abs(first.limit) + SIZES.get(extent.quantity, 0.0))
    return {
        "name": limit.name, "ok": bool(summary.ok and whole and first.margin >= -slack), **rows[0],
        "quantity": extent.quantity, "until": float(summary.t), "error": None, "worst": worst(rows),
    }  # fmt: skip


def worst(rows: list[dict]) -> list[dict]:
    """The worst places, of each bound one at least."""
    first = {row["bound"]: row for row in reversed(rows)}
    return [*rows[:WORST], *(row for row in first.values() if row not in rows[:WORST])]


def nearest(model, limit, part: Met):
    """Of every bound of a limit the place of a part that is nearest to it, or beyond it most."""
    quantity = limit.extent.quantity
    for bound, (values, times), sign in zip(
        ("least", "greatest"), extremes(model, quantity, part), (1.0, -1.0), strict=True
    ):
        asked = getattr(limit, bound)
        if bound == "greatest" and limit.share_of_class is not None:
            allowed = limit.share_of_class * model.case.links[part.part].allowable_pressure
            asked = in_quantity(model, quantity, allowed + model.case.ambient_pressure, part.elevation)
        if asked is None:
            continue
        if isinstance(asked, str):
            pressure = model.case.ambient_pressure if asked == VACUUM else model.case.properties.vapor_pressure
            asked = in_quantity(model, quantity, pressure, part.elevation)
        asked = np.broadcast_to(np.asarray(asked, float), values.shape)
        margin = sign * (values - asked)
        at = int(np.argmin(np.where(np.isfinite(margin), margin, -np.inf)))
        yield Nearest(float(margin[at]), float(values[at]), float(asked[at]), bound, float(times[at]), part, at)


def extremes(model, quantity: str, part: Met):
    """Least and greatest of a quantity in the places of a part, each with its times; or of its magnitude."""
    if quantity in OF_PRESSURE:
        low, high = (in_quantity(model, quantity, one, part.elevation) for one in (part.least, part.greatest))
        return (low, part.t_least), (high, part.t_greatest)
    if quantity not in MAGNITUDES:
        return (part.least, part.t_least), (part.greatest, part.t_greatest)
    turns, back = (part.least <= 0.0) & (part.greatest >= 0.0), -part.least > part.greatest
    low = np.where(turns, 0.0, np.minimum(abs(part.least), abs(part.greatest)))
    t_low = np.where(turns, np.nan, np.where(back, part.t_greatest, part.t_least))
    high, t_high = np.where(back, -part.least, part.greatest), np.where(back, part.t_least, part.t_greatest)
    return (low, t_low), (high, t_high)


def row_of(one: Nearest, shown: UnitColumn, chainage: Chainages, extent) -> dict[str, Any]:
    """A place as a row: part, chainage and elevation [m], time [s], value, limit and margin in their unit."""
    part, at = one.met, one.at
    return {
        "place": part.part, "chainage": chainage.of(part, at, extent.on), "elevation": finite(part.elevation[at]),
        "time": finite(one.time), "bound": one.bound,
        "value": finite(shown.from_si(one.value)), "limit": finite(shown.from_si(one.limit)),
        "margin": finite(shown.span_from_si(one.margin)), "unit": shown.unit,
    }  # fmt: skip


def finite(value) -> float | None:
    """A number as JSON has it."""
    return float(value) if math.isfinite(value) else None


class Chainages:
    """Chainage of places: on the route that a limit names, else on the first one, else along their own pipe."""

    def __init__(self, case) -> None:
        self.case = case
        self.legs = {name: legs(route, case.links) for name, route in case.routes.items()}

    def of(self, part: Met, at: int, on: tuple[str, ...]) -> float | None:
        """Chainage of a place of a part [m]; None of what lies on none."""
        if part.group == "links":
            distance = part.distance[at]
            return float(self.leg(part.part, on).chainage(distance)) if math.isfinite(distance) else None
        for name in self.ordered(on):
            for leg in self.legs[name]:
                link = self.case.links[leg.pipe]
                if part.part in (link.from_, link.to):
                    return float(leg.chainage(0.0 if part.part == link.from_ else link.length))
        return None

    def leg(self, pipe: str, on: tuple[str, ...]) -> Leg:
        """The way through a pipe along which chainage is told."""
        found = next((leg for name in self.ordered(on) for leg in self.legs[name] if leg.pipe == pipe), None)
        return alone(pipe, self.case.links) if found is None else found

    def ordered(self, on: tuple[str, ...]) -> list[str]:
        """Names of routes, those that a limit is on first, and last what is but the way along a pipe that was cut."""
        return sorted(self.legs, key=lambda name: (is_cut(name, self.case.routes[name].pipes), name not in on))

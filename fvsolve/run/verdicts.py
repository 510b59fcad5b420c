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
from fvsolve.run.met import Met, in_quantity, met, pressure_of
from fvsolve.run.result import FAILS, HOLDS, OPEN

ROUNDING = 1e-9  # of a limit and of what its quantity usually is, within which it holds
SIZES = {"pressure": 1e5, "gauge_pressure": 1e5, "head": 10.0, "pressure_head": 10.0}
MAGNITUDES = ("velocity", "force")  # of which a limit counts the magnitude
NEAR = 1e-3  # of a vapour pressure, within which a limit is at it: that much is left in a cavity
WORST = 10  # places that a limit lists
STATES = (FAILS, OPEN, HOLDS)  # the worst first
SHARED = ("name", "quantity", "until")  # of all places of a limit
BESIDE = "beside"  # key of a row that no file has: all places of its part and bound


class Nearest(NamedTuple):
    """Where a bound of a limit is nearest in a part, or passed most [SI]."""

    margin: float
    value: float
    limit: float
    bound: str
    time: float
    met: Met
    at: int
    state: str
    margins: np.ndarray  # of all places of the part
    limits: np.ndarray


class Beside(NamedTuple):
    """All places of a part under a bound of a limit: probes, values allowed there and margins, in the limit's unit."""

    probes: list[str]
    limits: np.ndarray
    margins: np.ndarray


def verdicts(model, summary) -> list[dict[str, Any]]:
    """One verdict of every limit of the case, in units of `[output]`, with the worst place of each part."""
    return [verdict(rows) for rows in places(model, summary)]


def places(model, summary) -> list[list[dict[str, Any]]]:
    """Rows of every limit of the case: of each bound the nearest place of each part, in their order.

    A row that is not passed is open where the run is not ok, and where it is not whole: from a mark on not to be
    trusted, or at its end while a schedule goes on.
    """
    chainage = Chainages(model.case)
    sound = bool(summary.ok and not summary.marks and not horizon.notices(model.case))
    made = []
    for limit in model.case.limits.values():
        extent = limit.extent
        shown = column(extent.quantity, "head" if extent.quantity == "pressure_head" else extent.dimension, model.case)
        told = {"name": limit.name, "quantity": extent.quantity, "until": float(summary.t)}
        near = [one for part in met(model, summary, extent) for one in nearest(model, summary, limit, part, sound)]
        made.append([row_of(one, shown, chainage, extent) | told | {BESIDE: beside(model, extent, shown, one)}
                     for one in near])  # fmt: skip
    return made


def verdict(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """A limit by its rows: the worst row with its state, and the worst ones beside it."""
    rows = [{key: one for key, one in row.items() if key != BESIDE} for row in sorted(rows, key=badness)]
    listed = [{key: one for key, one in row.items() if key not in SHARED} for row in worst(rows)]
    return {**rows[0], "ok": rows[0]["state"] == HOLDS, "worst": listed}


def badness(row: dict[str, Any]) -> tuple[int, float]:
    """Key of sorting, the worst row first: by state, then by margin."""
    return STATES.index(row["state"]), -math.inf if row["margin"] is None else row["margin"]


def worst(rows: list[dict]) -> list[dict]:
    """The worst places, of each bound one at least."""
    first = {row["bound"]: row for row in reversed(rows)}
    return [*rows[:WORST], *(row for row in first.values() if row not in rows[:WORST])]


def nearest(model, summary, limit, part: Met, sound: bool):
    """Of every bound of a limit the place of a part that is nearest to it, or beyond it most."""
    quantity = limit.extent.quantity
    for bound, (values, times), sign in zip(
        ("least", "greatest"), extremes(model, quantity, part), (1.0, -1.0), strict=True
    ):
        asked = allowed(model, limit, bound, part)
        if asked is None:
            continue
        asked = np.broadcast_to(np.asarray(asked, float), values.shape)
        margin, slack = sign * (values - asked), ROUNDING * (abs(asked) + SIZES.get(quantity, 0.0))
        unknown = np.isnan(margin) | (margin == np.inf)
        at = int(np.argmin(np.where(unknown, -slack, margin)))
        state = FAILS if margin[at] < -slack[at] else HOLDS if sound and not unknown[at] else OPEN
        if state == FAILS and bound == "least" and asked[at] == cavity_of(model, quantity, part.elevation[at]):
            at = opened(summary, part, margin, at)
        yield Nearest(float(margin[at]), float(values[at]), float(asked[at]), bound, float(times[at]), part, at, state,
                      margin, asked)  # fmt: skip


def beside(model, extent, shown: UnitColumn, one: Nearest) -> Beside:
    """All places of a row; a pressure head is read as a head, and its limit moves with it."""
    part, above = one.met, extent.quantity == "pressure_head"
    text = f"{part.group}.{part.part}.{'head' if above else extent.quantity}"
    shares = part.distance / getattr(model.case.links.get(part.part), "length", np.nan)
    texts = [text if np.isnan(share) else f"{text}@{min(max(float(share), 0.0), 1.0)!r}" for share in shares]
    limits = one.limits + (part.elevation if above else 0.0)
    return Beside(texts, np.asarray(shown.from_si(limits)), np.asarray(shown.span_from_si(one.margins)))


def allowed(model, limit, bound: str, part: Met):
    """What a bound allows at the places of a part [SI]; None where it says nothing.

    Under `cavitation` no pressure falls below that of vapour: a least value there, or below, is that at which a place
    counts as a cavity.
    """
    case, quantity, asked = model.case, limit.extent.quantity, getattr(limit, bound)
    if bound == "greatest" and limit.share_of_class is not None:
        asked = limit.share_of_class * case.links[part.part].allowable_pressure
        return in_quantity(model, quantity, asked + case.ambient_pressure, part.elevation)
    if isinstance(asked, str):
        pressure = case.ambient_pressure if asked == VACUUM else case.law.cavity_pressure
        return in_quantity(model, quantity, pressure, part.elevation)
    if asked is None or bound == "greatest" or quantity not in OF_PRESSURE or not case.law.cavitates:
        return asked
    above = pressure_of(model, quantity, asked, part.elevation) > (1.0 + NEAR) * case.properties.vapor_pressure
    return np.where(above, asked, cavity_of(model, quantity, part.elevation))


def cavity_of(model, quantity: str, elevation):
    """What a quantity of pressure is where a place begins to count as a cavity; nan of others and of other laws."""
    if quantity not in OF_PRESSURE or not model.case.law.cavitates:
        return np.nan
    return in_quantity(model, quantity, model.case.law.cavity_pressure, elevation)


def opened(summary, part: Met, margin: np.ndarray, at: int) -> int:
    """The place where the first cavity of a pipe opened; `at` of what has none, or where the limit is not passed."""
    found = next((one.distance for one in summary.cavities if one.place == f"{part.group}.{part.part}"), np.nan)
    place = int(np.argmin(abs(part.distance - found))) if math.isfinite(found) else at
    return place if margin[place] < 0.0 else at


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
    part, at, known = one.met, one.at, not math.isnan(one.margin)
    return {
        "place": part.part, "chainage": chainage.of(part, at, extent.on) if known else None,
        "elevation": finite(part.elevation[at]), "time": finite(one.time) if known else None, "bound": one.bound,
        "value": finite(shown.from_si(one.value)), "limit": finite(shown.from_si(one.limit)),
        "margin": finite(shown.span_from_si(one.margin)), "unit": shown.unit, "error": None, "reason": None,
        "state": one.state,
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

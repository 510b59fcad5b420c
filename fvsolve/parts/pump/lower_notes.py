"""Notices about a pump at the start: direction, inertia, power and rated flow. Lists of notices are often empty."""

from __future__ import annotations

import math

import numpy as np

from fvsolve import units
from fvsolve.errors import Notice
from fvsolve.kernels import dtypes as rec
from fvsolve.parts.pump.lower_curve import rated_point
from fvsolve.parts.pump.lower_shaft import inertia, rated_power, usual_inertia

SPEED_TOLERANCE = 1e-6  # difference of heads regarded as rounding [m]
MAX_VELOCITY = 15.0  # velocity in adjacent pipes at the rated flow, above which a notice is given [m/s]
MIN_VELOCITY = 0.01  # velocity below which a notice is given: 1/100 of usual mains; a wrong unit gives 1/1000
INERTIA_RATIO = 30.0  # allowed ratio to the usual inertia: flywheels give 10, a wrong unit gives 1000
ROUNDING = 1e-9
LEAST_SHARE = 0.02  # least efficiency at the rated flow
UNITS = (("l/s", 1e-3), ("m3/h", 1.0 / 3600.0), ("l/min", 1e-3 / 60.0))


def reversed_pump(start, name: str, part, valve) -> list[Notice]:
    """Notice if a pump that runs at the start delivers to a lower head, or to the lowest water level; as a list."""
    i, j = int(valve["from_node"]), int(valve["to_node"])
    heads = start.nodes["pressure"] / start.weight + start.nodes["elevation"]
    fixed = np.isin(start.nodes["kind"], (rec.FIXED, rec.TANK))
    lowest = (
        fixed[j] and not fixed[i] and heads[j] < heads[fixed].max() - SPEED_TOLERANCE and heads[j] == heads[fixed].min()
    )
    if valve["drive"] <= 0.0 or start.rest or not (heads[i] > heads[j] + SPEED_TOLERANCE or lowest):
        return []
    target = (
        "which has the lowest water level"
        if lowest
        else f"where the head is {start.case.amount(heads[i] - heads[j], 'head', span=True)} lower"
    )
    text = (
        f"{name}: it pumps from {part.from_} to {part.to}, {target}; check its direction (`from` is the suction side)"
    )
    return [Notice("range", f"links.{name}", text, "from", float(heads[i] - heads[j]), 0.0)]


def estimated_inertia(draft, name: str, part) -> list[Notice]:
    """Notice of the estimated inertia if a pump trips and its inertia is not given; as a list."""
    if part.trip is None or part.inertia is not None:
        return []
    value = inertia(part, draft.fluid.density * draft.case.gravity)
    text = (f"{name}: its inertia is estimated from power and speed: {value:.4g} kg m2 for impeller, water and motor; "
            "the surge depends on this value; give the key `inertia` from the manufacturer")  # fmt: skip
    return [Notice("range", f"links.{name}", text, "inertia", value)]


def rated_point_notes(draft, name: str, part) -> list[Notice]:
    """Notices if the inertia or the shaft power of a pump is implausible for its rated point; as a list."""
    weight = draft.fluid.density * draft.case.gravity
    if weight == 0.0:
        return []
    notices, power = [], rated_power(part, weight)
    if part.inertia is not None:
        notices += unusual_inertia(draft.case, name, part.inertia, power, part.rated_speed)
    flow, head = rated_point(part, weight)
    taken = weight * flow * head
    plausible = (1.0 - ROUNDING) * taken <= power <= taken / LEAST_SHARE
    if part.shaft_power is not None and part.power is None and not plausible:
        stated, fluid = (draft.case.amount(value, "power") for value in (power, taken))
        likely = units.likely(power, "power", taken, taken / LEAST_SHARE)
        text = (
            f"{name}: shaft_power is {stated} at the rated flow, but the fluid takes up {fluid} there"
            f"{likely or '; check values and units of `shaft_power`'}"
        )
        notices.append(Notice("range", f"links.{name}", text, "shaft_power", power, taken))
    return notices


def unusual_inertia(case, name: str, given: float, power: float, speed: float) -> list[Notice]:
    """Notice if an inertia [kg m2] is far from the usual value at a power [W] and speed [rad/s]; as a list."""
    usual = usual_inertia(power, speed)
    if usual / INERTIA_RATIO <= given <= usual * INERTIA_RATIO:
        return []
    likely = units.likely(given, "inertia", usual / INERTIA_RATIO, usual * INERTIA_RATIO)
    rated = f"{case.amount(power, 'power')} at {speed * 30.0 / math.pi:.4g} rpm"
    hint = likely or "; check value and unit"
    text = f"{name}: an inertia of {given:.4g} kg m2, where {usual:.3g} kg m2 is usual for {rated}{hint}"
    return [Notice("range", f"links.{name}", text, "inertia", given, usual)]


def unusual_flow(draft, name: str, part) -> list[Notice]:
    """Notice if the rated flow of a pump is too fast or too slow in all adjacent pipes; as a list.

    Pumping stations have 1 to 4 m/s (Sanks, Pumping Station Design).
    """
    pipes = [pipe for pipe in draft.case.links.values() if pipe.kind in ("pipe", "rigid-column")]
    bores = [pipe.diameter for pipe in pipes if {pipe.from_, pipe.to} & {part.from_, part.to}]
    if not bores or part.power is not None:
        return []
    flow = rated_point(part, draft.fluid.density * draft.case.gravity)[0]
    most, least = (flow / (math.pi / 4.0 * bore**2) for bore in (min(bores), max(bores)))
    if least <= MAX_VELOCITY and most >= MIN_VELOCITY:
        return []
    if least > MAX_VELOCITY:
        speed, limit, extreme = least, MAX_VELOCITY, "widest"
        suggestion = next(
            (f'"{flow:.4g} {unit}"' for unit, size in UNITS if speed * size <= MAX_VELOCITY), "another unit"
        )
    else:
        speed, limit, extreme, suggestion = most, MIN_VELOCITY, "narrowest", "another unit"
    rated, velocity = draft.case.amount(flow, "flow"), draft.case.amount(speed, "velocity")
    text = f"{name}: its rated flow of {rated} is {velocity} in the {extreme} adjacent pipe; did you mean {suggestion}?"
    key = "suter" if part.suter is not None else "curve"
    return [Notice("range", f"links.{name}", text, key, speed, limit)]

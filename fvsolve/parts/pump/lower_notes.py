"""What is to be known of a pump as it starts. Knows one pump and what is beside it; computes no flow."""

from __future__ import annotations

import math

import numpy as np

from fvsolve import units
from fvsolve.errors import Notice
from fvsolve.kernels import records as rec
from fvsolve.parts.pump.lower_curve import rated_point
from fvsolve.parts.pump.lower_shaft import inertia, rated_power, usual_inertia

NEAR = 1e-6  # difference of heads that is rounding [m]
QUICKEST = 15.0  # velocity beside a pump at its rated flow beyond which a note asks [m/s]
SLOWEST = 0.01  # below which it asks too: a hundredth of what mains have, a thousandth is a slip of units
FAR = 30.0  # from the inertia that is usual: flywheels make it ten times as much, a slip of units a thousand times
ROUNDING = 1e-9
LEAST_SHARE = 0.02  # of the power at the shaft that the fluid gets at the rated flow
UNITS = (("l/s", 1e-3), ("m3/h", 1.0 / 3600.0), ("l/min", 1e-3 / 60.0))


def drawn_backwards(start, name: str, part, valve) -> list[Notice]:
    """A note on a pump that runs at the start and delivers downhill, or into the lowest water that there is."""
    i, j = int(valve["from_node"]), int(valve["to_node"])
    heads = start.nodes["pressure"] / start.weight + start.nodes["elevation"]
    still = np.isin(start.nodes["kind"], (rec.FIXED, rec.TANK))
    lowest = still[j] and not still[i] and heads[j] < heads[still].max() - NEAR and heads[j] == heads[still].min()
    if valve["drive"] <= 0.0 or start.rest or not (heads[i] > heads[j] + NEAR or lowest):
        return []
    what = (
        "the lowest water there is" if lowest else f"{start.case.amount(heads[i] - heads[j], 'head', span=True)} lower"
    )
    text = f"{name}: it pumps from {part.from_} to {part.to}, {what}; is it drawn backwards? `from` is its suction side"
    return [Notice("range", f"links.{name}", text, "from", float(heads[i] - heads[j]), 0.0)]


def estimated(draft, name: str, part) -> list[Notice]:
    """A note on the inertia of a pump that trips and was given none."""
    if part.trip is None or part.inertia is not None:
        return []
    found = inertia(part, draft.fluid.density * draft.case.gravity)
    text = (f"{name}: its inertia is estimated at {found:.4g} kg m2, impeller, water and motor, from power and speed; "
            "a surge hangs on it, so ask the maker for it and give inertia")  # fmt: skip
    return [Notice("range", f"links.{name}", text, "inertia", found)]


def at_odds(draft, name: str, part) -> list[Notice]:
    """Notes on an inertia, and on a power at the shaft, far from what the rated point lets expect."""
    weight = draft.fluid.density * draft.case.gravity
    if weight == 0.0:
        return []
    found, power = [], rated_power(part, weight)
    if part.inertia is not None:
        found += odd_inertia(draft.case, name, part.inertia, power, part.rated_speed)
    flow, head = rated_point(part, weight)
    taken = weight * flow * head
    fits = (1.0 - ROUNDING) * taken <= power <= taken / LEAST_SHARE
    if part.shaft_power is not None and part.power is None and not fits:
        said, gets = (draft.case.amount(one, "power") for one in (power, taken))
        likely = units.likely(power, "power", taken, taken / LEAST_SHARE)
        text = f"{name}: shaft_power says {said} at its rated flow, and the fluid gets {gets} there{likely}"
        found.append(Notice("range", f"links.{name}", text, "shaft_power", power, taken))
    return found


def odd_inertia(case, name: str, given: float, power: float, speed: float) -> list[Notice]:
    """A note on an inertia [kg m2] far from that of machines of such a power [W] and speed [rad/s]."""
    usual = usual_inertia(power, speed)
    if usual / FAR <= given <= usual * FAR:
        return []
    likely = units.likely(given, "inertia", usual / FAR, usual * FAR)
    rated = f"{case.amount(power, 'power')} at {speed * 30.0 / math.pi:.4g} rpm"
    text = f"{name}: an inertia of {given:.4g} kg m2, where {usual:.3g} kg m2 is usual of {rated}{likely}"
    return [Notice("range", f"links.{name}", text, "inertia", given, usual)]


def off_scale(draft, name: str, part) -> list[Notice]:
    """A note on a pump whose rated flow is too quick for every pipe beside it, or hardly any in each; pumping stations
    have 1 to 4 m/s (Sanks, Pumping Station Design)."""
    pipes = [one for one in draft.case.links.values() if one.kind in ("pipe", "rigid-column")]
    bores = [one.diameter for one in pipes if {one.from_, one.to} & {part.from_, part.to}]
    if not bores or part.power is not None:
        return []
    flow = rated_point(part, draft.fluid.density * draft.case.gravity)[0]
    most, least = (flow / (math.pi / 4.0 * bore**2) for bore in (min(bores), max(bores)))
    if least <= QUICKEST and most >= SLOWEST:
        return []
    if least > QUICKEST:
        speed, limit, which = least, QUICKEST, "widest"
        meant = next((f'was "{flow:.4g} {unit}"' for unit, size in UNITS if speed * size <= QUICKEST), "another unit")
    else:
        speed, limit, which, meant = most, SLOWEST, "narrowest", "another unit"
    rated, quick = draft.case.amount(flow, "flow"), draft.case.amount(speed, "velocity")
    text = f"{name}: its rated flow of {rated} is {quick} in the {which} pipe beside it; {meant} meant?"
    key = "suter" if part.suter is not None else "curve"
    return [Notice("range", f"links.{name}", text, key, speed, limit)]

"""What is to be known of a pump as it starts. Knows one pump and what is beside it; computes no flow."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.errors import Notice
from fvsolve.kernels import records as rec
from fvsolve.parts.pump.lower_curve import rated_point
from fvsolve.parts.pump.lower_shaft import inertia

NEAR = 1e-6  # difference of heads that is rounding [m]
QUICKEST = 15.0  # velocity beside a pump at its rated flow beyond which a note asks [m/s]
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


def quick(draft, name: str, part) -> list[Notice]:
    """A note on a pump whose rated flow is too quick for every pipe beside it; pumping stations have 1 to 4 m/s (Sanks,
    Pumping Station Design)."""
    pipes = [one for one in draft.case.links.values() if one.kind in ("pipe", "rigid-column")]
    wide = max((one.diameter for one in pipes if {one.from_, one.to} & {part.from_, part.to}), default=None)
    if wide is None or part.power is not None:
        return []
    flow = rated_point(part, draft.fluid.density * draft.case.gravity)[0]
    speed = flow / (math.pi / 4.0 * wide**2)
    if speed <= QUICKEST:
        return []
    meant = next((f'; was "{flow:.4g} {unit}" meant?' for unit, size in UNITS if speed * size <= QUICKEST), "")
    rated, quick = draft.case.amount(flow, "flow"), draft.case.amount(speed, "velocity")
    text = f"{name}: its rated flow of {rated} is {quick} in the widest pipe beside it{meant}"
    key = "suter" if part.suter is not None else "curve"
    return [Notice("range", f"links.{name}", text, key, speed, QUICKEST)]

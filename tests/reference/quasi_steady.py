"""Quasi-steady pipes and their losses by the formulas of handbooks; mains and altitude valves on them."""

import math

from scipy.optimize import brentq

from reference.scenes import GRAVITY, RHO, area

FACTOR = {"model": "steady", "factor": 0.02}
HAZEN = {"model": "hazen-williams", "coefficient": 120.0}


def pipe(start, end, length=100.0, diameter=0.05, friction=FACTOR, **more):
    return {
        "type": "pipe",
        "from": start,
        "to": end,
        "length": length,
        "diameter": diameter,
        "friction": friction,
        "pipe_model": "quasi-steady",
        **more,
    }


def colebrook(reynolds, roughness):
    def residual(x):
        return x + 2.0 * math.log10(roughness / 3.7 + 2.51 * x / reynolds)

    return brentq(residual, 1.0, 50.0, xtol=1e-14, rtol=1e-14) ** -2


def swamee_jain(reynolds, roughness):
    return 0.25 / math.log10(roughness / 3.7 + 5.74 / reynolds**0.9) ** 2


def loss_of(friction, flow, length=100.0, diameter=0.05, minor=2.0):
    """Head loss [m] of a flow [m3/s], by the formulas of the handbooks."""
    velocity = flow / area(diameter)
    other = minor * velocity**2 / (2.0 * GRAVITY)
    if friction["model"] == "hazen-williams":
        return (
            other
            + 4.727
            * 0.3048**-0.685
            * length
            * (flow / friction["coefficient"]) ** 1.852
            / diameter**4.871
        )
    if friction["model"] == "chezy-manning":
        return (
            other
            + length * (velocity * friction["coefficient"] / (diameter / 4.0) ** (2.0 / 3.0)) ** 2
        )
    law = swamee_jain if friction["model"] == "swamee-jain" else colebrook
    factor = friction.get("factor") or law(
        velocity * diameter * RHO / 1e-3, friction["roughness"] / diameter
    )
    return other + factor * length / diameter * velocity**2 / (2.0 * GRAVITY)


def main(start: str, end: str, length: float, diameter: float, coefficient: float = 110.0) -> dict:
    return pipe(
        start, end, length, diameter, {"model": "hazen-williams", "coefficient": coefficient}
    )


def altitude(tank_name: str, **levels: float) -> dict:
    return {
        "type": "altitude-valve",
        "from": f"{tank_name}-inlet",
        "to": tank_name,
        "diameter": 0.2,
        "loss_coefficient": 1e-4,
        **levels,
    }


def restated(case: dict) -> dict:
    """The same case with its nodes and links in the opposite order, and its pipes turned."""
    links = {name: dict(link) for name, link in reversed(case["links"].items())}
    for link in links.values():
        if link["type"] == "pipe":
            link["from"], link["to"] = link["to"], link["from"]
    return {**case, "nodes": dict(reversed(case["nodes"].items())), "links": links}

"""Turbines and pump-turbines with shaft: keys and faults."""

from itertools import pairwise
from math import pi
from typing import Annotated, ClassVar

from pydantic import Field

from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.table_model import CaseContext, Faults
from fvsolve.parts.turbine.hill_chart import HillChart, HillChartValue, OpeningCurve
from fvsolve.parts.value import PROFILE, Quantity, UsualRange, anything, between, positive

RUNNER_DIAMETERS = UsualRange(0.05, 12.0, "pico turbines to large Kaplan runners")
ROUNDING = 1e-9  # tolerance, over the power of the water


class Turbine(TwoPort, kind="turbine"):
    """Turbine that takes the head H from `from` to `to` by its hill chart.

    After load rejection J d(omega)/dt = torque, with inertia J and angular velocity omega. Ports: from, to. Place:
    shaft (angular velocity, torque). Stored energy: J omega^2 / 2 [J] where the shaft runs free. Of the power rho g H q
    [W] of the flow q the shaft takes torque omega, which goes to the generator while it holds the speed.
    """

    owns: ClassVar[dict[str, str]] = {"shaft": "rotational"}
    quantities: ClassVar[dict[str, str]] = {
        "flow": "flow",
        "head": "head",
        "speed": "angular_velocity",
        "torque": "torque",
        "power": "power",
        "opening": "number",
    }

    diameter: Annotated[
        float,
        Quantity(
            "length", positive, "runner diameter D, as in the hill chart [m]", RUNNER_DIAMETERS
        ),
    ]
    hill_chart: Annotated[HillChart, HillChartValue()]
    speed: Annotated[
        Schedule,
        Scheduled(
            "angular_velocity", anything, "speed held by the generator, positive forward [rad/s]"
        ),
    ]
    opening: Annotated[
        Schedule, Scheduled("number", between(0, 1), "opening of the guide vanes, 0 shut to 1 open")
    ] = Field(default_factory=lambda: constant(1.0))
    inertia: Annotated[
        float | None,
        Quantity(
            "inertia",
            positive,
            "inertia of runner, water in it and generator, required with `trip` [kg m2]",
            changes=PROFILE,
        ),
    ] = None
    trip: Annotated[
        float | None,
        Quantity("time", about="time of load rejection, when the generator is disconnected [s]"),
    ] = None

    @classmethod
    def key_faults(cls, given) -> list:
        faults = super().key_faults(given)
        if "trip" in given and isinstance(given.get("speed"), dict) and "control" in given["speed"]:
            text = "cannot follow a control if the machine trips, because the speed at the trip is then unknown"
            faults.append((("speed",), f"{text}; expected a schedule, or no `trip`"))
        if "trip" in given and "inertia" not in given:
            faults.append(
                (("trip",), "needs the key `inertia`, the inertia of all rotating masses")
            )
        return faults

    def faults(self, name: str, around: CaseContext) -> Faults:
        if around.fluid is None or around.gravity is None:
            return
        weight = around.fluid.density * around.gravity
        for curve in self.hill_chart.curves:
            if (text := excess_power_point(curve, weight)) is not None:
                yield ("hill_chart",), f"opening {curve.opening:g}: {text}"


def excess_power_point(curve: OpeningCurve, weight: float) -> str | None:
    """Text on the first point or line of a curve where shaft power exceeds hydraulic power; None for a valid curve."""
    points = list(
        zip(curve.speed, curve.flow, (t * pi / 30.0 for t in curve.torques(weight)), strict=True)
    )
    for n, q, t in points:
        if t * n > weight * q + ROUNDING * weight * abs(q):
            most = t * n / (weight * q) if q > 0.0 else 0.0
            excess = (
                f"an efficiency of {most:.4g}"
                if q > 0.0
                else "a shaft power above the power of the flow"
            )
            rule = (
                "at most 1"
                if q > 0.0
                else "at most the power of the flow (negative if the shaft drives the water)"
            )
            return f"torque at unit_speed {n:g}, unit_flow {q:g} means {excess}; expected {rule}"
    for (n, q, t), (m, r, s) in pairwise(points):
        # power lost on the line, fractions a + b = 1: a^2 (w q - t n) + a b (w (q + r) - t m - s n) + b^2 (w r - s m)
        ends, both = (weight * q - t * n, weight * r - s * m), weight * (q + r) - t * m - s * n
        if both < 0.0 and both * both > 4.0 * ends[0] * ends[1] * (1.0 + ROUNDING):
            ends = f"(unit_speed, unit_flow) = ({n:g}, {q:g}) and ({m:g}, {r:g})"
            return f"between {ends} the efficiency would exceed 1; give more points there"
    return None

"""A turbine, or a pump-turbine, with its shaft. Knows its hill chart and what turns it; computes no flow."""

from __future__ import annotations

from itertools import pairwise
from math import pi
from typing import Annotated, ClassVar

from pydantic import Field

from fvsolve.parts.around import Around, Faults
from fvsolve.parts.link import TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.turbine.hill_chart import HillChart, HillChartValue, OpeningCurve
from fvsolve.parts.value import VALUE, Quantity, Usual, anything, between, positive

RUNNERS = Usual(0.05, 12.0, "pico turbines to great Kaplan runners")
ROUNDING = 1e-9  # share of the power of the water


class Turbine(TwoPort, kind="turbine"):
    """Takes the head H from `from` to `to` by its hill chart; J d(omega)/dt = torque, once the generator has let go.

    Ports: from, to. Place: shaft (angular velocity, torque). Stored energy: J omega^2 / 2 [J] where the shaft runs
    free. Of rho g H q [W] the shaft takes torque omega, which leaves by the generator while that holds the speed.
    """

    owns: ClassVar[dict[str, str]] = {"shaft": "rotational"}
    quantities: ClassVar[dict[str, str]] = {
        "flow": "flow", "head": "head", "speed": "angular_velocity", "torque": "torque", "power": "power",
        "opening": "number",
    }  # fmt: skip

    diameter: Annotated[float, Quantity("length", positive, "D of its runner, that of the hill chart [m]", RUNNERS)]
    hill_chart: Annotated[HillChart, HillChartValue()]
    speed: Annotated[
        Schedule, Scheduled("angular_velocity", anything, "at which the generator holds it, forward positive [rad/s]")
    ]
    opening: Annotated[Schedule, Scheduled("number", between(0, 1), "of its vanes, 0 shut to 1 open")] = Field(
        default_factory=lambda: constant(1.0)
    )
    inertia: Annotated[
        float | None,
        Quantity("inertia", positive, "of runner, water in it and generator [kg m2]; trip wants it", changes=VALUE),
    ] = None
    trip: Annotated[
        float | None, Quantity("time", about="when the generator lets go of the shaft, load rejection [s]")
    ] = None

    @classmethod
    def key_faults(cls, given) -> list:
        faults = super().key_faults(given)
        if "trip" in given and "inertia" not in given:
            faults.append((("trip",), "wants the inertia of all that turns with the shaft"))
        return faults

    def faults(self, name: str, around: Around) -> Faults:
        if around.fluid is None or around.gravity is None:
            return
        weight = around.fluid.density * around.gravity
        for one in self.hill_chart.curves:
            if (text := overdrawn(one, weight)) is not None:
                yield ("hill_chart",), f"opening {one.opening:g}: {text}"


def overdrawn(one: OpeningCurve, weight: float) -> str | None:
    """Where the shaft gets more than the water gives, at a point or on the line to the next; None where nowhere."""
    points = list(zip(one.speed, one.flow, (t * pi / 30.0 for t in one.torques(weight)), strict=True))
    for n, q, t in points:
        if t * n > weight * q + ROUNDING * weight * abs(q):
            most = t * n / (weight * q) if q > 0.0 else 0.0
            said = f"an efficiency of {most:.4g}" if q > 0.0 else "less than the pumped water takes up"
            return f"torque at ({n:g}, {q:g}) means {said}; wanted {'1 at most' if q > 0.0 else 'more'}"
    for (n, q, t), (m, r, s) in pairwise(points):
        # lost on the line, with shares a + b = 1: a^2 (w q - t n) + a b (w (q + r) - t m - s n) + b^2 (w r - s m)
        ends, both = (weight * q - t * n, weight * r - s * m), weight * (q + r) - t * m - s * n
        if both < 0.0 and both * both > 4.0 * ends[0] * ends[1] * (1.0 + ROUNDING):
            return f"between ({n:g}, {q:g}) and ({m:g}, {r:g}) the efficiency would pass 1; give more points there"
    return None

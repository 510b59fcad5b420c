"""A pump with its shaft. Knows its curve and what turns it; computes no head."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.link import TwoPort
from fvsolve.parts.pump.head_curve import CurvePoints, Efficiency, HeadCurve, ShaftPower, Suter, SuterTable
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.value import PROFILE, VALUE, Choice, Flag, Quantity, Usual, nonnegative, positive

EFFICIENCY = 0.75
SPEEDS = Usual(2.0, 1400.0, "20 rpm of great tidal pumps to 13 000 rpm of small ones")


class Pump(TwoPort, kind="pump"):
    """Raises the head from `from` to `to` by n^2 f(q / n), n its relative speed; J d(omega)/dt = sum of torques.

    f is a - b q^c through one point (4/3 of its head at no flow, none at twice its flow) or three from no flow on, and
    straight lines through others, as in EPANET. Ports: from, to. Place: shaft (angular velocity, torque). Stored
    energy: J omega^2 / 2 [J] where the shaft runs free. It supplies rho g H q [W].
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("curve", "power", "suter"),
        ("efficiency", "shaft_power"),
    )
    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("curve", "power", "suter"),)
    owns: ClassVar[dict[str, str]] = {"shaft": "rotational"}
    quantities: ClassVar[dict[str, str]] = {
        "flow": "flow", "head": "head", "speed": "number", "torque": "torque", "power": "power"
    }  # fmt: skip

    curve: Annotated[CurvePoints | None, HeadCurve()] = None
    power: Annotated[float | None, Quantity("power", positive, "given to the fluid whatever its flow [W]")] = None
    suter: Annotated[SuterTable | None, Suter()] = None
    outside: Annotated[
        str | None,
        Choice(
            "law",
            ("suter", "parabola"),
            "outside of curve: the Suter table of its specific speed, joined to it, where rated_speed is given; or a "
            "parabola",
        ),
    ] = None
    speed: Annotated[
        Schedule,
        Scheduled("number", nonnegative, "relative to that of the curve", Usual(0.0, 2.5, "of the rated speed")),
    ] = Field(default_factory=lambda: constant(1.0))
    rated_speed: Annotated[
        float | None, Quantity("angular_velocity", positive, "at relative speed 1 [rad/s]", SPEEDS, PROFILE)
    ] = None
    inertia: Annotated[
        float | None,
        Quantity(
            "inertia",
            positive,
            "of all that turns with the shaft, the water in it too [kg m2]; wants rated_speed; else estimated",
            changes=VALUE,
        ),
    ] = None
    trip: Annotated[
        float | None, Quantity("time", about="when the motor lets go of the shaft [s]; wants rated_speed")
    ] = None
    efficiency: Annotated[Any, Efficiency()] = None
    shaft_power: Annotated[CurvePoints | None, ShaftPower()] = None
    check_valve: Annotated[bool, Flag("lets nothing pass from `to` to `from`, without loss", PROFILE)] = False

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        if "trip" in given and "inertia" not in given and "rated_speed" not in given:
            faults.append((("trip",), 'wants rated_speed, for example "1480 rpm", and the inertia of all that turns '
                                      "with the shaft, which is else estimated; to stop it at once let speed fall to 0 "
                                      "by a schedule"))  # fmt: skip
        if "inertia" in given and "rated_speed" not in given:
            faults.append((("inertia",), 'wants rated_speed, for example "1480 rpm"'))
        if "outside" in given and "curve" not in given:
            faults.append((("outside",), "wants a curve that it is outside of"))
        if given.get("outside") == "suter" and "curve" in given and "rated_speed" not in given:
            faults.append((("outside",), 'wants rated_speed, for example "1480 rpm", which its specific speed needs'))
        if "suter" in given and isinstance(given.get("efficiency"), dict):
            faults.append((("efficiency",), "the torque is that of suter; wanted one number, at the rated point"))
        if "suter" in given and "shaft_power" in given:
            faults.append((("shaft_power",), "the torque is that of suter; leave it out"))
        return faults

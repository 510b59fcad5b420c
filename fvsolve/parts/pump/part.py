"""Pumps with shaft: keys and faults."""

from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.pump.head_curve import (
    CurvePoints,
    Efficiency,
    HeadCurve,
    ShaftPower,
    Suter,
    SuterTable,
)
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.table_model import CaseContext, Faults
from fvsolve.parts.value import (
    PROFILE,
    Choice,
    Flag,
    Quantity,
    UsualRange,
    Whole,
    between,
    nonnegative,
    positive,
)

EFFICIENCY = 0.75
SPEEDS = UsualRange(2.0, 1400.0, "20 rpm of great tidal pumps to 13 000 rpm of small ones")


class Pump(TwoPort, kind="pump"):
    """Pump that raises the head from `from` to `to` by n^2 f(q / n), q the flow, n the relative speed, f the curve.

    On a free shaft, J d(omega)/dt = sum of torques, with inertia J and angular velocity omega. As in EPANET, f is a - b
    q^c through one point (4/3 of its head at no flow, zero head at twice its flow) or through three points from no flow
    on, and linear between any other number of points. Ports: from, to. Place: shaft (angular velocity, torque). Stored
    energy: J omega^2 / 2 [J] where the shaft runs free. It supplies rho g H q [W], H the head. With `count`,
    equal pumps in parallel are a single part: other keys are those of each pump; flow, torque and power those of all.
    """

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("curve", "power", "suter"),
        ("efficiency", "shaft_power"),
    )
    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("curve", "power", "suter"),)
    owns: ClassVar[dict[str, str]] = {"shaft": "rotational"}
    quantities: ClassVar[dict[str, str]] = {
        "flow": "flow",
        "head": "head",
        "speed": "number",
        "torque": "torque",
        "power": "power",
        "electric_power": "power",
    }

    curve: Annotated[CurvePoints | None, HeadCurve()] = None
    power: Annotated[
        float | None, Quantity("power", positive, "constant hydraulic power given to the fluid [W]")
    ] = None
    suter: Annotated[SuterTable | None, Suter()] = None
    curve_extrapolation: Annotated[
        str | None,
        Choice(
            "law",
            ("suter", "parabola"),
            "head outside the flows of `curve`: suter (a table by specific speed, joined to the curve; default with "
            "`rated_speed`) or parabola",
        ),
    ] = None
    speed: Annotated[
        Schedule,
        Scheduled(
            "number",
            nonnegative,
            "relative speed, 1 at the speed of the curve",
            UsualRange(0.0, 2.5, "of the rated speed"),
        ),
    ] = Field(default_factory=lambda: constant(1.0))
    rated_speed: Annotated[
        float | None,
        Quantity(
            "angular_velocity", positive, "speed at relative speed 1 [rad/s]", SPEEDS, PROFILE
        ),
    ] = None
    inertia: Annotated[
        float | None,
        Quantity(
            "inertia",
            positive,
            "inertia of all rotating masses and water in the pump, with `rated_speed` [kg m2]; estimated if left out",
            changes=PROFILE,
        ),
    ] = None
    trip: Annotated[
        float | None,
        Quantity(
            "time", about="time at which the motor is switched off, requires `rated_speed` [s]"
        ),
    ] = None
    efficiency: Annotated[Any, Efficiency()] = None
    shaft_power: Annotated[CurvePoints | None, ShaftPower()] = None
    overall_efficiency: Annotated[
        Any,
        Efficiency(
            "hydraulic power over electric power (wire to water), at every flow, "
            "or over flow at relative speed 1; that of "
            "`[energy]` if left out"
        ),
    ] = None
    price: Annotated[
        Schedule | None,
        Scheduled(
            "number",
            about="price of its electric energy per kWh, with `[energy]`; that of `[energy]` if left out",
        ),
    ] = None
    count: Annotated[
        int,
        Whole(
            between(1, 1000),
            "number of equal pumps in parallel that turn and trip together; other keys are those of each pump",
            PROFILE,
        ),
    ] = 1
    check_valve: Annotated[
        bool, Flag("ideal check valve: no flow from `to` to `from`, no loss", PROFILE)
    ] = False

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        if "trip" in given and isinstance(given.get("speed"), dict) and "control" in given["speed"]:
            text = "cannot follow a control if the machine trips, because the speed at the trip is then unknown"
            faults.append((("speed",), f"{text}; expected a schedule, or no `trip`"))
        if "trip" in given and "inertia" not in given and "rated_speed" not in given:
            faults.append(
                (
                    ("trip",),
                    'needs rated_speed, for example "1480 rpm", and the inertia of all rotating '
                    "masses, which is otherwise estimated; to stop the pump at once, set speed to 0 "
                    "by a schedule",
                )
            )
        if "inertia" in given and "rated_speed" not in given:
            faults.append((("inertia",), 'needs rated_speed, for example "1480 rpm"'))
        if "curve_extrapolation" in given and "curve" not in given:
            text = "applies outside the flows of a curve; give the key `curve`, or remove this key"
            faults.append((("curve_extrapolation",), text))
        if (
            given.get("curve_extrapolation") == "suter"
            and "curve" in given
            and "rated_speed" not in given
        ):
            faults.append(
                (
                    ("curve_extrapolation",),
                    'needs rated_speed, for example "1480 rpm", for the specific speed',
                )
            )
        if "suter" in given and isinstance(given.get("efficiency"), dict):
            text = "`suter` already gives the torque; expected a number, the efficiency at the rated point"
            faults.append((("efficiency",), text))
        if "suter" in given and "shaft_power" in given:
            faults.append(
                (("shaft_power",), "`suter` already gives the torque; leave `shaft_power` out")
            )
        return faults

    def faults(self, name: str, around: CaseContext) -> Faults:
        yield from super().faults(name, around)
        shaft = f"{name}.shaft"
        for other, link in around.links.items() if self.count > 1 else ():
            if shaft in link.ports.values():
                text = f"{self.count} pumps have no common shaft, but {other} joins {shaft}"
                yield ("count",), f"{text}; expected count = 1, or a part for each pump"

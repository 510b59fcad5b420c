"""Valves of fluid power that other pressures open: counterbalance, pilot check, shuttle, pressure compensator."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve.parts.nodes_and_links import Link, Ports, TwoPort
from fvsolve.parts.self_acting.part import DROPS, Disc, ReliefValve
from fvsolve.parts.value import (
    SHAPE,
    Number,
    Quantity,
    ReadContext,
    Text,
    UsualRange,
    Value,
    nonnegative,
    positive,
)
from fvsolve.parts.valve import Sized
from fvsolve.units import show

PILOT = Text("place whose pressure pilots the valve; the valve only senses it")
RATIO = Number(
    positive,
    "area of the pilot over area of the seat",
    UsualRange(0.3, 20.0, "catalogues of cartridges"),
)
SHARE = 0.05  # overpressure of a pressure compensator over set_drop, if left out


class Counterbalance(ReliefValve, kind="counterbalance"):
    """Counterbalance valve, q = x Cd A sqrt(2 dp / rho) with flow q, drop dp and lift x between 0 and 1.

    x = (p_from + pilot_ratio p_pilot - set_pressure) / overpressure, in gauge pressures; reverse flow, from `to` to
    `from`, passes the full size (x = 1). The lift follows the pressures at once, or with the dynamics of a disc that
    has a time_constant or a natural_frequency. Ports: from, to. Stored energy: none, that of the disc is neglected.
    Dissipated power: dp q [W].
    """

    sensed_keys: ClassVar[tuple[str, ...]] = ("pilot",)

    pilot: Annotated[str, PILOT]
    pilot_ratio: Annotated[float, RATIO]


class PilotCheck(Sized, TwoPort, kind="pilot-check"):
    """Pilot-operated check valve: while open a turbulent restriction q = Cd A sqrt(2 |dp| / rho) sign(dp).

    It opens when dp = p_from - p_to exceeds cracking_pressure, or when pilot_ratio (p_pilot - p_from) exceeds
    p_to - p_from + cracking_pressure. It shuts when its flow q is reversed and this pilot condition does not hold.
    Ports: from, to. Stored energy: none. Dissipated power: dp q [W].
    """

    sensed_keys: ClassVar[tuple[str, ...]] = ("pilot",)
    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    pilot: Annotated[str, PILOT]
    pilot_ratio: Annotated[float, RATIO]
    cracking_pressure: Annotated[
        float,
        Quantity(
            "pressure_drop", nonnegative, "pressure drop above which the valve opens [Pa]", DROPS
        ),
    ] = 0.0


class Shuttle(Sized, Link, kind="shuttle"):
    """Shuttle valve: the higher of the pressures at A and B is joined to out, q = Cd A sqrt(2 |dp| / rho) sign(dp).

    q is the flow, dp the drop. It switches where the pressures at A and B are equal; the other port is shut. Ports: A,
    B, out. Stored energy: none. Dissipated power: dp q [W].
    """

    joins: ClassVar[dict[str, str]] = dict.fromkeys(("A", "B", "out"), "hydraulic")
    quantities: ClassVar[dict[str, str]] = {
        **{f"flow_{port}": "flow" for port in ("A", "B", "out")},
        "position": "number",
    }

    ports: Annotated[dict[str, str], Ports(("A", "B", "out"))]


@dataclass(frozen=True)
class SensedPair(Value):
    """Value of a case file: names of the two places between which a valve senses the drop."""

    about: str = ""
    changes: str = SHAPE
    takes: ClassVar[str] = "[place before, place behind]"
    schema: ClassVar[dict[str, Any]] = {
        "type": "array",
        "items": {"type": "string"},
        "minItems": 2,
        "maxItems": 2,
    }

    def read(self, given: Any, setting: ReadContext) -> tuple[str, str]:
        if (
            not isinstance(given, (list, tuple))
            or len(given) != 2
            or not all(isinstance(name, str) for name in given)
        ):
            raise ValueError(
                f"{show(given)} is not a list of two places; expected {self.takes}, names in quotes"
            )
        if given[0] == given[1]:
            raise ValueError(
                f"{show(given[0])} is named twice, so the drop is always 0; expected two places"
            )
        return tuple(given)


class PressureCompensator(Disc, Sized, TwoPort, kind="pressure-compensator"):
    """Pressure compensator, normally open, q = x Cd A sqrt(2 |dp| / rho) sign(dp) with flow q, drop dp and opening x.

    x = 1 - (p_before - p_behind - set_drop) / overpressure, between 0 and 1, so that it keeps the drop between the
    sensed places near set_drop. The opening follows at once, or with the dynamics of a disc that has a time_constant or
    a natural_frequency. Ports: from, to. Stored energy: none, that of the spool is neglected. Dissipated power:
    dp q [W].
    """

    sensed_keys: ClassVar[tuple[str, ...]] = ("senses",)
    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    senses: Annotated[
        tuple[str, str], SensedPair("places before and behind the metering orifice, only sensed")
    ]
    set_drop: Annotated[
        float,
        Quantity(
            "pressure_drop",
            positive,
            "drop between the sensed places at which it begins to shut [Pa]",
            DROPS,
        ),
    ]
    overpressure: Annotated[
        float | None,
        Quantity(
            "pressure_drop",
            positive,
            f"drop above `set_drop` that shuts it [Pa]; {SHARE} set_drop if left out",
            DROPS,
        ),
    ] = None

    def model_post_init(self, context: Any) -> None:
        super().model_post_init(context)
        if self.overpressure is None:
            object.__setattr__(self, "overpressure", SHARE * self.set_drop)

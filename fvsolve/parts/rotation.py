"""Rotational mechanics on one axis: shafts, housings, gears, torsion springs, bearings, clutches and racks."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.core.assembly.lowering import ANGULAR_SPEED, InputKind
from fvsolve.parts.network_elements import (
    CAPACITY,
    INERTANCE,
    RESISTANCE,
    TRANSFORMER,
    Element,
    NetworkRows,
    fill_network_probe,
    node_or_reference,
)
from fvsolve.parts.network_parts import (
    HEAT_TO,
    GivenPotential,
    GivenPotentialRows,
    NetworkNodeRows,
    dry_friction,
    ends_of,
    heat_to_faults,
)
from fvsolve.parts.nodes_and_links import Link, Node, Ports, TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.value import (
    VALUE,
    Number,
    Quantity,
    Range,
    Text,
    UsualRange,
    nonnegative,
    nonzero,
    positive,
)

CLUTCH_TORQUE = InputKind("N m", "a torque of at least 0 [N m]", 0.0)
SPEEDS = UsualRange(-1300.0, 1300.0, "to 12 000 rpm of machine tools")  # of shafts [rad/s]
# sizes of small deviations, where the network does not tell [rad/s], [N m]
SMALL_SPEED, SMALL_TORQUE = 1.0, 1.0


class Shaft(Node, kind="shaft"):
    """Rotating shaft, inertia d(omega)/dt = sum of the torques on it, with angular velocity omega.

    Without inertia it is a joint of links. Ports: those of the links that name it, angular velocity and torque. Stored
    energy: inertia omega^2 / 2 [J]. Dissipated: none.
    """

    domain: ClassVar[str] = "rotational"
    quantities: ClassVar[dict[str, str]] = {"speed": "angular_velocity", "angle": "angle"}
    main_quantities: ClassVar[tuple[str, ...]] = ("speed",)
    on_request: ClassVar[tuple[str, ...]] = ("angle",)

    inertia: Annotated[
        float | None,
        Quantity(
            "inertia",
            positive,
            "moment of inertia; none if left out [kg m2]",
            UsualRange(1e-9, 1e7, "micromotors to turbine sets"),
        ),
    ] = None
    initial_speed: Annotated[
        float | None,
        Quantity(
            "angular_velocity",
            about="angular velocity at the start; that of equilibrium if left out [rad/s]",
            usual=SPEEDS,
        ),
    ] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        if "initial_speed" in given and "inertia" not in given:
            faults.append(
                (
                    ("initial_speed",),
                    "needs the key `inertia`: a shaft without inertia stores no speed",
                )
            )
        return faults


class ShaftPlace(Node):
    """Shaft of a pump or turbine that links of rotation join, as a place for probes."""

    kind: ClassVar[str] = "shaft"
    domain: ClassVar[str] = "rotational"
    quantities: ClassVar[dict[str, str]] = {"speed": "angular_velocity"}


class ShaftRows(NetworkNodeRows, kind="shaft"):
    """Conversion of shafts to stores of angular velocity."""

    def network_elements(self, case, name, part):
        if part.inertia is None:
            return [], []
        return [
            Element(
                CAPACITY,
                f"nodes.{name}",
                f"nodes.{name}",
                (name, None),
                part.inertia,
                f"{name}.speed",
                SMALL_SPEED,
                part.initial_speed,
                ledger="stored",
            )
        ], []


class Housing(GivenPotential, kind="housing"):
    """Fixed or driven place with a given angular velocity.

    Ports: those of the links that name it, angular velocity and torque. Stored and dissipated energy: none; it supplies
    torque times angular velocity [W].
    """

    domain: ClassVar[str] = "rotational"
    quantities: ClassVar[dict[str, str]] = {"speed": "angular_velocity"}
    potential_key: ClassVar[str] = "speed"

    speed: Annotated[
        Schedule, Scheduled("angular_velocity", about="angular velocity [rad/s]", usual=SPEEDS)
    ] = Field(default_factory=lambda: constant(0.0))


class HousingRows(GivenPotentialRows, kind="housing"):
    """Conversion of housings to sources of angular velocity."""

    input_kinds: ClassVar = {"speed": ANGULAR_SPEED}


class RotationalLink(TwoPort):
    """Link between two shafts; its torque [N m] acts on it at `from`, and from it on `to`."""

    in_network: ClassVar[bool] = True
    joins: ClassVar[dict[str, str]] = {"from": "rotational", "to": "rotational"}
    quantities: ClassVar[dict[str, str]] = {"torque": "torque"}
    main_quantities: ClassVar[tuple[str, ...]] = ("torque",)

    from_: Annotated[str, Text("shaft or housing at its start"), Field(alias="from")]
    to: Annotated[str, Text("shaft or housing at its end")]


class Gear(RotationalLink, kind="gear"):
    """Ideal gear, speed of `from` = ratio times speed of `to`; the torque on `to` is ratio times that at `from`.

    Ports: from, to. Stored and dissipated energy: none.
    """

    ratio: Annotated[
        float,
        Number(nonzero, "speed of `from` over speed of `to`; negative if the direction reverses"),
    ]


class GearRows(NetworkRows, kind="gear"):
    """Conversion of gears to transformers."""

    quantities: ClassVar = {"torque": ("", "flow", 1.0)}

    def network_elements(self, case, name, part):
        first, second = ends_of(case, part)
        ends = (first, None, second, None)
        return [Element(TRANSFORMER, f"links.{name}", f"links.{name}", ends, part.ratio)], []


class TorsionSpring(RotationalLink, kind="torsion-spring"):
    """Torsion spring, d(torque)/dt = stiffness (omega_from - omega_to), with a damper in parallel.

    Ports: from, to. Stored energy: torque^2 / (2 stiffness) [J], of the torque without the damper. Dissipated power:
    damping (omega_from - omega_to)^2 [W].
    """

    stiffness: Annotated[
        float, Quantity("torsional_stiffness", positive, "torque per angle of twist [N m/rad]")
    ]
    damping: Annotated[
        float,
        Quantity("rotational_damping", nonnegative, "torque per difference of speed [N m s/rad]"),
    ] = 0.0
    initial_torque: Annotated[
        float | None,
        Quantity(
            "torque",
            about="torque of the spring at the start; that of equilibrium if left out [N m]",
        ),
    ] = None


class TorsionSpringRows(NetworkRows, kind="torsion-spring"):
    """Conversion of torsion springs to stores of torque, with a resistance in parallel."""

    def network_elements(self, case, name, part):
        place, ends = f"links.{name}", ends_of(case, part)
        found = [
            Element(
                INERTANCE,
                place,
                place,
                ends,
                1.0 / part.stiffness,
                f"{name}.torque",
                SMALL_TORQUE,
                part.initial_torque,
                ledger="stored",
            )
        ]
        return found + resistances(place, ends, part.damping), []

    def probe(self, draft, name, probe, row) -> None:
        fill_network_probe(draft, row, f"links.{name}", "all flows")


def resistances(
    place: str, ends: tuple, damping: float, heat_to: str | None = None
) -> list[Element]:
    """Resistance of a viscous damping [N m s/rad], in a list; none without damping."""
    if damping == 0.0:
        return []
    return [
        Element(
            RESISTANCE,
            f"{place}.damping",
            place,
            ends,
            1.0 / damping,
            ledger="dissipated",
            heat_to=heat_to,
        )
    ]


class Bearing(RotationalLink, kind="bearing"):
    """Bearing with viscous and dry friction: T = damping w + (T_c + (T_s - T_c) exp(-(w / w_s)^2)) sign(w).

    w is the speed of `from` minus that of `to`, T_c `friction_torque`, T_s `static_torque`, w_s `stribeck_speed`. It
    sticks, w = 0, until the torque exceeds T_s. Ports: from, to. Stored energy: none. Dissipated power: T w [W].
    """

    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("damping", "friction_torque"),)

    damping: Annotated[
        float, Quantity("rotational_damping", nonnegative, "torque per speed [N m s/rad]")
    ] = 0.0
    friction_torque: Annotated[
        float, Quantity("torque", nonnegative, "torque of dry friction while it turns [N m]")
    ] = 0.0
    static_torque: Annotated[
        float | None,
        Quantity(
            "torque", nonnegative, "greatest torque at rest; `friction_torque` if left out [N m]"
        ),
    ] = None
    stribeck_speed: Annotated[
        float | None,
        Quantity(
            "angular_velocity",
            positive,
            "speed at which the excess of the torque at rest has fallen to 1/e; "
            "no excess in motion if left out [rad/s]",
        ),
    ] = None
    heat_to: Annotated[str | None, HEAT_TO] = None

    def faults(self, name: str, around: Any) -> Iterator:
        if self.static_torque is not None and self.static_torque < self.friction_torque:
            text = f"is {self.static_torque:g} N m, below `friction_torque`, {self.friction_torque:g} N m"
            yield ("static_torque",), f"{text}; expected at least that torque"
        yield from heat_to_faults(self, around)


class BearingRows(NetworkRows, kind="bearing"):
    """Conversion of bearings to resistances, and to dry friction."""

    def network_elements(self, case, name, part):
        place, ends = f"links.{name}", ends_of(case, part)
        found = resistances(place, ends, part.damping, part.heat_to)
        static = part.friction_torque if part.static_torque is None else part.static_torque
        if static == 0.0 and found:
            return found, []
        numbers = part.friction_torque, static, part.stribeck_speed or 0.0, 1.0
        friction, switches = dry_friction(place, ends, numbers, part.heat_to)
        return found + friction, switches

    def probe(self, draft, name, probe, row) -> None:
        fill_network_probe(draft, row, f"links.{name}", "all flows")


class Clutch(RotationalLink, kind="clutch"):
    """Friction clutch or brake: transmits `torque` while it slips, and up to static_factor torque while it sticks.

    It locks where both speeds become equal. Ports: from, to. Stored energy: none. Dissipated power: torque times slip
    [W].
    """

    quantities: ClassVar[dict[str, str]] = {
        "torque": "torque",
        "slip": "angular_velocity",
        "locked": "number",
    }

    torque: Annotated[
        Schedule, Scheduled("torque", nonnegative, "torque that it transmits while it slips [N m]")
    ]
    static_factor: Annotated[
        float, Number(Range(1), "greatest torque while it sticks, over `torque`")
    ] = 1.0
    heat_to: Annotated[str | None, HEAT_TO] = None

    def faults(self, name: str, around: Any) -> Iterator:
        yield from heat_to_faults(self, around)


class ClutchRows(NetworkRows, kind="clutch"):
    """Conversion of clutches to dry friction with a scheduled torque."""

    input_kinds: ClassVar = {"torque": CLUTCH_TORQUE}

    def network_elements(self, case, name, part):
        numbers = (0.0, 0.0, 0.0, part.static_factor)
        return dry_friction(
            f"links.{name}", ends_of(case, part), numbers, part.heat_to, part.torque
        )

    def probe(self, draft, name, probe, row) -> None:
        if probe.quantity == "torque":
            fill_network_probe(draft, row, f"links.{name}", "all flows")
        elif probe.quantity == "slip":
            fill_network_probe(draft, row, f"links.{name}.friction", "drop")
        else:
            fill_network_probe(draft, row, f"links.{name}", "locked")


class Rack(Link, kind="rack"):
    """Rack and pinion: velocity of the mass = radius times angular velocity of the shaft.

    Ports: shaft, mass. Its force [N] acts on the mass in the positive direction. Stored and dissipated energy: none.
    """

    in_network: ClassVar[bool] = True
    joins: ClassVar[dict[str, str]] = {"shaft": "rotational", "mass": "translational"}
    quantities: ClassVar[dict[str, str]] = {"force": "force"}

    ports: Annotated[dict[str, str], Ports(("shaft", "mass"), "shaft and mass that it couples")]
    radius: Annotated[
        float,
        Quantity(
            "position",
            nonzero,
            "pitch radius of the pinion; negative to reverse [m]",
            changes=VALUE,
        ),
    ]


class RackRows(NetworkRows, kind="rack"):
    """Conversion of racks to transformers between a shaft and a mass."""

    quantities: ClassVar = {"force": ("", "flow", -1.0)}

    def network_elements(self, case, name, part):
        shaft, mass = node_or_reference(case, part.ports["shaft"]), part.ports["mass"]
        mass = None if case.nodes[mass].kind == "frame" else mass
        return [
            Element(
                TRANSFORMER,
                f"links.{name}",
                f"links.{name}",
                (mass, None, shaft, None),
                part.radius,
            )
        ], []

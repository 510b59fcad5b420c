"""Hydraulic cylinders."""

import math
from typing import Annotated, Any, ClassVar

from fvsolve.core.assembly.lowering import Lowering
from fvsolve.parts.hydraulic_nodes import Chamber
from fvsolve.parts.network_parts import dry_friction
from fvsolve.parts.nodes_and_links import Link, Ports
from fvsolve.parts.table_model import CaseContext, Faults, Nested, Table
from fvsolve.parts.value import PROFILE, VALUE, Quantity, UsualRange, nonnegative, positive

SIZES = UsualRange(5e-4, 30.0, "micro-hydraulics to ship lifts")
AREAS = UsualRange(1e-7, 30.0, "micro-hydraulics to presses")


class DryFriction(Table):
    """Dry friction F = (F_c + (F_s - F_c) exp(-(v / v_s)^2)) sign(v), with F_c `coulomb`, F_s `static`.

    v_s is `stribeck_velocity`. It sticks, v = 0, until the force exceeds F_s.
    """

    coulomb: Annotated[
        float, Quantity("force", nonnegative, "force F_c of dry friction in motion [N]")
    ]
    static: Annotated[
        float | None,
        Quantity("force", nonnegative, "greatest force F_s at rest; `coulomb` if left out [N]"),
    ] = None
    stribeck_velocity: Annotated[
        float | None,
        Quantity(
            "velocity",
            positive,
            "speed v_s at which the excess of the force at rest has fallen to 1/e; "
            "no excess in motion if left out [m/s]",
        ),
    ] = None

    @property
    def greatest(self) -> float:
        """Greatest force at rest [N]."""
        return self.coulomb if self.static is None else self.static


class Cylinder(Link, kind="cylinder"):
    """Hydraulic cylinder: a piston between chambers A and B moves a rod relative to a case.

    The volumes are dead_volume_A + area_A x and dead_volume_B + area_B (stroke - x), with the piston position
    x = x_rod - x_case - closed_length, or between points of bodies, their distance minus closed_length.
    The piston pushes the rod forward by area_A p_A - area_B p_B - viscous_friction v - F, p above ambient, and the case
    backward by the same force, with v = v_rod - v_case and the dry friction F = (F_c + (F_s - F_c) exp(-(v / v_s)^2))
    sign(v) of `friction`; it sticks, v = 0, until the other forces exceed F_s. Ports: rod, case (velocity, force);
    places A, B (pressure, flow). Stored energy: that of its chambers. Dissipated power: leakage (p_A - p_B)^2 +
    viscous_friction v^2 + F v [W].
    """

    no_scalars: ClassVar[str] = (
        "its chambers carry no scalars yet; leave out this part, or `[scalars]`"
    )
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (
        ("area_A", "piston_diameter"),
        ("area_B", "rod_diameter"),
    )
    joins: ClassVar[dict[str, str]] = {
        "rod": "translational or spatial",
        "case": "translational or spatial",
    }
    owns: ClassVar[dict[str, str]] = {"A": "hydraulic", "B": "hydraulic"}
    quantities: ClassVar[dict[str, str]] = {
        "force": "force",
        "position": "position",
        "velocity": "velocity",
    }

    ports: Annotated[dict[str, str], Ports(("rod", "case"))]
    stroke: Annotated[
        float,
        Quantity("length", positive, "stroke, from x = 0 (rod in) to x = stroke [m]", SIZES, VALUE),
    ]
    closed_length: Annotated[
        float,
        Quantity(
            "length",
            nonnegative,
            "distance from case to rod at x = 0 (rod in) [m]",
            changes=PROFILE,
        ),
    ] = 0.0
    area_A: Annotated[
        float | None,
        Quantity(
            "area",
            positive,
            "area of the piston at A [m2]; required without `piston_diameter`",
            AREAS,
        ),
    ] = None
    area_B: Annotated[
        float | None,
        Quantity(
            "area",
            positive,
            "ring area at B, without the rod [m2]; required without `rod_diameter`",
            AREAS,
        ),
    ] = None
    piston_diameter: Annotated[
        float | None,
        Quantity("length", positive, "diameter of the piston, instead of `area_A` [m]", SIZES),
    ] = None
    rod_diameter: Annotated[
        float | None,
        Quantity(
            "length",
            nonnegative,
            "diameter of the rod, with `piston_diameter`, instead of `area_B` [m]",
            SIZES,
        ),
    ] = None
    dead_volume_A: Annotated[
        float,
        Quantity(
            "volume",
            positive,
            "volume of chamber A with the rod in, lines included [m3]",
            changes=VALUE,
        ),
    ]
    dead_volume_B: Annotated[
        float,
        Quantity(
            "volume",
            positive,
            "volume of chamber B with the rod out, lines included [m3]",
            changes=VALUE,
        ),
    ]
    initial_pressure_A: Annotated[
        float | None,
        Quantity(
            "pressure",
            about="pressure of chamber A at the start [Pa]; that of its links, or the supporting pressure of a shut "
            "chamber if left out",
        ),
    ] = None
    initial_pressure_B: Annotated[
        float | None,
        Quantity(
            "pressure",
            about="pressure of chamber B at the start [Pa]; that of its links, or the supporting pressure of a shut "
            "chamber if left out",
        ),
    ] = None
    leakage: Annotated[
        float,
        Quantity(
            "leakage", nonnegative, "leakage flow from A to B per pressure difference [m3/s/Pa]"
        ),
    ] = 0.0
    viscous_friction: Annotated[
        float,
        Quantity(
            "damping", nonnegative, "viscous friction of piston and rod [N s/m]", changes=VALUE
        ),
    ] = 0.0
    friction: Annotated[
        DryFriction | None, Nested(DryFriction, "dry friction beside the viscous friction")
    ] = None
    elevation: Annotated[
        float | None, Quantity("length", about="elevation of both chambers [m]")
    ] = None

    @property
    def has_dry_friction(self) -> bool:
        """True if the dry friction is not zero."""
        return self.friction is not None and self.friction.greatest > 0.0

    @property
    def network_places(self) -> tuple[str, ...]:
        return (self.ports["rod"], self.ports["case"]) if self.has_dry_friction else ()

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        if "area_A" not in given and "piston_diameter" not in given:
            faults.append(((), "area_A or piston_diameter is missing"))
        if "area_B" not in given and "rod_diameter" not in given:
            faults.append(((), "area_B or rod_diameter is missing"))
        if "rod_diameter" in given and "area_A" in given and "piston_diameter" not in given:
            faults.append(
                (
                    ("rod_diameter",),
                    "needs the key `piston_diameter`; with `area_A` give `area_B` instead",
                )
            )
        return faults

    def faults(self, name: str, around: CaseContext) -> Faults:
        for place, pressure in (("A", self.initial_pressure_A), ("B", self.initial_pressure_B)):
            if pressure is not None:
                yield from around.boiling_faults(
                    "links", name, f"initial_pressure_{place}", [pressure]
                )
        if self.friction is not None and any(map(around.spatial, self.ports.values())):
            text = "dry friction acts between masses on an axis only, and this cylinder joins points in space"
            yield ("friction",), f"{text}; remove this key, or use `viscous_friction`"
        if self.friction is not None and self.friction.greatest < self.friction.coulomb:
            text = f"is {self.friction.static:g} N, below `coulomb`, {self.friction.coulomb:g} N"
            yield ("friction", "static"), f"{text}; expected at least that force"
        if (distance := around.separation(self, "case", "rod")) is None:
            return
        x, (rod, case) = distance - self.closed_length, (self.ports["rod"], self.ports["case"])
        if not 0.0 <= x <= self.stroke:
            closed = " minus closed_length" if self.closed_length else ""
            place = f"{x:g} m (distance from {case} to {rod}{closed})"
            text = f"the piston starts at {place}; expected 0 to {self.stroke:g} m"
            yield ("stroke",), text
        if min(self.areas()) <= 0.0:
            yield (
                ("rod_diameter",),
                "leaves no area at B; expected a diameter below `piston_diameter`",
            )

    def areas(self) -> tuple[float, float]:
        """(area at A [m2], area at B [m2]) of the piston."""
        bore = self.area_A if self.area_A is not None else math.pi / 4.0 * self.piston_diameter**2
        if self.area_B is not None:
            return bore, self.area_B
        return bore, math.pi / 4.0 * (self.piston_diameter**2 - self.rod_diameter**2)

    def chambers(self, x: float) -> dict[str, Chamber]:
        """Chambers "A" and "B" -> `Chamber` with the volume that it has at the piston position x [m]."""
        a, b = self.areas()
        volumes = {"A": self.dead_volume_A + a * x, "B": self.dead_volume_B + b * (self.stroke - x)}
        given = {"A": self.initial_pressure_A, "B": self.initial_pressure_B}
        return {
            place: Chamber.model_construct(
                volume=volume, initial_pressure=given[place], elevation=self.elevation
            )
            for place, volume in volumes.items()
        }


class CylinderRows(Lowering, kind="cylinder"):
    """Conversion to table rows of cylinders: a piston between two chambers, and between two masses or two points."""

    table = "piston"

    def network_elements(self, case, name, part):
        """Elements of the dry friction between rod and case."""
        if not part.has_dry_friction:
            return [], []
        rod, housing = (
            None if case.nodes[place].kind == "frame" else place for place in part.network_places
        )
        coulomb = part.friction.coulomb
        static = part.friction.greatest
        speed = part.friction.stribeck_velocity
        return dry_friction(f"links.{name}", (rod, housing), (coulomb, static, speed or 0.0, 1.0))

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        distance, row["speed"] = draft.join(
            row, ("case", "rod"), (link.ports["case"], link.ports["rod"])
        )
        row["position"] = distance - link.closed_length
        row["a"], row["b"] = draft.node_index[f"{name}.A"], draft.node_index[f"{name}.B"]
        row["area_a"], row["area_b"] = link.areas()
        row["stroke"], row["leakage"], row["damping"] = (
            link.stroke,
            link.leakage,
            link.viscous_friction,
        )

"""Electrical circuits: terminals, ground, sources, resistors, inductors, capacitors, switches, diodes and DC motors."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.core.assembly.lowering import VALUE as ANY_VALUE
from fvsolve.core.assembly.lowering import InputKind
from fvsolve.parts import law_elements as codes
from fvsolve.parts.network_elements import (
    CAPACITY,
    FLOW,
    GAUGE,
    INERTANCE,
    POTENTIAL,
    RESISTANCE,
    TRANSFORMER,
    Element,
    NetworkRows,
    Switch,
    fill_network_probe,
    node_or_reference,
)
from fvsolve.parts.network_parts import (
    HEAT_TO,
    GivenPotential,
    GivenPotentialRows,
    NetworkNodeRows,
    ends_of,
    heat_to_faults,
)
from fvsolve.parts.nodes_and_links import Link, Node, Ports, TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled, constant
from fvsolve.parts.value import Quantity, Text, UsualRange, nonnegative, nonzero, positive

VOLTAGE = InputKind("V", "a finite number [V]")
CURRENT = InputKind("A", "a finite number [A]")
CONTACT = "1 mohm"  # resistance of closed switches and conducting diodes that state none
VOLTAGES = UsualRange(-1e6, 1e6, "to transmission lines")  # [V]
RESISTANCES = UsualRange(1e-6, 1e9, "contacts to insulation")  # [ohm]
INDUCTANCES = UsualRange(1e-9, 100.0, "conductors to iron-core chokes")  # [H]
CAPACITANCES = UsualRange(1e-12, 10.0, "ceramic to double-layer capacitors")  # [F]
# sizes of small deviations, where the network does not tell [V], [A]
SMALL_VOLTAGE, SMALL_CURRENT = 1.0, 1.0


class Terminal(Node, kind="terminal"):
    """Place where electrical links join; the sum of the currents out of it is zero.

    Ports: those of the links that name it, voltage and current. Stored and dissipated energy: none.
    """

    domain: ClassVar[str] = "electrical"
    quantities: ClassVar[dict[str, str]] = {"voltage": "voltage"}
    main_quantities: ClassVar[tuple[str, ...]] = ("voltage",)


class TerminalRows(NetworkNodeRows, kind="terminal"):
    """Conversion of terminals, which have no element."""


class Ground(GivenPotential, kind="ground"):
    """Place with a given voltage, 0 V if left out: the reference of a circuit.

    Ports: those of the links that name it, voltage and current. Stored and dissipated energy: none; it supplies voltage
    times current [W].
    """

    domain: ClassVar[str] = "electrical"
    quantities: ClassVar[dict[str, str]] = {"voltage": "voltage"}
    main_quantities: ClassVar[tuple[str, ...]] = ("voltage",)
    potential_key: ClassVar[str] = "voltage"

    voltage: Annotated[Schedule, Scheduled("voltage", about="voltage [V]", usual=VOLTAGES)] = Field(
        default_factory=lambda: constant(0.0)
    )


class GroundRows(GivenPotentialRows, kind="ground"):
    """Conversion of grounds to sources of voltage."""

    input_kinds: ClassVar = {"voltage": VOLTAGE}


class ElectricalLink(TwoPort):
    """Electrical link; its current [A] enters at `from` and leaves at `to`."""

    in_network: ClassVar[bool] = True
    joins: ClassVar[dict[str, str]] = {"from": "electrical", "to": "electrical"}
    quantities: ClassVar[dict[str, str]] = {"current": "current", "voltage": "voltage"}
    main_quantities: ClassVar[tuple[str, ...]] = ("current",)

    from_: Annotated[str, Text("terminal or ground at its start"), Field(alias="from")]
    to: Annotated[str, Text("terminal or ground at its end")]


class VoltageSource(ElectricalLink, kind="voltage-source"):
    """Ideal source, voltage of `to` minus voltage of `from` = voltage(t).

    Ports: from, to. Its current flows from `from` through the source to `to`. Stored and dissipated energy: none; it
    supplies the power voltage times current [W].
    """

    quantities: ClassVar[dict[str, str]] = {"current": "current", "power": "power"}

    voltage: Annotated[
        Schedule, Scheduled("voltage", about="voltage of `to` above `from` [V]", usual=VOLTAGES)
    ]


class SourceRows(NetworkRows, kind=""):
    """Base of the conversion of sources; kind_of_source : POTENTIAL or FLOW; key : key of the schedule."""

    kind_of_source = POTENTIAL
    key = "voltage"

    def network_elements(self, case, name, part):
        first, second = ends_of(case, part)
        ends = (second, first) if self.kind_of_source == POTENTIAL else (first, second)
        return [
            Element(
                self.kind_of_source,
                f"links.{name}",
                f"links.{name}",
                ends,
                schedule=getattr(part, self.key),
                key=self.key,
                ledger="supplied",
            )
        ], []


class VoltageSourceRows(SourceRows, kind="voltage-source"):
    """Conversion of voltage sources to given potentials."""

    quantities: ClassVar = {"current": ("", "flow", -1.0), "power": ("", "power", -1.0)}
    input_kinds: ClassVar = {"voltage": VOLTAGE}


class CurrentSource(ElectricalLink, kind="current-source"):
    """Ideal source of the current(t) that flows from `from` through the source to `to`.

    Ports: from, to. Stored and dissipated energy: none; it supplies the power current times (voltage of `to` minus
    voltage of `from`) [W].
    """

    quantities: ClassVar[dict[str, str]] = {"current": "current", "power": "power"}

    current: Annotated[Schedule, Scheduled("current", about="current from `from` to `to` [A]")]


class CurrentSourceRows(SourceRows, kind="current-source"):
    """Conversion of current sources to given flows."""

    kind_of_source, key = FLOW, "current"
    quantities: ClassVar = {"current": ("", "flow", 1.0), "power": ("", "power", -1.0)}
    input_kinds: ClassVar = {"current": CURRENT}


class Resistor(ElectricalLink, kind="resistor"):
    """Resistor, voltage = resistance times current.

    Ports: from, to. Stored energy: none. Dissipated power: resistance current^2 [W].
    """

    resistance: Annotated[float, Quantity("resistance", positive, "resistance [ohm]", RESISTANCES)]
    heat_to: Annotated[str | None, HEAT_TO] = None

    def faults(self, name: str, around: Any) -> Iterator:
        yield from heat_to_faults(self, around)


class ElectricalRows(NetworkRows, kind=""):
    """Conversion of links with a single element."""

    quantities: ClassVar = {"current": ("", "flow", 1.0), "voltage": ("", "drop", 1.0)}


class ResistorRows(ElectricalRows, kind="resistor"):
    """Conversion of resistors."""

    def network_elements(self, case, name, part):
        place = f"links.{name}"
        return [
            Element(
                RESISTANCE,
                place,
                place,
                ends_of(case, part),
                part.resistance,
                ledger="dissipated",
                heat_to=part.heat_to,
            )
        ], []


class Inductor(ElectricalLink, kind="inductor"):
    """Inductor, voltage = inductance d(current)/dt.

    Ports: from, to. Stored energy: inductance current^2 / 2 [J]. Dissipated: none.
    """

    inductance: Annotated[float, Quantity("inductance", positive, "inductance [H]", INDUCTANCES)]
    initial_current: Annotated[
        float | None,
        Quantity("current", about="current at the start; that of equilibrium if left out [A]"),
    ] = None


class InductorRows(ElectricalRows, kind="inductor"):
    """Conversion of inductors to stores of current."""

    def network_elements(self, case, name, part):
        place = f"links.{name}"
        return [
            Element(
                INERTANCE,
                place,
                place,
                ends_of(case, part),
                part.inductance,
                f"{name}.current",
                SMALL_CURRENT,
                part.initial_current,
                ledger="stored",
            )
        ], []


class Capacitor(ElectricalLink, kind="capacitor"):
    """Capacitor, current = capacitance d(voltage)/dt.

    Ports: from, to. Stored energy: capacitance voltage^2 / 2 [J]. Dissipated: none.
    """

    capacitance: Annotated[
        float, Quantity("capacitance", positive, "capacitance [F]", CAPACITANCES)
    ]
    initial_voltage: Annotated[
        float | None,
        Quantity("voltage", about="voltage at the start; that of equilibrium if left out [V]"),
    ] = None


class CapacitorRows(ElectricalRows, kind="capacitor"):
    """Conversion of capacitors to stores of voltage."""

    def network_elements(self, case, name, part):
        place = f"links.{name}"
        first, second = ends_of(case, part)
        sign = -1.0 if first is None else 1.0
        ends = (first, second) if sign > 0.0 else (second, first)
        initial = None if part.initial_voltage is None else sign * part.initial_voltage
        return [
            Element(
                CAPACITY,
                place,
                place,
                ends,
                part.capacitance,
                f"{name}.voltage",
                SMALL_VOLTAGE,
                initial,
                ledger="stored",
            )
        ], []

    def probe(self, draft, name, probe, row) -> None:
        first, _ = ends_of(draft.case, draft.case.links[name])
        reads = {"current": "flow", "voltage": "drop"}[probe.quantity]
        fill_network_probe(draft, row, f"links.{name}", reads, -1.0 if first is None else 1.0)


class ElectricalSwitch(ElectricalLink, kind="switch"):
    """Switch, closed while closed(t) is above 0.5: a resistance while closed, no current while open.

    Ports: from, to. Stored energy: none. Dissipated power: resistance current^2 [W].
    """

    closed: Annotated[Schedule, Scheduled("number", about="closed above 0.5, open otherwise")]
    resistance: Annotated[
        float, Quantity("resistance", positive, "resistance while closed [ohm]", RESISTANCES)
    ] = 1e-3


class SwitchRows(NetworkRows, kind="switch"):
    """Conversion of switches."""

    input_kinds: ClassVar = {"closed": ANY_VALUE}

    def network_elements(self, case, name, part):
        place = f"links.{name}"
        found = [
            Element(
                RESISTANCE,
                place,
                place,
                ends_of(case, part),
                part.resistance,
                switch=place,
                ledger="dissipated",
            )
        ]
        return found, [
            Switch(codes.SWITCH, place, place, place, place, (0.0,), part.closed, "closed")
        ]

    def probe(self, draft, name, probe, row) -> None:
        reads = "all flows" if probe.quantity == "current" else "drop"
        fill_network_probe(draft, row, f"links.{name}", reads)


class Diode(ElectricalLink, kind="diode"):
    """Ideal diode with a forward voltage: voltage = forward_voltage + resistance times current while it conducts.

    It conducts from `from` to `to` while this current is positive. Ports: from, to. Stored energy: none. Dissipated
    power: voltage times current [W].
    """

    forward_voltage: Annotated[
        float, Quantity("voltage", nonnegative, "voltage above which it conducts [V]")
    ] = 0.0
    resistance: Annotated[
        float, Quantity("resistance", positive, "resistance while it conducts [ohm]", RESISTANCES)
    ] = 1e-3


class DiodeRows(NetworkRows, kind="diode"):
    """Conversion of diodes: a resistance and its forward voltage in series while they conduct."""

    quantities: ClassVar = {"current": (".forward", "flow", 1.0), "voltage": ("", "drop", 1.0)}

    def network_elements(self, case, name, part):
        place, (first, second), inner = f"links.{name}", ends_of(case, part), f"{name}.junction"
        return [
            Element(GAUGE, place, place, (first, second)),
            Element(
                RESISTANCE,
                f"{place}.resistance",
                place,
                (first, inner),
                part.resistance,
                switch=place,
                ledger="dissipated",
            ),
            Element(
                POTENTIAL,
                f"{place}.forward",
                place,
                (inner, second),
                schedule=constant(part.forward_voltage),
                switch=place,
                ledger="dissipated",
            ),
        ], [Switch(codes.DIODE, place, place, place, f"{place}.forward", (part.forward_voltage,))]


class DcMotor(Link, kind="dc-motor"):
    """DC motor or generator: voltage = torque_constant omega + resistance current + inductance d(current)/dt.

    The current enters at `p` and leaves at `n`; the torque torque_constant times current acts on the shaft.
    Ports: p, n, shaft. Stored energy: inductance current^2 / 2 [J]. Dissipated power: resistance current^2 [W].
    """

    in_network: ClassVar[bool] = True
    joins: ClassVar[dict[str, str]] = {"p": "electrical", "n": "electrical", "shaft": "rotational"}
    quantities: ClassVar[dict[str, str]] = {"current": "current", "torque": "torque"}
    main_quantities: ClassVar[tuple[str, ...]] = ("current", "torque")

    ports: Annotated[dict[str, str], Ports(("p", "n", "shaft"), "terminals p and n, and the shaft")]
    torque_constant: Annotated[
        float,
        Quantity(
            "torque_constant",
            nonzero,
            "torque per current, and voltage per angular velocity [N m/A]",
            UsualRange(1e-5, 1e3, "watch motors to rolling mills"),
        ),
    ]
    resistance: Annotated[
        float, Quantity("resistance", positive, "resistance of the armature [ohm]", RESISTANCES)
    ]
    inductance: Annotated[
        float | None,
        Quantity(
            "inductance", positive, "inductance of the armature; none if left out [H]", INDUCTANCES
        ),
    ] = None
    initial_current: Annotated[
        float | None,
        Quantity("current", about="current at the start; that of equilibrium if left out [A]"),
    ] = None
    heat_to: Annotated[str | None, HEAT_TO] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        if "initial_current" in given and "inductance" not in given:
            faults.append(
                (
                    ("initial_current",),
                    "needs the key `inductance`: without it no current is stored",
                )
            )
        return faults

    def faults(self, name: str, around: Any) -> Iterator:
        yield from heat_to_faults(self, around)


class DcMotorRows(NetworkRows, kind="dc-motor"):
    """Conversion of DC motors: a resistance, an inductance and a transformer between voltage and angular velocity."""

    quantities: ClassVar = {
        "current": (".coupling", "flow", 1.0),
        "torque": (".coupling", "second flow", -1.0),
    }

    def network_elements(self, case, name, part):
        place = f"links.{name}"
        p, n, shaft = (node_or_reference(case, part.ports[port]) for port in ("p", "n", "shaft"))
        inner = f"{name}.armature" if part.inductance is not None else f"{name}.brushes"
        found = [
            Element(
                RESISTANCE,
                f"{place}.resistance",
                place,
                (p, inner),
                part.resistance,
                ledger="dissipated",
                heat_to=part.heat_to,
            )
        ]
        if part.inductance is not None:
            found.append(
                Element(
                    INERTANCE,
                    f"{place}.inductance",
                    place,
                    (inner, f"{name}.brushes"),
                    part.inductance,
                    f"{name}.current",
                    SMALL_CURRENT,
                    part.initial_current,
                    ledger="stored",
                )
            )
        ends = (f"{name}.brushes", n, shaft, None)
        return [
            *found,
            Element(TRANSFORMER, f"{place}.coupling", place, ends, part.torque_constant),
        ], []

    def probe(self, draft, name, probe, row) -> None:
        place, part = f"links.{name}.coupling", draft.case.links[name]
        # torque = constant times current
        scale = 1.0 if probe.quantity == "current" else part.torque_constant
        fill_network_probe(draft, row, place, "flow", scale)

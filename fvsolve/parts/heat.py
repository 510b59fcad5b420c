"""Heat: heat capacities, ambients, conductors, convection, heat sources and heat exchangers."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from pydantic import Field

from fvsolve.core.assembly.lowering import InputKind
from fvsolve.errors import article
from fvsolve.parts import law_elements as codes
from fvsolve.parts.network_elements import (
    CAPACITY,
    FLOW,
    RESISTANCE,
    Element,
    NetworkRows,
    node_or_reference,
)
from fvsolve.parts.network_parts import GivenPotential, GivenPotentialRows, NetworkNodeRows, ends_of
from fvsolve.parts.nodes_and_links import Link, Node, TwoPort
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import Number, Quantity, Text, UsualRange, between, positive

TEMPERATURE = InputKind("K", "a temperature above 0 [K]", 0.0)
HEAT = InputKind("W", "a finite number [W]", small=100.0)
TEMPERATURES = UsualRange(150.0, 3000.0, "polar winters to furnaces")  # [K]
SMALL_TEMPERATURE = 1.0  # size of a small deviation, where the network does not tell [K]


class HeatCapacity(Node, kind="heat-capacity"):
    """Body of uniform temperature T, heat_capacity dT/dt = sum of the heat flows into it.

    Ports: those of the links that name it, temperature and heat flow. Stored energy: heat_capacity T [J]. Dissipated:
    none.
    """

    domain: ClassVar[str] = "thermal"
    quantities: ClassVar[dict[str, str]] = {"temperature": "temperature"}
    main_quantities: ClassVar[tuple[str, ...]] = ("temperature",)

    heat_capacity: Annotated[
        float,
        Quantity(
            "heat_capacity",
            positive,
            "heat per temperature [J/K]",
            UsualRange(1e-6, 1e12, "chips to buildings"),
        ),
    ]
    initial_temperature: Annotated[
        float | None,
        Quantity(
            "temperature",
            positive,
            "temperature at the start; that of equilibrium if left out [K]",
            TEMPERATURES,
        ),
    ] = None


class HeatCapacityRows(NetworkNodeRows, kind="heat-capacity"):
    """Conversion of heat capacities to stores of temperature."""

    def network_elements(self, case, name, part):
        place = f"nodes.{name}"
        return [
            Element(
                CAPACITY,
                place,
                place,
                (name, None),
                part.heat_capacity,
                f"{name}.temperature",
                SMALL_TEMPERATURE,
                part.initial_temperature,
                ledger="stored",
                thermal=True,
            )
        ], []


class Ambient(GivenPotential, kind="ambient"):
    """Surroundings with a given temperature.

    Ports: those of the links that name it, temperature and heat flow. Stored and dissipated energy: none; it supplies
    the heat that flows out of it [W].
    """

    domain: ClassVar[str] = "thermal"
    quantities: ClassVar[dict[str, str]] = {"temperature": "temperature"}
    main_quantities: ClassVar[tuple[str, ...]] = ("temperature",)
    potential_key: ClassVar[str] = "temperature"

    temperature: Annotated[
        Schedule, Scheduled("temperature", positive, "temperature [K]", TEMPERATURES)
    ]


class AmbientRows(GivenPotentialRows, kind="ambient"):
    """Conversion of ambients to sources of temperature."""

    input_kinds: ClassVar = {"temperature": TEMPERATURE}


class ThermalLink(TwoPort):
    """Link through which heat [W] flows; its entropy flow is the heat over the temperature of `from`."""

    in_network: ClassVar[bool] = True
    joins: ClassVar[dict[str, str]] = {"from": "thermal", "to": "thermal"}
    quantities: ClassVar[dict[str, str]] = {"heat": "power", "entropy_flow": "entropy_flow"}
    main_quantities: ClassVar[tuple[str, ...]] = ("heat",)

    from_: Annotated[str, Text("thermal node at its start"), Field(alias="from")]
    to: Annotated[str, Text("thermal node at its end")]


class ThermalConductor(ThermalLink, kind="thermal-conductor"):
    """Conduction of heat, heat = conductance (T_from - T_to).

    Ports: from, to. Stored and dissipated energy: none; it produces entropy.
    """

    conductance: Annotated[
        float, Quantity("thermal_conductance", positive, "heat per temperature difference [W/K]")
    ]

    @property
    def heat_conductance(self) -> float:
        """Heat per temperature difference [W/K]."""
        return self.conductance


class ThermalConductorRows(NetworkRows, kind="thermal-conductor"):
    """Conversion of thermal conductors and convection to resistances."""

    quantities: ClassVar = {"heat": ("", "flow", 1.0), "entropy_flow": ("", "entropy", 1.0)}

    def network_elements(self, case, name, part):
        place = f"links.{name}"
        return [
            Element(
                RESISTANCE,
                place,
                place,
                ends_of(case, part),
                1.0 / part.heat_conductance,
                thermal=True,
            )
        ], []


class Convection(ThermalLink, kind="convection"):
    """Convection between a surface and a fluid, heat = coefficient area (T_from - T_to).

    Ports: from, to. Stored and dissipated energy: none; it produces entropy.
    """

    coefficient: Annotated[
        float,
        Quantity(
            "heat_transfer_coefficient",
            positive,
            "heat transfer coefficient [W/m2/K]",
            UsualRange(0.5, 1e5, "still air to boiling water"),
        ),
    ]
    area: Annotated[float, Quantity("area", positive, "area of the surface [m2]")]

    @property
    def heat_conductance(self) -> float:
        """Heat per temperature difference [W/K]."""
        return self.coefficient * self.area


class ConvectionRows(ThermalConductorRows, kind="convection"):
    """Conversion of convection to resistances."""


class HeatSource(Link, kind="heat-source"):
    """Source of the heat flow heat(t) into `to`; entropy_flow is the heat over the temperature of `to`.

    Ports: to. Stored and dissipated energy: none; it supplies the heat [W].
    """

    in_network: ClassVar[bool] = True
    joins: ClassVar[dict[str, str]] = {"to": "thermal"}
    quantities: ClassVar[dict[str, str]] = {"heat": "power", "entropy_flow": "entropy_flow"}
    main_quantities: ClassVar[tuple[str, ...]] = ("heat",)

    to: Annotated[str, Text("thermal node that it heats"), Field()]
    heat: Annotated[
        Schedule, Scheduled("power", about="heat flow into `to`; negative for cooling [W]")
    ]

    @property
    def ports(self) -> dict[str, str]:
        """Places that the ports join: port name -> place."""
        return {"to": self.to}


class HeatSourceRows(NetworkRows, kind="heat-source"):
    """Conversion of heat sources to given flows."""

    quantities: ClassVar = {"heat": ("", "flow", 1.0), "entropy_flow": ("", "entropy", 1.0)}
    input_kinds: ClassVar = {"heat": HEAT}

    def network_elements(self, case, name: str, part: Any):
        place, to = f"links.{name}", node_or_reference(case, part.to)
        return [
            Element(
                FLOW,
                place,
                place,
                (None, to),
                schedule=part.heat,
                key="heat",
                ledger="supplied",
                thermal=True,
            )
        ], []


class HeatExchanger(ThermalLink, kind="heat-exchanger"):
    """Heat out of the fluid of a place into a thermal node: conductance (T - T_to), or effectiveness m cp (T - T_to).

    T is the temperature of the fluid in a tank or chamber, with the mass flow m into it. At a junction T is that of
    the mixed inflow m: before it is cooled for an effectiveness, after it for a conductance. Ports: from, to. Stored
    and dissipated energy: none; it supplies the heat [W] to the thermal network, and takes it from the fluid.
    """

    joins: ClassVar[dict[str, str]] = {"from": "hydraulic", "to": "thermal"}
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("conductance", "effectiveness"),)
    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("conductance", "effectiveness"),)

    from_: Annotated[
        str, Text("tank, chamber or junction whose fluid it cools or heats"), Field(alias="from")
    ]
    conductance: Annotated[
        float | None,
        Quantity("thermal_conductance", positive, "heat per temperature difference [W/K]"),
    ] = None
    effectiveness: Annotated[
        float | None,
        Number(
            between(0, 1), "heat over the greatest heat that the flow through the place could give"
        ),
    ] = None

    def faults(self, name: str, around: Any) -> Iterator:
        """Faults of a place that has no temperature of its own, and of further exchangers at a junction."""
        place = around.nodes.get(self.from_)
        if place is not None and place.kind not in EXCHANGING:
            text = f"{self.from_} is {article(place.kind)}, whose temperature no heat changes"
            yield ("from",), f"{text}; expected a tank, a chamber or a junction"
        others = [
            other
            for other, link in around.links.items()
            if other != name and link.kind == self.kind and link.from_ == self.from_
        ]
        if others and self.effectiveness is not None and getattr(place, "kind", "") == "junction":
            text = f"{others[0]} is at {self.from_} too; expected one heat exchanger at a junction"
            yield ("effectiveness",), f"{text}, or only exchangers with a conductance"


EXCHANGING = ("tank", "chamber", "junction")  # kinds of places whose fluid exchanges heat


class HeatExchangerRows(NetworkRows, kind="heat-exchanger"):
    """Conversion of heat exchangers to given heat flows."""

    quantities: ClassVar = {"heat": ("", "flow", 1.0), "entropy_flow": ("", "entropy", 1.0)}

    def network_elements(self, case, name: str, part: Any):
        place, to = f"links.{name}", node_or_reference(case, part.to)
        return [
            Element(
                FLOW,
                place,
                place,
                (None, to),
                reads=(codes.FLUID_HEAT, name),
                ledger="supplied",
                thermal=True,
            )
        ], []


def exchanger_names(case) -> list[str]:
    """Names of the heat exchangers of a case, in the order of their table."""
    return [name for name, link in case.links.items() if link.kind == "heat-exchanger"]

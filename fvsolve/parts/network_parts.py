"""Declarations common to parts of networks: given potentials, probes of nodes, dry friction, `heat_to`."""

from collections.abc import Iterator
from typing import Any, ClassVar

from fvsolve.parts import law_elements as codes
from fvsolve.parts.network_elements import (
    FLOW,
    LOCK,
    POTENTIAL,
    Element,
    NetworkRows,
    Switch,
    network_of,
    node_or_reference,
)
from fvsolve.parts.nodes_and_links import Node
from fvsolve.parts.schedule import Schedule
from fvsolve.parts.value import Text
from fvsolve.units import show

HEAT_TO = Text("thermal node that its dissipation heats")


class GivenPotential(Node):
    """Node with a given potential; potential_key : key that gives it."""

    potential_key: ClassVar[str] = ""

    @property
    def reference_potential(self) -> Schedule:
        """Its given potential."""
        return getattr(self, self.potential_key)


class NetworkNodeRows(NetworkRows, kind=""):
    """Base of the conversion of nodes, whose probes read their potential, or the angle of a shaft."""

    def probe(self, draft, name, probe, row) -> None:
        network_of(draft).fill_node_probe(draft, row, name, probe.quantity == "angle")


class GivenPotentialRows(NetworkNodeRows, kind=""):
    """Base of the conversion of nodes with a given potential to sources; the constant 0 is the reference."""

    def network_elements(self, case, name, part):
        if node_or_reference(case, name) is None:
            return [], []
        return [
            Element(
                POTENTIAL,
                f"nodes.{name}",
                f"nodes.{name}",
                (name, None),
                schedule=part.reference_potential,
                key=part.potential_key,
                ledger="supplied",
                thermal=part.domain == "thermal",
            )
        ], []


def ends_of(case, part: Any) -> tuple[str | None, str | None]:
    """Nodes of the network that both ports of a link join; None for the reference."""
    return node_or_reference(case, part.from_), node_or_reference(case, part.to)


def dry_friction(
    place: str,
    ends: tuple,
    numbers: tuple[float, ...],
    heat_to: str | None = None,
    torque: Schedule | None = None,
) -> tuple[list[Element], list[Switch]]:
    """(elements, switches) of dry friction: a torque or force while it slips, equal speeds while it sticks.

    numbers : as those of `Switch`; torque : schedule of the torque of a clutch
    """
    switch = Switch(
        codes.FRICTION,
        place,
        place,
        f"{place}.friction",
        f"{place}.lock",
        numbers,
        torque,
        "torque",
    )
    return [
        Element(
            FLOW,
            f"{place}.friction",
            place,
            ends,
            reads=(codes.FRICTION_FLOW, place),
            ledger="dissipated",
            heat_to=heat_to,
        ),
        Element(LOCK, f"{place}.lock", place, ends, numbers[1] or 1.0, switch=place),
    ], [switch]


def heat_to_faults(part: Any, around: Any) -> Iterator:
    """Fault of a key `heat_to` that names no thermal node."""
    if (
        part.heat_to is not None
        and getattr(around.nodes.get(part.heat_to), "domain", "") != "thermal"
    ):
        thermal = [
            node
            for node, other in around.nodes.items()
            if getattr(other, "domain", "") == "thermal"
        ]
        has = (
            f"thermal nodes are {', '.join(thermal)}" if thermal else "the case has no thermal node"
        )
        yield ("heat_to",), f"no thermal node named {show(part.heat_to)}; {has}"

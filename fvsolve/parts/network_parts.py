"""Declarations common to parts of rotation, electricity and heat: given potentials, probes of nodes, `heat_to`."""

from collections.abc import Iterator
from typing import Any, ClassVar

from fvsolve.assembly.network_elements import POTENTIAL, Element, NetworkRows, node_or_reference
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
        draft.network.fill_node_probe(draft, row, name, probe.quantity == "angle")


class GivenPotentialRows(NetworkNodeRows, kind=""):
    """Base of the conversion of nodes with a given potential to sources; the constant 0 is the reference."""

    def network_elements(self, case, name, part):
        if node_or_reference(case, name) is None:
            return [], []
        return [Element(POTENTIAL, f"nodes.{name}", f"nodes.{name}", (name, None), schedule=part.reference_potential,
                        key=part.potential_key, ledger="supplied", thermal=part.domain == "thermal")], []  # fmt: skip


def ends_of(case, part: Any) -> tuple[str | None, str | None]:
    """Nodes of the network that both ports of a link join; None for the reference."""
    return node_or_reference(case, part.from_), node_or_reference(case, part.to)


def heat_to_faults(part: Any, around: Any) -> Iterator:
    """Fault of a key `heat_to` that names no thermal node."""
    if part.heat_to is not None and getattr(around.nodes.get(part.heat_to), "domain", "") != "thermal":
        thermal = [node for node, other in around.nodes.items() if getattr(other, "domain", "") == "thermal"]
        has = f"thermal nodes are {', '.join(thermal)}" if thermal else "the case has no thermal node"
        yield ("heat_to",), f"no thermal node named {show(part.heat_to)}; {has}"

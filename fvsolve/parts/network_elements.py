"""Elements of networks of potential and flow, into which parts of rotation, electricity and heat are converted.

The feature `networks` puts them together: a part with elements has a lowering with the method `network_elements`, which
returns its elements and switches.
"""

from __future__ import annotations

from typing import Any, ClassVar, NamedTuple

from fvsolve.core.assembly.features import with_slot
from fvsolve.core.assembly.lowering import Input, InputKind, Lowering
from fvsolve.parts import law_elements as codes

CAPACITY, INERTANCE, RESISTANCE, POTENTIAL, FLOW, TRANSFORMER, LOCK, GAUGE = range(8)
"""Kinds of elements: flow = value d potential / dt; potential = value d flow / dt; potential = value times flow; given
potential; given flow; potential 1 = value times potential 2; equal potentials, with the value as share of the flow of
locks in parallel; a difference that is only read."""


class Element(NamedTuple):
    """Element of a network, with the flow into it at `ends[0]` and out of it at `ends[1]`.

    name : its own name, such as "links.motor.inductance"; part : place of its part in the case, such as "links.motor"
    ends : nodes, None for the reference; of a transformer the second pair of nodes follows, with the flow -value times
    that of the first pair
    state, small, initial : of a store, name of its state, size of a small deviation, and stated value at the start
    state_of : part whose state it is, if the network does not own the state; unit : potential of a unit of this state
    A source with a state follows the integral of the difference of potentials at its ends, which is that state.
    schedule, key : of a source that follows a schedule of its part; reads : (kind of `network_inputs`, name) of another
    switch : name of the switch that is on while the element is active, "" for an element that is always active
    ledger : category in the energy ledger, "" for none; thermal : True if its flow is a heat flow
    heat_to : thermal node that gets what it dissipates
    """

    kind: int
    name: str
    part: str
    ends: tuple[str | None, ...]
    value: float = 1.0
    state: str = ""
    small: float = 1.0
    initial: float | None = None
    state_of: tuple[str, str] | None = None
    unit: float = 1.0
    schedule: Any = None
    key: str = ""
    reads: tuple[int, str] | None = None
    switch: str = ""
    ledger: str = ""
    thermal: bool = False
    heat_to: str | None = None

    @property
    def is_store(self) -> bool:
        """True if it stores potential or flow."""
        return self.kind in (CAPACITY, INERTANCE)

    @property
    def is_source(self) -> bool:
        """True if its potential or flow is given."""
        return self.kind in (POTENTIAL, FLOW)


class Switch(NamedTuple):
    """Element that is on or off, as an event flag tells.

    kind : SWITCH, DIODE or FRICTION of `law_elements`, which is on while it sticks; schedule : what closes a switch, or
    the torque of a clutch, with its key
    drop, flow : names of the elements whose difference of potentials and whose flow decide
    numbers : forward voltage of a diode; of friction: kinetic torque, greatest torque at rest, speed of the exponential
    (0 for none); factor of the torque at rest on a scheduled torque
    """

    kind: int
    name: str
    part: str
    drop: str
    flow: str
    numbers: tuple[float, ...]
    schedule: Any = None
    key: str = ""


class NetworkRows(Lowering):
    """Conversion of parts of networks: their elements, and the rows that their probes read.

    quantities : quantity of a probe -> (end of the name of an element, what is read of it, sign): "drop", "flow",
    "power", "entropy" (heat flow over temperature), "all flows" (of the elements of a part) or "locked" (of friction)
    input_kinds : key -> kind of the input
    """

    quantities: ClassVar[dict[str, tuple[str, str, float]]] = {}
    input_kinds: ClassVar[dict[str, InputKind]] = {}

    def inputs(self, model, name, part):
        place = f"{'links' if name in model.case.links and model.case.links[name] is part else 'nodes'}.{name}"
        schedules = network_of(model).schedules
        return {
            key: Input(kind, schedules[place, key])
            for key, kind in self.input_kinds.items()
            if (place, key) in schedules
        }

    def probe(self, draft, name, probe, row) -> None:
        end, reads, sign = self.quantities[probe.quantity]
        fill_network_probe(draft, row, f"{probe.part}.{name}{end}", reads, sign)


def network_of(owner) -> Any:
    """Network (`features.networks.network.Network`) of a draft or model; None without one."""
    own = with_slot(owner.features, codes.SLOT)
    return None if own is None else own.network


def fill_network_probe(draft, row, element: str, reads: str, sign: float = 1.0) -> None:
    """Fill the row of a probe that reads an element of the network; arguments as in `NetworkRows.quantities`."""
    network = network_of(draft)
    row["kind"], row["scale"] = codes.NETWORK_VALUE, sign
    row["side"] = {"power": codes.POWER, "entropy": codes.ENTROPY, "locked": codes.LOCKED}.get(
        reads, codes.ROW
    )
    if reads == "locked":
        row["index"] = network.flags[element]
    elif reads == "all flows":
        row["index"] = network.total_row(element)
    else:
        drop, flow = network.rows_of(element)
        row["index"], row["cell"] = flow if reads == "flow" else drop, flow
        if reads == "entropy":
            row["index"] = network.node_row(
                next(node for node in network.ends_of(element) if node is not None)
            )


def node_or_reference(case, place: str) -> str | None:
    """Node of the network that a port joins; None for a place whose potential is always zero."""
    node = case.nodes.get(place)
    schedule = getattr(node, "reference_potential", None)
    return None if schedule is not None and schedule.constant and schedule.first == 0.0 else place

"""Tables of a network of rotation, electricity and heat: elements, states, sources and switches; faults of networks."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fvsolve.core.assembly.features import coordinate_of
from fvsolve.core.assembly.lowering import lowering_of
from fvsolve.features.networks.elimination import (
    Elimination,
    NetworkError,
    dependent_stores,
    substituted,
)
from fvsolve.features.networks.faults import NO_INERTIA, NO_SPEED, network_faults, stated_faults
from fvsolve.features.networks.kernels.tables import (
    NETWORK_ELEMENT,
    NETWORK_INPUT,
    NETWORK_RATE,
    NETWORK_SWITCH,
)
from fvsolve.features.networks.network import MOST_STATES, Network
from fvsolve.parts import law_elements as codes
from fvsolve.parts.heat import exchanger_names
from fvsolve.parts.network_elements import FLOW, INERTANCE, Element, Switch, node_or_reference

CURRENT_ROUNDING = 1e-13  # of diodes, over the sum of all sources divided by their resistance
SAMPLES = 12  # times at which responses are computed for the sizes of states
CATEGORIES = {
    "": codes.NOT_BOOKED,
    "stored": codes.STORED,
    "dissipated": codes.DISSIPATED,
    "supplied": codes.SUPPLIED,
}
EVENTS = {
    codes.SWITCH: ("closes", "opens"),
    codes.DIODE: ("conducts", "blocks"),
    codes.FRICTION: ("slips forward", "sticks", "slips backward", "sticks"),
}


def lower_network(own, draft) -> Network | None:
    """Fill the tables of the network of a case, and add the states of its stores and of angles that are probed.

    Returns the network, None if the case has no elements or if the network has a fault. own : feature of the draft
    """
    elements, switches = parts_of_network(draft.case)
    if not elements:
        return None
    network = Network(
        elements, switches, tuple(sorted(draft.case.network_places)), rounding=draft.rounding
    )
    try:
        found = network.equations(network.conducting)
    except NetworkError as error:
        case, fixed = draft.case, network.states_of_others
        found = [
            *network_faults(error.faults, case),
            *stated_faults(error.relations, network.stores, fixed, case),
        ]
        for place, text in found:
            draft.fault(place, text)
        return None
    network.dependent = dependent_stores(found.relations, network.stores, network.states_of_others)
    for place, text in friction_faults(network, found):
        draft.fault(place, text)
    for item in network.sources:
        if item.schedule is not None:
            network.schedules[item.part, item.key] = draft.schedules.add(item.schedule)
    for switch in network.switches:
        if switch.schedule is not None:
            network.schedules[switch.part, switch.key] = draft.schedules.add(switch.schedule)
        network.flags[switch.name] = draft.flags(switch.part.partition(".")[2], EVENTS[switch.kind])
    sizes = response_sizes(network, draft.case)
    for column, item in network.stores.items():
        if column not in network.dependent:
            network.states[column] = state_place(draft, item, sizes[column])
    for name in probed_angles(draft.case):
        network.integrals[name] = draft.states([f"{name}.angle"], 1.0)
    network.integrals |= {
        item.name: state_place(draft, item, 1.0) for item in network.sources if item.state_of
    }
    for place, text in speed_faults(draft, network):
        draft.fault(place, text)
    fill_tables(own, draft, network)
    return network


def parts_of_network(case) -> tuple[list[Element], list[Switch]]:
    """Elements and switches of all parts of a case, then sources of heat of parts with `heat_to`."""
    elements: list[Element] = []
    switches: list[Switch] = []
    for name, part in (*case.nodes.items(), *case.links.items()):
        lowering = lowering_of(type(part)).of(part)
        if hasattr(lowering, "network_elements"):
            own, more = lowering.network_elements(case, name, part)
            elements += own
            switches += more
    for item in [item for item in elements if item.heat_to is not None]:
        node = node_or_reference(case, item.heat_to)
        elements.append(
            Element(
                FLOW,
                f"{item.name}.heat",
                item.part,
                (None, node),
                reads=(codes.HEAT_INPUT, item.name),
                thermal=True,
            )
        )
    return elements, switches


def friction_faults(network: Network, found: Elimination) -> Iterator[tuple[str, str]]:
    """Yield a fault (place, text) for each dry friction whose slip depends on a torque of friction at once."""
    torques = {
        network.columns[item.name]
        for item in network.sources
        if item.reads and item.reads[0] == codes.FRICTION_FLOW
    }
    for switch in network.switches:
        if switch.kind == codes.FRICTION:
            terms = found.drop(network.elements[network.numbers[switch.drop]])
            if torques & terms.keys():
                yield switch.part, NO_INERTIA


def speed_faults(draft, network: Network) -> Iterator[tuple[str, str]]:
    """Yield a fault (place, text) for each device on a shaft whose speed does not follow from stores and schedules."""
    rows, first = network.terms(network.conducting), len(network.stores)
    for name, part, device in draft.devices:
        shaft = device.turns_with(part)
        follows = () if shaft is None else rows[network.node_row(shaft)]
        if any(
            column >= first and network.sources[column - first].schedule is None
            for column in follows
        ):
            yield f"links.{name}.ports.shaft", f"{shaft} {NO_SPEED}"


def state_place(draft, item: Element, size: float) -> int:
    """Place in y of the state of a store: a new state, or that of another part."""
    if item.state_of is None:
        return draft.states([item.state], size)
    kind, name = item.state_of
    if kind == "device":
        return int(draft.device_table[draft.device_names.index(name)]["y"])
    return coordinate_of(draft, name).rate


def probed_angles(case) -> list[str]:
    """Nodes whose angle a probe of the case or an input of a block reads."""
    probes = [*case.probes, *case.extreme_probes]
    probes += [
        item
        for block in case.controls.values()
        for item in block.inputs
        if not isinstance(item, str)
    ]
    return list(
        dict.fromkeys(
            p.name
            for p in probes
            if p.part == "nodes"
            and p.quantity == "angle"
            and case.nodes[p.name].domain == "rotational"
        )
    )


def fill_tables(own, draft, network: Network) -> None:
    """Fill the tables of sources, rates, elements with power, switches, and shafts that devices read."""
    own.source_table = np.zeros(len(network.sources), NETWORK_INPUT)
    for item, row in zip(network.sources, own.source_table, strict=True):
        row["sign"] = 1.0
        if item.reads is None:
            row["kind"], row["index"] = codes.SCHEDULE_INPUT, network.schedules[item.part, item.key]
            continue
        row["kind"], name = item.reads
        if row["kind"] == codes.DEVICE_INPUT:
            name, quantity, row["sign"] = name
            row["index"] = draft.device_names.index(name)
            row["side"] = draft.devices[row["index"]][2].quantities.index(quantity)
        elif row["kind"] == codes.FORCE_INPUT:
            row["index"] = coordinate_of(draft, name).net
        elif row["kind"] == codes.FLUID_HEAT:
            row["index"] = exchanger_names(draft.case).index(name)
        elif row["kind"] == codes.FRICTION_FLOW:
            row["index"] = [switch.name for switch in network.switches].index(name)
        else:
            row["index"] = [other.name for other in network.booked].index(name)
    thermal = [draft.case.links[name].to for name in exchanger_names(draft.case)]
    own.thermal_rows = np.array([network.node_row(node) for node in thermal], dtype=np.int64)
    for scalar in draft.case.scalars.values():
        if scalar.heat:
            own.settings[0]["zero"] = scalar.zero
    by_shaft = {k: device.turns_with(part) for k, (_, part, device) in enumerate(draft.devices)}
    devices = [k for k, shaft in by_shaft.items() if shaft is not None]
    own.shafts = list(dict.fromkeys(by_shaft[k] for k in devices))
    own.turned = np.array([network.node_row(shaft) for shaft in own.shafts], dtype=np.int64)
    own.turned_devices = np.array(devices, dtype=np.int64)
    places = [*network.states.values(), *network.integrals.values()]
    own.rates = np.array([(place,) for place in places], NETWORK_RATE)
    own.elements = np.zeros(len(network.booked), NETWORK_ELEMENT)
    for item, row in zip(network.booked, own.elements, strict=True):
        row["drop"], row["flow"] = network.rows_of(item.name)
        row["category"] = CATEGORIES["" if item.heat_to is not None else item.ledger]
        row["thermal"], row["weight"] = (
            item.thermal,
            (item.ends[0] is not None) - (item.ends[1] is not None),
        )
        if item.is_store:
            row["inertance" if item.kind == INERTANCE else "capacity"] = item.value
    own.switches = np.zeros(len(network.switches), NETWORK_SWITCH)
    for switch, row in zip(network.switches, own.switches, strict=True):
        row["kind"], row["flag"] = switch.kind, network.flags[switch.name]
        row["schedule"] = network.schedules.get((switch.part, switch.key), -1)
        row["drop"] = network.rows_of(switch.drop)[0]
        row["flow"] = network.rows_of(switch.flow)[1]
        if switch.kind == codes.FRICTION:
            row["kinetic"], row["static"], row["stribeck"], row["factor"] = switch.numbers
        else:
            row["forward"] = switch.numbers[0]
            if switch.kind == codes.DIODE:
                ohm = network.elements[network.numbers[f"{switch.name}.resistance"]].value
                row["rounding"] = CURRENT_ROUNDING * sum(map(source_size, network.sources)) / ohm


def response_sizes(network: Network, case) -> dict[int, float]:
    """Sizes of small deviations of all stores: greatest responses to the sizes of sources and of initial values.

    The network responds to steps of its sources and to the initial values of its stores, at times between the fastest
    and the slowest of its own and up to the length of the run.
    """
    small = {column: item.small for column, item in network.stores.items()}
    free = [column for column in network.stores if column not in network.dependent]
    n = len(free)
    if not 0 < n <= MOST_STATES:
        return small
    from scipy.linalg import expm

    found = network.equations(network.conducting)
    place = {column: k for k, column in enumerate(free)}
    inputs = {
        network.columns[item.name]: size
        for item in network.sources
        if (size := source_size(item)) > 0.0
    }
    a, b = np.zeros((n, n)), np.zeros((n, len(inputs)))
    for column in free:
        for other, value in substituted(found.rate(column), network.dependent).items():
            if other in place:
                a[place[column], place[other]] = value
            elif other in inputs:
                b[place[column], list(inputs).index(other)] = value * inputs[other]
    starts = np.diag([abs(network.stores[column].initial or 0.0) for column in free])
    rates = np.abs(np.linalg.eigvals(a))
    span = case.numerics.end - case.numerics.start
    fast, last = float(rates.max(initial=0.0)), span
    if fast > 0.0:
        last = min(span, 3.0 / float(rates[rates > 1e-9 * fast].min()))
    times = np.geomspace(min(0.3 / fast, last) if fast > 0.0 else last, last, SAMPLES)
    drive = np.hstack([b, a @ starts])
    whole = np.block([[a, drive], [np.zeros((drive.shape[1], n + drive.shape[1]))]])
    largest = np.zeros(n)
    for time in times:
        largest = np.maximum(largest, np.abs(expm(whole * time)[:n, n:]).sum(axis=1))
    return small | {
        column: float(size)
        for column, size in zip(free, largest, strict=True)
        if np.isfinite(size) and size > 1e-9 * small[column]
    }


def source_size(item: Element) -> float:
    """Greatest magnitude of a scheduled source [SI]; 0 for other sources, and where it has no bound."""
    if item.schedule is None:
        return 0.0
    finite = np.abs(item.schedule.value[np.isfinite(item.schedule.value)])
    return float(finite.max(initial=0.0))


def network_rate(network: Network) -> float:
    """Greatest rate of a network [1/s], in the mode in which all switches conduct."""
    if not network.states:
        return 0.0
    columns = list(network.states)
    rows = network.terms(network.conducting)[: len(columns)]
    # rates of energies have equal units
    root = {column: network.stores[column].value ** 0.5 for column in columns}
    if len(columns) > MOST_STATES:
        sums = (
            sum(
                abs(value) * root[column] / root[other]
                for other, value in row.items()
                if other in root
            )
            for column, row in zip(columns, rows, strict=True)
        )
        return max(sums, default=0.0)
    matrix = np.array([[row.get(column, 0.0) for column in columns] for row in rows])
    return float(np.abs(np.linalg.eigvals(matrix)).max())

"""Start of a network of potential and flow: stores in equilibrium where no value is stated, state of its switches."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fvsolve.core.assembly.features import coordinate_of
from fvsolve.core.steady import union
from fvsolve.errors import listing
from fvsolve.features.networks.elimination import Elimination, NetworkError, Terms, substituted
from fvsolve.features.networks.faults import network_faults, tie_fault
from fvsolve.parts import law_elements as codes
from fvsolve.parts.network_elements import Element

TURNS = 60  # changes of switches, and of nonlinear sources, in the search
RESTING = 1e-9  # rate of a store in equilibrium, over the sum of the magnitudes of its terms
LOOSE = 1e-6  # share of a store in a change of values under which no rate changes
SLIP = 1e-12  # slip that is rounding, over the sum of the magnitudes of its speeds


class NetworkStart:
    """Search for the values of all stores and sources of a network at the start, and for the state of its switches.

    values : of all columns; mode : as for `Network.equations`; directions : of each friction, 0 while it sticks
    solved : True if the start of all other parts is known
    integrating : sources that follow the integral of the difference of their potentials, by column
    free : columns of stores whose value is not known, then of integrating sources whose state is not known
    """

    def __init__(self, own, draft, start, solved: bool = True) -> None:
        self.own, self.draft, self.start, self.network, self.solved = (
            own,
            draft,
            start,
            own.network,
            solved,
        )
        self.values = np.zeros(len(self.network.columns))
        self.integrating = {
            self.network.columns[item.name]: item for item in self.network.sources if item.state_of
        }
        self.free = self.stated_values()
        self.switches = self.network.switches
        self.known = self.stores.keys() - {*self.free}
        self.exchange = [
            self.fluid_exchange(item)
            for item in self.network.sources
            if item.reads is not None and item.reads[0] == codes.FLUID_HEAT
        ]
        self.directions = [self.first_direction(k) for k in range(len(self.switches))]
        self.mode = tuple(self.begins_on(k) for k in range(len(self.switches)))

    @property
    def stores(self) -> dict[int, Element]:
        """Stores by column."""
        return self.network.stores

    def item(self, column: int) -> Element:
        """Store or integrating source of a column."""
        return self.stores.get(column) or self.integrating[column]

    def stated_values(self) -> list[int]:
        """Write the stated values of stores and sources; returns the columns of stores whose value is not known."""
        network, known = self.network, set()
        for item in network.sources:
            if item.reads is None:
                schedule = network.schedules[item.part, item.key]
                self.values[network.columns[item.name]] = self.start.schedule_value(schedule)
            elif item.reads[0] in (codes.DEVICE_INPUT, codes.FORCE_INPUT) and self.solved:
                self.values[network.columns[item.name]] = self.given_by_others(item)
        for column, item in self.stores.items():
            value = item.initial if item.state_of is None else self.state_of_other(item)
            value = self.own.start_speeds.get(column) if value is None else value
            if value is not None:
                self.values[column] = value
                known.add(column)
        for column, terms in network.dependent.items():
            unknown = [other for other in terms if other not in known]
            rest = sum(
                value * self.values[other] for other, value in terms.items() if other in known
            )
            if column in known and unknown:
                self.values[unknown[0]] = (self.values[column] - rest) / terms[unknown[0]]
                known.add(unknown[0])
            elif column in known:
                self.check_tie(column, float(rest), terms)
        stores = [
            column
            for column in self.stores
            if column not in known and column not in network.dependent
        ]
        return stores + [
            column for column, item in self.integrating.items() if item.initial is None
        ]

    def given_by_others(self, item: Element) -> float:
        """Quantity of a device, such as the torque of the fluid on a shaft, or force on a mass, at the start."""
        kind, name = item.reads
        draft = self.draft
        if kind == codes.FORCE_INPUT:
            return coordinate_of(draft, name).force
        name, quantity, sign = name
        k = draft.device_names.index(name)
        _, part, device = draft.devices[k]
        own = [
            column
            for column, other in self.integrating.items()
            if other.state_of == ("device", name)
        ]
        flow = float(self.values[own[0]]) if own else 0.0
        return sign * device.source_at_start(
            self.start, part, draft.device_table[k], quantity, flow
        )

    def fluid_exchange(self, item: Element) -> tuple[int, int, float, float]:
        """Heat exchanger at the start: (column of its heat, of its thermal node, conductance [W/K], temperature [K]).

        The heat is conductance (temperature - that of the thermal node). Adds a fault at a junction, where the fluid is
        mixed, if the temperature of the thermal node is not stated.
        """
        case, name = self.draft.case, item.reads[1]
        link = case.links[name]
        label, scalar = next((key, value) for key, value in case.scalars.items() if value.heat)
        place, i = case.nodes[link.from_], self.draft.node_index[self.draft.inside(link.from_)]
        value = place.scalars[label].first if label in place.scalars else scalar.initial
        heat, node = self.network.columns[item.name], self.potential_column(item.ends[1])
        inflow = 0.0
        for table in (self.draft.valve_table, self.draft.pipe_table):
            inflow += float(table["flow"][table["to_node"] == i].clip(min=0.0).sum())
            inflow -= float(table["flow"][table["from_node"] == i].clip(max=0.0).sum())
        effectiveness = link.effectiveness or 0.0
        conductance = (link.conductance or 0.0) + effectiveness * inflow * scalar.specific_heat
        if node in self.free and place.kind == "junction":
            text = f"its temperature at the start follows from that of junction {link.from_}"
            self.draft.fault(self.stores[node].part, f"{text}; give the key `initial_temperature`")
        return heat, node, conductance, value + scalar.zero

    def potential_column(self, node: str) -> int:
        """Column of the store or source that gives a thermal node its temperature."""
        (column,) = self.network.equations(self.network.conducting).potential(node)
        return column

    def state_of_other(self, item: Element) -> float:
        """Potential at the start of a store whose state is that of another part."""
        kind, name = item.state_of
        draft = self.draft
        if kind == "mass":
            return coordinate_of(draft, name).velocity
        k = draft.device_names.index(name)
        return item.unit * float(
            draft.devices[k][2].speed_at(self.start, int(draft.device_table[k]["valve"]))
        )

    def first_direction(self, k: int) -> float:
        """Direction of a slip between known speeds; 0 for friction that may stick, and for other switches."""
        switch = self.switches[k]
        if switch.kind != codes.FRICTION:
            return 0.0
        found = self.network.equations(self.network.conducting)
        terms = substituted(found.drop(self.element(switch.drop)), self.network.dependent)
        slip = self.sum_of(terms)
        known = all(column in self.known for column in terms if column in self.stores)
        return float(np.sign(slip)) if known and abs(slip) > self.rounding(terms) else 0.0

    def begins_on(self, k: int) -> bool:
        """First guess of the state of a switch: as scheduled; diodes block; friction sticks."""
        switch = self.switches[k]
        if switch.kind != codes.SWITCH:
            return switch.kind == codes.FRICTION and self.directions[k] == 0.0
        return self.start.schedule_value(self.network.schedules[switch.part, switch.key]) > 0.5

    # search ---------------------------------------------------------------------------------------------------

    def find(self) -> None:
        """Search for the start, and write it to the tables of the draft and to the network of the feature."""
        for _ in range(TURNS):
            try:
                faults = self.solve()
            except NetworkError as error:
                if self.let_slip():
                    continue
                for place, text in network_faults(error.faults, self.draft.case):
                    self.draft.fault(place, text)
                return
            if not self.change_switch():
                break
        else:
            text = "its state at the start alternates; state the initial values of the stores"
            faults = [(self.switches[0].part, text)]
        for place, text in faults:
            self.draft.fault(place, text)
        count = len(self.stores)
        for item in self.network.cut_sources(self.mode, self.values[count:]) if not faults else ():
            self.draft.fault(
                item.part,
                "its current at the start has no way; close a switch, or leave out the flux",
            )
        for column, terms in self.network.ties_of(self.mode).items() if not faults else ():
            self.check_tie(column, self.sum_of(terms), terms)
        self.write()

    def check_tie(self, column: int, value: float, terms: Terms) -> None:
        """Add a fault if a store does not have the value that the stores have to which it is tied."""
        if fault := tie_fault(
            self.draft.case, self.stores, column, float(self.values[column]), value, terms
        ):
            self.draft.fault(*fault)

    def let_slip(self) -> bool:
        """Let the last friction slip that sticks, where the mode has no solution; False if there is none."""
        sticking = [
            k for k, on in enumerate(self.mode) if on and self.switches[k].kind == codes.FRICTION
        ]
        if not sticking:
            return False
        k, network = sticking[-1], self.network
        found = network.equations(network.conducting)
        slip = self.sum_of(
            substituted(found.drop(self.element(self.switches[k].drop)), network.dependent)
        )
        self.directions[k], self.mode = (
            float(np.sign(slip)) or 1.0,
            (*self.mode[:k], False, *self.mode[k + 1 :]),
        )
        return True

    def sum_of(self, terms: Terms) -> float:
        """Value of a linear function at the present values."""
        return float(sum(value * self.values[column] for column, value in terms.items()))

    def size_of(self, terms: Terms) -> float:
        """Sum of the magnitudes of its terms."""
        return float(sum(abs(value * self.values[column]) for column, value in terms.items()))

    def rounding(self, terms: Terms) -> float:
        """Value of a linear function below which it is rounding."""
        small = sum(
            abs(value) * self.stores[column].small
            for column, value in terms.items()
            if column in self.stores
        )
        return SLIP * (small + self.size_of(terms))

    def solve(self) -> list[tuple[str, str]]:
        """Solve for the free stores in the present mode; returns the faults (place, text) without an equilibrium."""
        faults: list[tuple[str, str]] = []
        for _ in range(TURNS):
            before = self.values.copy()
            faults = self.balance()
            for column, terms in self.network.dependent.items():
                self.values[column] = self.sum_of(terms)
            self.set_nonlinear_sources()
            if np.all(
                np.abs(self.values - before) <= 1e-14 * (np.abs(before) + np.abs(self.values))
            ):
                break
        return faults

    def balance(self) -> list[tuple[str, str]]:
        """Set the free stores so that their rates are zero and ties of the mode hold; returns faults (place, text)."""
        network = self.network
        found = self.network.equations(self.mode)
        place = {c: k for k, c in enumerate(self.free)}
        if not place:
            return []
        ties = network.ties_of(self.mode)
        laws = [
            substituted(self.rate(found, column), network.dependent)
            for column in self.free
            if column not in ties
        ]
        laws += [
            {column: -1.0} | terms
            for column, terms in ties.items()
            if place.keys() & {column, *terms}
        ]
        matrix, given = np.zeros((len(laws), len(place))), np.zeros(len(laws))
        self.set_fluid_heat()
        for row, law in enumerate(laws):
            given[row] = -self.sum_of(law)
            for column in law.keys() & place.keys():
                matrix[row, place[column]] = law[column]
            for heat, node, conductance, _ in self.exchange:
                if heat in law and node in place:
                    matrix[row, place[node]] -= law[heat] * conductance
        sizes = np.array([self.item(column).small for column in self.free])
        largest = np.abs(matrix * sizes).max(axis=1)
        scale = 1.0 / np.where(largest > 0.0, largest, 1.0)
        solution, _, rank, _ = np.linalg.lstsq(
            matrix * sizes * scale[:, None], given * scale, rcond=1e-11
        )
        self.values[self.free] += solution * sizes
        self.set_fluid_heat()
        moves = [abs(self.sum_of(law)) > RESTING * self.size_of(law) for law in laws]
        if any(moves):
            reads = matrix != 0.0
            for k, column in enumerate(column for column in self.free if column not in ties):
                reads[k, place[column]] = True
            return list(self.moving_faults(moves, reads))
        null = np.linalg.svd(matrix * sizes * scale[:, None])[2][rank:]
        loose = [self.item(c) for c, k in place.items() if np.any(np.abs(null[:, k]) > LOOSE)]
        text = "nothing determines its temperature at the start; give the key `initial_temperature`"
        return [(item.part, text) for item in loose if item.thermal]

    def moving_faults(self, moves: list[bool], reads: np.ndarray) -> Iterator[tuple[str, str]]:
        """Yield a fault (place, text) for each group of free stores that has no equilibrium.

        moves : True for laws that do not hold; reads : True for the stores of each law, bool[laws, stores]
        """
        laws, count = reads.shape
        labels = union(laws + count, [(k, j + laws) for k, j in np.argwhere(reads).tolist()])
        for label in dict.fromkeys(labels[k] for k in range(laws) if moves[k]):
            items = [
                self.item(column) for j, column in enumerate(self.free) if labels[laws + j] == label
            ]
            names = listing([item.state for item in items], 4)
            yield (
                items[0].part,
                f"there is no equilibrium of {names} at the start; state its initial value",
            )

    def rate(self, found: Elimination, column: int) -> Terms:
        """Rate of a store, or of the state of an integrating source."""
        return found.rate(column) if column in self.stores else found.drop(self.integrating[column])

    def set_fluid_heat(self) -> None:
        """Write the heat of heat exchangers at the present temperatures of thermal nodes."""
        for heat, node, conductance, temperature in self.exchange:
            self.values[heat] = conductance * (temperature - self.values[node])

    def set_nonlinear_sources(self) -> None:
        """Write quantities of devices, torques of friction that slips, and heat that elements dissipate."""
        self.set_fluid_heat()
        network, found = self.network, self.network.equations(self.mode)
        numbers = {switch.name: k for k, switch in enumerate(self.switches)}
        on = {switch.name: on for switch, on in zip(self.switches, self.mode, strict=True)}
        for item in network.sources:
            if item.reads is None:
                continue
            kind, name = item.reads
            if kind == codes.DEVICE_INPUT:
                self.values[network.columns[item.name]] = self.given_by_others(item)
            elif kind == codes.FRICTION_FLOW:
                k = numbers[name]
                slip = self.sum_of(
                    substituted(found.drop(self.element(self.switches[k].drop)), network.dependent)
                )
                self.values[network.columns[item.name]] = self.directions[k] * self.friction_torque(
                    k, slip
                )
            elif kind == codes.HEAT_INPUT:
                other = self.element(name)
                active = not other.switch or on[other.switch]
                drop, flow = (
                    self.sum_of(substituted(terms, network.dependent))
                    for terms in (found.drop(other), found.flow(other))
                )
                self.values[network.columns[item.name]] = drop * flow * active

    def element(self, name: str) -> Element:
        """Element by name."""
        return self.network.elements[self.network.numbers[name]]

    def friction_torque(self, k: int, slip: float, at_rest: bool = False) -> float:
        """Torque of dry friction at a slip, or the greatest torque at rest."""
        switch = self.switches[k]
        kinetic, static, stribeck, factor = switch.numbers
        if switch.schedule is not None:
            torque = self.start.schedule_value(self.network.schedules[switch.part, switch.key])
            return torque * factor if at_rest else torque
        if at_rest:
            return static
        return kinetic + (
            (static - kinetic) * float(np.exp(-((slip / stribeck) ** 2))) if stribeck else 0.0
        )

    def change_switch(self) -> bool:
        """Change the first switch whose state contradicts the values; False if there is none."""
        network, found = self.network, self.network.equations(self.mode)
        for k, switch in enumerate(self.switches):
            drop_terms = substituted(found.drop(self.element(switch.drop)), network.dependent)
            drop, on = self.sum_of(drop_terms), self.mode[k]
            if switch.kind == codes.DIODE:
                flow = found.flow(self.element(switch.flow)) if on else {}
                least = -self.own.switches[k]["rounding"]
                changes = (
                    self.sum_of(substituted(flow, network.dependent)) < least
                    if on
                    else drop > switch.numbers[0]
                )
                direction = 0.0
            elif switch.kind == codes.SWITCH:
                continue
            elif on:
                torque = self.sum_of(found.flow(self.element(switch.flow)))
                slips = abs(drop) > self.rounding(drop_terms)
                changes = slips or abs(torque) > self.friction_torque(k, 0.0, True)
                direction = float(np.sign(drop if slips else torque))
            else:
                changes, direction = drop * self.directions[k] < -self.rounding(drop_terms), 0.0
            if changes:
                self.mode = (*self.mode[:k], not on, *self.mode[k + 1 :])
                self.directions[k] = direction
                return True
        return False

    def write(self) -> None:
        """Write the start to the tables and event flags of the draft."""
        draft, network = self.draft, self.network
        self.own.network = network = replace(network, values=self.values.copy(), written={})
        self.own.source_table["start"] = [
            self.values[network.columns[item.name]] for item in network.sources
        ]
        for k, switch in enumerate(self.switches):
            flag = network.flags[switch.name]
            if switch.kind == codes.FRICTION:
                terms = network.terms(network.conducting)[network.rows_of(switch.drop)[0]]
                self.own.switches[k]["rounding"] = self.rounding(terms)
                draft.start_flags |= {
                    flag: self.directions[k] > 0.0,
                    flag + 2: self.directions[k] < 0.0,
                }
            else:
                draft.start_flags[flag] = self.mode[k]
        for item, row in zip(network.booked, self.own.elements, strict=True):
            if item.is_store:
                row["start"] = self.values[network.columns[item.name]]


def unknown_speeds(own, draft, start) -> list[int]:
    """Columns of stores without a stated value whose potential turns a displacement machine."""
    search, network = NetworkStart(own, draft, start, solved=False), own.network
    rows = network.terms(network.conducting)
    shafts = {device.turns_with(part) for _, part, device in draft.devices}
    read = {
        column
        for node in network.nodes
        if node in shafts
        for column in rows[network.node_row(node)]
    }
    return [column for column in search.free if column in read]


def known_potentials(own, draft, start) -> dict[str, float]:
    """Potentials at the start of nodes that stores and schedules determine; stores of unknown value count as 0."""
    search, network = NetworkStart(own, draft, start, solved=False), own.network
    rows = network.terms(network.conducting)
    return {
        node: network.start_of(rows[network.node_row(node)], search.values)
        for node in network.nodes
    }


def start_network(own, draft, start) -> list[str]:
    """Compute the start of the network of a draft; returns texts of the motions of its states at the start."""
    search = NetworkStart(own, draft, start)
    search.find()
    network = own.network
    if not network.values.size or draft.faults:
        return []
    factors, texts = network.arrays(search.mode)[1], []
    by_name = {item.name: item for item in network.elements}
    items = [
        *(network.stores[column] for column in network.states),
        *map(by_name.get, network.integrals),
    ]
    for rate, item in zip(factors, items, strict=False):
        if rate != 0.0 and item is not None and item.state:
            texts.append(f"{item.state} changes by {rate * item.unit:.4g} per second")
    return texts


def accelerations_of_masses(own, draft, start) -> dict[str, float]:
    """Accelerations of the masses that are stores of a network, at present positions and forces in their table.

    name -> acceleration [m/s2]. Forces include those of solenoids and of friction, which holds a mass if it can. Raises
    CaseError if the network has no start.
    """
    search = NetworkStart(own, draft, start)
    search.find()
    draft.check()
    network = own.network
    rates = zip(network.states, network.arrays(search.mode)[1], strict=False)
    found = ((network.stores[column], float(rate)) for column, rate in rates)
    return {
        item.state_of[1]: item.unit * rate
        for item, rate in found
        if item.state_of and item.state_of[0] == "mass"
    }

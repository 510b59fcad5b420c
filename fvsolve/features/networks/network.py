"""Network of potential and flow of a case: its equations in each state of its switches, and its rows for kernels.

The rows of a network are linear functions of its stores and sources: rates of its states, then difference of potentials
and flow of each element, potentials of nodes, and sums of the flows of elements in parallel.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

import numpy as np

from fvsolve.core.steady import union
from fvsolve.errors import listing
from fvsolve.features.networks.elimination import (
    Elimination,
    NetworkError,
    Terms,
    add,
    cleaned,
    dependent_stores,
    reduced,
    substituted,
)
from fvsolve.parts import law_elements as codes
from fvsolve.parts.network_elements import TRANSFORMER, Element, Switch

ROUNDING = 1e-12  # sum of terms that is rounding, over the sum of their magnitudes
CUT = 1e-6  # stored quantity that a switch may cut, over a small deviation
ANOTHER_WAY = "give this flow another way, such as a diode,"
MOST_DIODES = 3  # diodes that begin to conduct at once when a switch opens
MOST_STATES = 200  # of networks whose responses are computed


class FirstRows(NamedTuple):
    """Numbers of the first row of elements (two for each), of nodes, totals and integrals; number of all rows."""

    elements: int
    nodes: int
    totals: int
    integrals: int
    count: int


@dataclass(eq=False)
class Network:
    """Network of a case: elements and switches, numbers of its stores and sources, places of its rows.

    columns : stores and sources by name; sources come after all stores; states : column -> its place in y
    places : nodes of the case; dependent : column of a store that others determine -> linear function of these
    flags : name of a switch -> its first event flag; schedules : (place, key) -> index of the schedule
    integrals : nodes whose potential a state integrates, such as an angle, and elements whose difference of potentials
    a state integrates, such as a flux -> its place in y; values : of all stores and sources at the start
    rounding : value of a row at the start that is rounding, over the sum of the magnitudes of its terms
    solved, written : results of `equations` and `arrays` by mode
    """

    elements: list[Element]
    switches: list[Switch]
    places: tuple[str, ...] = ()
    columns: dict[str, int] = field(init=False)
    states: dict[int, int] = field(default_factory=dict)
    dependent: dict[int, Terms] = field(default_factory=dict)
    flags: dict[str, int] = field(default_factory=dict)
    schedules: dict[tuple[str, str], int] = field(default_factory=dict)
    integrals: dict[str, int] = field(default_factory=dict)
    values: np.ndarray = field(default_factory=lambda: np.zeros(0))
    rounding: float = ROUNDING
    solved: dict[tuple, Elimination] = field(default_factory=dict)
    written: dict[tuple, tuple] = field(default_factory=dict)

    def __post_init__(self) -> None:
        stores = [item for item in self.elements if item.is_store]
        sources = [item for item in self.elements if item.is_source]
        sources.sort(key=lambda item: item.reads[0] if item.reads else codes.SCHEDULE_INPUT)
        self.columns = {item.name: k for k, item in enumerate((*stores, *sources))}
        self.stores, self.sources = dict(enumerate(stores)), sources

    # equations ------------------------------------------------------------------------------------------------

    @property
    def conducting(self) -> tuple[bool, ...]:
        """Mode in which all switches are closed, all diodes conduct and all friction slips."""
        return tuple(switch.kind != codes.FRICTION for switch in self.switches)

    def mode_of(self, armed: np.ndarray) -> tuple[bool, ...]:
        """True for each switch that is closed, each diode that conducts and each friction that sticks, by flags."""
        on = []
        for switch in self.switches:
            flag = self.flags[switch.name]
            sticks = (
                not (armed[flag] or armed[flag + 2])
                if switch.kind == codes.FRICTION
                else bool(armed[flag])
            )
            on.append(sticks)
        return tuple(on)

    def equations(self, mode: tuple[bool, ...]) -> Elimination:
        """Solution of the network in a mode. Raises NetworkError."""
        if mode not in self.solved:
            is_on = {switch.name: on for switch, on in zip(self.switches, mode, strict=True)}
            active = [item for item in self.elements if not item.switch or is_on[item.switch]]
            # an open switch is the limit of a small leak; slipping friction is no such limit
            leaks = [
                item.ends
                for switch in self.switches
                if switch.kind != codes.FRICTION and not is_on[switch.name]
                for item in self.elements
                if item.name == switch.drop
            ]
            constant = () if mode == self.conducting else self.constant_columns
            self.solved[mode] = Elimination(active, self.columns, leaks, constant)
        return self.solved[mode]

    @cached_property
    def states_of_others(self) -> set[int]:
        """Columns of stores whose states are those of other parts, such as shafts of pumps."""
        return {column for column, item in self.stores.items() if item.state_of is not None}

    @cached_property
    def constant_columns(self) -> set[int]:
        """Columns of sources that never change, to which friction may lock a store."""
        return {
            self.columns[item.name]
            for item in self.sources
            if item.schedule is not None and item.schedule.constant
        }

    def ties_of(self, mode: tuple[bool, ...]) -> dict[int, Terms]:
        """Stores that others determine in a mode only, such as speeds of a locked clutch: as `dependent`."""
        found = self.equations(mode)
        own = [
            left
            for item in found.relations
            if (left := reduced(substituted(item, self.dependent), ()))
        ]
        return dependent_stores(own, self.stores) if own else {}

    # rows -----------------------------------------------------------------------------------------------------

    @cached_property
    def nodes(self) -> list[str]:
        """Names of all nodes of the network."""
        return list(
            dict.fromkeys(
                [*self.places, *(node for item in self.elements for node in item.ends if node)]
            )
        )

    @cached_property
    def totals(self) -> dict[str, list[Element]]:
        """Place of a part -> its elements in parallel with its first one."""
        groups: dict[str, list[Element]] = {}
        for item in self.elements:
            members = groups.setdefault(item.part, [])
            if not members or {*item.ends} == {*members[0].ends} and item.kind != TRANSFORMER:
                members.append(item)
        return groups

    @cached_property
    def rows(self) -> FirstRows:
        """Numbers of the first rows; those of rates of states and integrals come before."""
        elements = len(self.states) + len(self.integrals)
        nodes = elements + 2 * len(self.elements)
        totals = nodes + len(self.nodes)
        integrals = totals + len(self.totals)
        return FirstRows(elements, nodes, totals, integrals, integrals + len(self.integrals))

    @cached_property
    def node_numbers(self) -> dict[str, int]:
        """Number of each node."""
        return {node: k for k, node in enumerate(self.nodes)}

    @cached_property
    def total_numbers(self) -> dict[str, int]:
        """Number of each part in `totals`."""
        return {part: k for k, part in enumerate(self.totals)}

    @cached_property
    def numbers(self) -> dict[str, int]:
        """Number of each element by name."""
        return {item.name: k for k, item in enumerate(self.elements)}

    def rows_of(self, name: str) -> tuple[int, int]:
        """Rows of the difference of potentials and of the flow of an element."""
        first = self.rows.elements + 2 * self.numbers[name]
        return first, first + 1

    def node_row(self, node: str) -> int:
        """Row of the potential of a node."""
        return self.rows.nodes + self.node_numbers[node]

    def total_row(self, part: str) -> int:
        """Row of the sum of the flows of the elements of a part in parallel."""
        return self.rows.totals + self.total_numbers[part]

    def ends_of(self, name: str) -> tuple[str | None, ...]:
        """Nodes of an element."""
        return self.elements[self.numbers[name]].ends

    @cached_property
    def columns_of_rows(self) -> list[set[int]]:
        """Columns that each row reads in any mode; with switches all columns of its island."""
        rows = self.terms(self.conducting)
        if not self.switches:
            return [set(terms) for terms in rows]
        names = {node: k for k, node in enumerate(self.nodes)}
        pairs = [
            (names[a], names[b])
            for item in self.elements
            for a, b in zip(item.ends, item.ends[1:], strict=False)
            if a is not None and b is not None
        ]
        pairs += [
            (names[item.ends[0]], names[item.ends[2]])
            for item in self.elements
            if len(item.ends) > 2 and item.ends[0] is not None and item.ends[2] is not None
        ]
        labels = union(len(names), pairs)
        islands: dict[int, set[int]] = {}
        for item in self.elements:
            if item.name in self.columns:
                for node in item.ends:
                    if node is not None:
                        islands.setdefault(labels[names[node]], set()).add(self.columns[item.name])
        islands = {
            label: {column for column in own if column not in self.dependent}
            for label, own in islands.items()
        }
        return [
            set().union(terms, *(own for own in islands.values() if own & set(terms)))
            if r < self.rows.elements or len(terms) != 1
            else set(terms)
            for r, terms in enumerate(rows)
        ]

    def facts(self) -> dict:
        """Facts for `fvsolve check`: states, tied stores, number of eliminated unknowns, passivity.

        greatest : greatest eigenvalue of Q A + A' Q, with the rates A of the states and their energy x' Q x / 2; the
        network is passive if it is not above 0. None for many states.
        """
        found, columns = self.equations(self.conducting), list(self.states)
        name = {column: item.state for column, item in self.stores.items()}
        tied = {
            name[column]: " + ".join(f"{value:.6g} {name[other]}" for other, value in terms.items())
            for column, terms in self.dependent.items()
        }
        greatest = None
        if 0 < len(columns) <= MOST_STATES:
            rows = self.terms(self.conducting)[: len(columns)]
            a = np.array([[row.get(column, 0.0) for column in columns] for row in rows])
            share = {column: {column: 1.0} for column in columns} | self.dependent
            spread = np.array(
                [[terms.get(column, 0.0) for column in columns] for terms in share.values()]
            )
            q = spread.T @ np.diag([self.stores[column].value for column in share]) @ spread
            greatest = float(np.linalg.eigvalsh(q @ a + a.T @ q).max())
            size = float(np.abs(q @ a).max(initial=0.0))
            greatest = 0.0 if abs(greatest) <= ROUNDING * size else greatest
        states = [name[column] for column in columns]
        states += [
            self.elements[self.numbers[item]].state
            for item in self.integrals
            if item in self.numbers
        ]
        return {
            "states": states,
            "tied": tied,
            "eliminated": len(found.unknowns),
            "passive": None if greatest is None else greatest <= 0.0,
            "greatest": greatest,
        }

    def is_known_early(self, row) -> bool:
        """True if a probe reads states alone."""
        if row["side"] == codes.LOCKED or row["index"] >= self.rows.integrals:
            return True
        rows = [
            int(row["index"]),
            *([int(row["cell"])] if row["side"] in (codes.POWER, codes.ENTROPY) else []),
        ]
        return all(column < len(self.stores) for r in rows for column in self.columns_of_rows[r])

    def inputs_of(self, row) -> set[int]:
        """Numbers of the sources that a probe reads, also through torques of friction and heat."""
        if row["side"] == codes.LOCKED or row["index"] >= self.rows.integrals:
            return set()
        rows = [
            int(row["index"]),
            *([int(row["cell"])] if row["side"] in (codes.POWER, codes.ENTROPY) else []),
        ]
        return self.inputs_of_columns(set().union(*(self.columns_of_rows[r] for r in rows)))

    def inputs_of_columns(self, columns: set[int]) -> set[int]:
        """Numbers of the sources among columns, and of those that they follow."""
        found = set()
        ahead = {column - len(self.stores) for column in columns if column >= len(self.stores)}
        while ahead:
            j = ahead.pop()
            found.add(j)
            more = {
                column - len(self.stores)
                for column in self.columns_followed(j)
                if column >= len(self.stores)
            }
            ahead |= more - found
        return found

    def columns_followed(self, j: int) -> set[int]:
        """Columns of stores and sources that the source j follows: torque of friction, heat of an element."""
        item = self.sources[j]
        if item.reads is not None and item.reads[0] == codes.FLUID_HEAT:
            return set(self.columns_of_rows[self.node_row(item.ends[1])])
        if item.reads is None or item.reads[0] not in (codes.FRICTION_FLOW, codes.HEAT_INPUT):
            return set()
        name = item.reads[1]
        if item.reads[0] == codes.FRICTION_FLOW:
            name = next(switch.drop for switch in self.switches if switch.name == name)
            return self.columns_of_rows[self.rows_of(name)[0]]
        return set().union(*(self.columns_of_rows[r] for r in self.rows_of(name)))

    def follows_blocks(self, draft, row) -> bool:
        """True if a probe follows at once the output of a block that drives a source or switch of the network."""
        followers = {k for k, (_, pieces) in enumerate(draft.schedules.records) if pieces == 0}
        for j in self.inputs_of(row):
            item = self.sources[j]
            index = self.schedules.get((item.part, item.key), -1)
            if item.reads is not None and item.reads[0] == codes.FRICTION_FLOW:
                switch = next(other for other in self.switches if other.name == item.reads[1])
                index = self.schedules.get((switch.part, switch.key), -1)
            if index in followers:
                return True
        return False

    def fill_node_probe(self, draft, row, node: str, angle: bool) -> None:
        """Fill the row of a probe of the potential of a node, or of its angle."""
        row["kind"], row["side"], row["scale"] = codes.NETWORK_VALUE, codes.ROW, 1.0
        row["index"] = (
            self.rows.integrals + list(self.integrals).index(node) if angle else self.node_row(node)
        )

    def terms(self, mode: tuple[bool, ...]) -> list[Terms]:
        """All rows in a mode, as linear functions of the stores and sources that are not determined by others."""
        found, ties = self.equations(mode), self.ties_of(mode)
        on = {switch.name: on for switch, on in zip(self.switches, mode, strict=True)}
        rates = {
            column: cleaned(substituted(found.rate(column), self.dependent))
            for column in self.states
        }
        for column, terms in ties.items():
            if column in rates:
                rates[column] = {}
                for other, factor in terms.items():
                    add(rates[column], rates.get(other, {}), factor)
        rows = list(rates.values())
        rows += [
            found.drop(self.elements[self.numbers[name]])
            if name in self.numbers
            else found.potential(name)
            for name in self.integrals
        ]
        flows = {}
        for item in self.elements:
            active = not item.switch or on[item.switch]
            flows[item.name] = found.flow(item) if active else {}
            rows += [found.drop(item), flows[item.name]]
        rows += [found.potential(node) for node in self.nodes]
        for members in self.totals.values():
            total: Terms = {}
            for item in members:
                sign = 1.0 if item.ends[:2] == members[0].ends[:2] else -1.0
                add(total, flows[item.name], sign)
            rows.append(total)
        first = len(rates)
        return rows[:first] + [cleaned(substituted(item, self.dependent)) for item in rows[first:]]

    def arrays(self, mode: tuple[bool, ...]) -> tuple[np.ndarray, np.ndarray]:
        """(`network_places`, `network_factors`) in a mode, see `kernels.networks`."""
        if mode not in self.written:
            self.written[mode] = self.make_arrays(mode)
        return self.written[mode]

    def make_arrays(self, mode: tuple[bool, ...]) -> tuple[np.ndarray, np.ndarray]:
        """Arrays as `arrays`; values at the start that are rounding are zero."""
        rows, count = self.terms(mode), len(self.stores)
        places = []
        numbers = []
        starts = []
        factors = []
        rated = list(self.states)
        for r, terms in enumerate(rows):
            unit = self.stores[rated[r]].unit if r < len(rated) else 1.0
            own = {
                self.states[c]: value * self.stores[c].unit / unit
                for c, value in terms.items()
                if c in self.states
            }
            given = {c - count: value / unit for c, value in terms.items() if c >= count}
            starts.append(self.start_of(terms, self.values, unit))
            first = 3 * (len(rows) + len(self.integrals)) + len(numbers)
            places += [first, first + len(own), first + len(own) + len(given)]
            numbers += [*own, *given]
            factors += [*own.values(), *given.values()]
        for place in self.integrals.values():
            first = 3 * (len(rows) + len(self.integrals)) + len(numbers)
            places += [first, first + 1, first + 1]
            numbers.append(place)
            factors.append(1.0)
            starts.append(0.0)
        return np.array([*places, *numbers], dtype=np.int64), np.array([*starts, *factors])

    def start_of(self, terms: Terms, values: np.ndarray, unit: float = 1.0) -> float:
        """Value of a row at given values of stores and sources, in this unit; zero if it is rounding."""
        parts = [value * values[column] / unit for column, value in terms.items()]
        total = float(np.sum(parts))
        return total if abs(total) > self.rounding * float(np.sum(np.abs(parts))) else 0.0

    def schedules_of_node(self, node: str) -> list[int]:
        """Indices of the schedules that the potential of a node reads."""
        sources = [
            self.sources[column - len(self.stores)]
            for column in self.columns_of_rows[self.node_row(node)]
            if column >= len(self.stores)
        ]
        return [
            self.schedules[item.part, item.key] for item in sources if item.schedule is not None
        ]

    def lightness(self, node: str) -> float:
        """Rate of the potential of a node per flow into it through its torque of the fluid [1/kg/m2], at least 0."""
        rows, found = self.terms(self.conducting), 0.0
        torques = [
            item
            for item in self.sources
            if item.reads is not None and item.reads[0] == codes.DEVICE_INPUT
        ]
        sources = [self.columns[item.name] for item in torques if item.ends[0] == node]
        rates = dict(zip(self.states, rows, strict=False))
        for column, factor in rows[self.node_row(node)].items():
            found = max(
                [
                    found,
                    *(abs(factor * rates.get(column, {}).get(source, 0.0)) for source in sources),
                ]
            )
        return found

    def cut_sources(self, mode: tuple[bool, ...], values: np.ndarray) -> list[Element]:
        """Integrating sources, such as coils, whose flow has no way in a mode but is not zero.

        values : flows of all sources
        """
        columns = [
            column - len(self.stores)
            for relation in self.equations(mode).relations
            for column in relation
            if len(relation) == 1 and column >= len(self.stores)
        ]
        return [self.sources[j] for j in columns if abs(values[j]) > CUT * self.sources[j].small]

    def fault_in(self, mode: tuple[bool, ...], y: np.ndarray, sources: np.ndarray) -> str:
        """Text of the fault of a mode that has no solution, or would cut a flow at once; "" for none.

        sources : present values of all sources
        """
        changed = [
            item.part.partition(".")[2]
            for item, on, other in zip(self.switches, mode, self.conducting, strict=True)
            if on != other
        ]
        try:
            ties = self.ties_of(mode)
        except NetworkError as error:
            fault = error.faults[0]
            parts = [item.part for item in fault.sources] or fault.parts
            names = listing(list(dict.fromkeys(part.partition(".")[2] for part in parts)), 3)
            if fault.sources:
                return f"{listing(changed, 3)} would stick to {names}, whose speed changes with time or differs,"
            return f"{listing(changed, 3)} leaves {names} without a solution"
        if cut := self.cut_sources(mode, sources):
            names = listing([item.part.partition(".")[2] for item in cut], 3)
            return f"{listing(changed, 3)} would cut the current of {names} at once; {ANOTHER_WAY}"
        for column, terms in ties.items():
            store, total = self.stores[column], self.sum_of(terms, y)
            before = self.value_of(column, y)
            if abs(total - before) > CUT * (store.small + abs(total) + abs(before)):
                text = f"{listing(changed, 3)} would change {store.state} from {before:.6g} to {total:.6g}"
                return f"{text} at once; {ANOTHER_WAY}"
        return ""

    def commutated(
        self, mode: tuple[bool, ...], y: np.ndarray, sources: np.ndarray
    ) -> tuple[bool, ...] | None:
        """Mode in which further diodes take over the flows that an opened switch would cut; None without one.

        sources : present values of all sources
        """
        blocking = [
            k
            for k, switch in enumerate(self.switches)
            if switch.kind == codes.DIODE and not mode[k]
        ]
        for count in range(1, min(len(blocking), MOST_DIODES) + 1):
            for chosen in combinations(blocking, count):
                other = tuple(on or k in chosen for k, on in enumerate(mode))
                flows = (self.current(other, k, y, sources) for k in chosen)
                if not self.fault_in(other, y, sources) and all(flow > 0.0 for flow in flows):
                    return other
        return None

    def current(self, mode: tuple[bool, ...], k: int, y: np.ndarray, sources: np.ndarray) -> float:
        """Flow of switch k in a mode and state; sources : values of all sources."""
        row, count = self.rows_of(self.switches[k].flow)[1], len(self.stores)
        terms = self.terms(mode)[row]
        stored = self.sum_of(
            {column: value for column, value in terms.items() if column < count}, y
        )
        return stored + sum(
            value * sources[column - count] for column, value in terms.items() if column >= count
        )

    def set_diodes(self, mode: tuple[bool, ...], armed: np.ndarray) -> None:
        """Set the event flags of all diodes to a mode."""
        for switch, on in zip(self.switches, mode, strict=True):
            if switch.kind == codes.DIODE:
                flag = self.flags[switch.name]
                armed[flag], armed[flag + 1] = float(on), float(not on)

    def settle(self, mode: tuple[bool, ...], y: np.ndarray) -> None:
        """Set the states that a mode ties to others, such as the speeds of a clutch that has locked."""
        for column, terms in self.ties_of(mode).items():
            change = self.sum_of(terms, y) - self.value_of(column, y)
            if column in self.states and change != 0.0:
                y[self.states[column]] += change / self.stores[column].unit

    def sum_of(self, terms: Terms, y: np.ndarray) -> float:
        """Value of a linear function of stores and sources in a state."""
        return sum((factor * self.value_of(column, y) for column, factor in terms.items()), 0.0)

    def value_of(self, column: int, y: np.ndarray) -> float:
        """Value of a store in a state, or of a source at the start."""
        if column in self.dependent:
            return self.sum_of(self.dependent[column], y)
        change = y[self.states[column]] * self.stores[column].unit if column in self.states else 0.0
        return float(self.values[column] + change)

    @cached_property
    def booked(self) -> list[Element]:
        """Elements whose power is computed, for the energy ledger or as heat."""
        return [item for item in self.elements if item.ledger or item.heat_to is not None]

    @cached_property
    def capacity(self) -> int:
        """Number of entries of all rows for which the arrays have space in any mode."""
        if not self.switches:
            return sum(len(terms) for terms in self.terms(self.conducting)) + len(self.integrals)
        return self.rows.count * len(self.columns)

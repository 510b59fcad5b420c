"""Elimination in a linear network of potentials and flows: all unknowns as linear functions of stores and sources.

A store of potential (capacity) gives the potential of its node, a store of flow (inertance) its flow; sources give one
or the other. Potentials of other nodes and flows of other elements are unknowns. Their equations are the balance of
flows at each node and the law of each element. Nodes whose potential is known separate the equations into small blocks.
The singular values of a block decide on its rank. A left null vector is a relation between stores: stores are tied, for
example two inertias by a gear. Its time derivative is a further equation, so that all unknowns are determined.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fvsolve.core.steady import union
from fvsolve.parts.network_elements import (
    CAPACITY,
    GAUGE,
    LOCK,
    POTENTIAL,
    RESISTANCE,
    TRANSFORMER,
    Element,
)

HAS_FLOW = (CAPACITY, POTENTIAL, TRANSFORMER, LOCK)  # kinds whose flow is an unknown
RANK = 1e-11  # singular values below this share of the greatest are zero
SMALL = 1e-9  # coefficients of a relation below this share of the greatest are rounding
NOTHING = 1e-14  # scaled unknowns below this share of the greatest are zero
REFINEMENTS = 2  # corrections of a solution by its residual in extended precision

Terms = dict[int, float]  # column -> coefficient of a linear function of stores and sources


class NetworkFault(NamedTuple):
    """Reason for which a network has no unique solution.

    parts : places of the parts concerned; tied : stores that are tied to sources; sources : sources that contradict
    each other, or to which stores are tied; laws : parts of elements whose laws contradict each other
    """

    parts: list[str]
    tied: list[Element] = []
    sources: list[Element] = []
    laws: list[str] = []


class NetworkError(Exception):
    """Network without a unique solution.

    faults : independent reasons, at least one; relations : as in `Elimination`
    """

    def __init__(self, faults: list[NetworkFault], relations: list[Terms]) -> None:
        super().__init__()
        self.faults, self.relations = faults, relations


def add(terms: Terms, more: Terms, factor: float = 1.0) -> Terms:
    """Add `factor` times the linear function `more` to `terms`; returns `terms`."""
    for column, value in more.items():
        terms[column] = terms.get(column, 0.0) + factor * value
    return terms


def cleaned(terms: Terms) -> Terms:
    """Linear function without coefficients that are rounding."""
    largest = max(map(abs, terms.values()), default=0.0)
    return {column: value for column, value in terms.items() if abs(value) > 1e-13 * largest}


class Equation:
    """Equation: linear function of unknowns, `left` = linear function of stores and sources, `right`.

    parts : place of the part whose law it is, in a list; empty for a balance
    """

    def __init__(self, *parts: str) -> None:
        self.left, self.right, self.parts = {}, {}, list(parts)


class Elimination:
    """Solution of a network: potentials, flows and rates of stores as linear functions of stores and sources.

    elements : active elements; columns : numbers of the stores and sources of all modes, by name
    leaks : ends of open switches; the potential of a node that only these join is the limit of equal small leaks
    constant : columns of sources that never change, to which stores may be tied. Raises NetworkError.
    """

    def __init__(
        self,
        elements: Sequence[Element],
        columns: dict[str, int],
        leaks: Sequence[tuple] = (),
        constant: Collection[int] = (),
    ) -> None:
        self.elements, self.columns, self.leaks, self.constant = elements, columns, leaks, constant
        self.stores = {columns[item.name]: item for item in elements if item.is_store}
        self.integrating = {
            columns[item.name]: item for item in elements if item.is_source and item.state_of
        }
        self.items = {
            number: item for item in elements if (number := columns.get(item.name)) is not None
        }
        self.known: dict[str, int] = {}  # node -> column of its potential
        for kind in (POTENTIAL, CAPACITY):
            for item in elements:
                if item.kind == kind and item.ends[1] is None and item.ends[0] is not None:
                    self.known.setdefault(item.ends[0], columns[item.name])
        self.unknowns: dict[tuple, int] = {}
        for item in elements:  # gauges name nodes too
            for node in item.ends:
                if node is not None and node not in self.known:
                    self.unknowns.setdefault(("potential", node), len(self.unknowns))
        for item in elements:
            if item.kind in HAS_FLOW:
                self.unknowns.setdefault(("flow", item.name), len(self.unknowns))
        self.equations = list(self.make_equations())
        self.relations: list[Terms] = []  # sums of stores and sources that are zero
        # sums of sources that would have to be zero, or of stores tied to them
        self.contradictions: list[Terms] = []
        self.faults: list[NetworkFault] = []
        self.solution: dict[int, Terms] = {}
        while self.solve():
            pass
        if self.faults:
            raise NetworkError(self.faults, self.relations)

    def add_fault(self, fault: NetworkFault) -> None:
        """Add a fault, unless earlier faults have parts of it; of a contradiction, all parts of it."""
        known = {part for other in self.faults for part in other.parts}
        if known.isdisjoint(fault.parts) or (fault.sources and not known.issuperset(fault.parts)):
            self.faults.append(fault)

    def parts_of(self, unknown: int) -> list[str]:
        """Places of the parts that an unknown concerns."""
        kind, name = list(self.unknowns)[unknown]
        return [
            item.part
            for item in self.elements
            if (item.name == name if kind == "flow" else name in item.ends)
        ]

    # equations ------------------------------------------------------------------------------------------------

    def put_potential(self, equation: Equation, node: str | None, factor: float) -> None:
        """Add `factor` times the potential of a node to an equation."""
        if node in self.known:
            add(equation.right, {self.known[node]: -factor})
        elif node is not None:
            add(equation.left, {self.unknowns["potential", node]: factor})

    def put_drop(self, equation: Equation, ends: Sequence[str | None], factor: float = 1.0) -> None:
        """Add `factor` times the difference of two potentials to an equation."""
        self.put_potential(equation, ends[0], factor)
        self.put_potential(equation, ends[1], -factor)

    def make_equations(self) -> Iterator[Equation]:
        """Yield the balance of flows at each node, and the laws of elements whose flow is an unknown."""
        nodes: dict[str, Equation] = {}
        for item in self.elements:
            scale = (1.0, -1.0, -item.value, item.value)
            for node, factor in zip(item.ends, scale, strict=False):
                if node is None or item.kind == GAUGE:
                    continue
                balance = nodes.setdefault(node, Equation())
                if item.kind == RESISTANCE:
                    self.put_drop(balance, item.ends, factor / item.value)
                elif item.kind in HAS_FLOW:
                    add(balance.left, {self.unknowns["flow", item.name]: factor})
                else:
                    add(balance.right, {self.columns[item.name]: -factor})
        yield from nodes.values()
        for item in self.elements:
            column = self.columns.get(item.name, -1)
            if item.kind in HAS_FLOW and self.known.get(item.ends[0], -2) != column:
                law = Equation(item.part)
                self.put_drop(law, item.ends)
                if item.kind == TRANSFORMER:
                    self.put_drop(law, item.ends[2:], -item.value)
                elif item.kind != LOCK:
                    add(law.right, {column: 1.0})
                yield law

    def raw_rate(self, column: int) -> tuple[Terms, Terms]:
        """Rate of a store, as (terms of unknowns, terms of stores and sources)."""
        item, law = self.stores[column], Equation()
        if item.kind == CAPACITY:
            add(law.left, {self.unknowns["flow", item.name]: 1.0 / item.value})
        else:
            self.put_drop(law, item.ends, 1.0 / item.value)
        return law.left, {number: -value for number, value in law.right.items()}

    # solution -------------------------------------------------------------------------------------------------

    def solve(self) -> bool:
        """Solve all blocks of equations; True if relations were found, whose derivatives must be solved too."""
        found = [
            (equation.right, equation.parts)
            for equation in self.equations
            if not equation.left and any(equation.right.values())
        ]
        self.equations = [equation for equation in self.equations if equation.left]
        new = [self.tie(*relation) for relation in found]
        if not any(new):
            blocks = [EquationBlock(*block) for block in self.blocks()]
            new = [self.tie(*relation) for block in blocks for relation in block.relations()]
            if not any(new):
                for block in blocks:
                    self.solution |= self.solve_block(block)
        return any(new)

    def blocks(self) -> Iterator[tuple[list[Equation], list[int]]]:
        """Yield independent blocks: their equations, and the numbers of their unknowns."""
        count = len(self.unknowns)
        pairs = [
            (count + k, number)
            for k, equation in enumerate(self.equations)
            for number in equation.left
        ]
        for ends in self.leaks:
            numbers = [
                self.unknowns[key] for node in ends if (key := ("potential", node)) in self.unknowns
            ]
            pairs += zip(numbers, numbers[1:], strict=False)
        labels = union(count + len(self.equations), pairs)
        groups: dict[int, tuple[list[Equation], list[int]]] = {}
        for number in range(count):
            groups.setdefault(labels[number], ([], []))[1].append(number)
        for k, equation in enumerate(self.equations):
            if equation.left:
                groups[labels[count + k]][0].append(equation)
        return iter(groups.values())

    def solve_block(self, block: EquationBlock) -> dict[int, Terms]:
        """Solution of a block : unknown -> linear function of stores and sources."""
        solution, free = block.solve()
        if free.shape[1]:
            solution = self.with_free_part(solution, free, block)
        return {
            u: cleaned(dict(zip(block.columns, row, strict=True)))
            for u, row in zip(block.unknowns, solution.tolist(), strict=True)
        }

    def with_free_part(
        self, solution: np.ndarray, free: np.ndarray, block: EquationBlock
    ) -> np.ndarray:
        """Choose the solution among several: of potentials by equal small leaks, of locks by the least flows.

        Locks in parallel share a flow in proportion to their values.

        free : basis of the null space, a column for each vector
        """
        unknowns, laws = block.unknowns, []
        for ends in self.leaks:
            laws.append(Equation())
            self.put_drop(laws[-1], ends)
        for item in self.elements:
            if item.kind == LOCK:
                laws.append(Equation())
                add(laws[-1].left, {self.unknowns["flow", item.name]: item.value**-0.5})
        laws = [law for law in laws if law.left.keys() & set(unknowns)]
        further = {c for law in laws for c in law.right} - {*block.columns}
        block.columns += sorted(further)
        solution = np.hstack([solution, np.zeros((len(solution), len(further)))])
        rows = np.array([[law.left.get(u, 0.0) for u in unknowns] for law in laws]).reshape(
            -1, len(unknowns)
        )
        given = np.array([[law.right.get(c, 0.0) for c in block.columns] for law in laws])
        choice = rows @ free
        if np.linalg.matrix_rank(choice, 1e-9) < free.shape[1]:
            loose = np.abs(free).max(axis=1) > 1e-6 * np.abs(free).max()
            parts = [
                part
                for u, is_loose in zip(unknowns, loose, strict=True)
                if is_loose
                for part in self.parts_of(u)
            ]
            self.add_fault(NetworkFault(list(dict.fromkeys(parts))))
        rest = rows @ solution - given.reshape(len(laws), len(block.columns))
        return solution - free @ (np.linalg.pinv(choice) @ rest)

    def tie(self, relation: Terms, laws: list[str]) -> bool:
        """Add a relation, and its derivative as an equation; False if it follows from earlier ones or cannot hold.

        laws : places of the parts from whose laws it follows
        """
        if not reduced(relation, [*self.relations, *self.contradictions]):
            return False
        relation = reduced(relation, self.relations)
        if (
            self.leaks
            and len(relation) == 1
            and (item := self.integrating.get(next(iter(relation))))
        ):
            # no current of a coil in an open circuit, whose flux does not change
            self.relations.append(relation)
            self.equations.append(Equation())
            self.put_drop(self.equations[-1], item.ends)
            return True
        sources = [
            column
            for column in relation
            if column not in self.stores and column not in self.constant
        ]
        sources += [] if relation.keys() & self.stores.keys() else list(relation)
        if sources:
            self.contradictions.append(relation)
            items = [self.items[column] for column in relation]
            tied = [item for item in items if item.is_store]
            parts = dict.fromkeys(item.part for item in items)
            self.add_fault(NetworkFault(list(parts), tied, [self.items[c] for c in sources], laws))
            return False
        self.relations.append(relation)
        equation = Equation()
        for column, factor in relation.items():
            if column not in self.stores:
                continue
            of_unknowns, rest = self.raw_rate(column)
            add(equation.left, of_unknowns, factor)
            add(equation.right, rest, -factor)
        self.equations.append(equation)
        return True

    # results --------------------------------------------------------------------------------------------------

    def potential(self, node: str | None) -> Terms:
        """Potential of a node."""
        if node is None:
            return {}
        if node in self.known:
            return {self.known[node]: 1.0}
        number = self.unknowns.get(("potential", node))
        return dict(self.solution.get(number, {})) if number is not None else {}

    def drop(self, item: Element) -> Terms:
        """Difference of the potentials at the first two ends of an element."""
        first, second = item.ends[:2]
        return add(self.potential(first), self.potential(second), -1.0)

    def flow(self, item: Element) -> Terms:
        """Flow through an element; zero for a lock that is not active."""
        if item.kind == RESISTANCE:
            return {column: value / item.value for column, value in self.drop(item).items()}
        if item.kind == GAUGE:
            return {}
        if item.kind in HAS_FLOW:
            return dict(self.solution.get(self.unknowns.get(("flow", item.name)), {}))
        return {self.columns[item.name]: 1.0}

    def rate(self, column: int) -> Terms:
        """Rate of a store."""
        of_unknowns, rest = self.raw_rate(column)
        result = dict(rest)
        for number, factor in of_unknowns.items():
            add(result, self.solution.get(number, {}), factor)
        return result


class EquationBlock:
    """Independent equations of a network: matrix times unknowns = given times stores and sources.

    unknowns, columns : their numbers, in the order of the columns of both matrices
    """

    def __init__(self, equations: list[Equation], unknowns: list[int]) -> None:
        self.unknowns, self.equations = unknowns, equations
        self.columns = sorted({column for equation in equations for column in equation.right})
        place = {u: k for k, u in enumerate(unknowns)}
        side = {c: k for k, c in enumerate(self.columns)}
        self.matrix = np.zeros((len(equations), len(unknowns)))
        self.given = np.zeros((len(equations), len(self.columns)))
        for k, equation in enumerate(equations):
            for u, value in equation.left.items():
                self.matrix[k, place[u]] = value
            for c, value in equation.right.items():
                self.given[k, side[c]] = value
        if self.matrix.shape == (1, 1) and self.matrix[0, 0] != 0.0:  # most blocks of long networks
            self.rank = 1
            return
        self.by_row = inverse_sizes(self.matrix, 1)[:, None]
        self.by_column = inverse_sizes(self.matrix * self.by_row, 0)[:, None]
        self.left, self.singular, self.right = np.linalg.svd(
            self.matrix * self.by_row * self.by_column.T
        )
        self.rank = int(np.sum(self.singular > RANK * self.singular.max(initial=0.0)))

    def relations(self) -> list[tuple[Terms, list[str]]]:
        """Relations between stores and sources, from the left null vectors of the matrix.

        Places of the parts from whose laws each of them follows are added.
        """
        if self.rank == len(self.matrix):
            return []
        scaled, found = self.given * self.by_row, []
        size = np.abs(scaled).max(initial=0.0)
        for vector in self.left[:, self.rank :].T:
            terms = vector @ scaled
            largest = np.abs(terms).max(initial=0.0)
            if largest > SMALL * size:
                laws = [
                    equation.parts
                    for equation, v in zip(self.equations, vector, strict=True)
                    if abs(v) > SMALL
                ]
                relation = {
                    c: float(v)
                    for c, v in zip(self.columns, terms, strict=True)
                    if abs(v) > SMALL * largest
                }
                found.append((relation, list(dict.fromkeys(sum(laws, [])))))
        return found

    def solve(self) -> tuple[np.ndarray, np.ndarray]:
        """(a solution, a row for each unknown; basis of the null space, a column for each vector)."""
        if self.matrix.shape == (1, 1) and self.rank:
            return self.given / self.matrix[0, 0], np.zeros((1, 0))
        rank, exact = self.rank, self.matrix.astype(np.longdouble)

        def inverse(values: np.ndarray) -> np.ndarray:
            within = (self.left[:, :rank].T @ (values * self.by_row)) / self.singular[:rank, None]
            return self.by_column * (self.right[:rank].T @ within)

        solution = inverse(self.given)
        for _ in range(REFINEMENTS):
            solution = solution + inverse((self.given - exact @ solution).astype(float))
        sizes = np.abs(solution / self.by_column)
        # such as a flow that has no way
        solution[sizes < NOTHING * sizes.max(axis=0, initial=0.0)] = 0.0
        free = self.right[rank:].T.copy()
        free[np.abs(free) < NOTHING] = 0.0
        return solution, self.by_column * free


def inverse_sizes(matrix: np.ndarray, axis: int) -> np.ndarray:
    """Inverse of the greatest magnitude in each row (axis 1) or column (axis 0); 1 where all entries are zero."""
    largest = np.abs(matrix).max(axis=axis, initial=0.0)
    return 1.0 / np.where(largest > 0.0, largest, 1.0)


def reduced(relation: Terms, others: Sequence[Terms]) -> Terms:
    """Relation without the part that follows from others, normalised; empty if all of it follows."""
    columns = sorted({column for item in (relation, *others) for column in item})
    own = np.array([relation.get(column, 0.0) for column in columns])
    own = own / np.abs(own).max(initial=0.0) if own.any() else own
    if others:
        rows = np.array([[item.get(column, 0.0) for column in columns] for item in others])
        own = own - rows.T @ np.linalg.lstsq(rows.T, own, rcond=None)[0]
    largest = np.abs(own).max(initial=0.0)
    if largest < SMALL:
        return {}
    return {
        column: float(v / largest)
        for column, v in zip(columns, own, strict=True)
        if abs(v) > SMALL * largest
    }


def dependent_stores(
    relations: Sequence[Terms], stores: dict[int, Element], fixed: Collection[int] = ()
) -> dict[int, Terms]:
    """Stores that others determine: column -> linear function of the other stores.

    From each relation the store with the least energy is determined by the others. stores : column -> element
    fixed : stores that are not chosen; a relation of these alone is left out
    """
    found: dict[int, Terms] = {}
    for relation in relations:
        left = substituted(relation, found)
        own = [c for c, value in left.items() if c in stores and value != 0.0 and c not in fixed]
        if not own:
            continue
        chosen = min(own, key=lambda column: (stores[column].value / left[column] ** 2, -column))
        terms = {
            column: -value / left[chosen] for column, value in left.items() if column != chosen
        }
        found = {column: substituted(old, {chosen: terms}) for column, old in found.items()} | {
            chosen: terms
        }
    return found


def substituted(terms: Terms, known: dict[int, Terms]) -> Terms:
    """Linear function in which columns are replaced by their own linear functions."""
    result: Terms = {}
    for column, value in terms.items():
        add(result, known[column] if column in known else {column: 1.0}, value)
    return {column: value for column, value in result.items() if value != 0.0}

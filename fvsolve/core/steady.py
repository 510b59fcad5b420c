"""Steady state of a network of resistances: pressures and flows.

Potentials are P = p + rho g z [Pa], flows are mass flows M [kg/s]. A node has a given potential or balances its flows;
along an edge (link) the potential decreases by drop(M). The edges and nodes of each connected piece of a network are
solved together by Newton's method (Todini and Pilati 1988). In a loop without friction the flows are those of least
norm.
"""

from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fvsolve.core.kernels.steady_edges import LAW_SIZE, fill_systems, take_changes

DENSE_LIMIT = 150  # number of unknowns up to which a dense solver is faster
DAMPING = 1e-12  # weight of |x|^2 in the least-squares solution of a singular system
SMALL_DROP = 1e-12  # relative difference of potentials that counts as rounding
SMALL = 1e-9  # relative residual below which a node counts as balanced
# relative residual of the balance of a node above which a solution is refused
LARGEST_IMBALANCE = 1e-6
ROUNDING_SHARE = 1e-12  # flows below this share of the flow scale are rounding
LEAST_SCALE = 1e-9  # least typical mass flow of a piece [kg/s]


@dataclass
class Edge:
    """Link from node i to node j in the steady problem, with its linear equation in each Newton step.

    The equation is alpha dM - beta d(drop) = gamma, for changes of the mass flow M [kg/s] and of the potential drop
    [Pa], positive from i to j.
    row : function (flow, drop) -> (alpha, beta, gamma), or a law of `kernels.steady_edges` as an array; None for a
        fixed flow
    flow : fixed mass flow, or first value of the iteration [kg/s]
    shut : True for a link without flow; potentials of nodes behind it may be estimated from its other side
    drop : function of the flow [kg/s] that gives the potential drop [Pa] of an edge with a fixed flow; None if unknown
    sensed_nodes : nodes with potentials P on which the flow depends. Each adds an argument P and a result c to `row`,
        and the equation has the further term -c dP on its left side.
    held_potential : (node, potential [Pa] that the flow maintains there), whose equation replaces `row`; or None
    drives : True if the edge drives flow between equal potentials
    """

    i: int
    j: int
    row: Any
    flow: float = 0.0
    shut: bool = False
    drop: Any = None
    sensed_nodes: tuple[int, ...] = ()
    held_potential: tuple[int, float] | None = None
    drives: bool = False

    def numbered(self, number: dict[int, int]) -> "Edge":
        """This edge with other numbers of nodes; number : number of a node -> its other number."""
        held = self.held_potential
        return replace(
            self,
            i=number[self.i],
            j=number[self.j],
            sensed_nodes=tuple(number[i] for i in self.sensed_nodes),
            held_potential=None if held is None else (number[held[0]], held[1]),
        )


@dataclass
class SteadyState:
    """Solution of a steady problem: potentials of nodes [Pa] and mass flows of edges [kg/s].

    converged : True if Newton's method converged
    split : True if the flows of a loop are not unique; then they are those of least norm
    undetermined : nodes whose potentials a singular system determines least, one for each of its pieces
    no_solution : nodes in sets that have no known potential and whose demands do not add up to zero
    pieces : for each piece of the network its nodes, its edges and its typical mass flow [kg/s]
    """

    potential: np.ndarray
    flow: np.ndarray
    converged: bool = True
    split: bool = False
    undetermined: list[int] = field(default_factory=list)
    no_solution: list[int] = field(default_factory=list)
    pieces: list[tuple[np.ndarray, np.ndarray, float]] = field(default_factory=list)


def solve_steady(
    held: np.ndarray, demand: np.ndarray, edges: list[Edge], scale: tuple[float, Any]
) -> SteadyState:
    """Solve for the flows of edges that balance the demands of nodes, and for the potentials of these nodes.

    Pieces of the network that no edge connects do not affect each other: each has the bits of its own problem.
    held : float64[n]  given potential [Pa], nan for nodes to be solved
    demand : float64[n]  mass flow out of each node [kg/s], ignored at nodes of given potential
    scale : typical pressure [Pa]; float64[edges], typical mass flow of each edge [kg/s]
    A problem without solution raises no error, see `SteadyState`.
    """
    sizes, average = np.asarray(scale[1]), mean_of(held, 0.0)
    result = SteadyState(np.zeros(held.size), np.zeros(len(edges)))
    problems: dict[tuple, list[_Problem]] = {}
    for nodes, own in _pieces(held.size, edges):
        typical = max([LEAST_SCALE, *sizes[own]])
        result.pieces.append((nodes, own, typical))
        given, piece = held[nodes], edges
        if nodes.size < held.size:
            number = {i: k for k, i in enumerate(nodes.tolist())}
            piece = [edges[e].numbered(number) for e in own]
        first = np.where(np.isnan(given), mean_of(given, average), given)
        problem = _Problem(given, demand[nodes], piece, (scale[0], typical), first)
        problems.setdefault(problem.pattern(), []).append(problem)
        result.no_solution += [int(nodes[i]) for i in problem.no_solution]
        problem.nodes, problem.own = nodes, own
    for alike in problems.values():
        _newton(alike)
        for problem in alike:
            _through_shut(problem)
            result.potential[problem.nodes], result.flow[problem.own] = (
                problem.potential,
                problem.flow,
            )
            result.converged &= problem.converged
            result.split |= problem.split
            if problem.split and (weakest := int(np.abs(problem.open_part()).argmax())) >= len(
                problem.active
            ):
                result.undetermined.append(
                    int(problem.nodes[problem.unknown[weakest - len(problem.active)]])
                )
    return result


def mean_of(held: np.ndarray, otherwise: float) -> float:
    """Mean of the numbers in an array that are not nan; `otherwise` if there are none."""
    missing = np.isnan(held)
    count = held.size - np.count_nonzero(missing)
    return float(np.where(missing, 0.0, held).sum() / count) if count else otherwise


def _pieces(count: int, edges: list[Edge]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Nodes and edges of each piece of a network, in order; edges connect the nodes that they join, sense or hold."""
    joined = [(edge.i, edge.j) for edge in edges]
    joined += [(edge.i, i) for edge in edges for i in edge.sensed_nodes]
    joined += [
        (edge.i, edge.held_potential[0]) for edge in edges if edge.held_potential is not None
    ]
    nodes: dict[int, list[int]] = {}
    links: dict[int, list[int]] = {}
    labels = union(count, joined)
    for i, label in enumerate(labels):
        nodes.setdefault(label, []).append(i)
    for e, edge in enumerate(edges):
        links.setdefault(labels[edge.i], []).append(e)
    return [
        (np.array(own), np.array(links.get(label, []), dtype=int)) for label, own in nodes.items()
    ]


class _Problem:
    """Steady problem of one piece of a network, with its unknowns and equations, and its solution so far.

    Unknowns are the flows of the edges `active` and the potentials of the nodes `unknown`. The system has a row for
    each edge in `rows`, for the balance of each node in `balances`, and for each node in `anchors`, whose potential is
    kept because nothing determines it. All are lists of indices.
    held, demand, edges : as for `solve_steady`; scale : typical pressure [Pa] and mass flow [kg/s]
    potential : float64[n]  first potentials of the iteration [Pa]
    """

    def __init__(self, held, demand, edges, scale, potential) -> None:
        self.held, self.demand, self.scale, self.potential = held, demand, scale, potential
        self.converged, self.split = True, False
        # of the last singular system
        self.open_part: Callable[[], np.ndarray] = lambda: np.zeros(1)
        quiet = _quiet(held, demand, edges)
        self.edges = [
            replace(edge, row=None, flow=0.0, drop=lambda flow: 0.0) if e in quiet else edge
            for e, edge in enumerate(edges)
        ]
        self.flow = np.array([edge.flow for edge in self.edges])
        parts, self.free_sets = _components(held, self.edges)
        dropped, entries = _references(held, demand, self.edges, parts, self.free_sets)
        self.floating = {
            i for group in self.free_sets if group not in entries.values() for i in group
        }
        self.no_solution = [
            i
            for i in self.floating
            if abs(sum(demand[k] for k in _group_of(self.free_sets, i))) > SMALL * scale[1]
        ]
        self.active = [
            e for e, edge in enumerate(self.edges) if edge.row is not None and not edge.shut
        ]
        self.rows = self.active + [e for e in entries]
        self.unknown = [i for i in range(held.size) if np.isnan(held[i])]
        self.balances = [i for i in self.unknown if i not in dropped and i not in self.floating]
        self.anchors = sorted({min(_group_of(self.free_sets, i)) for i in self.floating})
        self.balances += [i for i in self.floating if i not in self.anchors]
        self.column = {("flow", e): k for k, e in enumerate(self.active)}
        self.column |= {("node", i): len(self.active) + k for k, i in enumerate(self.unknown)}
        self.columns = [_columns(self.column, e, self.edges[e]) for e in self.rows]

    def is_balanced(self) -> bool:
        """True if the flows balance the demands: the least-squares solution of a system without solution does not."""
        missing = self.demand.copy()
        for edge, flow in zip(self.edges, self.flow, strict=True):
            missing[edge.i] += flow
            missing[edge.j] -= flow
        largest = max(
            np.abs(self.flow).max(initial=0.0), np.abs(self.demand[self.unknown]).max(initial=0.0)
        )
        least = LARGEST_IMBALANCE * largest + ROUNDING_SHARE * self.scale[1]
        return bool(np.all(np.abs(missing[self.balances]) <= least))

    def pattern(self) -> tuple:
        """Structure of the system: equal for problems that one call of `_newton` solves together."""
        ends = tuple(
            (edge.i, edge.j, edge.shut, isinstance(edge.row, np.ndarray)) for edge in self.edges
        )
        lists = (self.active, self.rows, self.unknown, self.balances, self.anchors, self.columns)
        return ends, *map(tuple, lists)


def _quiet(held, demand, edges) -> set[int]:
    """Indices of the edges in those parts of the network in which nothing drives a flow.

    Such a part has a given potential. All its given potentials agree to rounding, all demands are zero, no fixed flow
    enters, and no edge drives a flow or maintains a potential.
    If the part were solved, rounding of a head would drive a flow: by M |M| = G dP it is of the order of the square
    root of the rounding error (mass flow M, conductance G, potential drop dP).
    held, demand, edges : as for `solve_steady`
    """
    fed = {i for edge in edges if edge.row is None and edge.flow != 0.0 for i in (edge.i, edge.j)}
    quiet = set()
    for group in _components(held, edges)[0]:
        given = [held[i] for i in group if held[i] == held[i]]
        driven = any(
            edge.i in group and (edge.drives or edge.held_potential is not None) for edge in edges
        )
        if (
            driven
            or not given
            or any(demand[i] != 0.0 or (i in fed and held[i] != held[i]) for i in group)
        ):
            continue
        if max(given) - min(given) <= SMALL_DROP * (1e5 + max(map(abs, given))):
            quiet |= {
                e
                for e, edge in enumerate(edges)
                if edge.row is not None and not edge.shut and edge.i in group
            }
    return quiet


def _group_of(groups, i):
    return next(group for group in groups if i in group)


def union(n: int, pairs) -> list[int]:
    """Labels of n items, equal for items that are connected, directly or through others : list of n indices.

    pairs : pairs of items that are connected
    """
    label = list(range(n))

    def root(i: int) -> int:
        while label[i] != i:
            label[i] = i = label[label[i]]
        return i

    for i, j in pairs:
        label[root(int(i))] = root(int(j))
    return [root(i) for i in range(n)]


def _components(held, edges):
    """Sets of nodes that edges with unknown flow connect : (all sets, the sets without a given potential).

    held, edges : as for `solve_steady`
    """
    joined = [(edge.i, edge.j) for edge in edges if edge.row is not None and not edge.shut]
    groups: dict[int, set[int]] = {}
    for i, label in enumerate(union(held.size, joined)):
        groups.setdefault(label, set()).add(i)
    parts = [frozenset(group) for group in groups.values()]
    return parts, [group for group in parts if all(np.isnan(held[i]) for i in group)]


def _references(held, demand, edges, parts, free_sets):
    """Fixed flows that give a potential to sets of nodes without one : (nodes whose balance is dropped, edge -> set).

    An edge with a fixed flow joins such a set to known potentials. The equation of the edge determines the potential of
    the set, and replaces the balance of one node of the set.
    held, demand, edges : as for `solve_steady`
    parts, free_sets : as from `_components`
    """
    dropped: set[int] = set()
    entries: dict[int, frozenset[int]] = {}
    known = {i for group in set(parts) - set(free_sets) for i in group}
    links_at, given_at = _edges_at_nodes(edges)
    waiting = list(free_sets)
    while waiting:
        for group in waiting:
            near = sorted({e for i in group for e in given_at[i]})
            entry = next((e for e in near if _enters(edges[e], group, known)), None)
            if entry is not None:
                entries[entry] = group
                dropped.add(_dead_end(group, demand, links_at))
                known |= group
                waiting.remove(group)
                break
        else:
            break
    return dropped, entries


def _enters(edge, group, known) -> bool:
    """True if an edge joins the sets of nodes `group` and `known`."""
    return (edge.i in group and edge.j in known) or (edge.j in group and edge.i in known)


def _edges_at_nodes(edges):
    """Edges of each node : (number of all edges, indices of those with a fixed flow and a known drop)."""
    counts: dict[int, int] = Counter()
    given: dict[int, list[int]] = defaultdict(list)
    for e, edge in enumerate(edges):
        for i in {edge.i, edge.j}:
            counts[i] += 1
            if edge.row is None and edge.drop is not None:
                given[i].append(e)
    return counts, given


def _dead_end(group, demand, counts):
    """Node of the set `group` that is most similar to a dead end: without demand, with the fewest links."""
    return min(sorted(group), key=lambda i: (demand[i] != 0.0, counts[i]))


def _newton(problems: list[_Problem]) -> None:
    """Solve problems of equal pattern by Newton's method, all in one loop; each ends with its own iteration."""
    first = problems[0]
    if not first.column:
        return
    system = _System(problems)
    active, unknown = np.array(first.active, dtype=int), np.array(first.unknown, dtype=int)
    sizes, ended = np.full(len(problems), np.inf), np.zeros(len(problems), dtype=int)
    waiting = np.arange(len(problems))
    for sweep in range(200):
        take_changes(
            waiting,
            system.changes(waiting),
            active,
            unknown,
            system.scales,
            system.flow,
            system.potential,
            sizes,
            sweep,
            ended,
        )
        waiting = np.flatnonzero(ended == 0)
        if not waiting.size:
            break
    for k, problem in enumerate(problems):
        problem.flow, problem.potential = system.flow[k], system.potential[k]
        problem.converged = (
            bool(ended[k] == 1 or (ended[k] == 0 and sizes[k] < 1e-9)) and problem.is_balanced()
        )


class _System:
    """Newton systems of problems of equal pattern, in scaled unknowns.

    flow, potential : mass flows [kg/s] and potentials [Pa] of the edges and nodes of each problem
    scales : typical pressure [Pa] and mass flow [kg/s] of each problem
    """

    def __init__(self, problems: list[_Problem]) -> None:
        first = problems[0]
        self.problems, self.width = problems, len(first.column)
        self.flow = np.array([problem.flow for problem in problems])
        self.potential = np.array([problem.potential for problem in problems])
        self.scales = np.array([problem.scale for problem in problems])
        begin = np.cumsum([0, *(sum(c >= 0 for c in row) for row in first.columns)]).tolist()
        at = {i: k for k, i in enumerate(first.balances, start=len(first.rows))}
        height = len(first.rows) + len(first.balances) + len(first.anchors)
        ends = [
            (at[i], e, sign, first.column.get(("flow", e), -1))
            for e, edge in enumerate(first.edges)
            for i, sign in ((edge.i, -1), (edge.j, 1))
            if i in at and not edge.shut
        ]
        self.terms = np.array([end[:3] for end in ends], dtype=int).reshape(-1, 3)
        entries = [(k, c) for k, row in enumerate(first.columns) for c in row if c >= 0]
        entries += [(k, own) for k, _, _, own in ends if own >= 0]
        last = enumerate(first.anchors, start=len(first.rows) + len(first.balances))
        entries += [(k, first.column["node", i]) for k, i in last]
        self.places = np.array([k * self.width + c for k, c in entries], dtype=int)
        constant = [float(sign) for _, _, sign, own in ends if own >= 0] + [1.0] * len(
            first.anchors
        )
        self.values, self.drawn = (
            np.zeros((len(problems), len(entries))),
            np.zeros((len(problems), height)),
        )
        self.values[:, begin[-1] :] = constant
        for k, problem in enumerate(problems):
            self.drawn[k, len(first.rows) :][: len(first.balances)] = (
                problem.demand[first.balances] / problem.scale[1]
            )
        self.right = self.drawn.copy()
        dense = max(height, self.width) <= DENSE_LIMIT
        self.matrices = np.zeros((len(problems), height * self.width if dense else 0))
        lawful = [k for k, e in enumerate(first.rows) if isinstance(first.edges[e].row, np.ndarray)]
        edges = [first.rows[k] for k in lawful]
        rows = [
            (
                k,
                begin[k],
                e,
                first.edges[e].i,
                first.edges[e].j,
                *(c >= 0 for c in first.columns[k][1:]),
            )
            for k, e in zip(lawful, edges, strict=True)
        ]
        self.law_rows = np.array(rows, dtype=int).reshape(-1, 7)
        laws = [problem.edges[e].row for problem in problems for e in edges]
        self.laws = np.array(laws, dtype=float).reshape(len(problems), len(edges), LAW_SIZE)
        # numbers of the other rows, with their values
        by_law = set(lawful)
        self.others = [
            (k, slice(begin[k], begin[k + 1])) for k in range(len(first.rows)) if k not in by_law
        ]

    def changes(self, numbers: np.ndarray) -> np.ndarray:
        """Changes of the unknowns of some problems in the next iteration; NaN where a number is not finite."""
        for row, own in self.others:
            for k in numbers:
                found = _edge_row(self.problems[k], row, self.flow[k], self.potential[k])
                self.values[k, own], self.right[k, row] = found
        fill_systems(
            numbers,
            self.law_rows,
            self.laws,
            self.terms,
            self.places,
            self.drawn,
            self.scales,
            self.flow,
            self.potential,
            self.values,
            self.right,
            self.matrices,
        )
        matrices = (
            self.matrices[numbers].reshape(numbers.size, -1, self.width)
            if self.matrices.size
            else None
        )
        return _solve(
            self.places,
            self.values[numbers],
            self.right[numbers],
            matrices,
            self.width,
            [self.problems[k] for k in numbers],
        )


def _columns(column, e, edge) -> tuple[int, ...]:
    """Columns of the Newton row of edge e, in the order of `_edge_row`; -1 for a quantity that is not an unknown.

    column : unknown -> its column; unknowns are ("flow", edge) and ("node", node)
    """
    if edge.held_potential is not None:
        return (column["node", edge.held_potential[0]],)
    flow = column.get(("flow", e), -1)
    sensed = (-1 if flow < 0 else column.get(("node", i), -1) for i in edge.sensed_nodes)
    return *sensed, flow, column.get(("node", edge.i), -1), column.get(("node", edge.j), -1)


def _edge_row(problem, row, flow, potential) -> tuple[list[float], float]:
    """Values of a Newton row of a problem in scaled unknowns, and its right-hand side.

    row : index in `problem.rows`; flow, potential : mass flows [kg/s] and potentials [Pa] of the last iteration
    """
    e, scale = problem.rows[row], problem.scale
    edge = problem.edges[e]
    if edge.held_potential is not None:
        return [1.0], (edge.held_potential[1] - potential[edge.held_potential[0]]) / scale[0]
    drop, values = potential[edge.i] - potential[edge.j], []
    *sensed, own, start, end = problem.columns[row]
    if own >= 0:
        alpha, beta, gamma, *lifts = edge.row(
            flow[e], drop, *(potential[i] for i in edge.sensed_nodes)
        )
        values = [-lift for lift, at in zip(lifts, sensed, strict=True) if at >= 0] + [
            alpha * scale[1] / scale[0]
        ]
    else:
        beta, gamma = 1.0, drop - edge.drop(flow[e])
    values += [-beta] * (start >= 0) + [beta] * (end >= 0)
    return values, gamma / scale[0]


def _solve(places, values, right, matrices, size, problems) -> np.ndarray:
    """Solutions of the Newton systems of n problems; the least-squares solution of least norm where one is singular.

    `split` of a problem is set to True for a singular system, and for a large system also if it is not square, and
    `open_part` to a function that gives the vector of unknowns that such a system leaves open.
    places : index of each of the `values` in a matrix, row * size + column; values : float64[n, entries]
    right : float64[n, rows]  right-hand sides; matrices : float64[n, rows, size], None for large systems
    size : number of unknowns. A solution is NaN if a number in its values or right-hand side is not finite.
    """
    finite = np.isfinite(values).all(axis=1) & np.isfinite(right).all(axis=1)
    if matrices is not None and right.shape[1] == size and finite.all():
        try:
            solutions = np.linalg.solve(matrices, right[:, :, None])[:, :, 0]
            # False for NaN
            if np.abs(np.matmul(matrices, solutions[:, :, None])[:, :, 0] - right).max() < 1e-6:
                return solutions
        except np.linalg.LinAlgError:
            pass
    solutions = np.full((len(problems), size), np.nan)
    for k in np.flatnonzero(finite):
        if matrices is not None:
            solutions[k], open_part = _solve_dense(matrices[k], right[k])
        else:
            solutions[k], open_part = _solve_sparse(
                values[k], places // size, places % size, right[k], size
            )
        if open_part is not None:
            problems[k].split, problems[k].open_part = True, open_part
    return solutions


def _solve_dense(matrix, right):
    """Solution of least norm of a small system A x = b : (x, function that gives `open_part` of a singular one)."""
    if len(right) == matrix.shape[1]:
        try:
            solution = np.linalg.solve(matrix, right)
            if np.isfinite(solution).all() and np.abs(matrix @ solution - right).max() < 1e-6:
                return solution, None
        except np.linalg.LinAlgError:
            pass
    solution, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=1e-12)
    regular = rank == matrix.shape[1]
    # which costs more than the solution
    return solution, None if regular else lambda: np.linalg.svd(matrix)[2][-1]


def _solve_sparse(values, i, j, right, size):
    """Solution of a large sparse system A x = b : (x, function that gives `open_part`, None if it is regular).

    values, i, j : entries of A with their rows and columns, entries at the same place are added; right : b
    size : number of unknowns
    A system that is singular or not square is replaced by r + A x = b, A' r = DAMPING x. Then x minimises
    |A x - b|^2 + DAMPING |x|^2.
    """
    from scipy.sparse import bmat, csc_matrix, identity
    from scipy.sparse.linalg import splu

    matrix = csc_matrix((values, (i, j)), shape=(len(right), size))
    if len(right) == size:
        try:
            solution = splu(matrix).solve(right)
            if np.all(np.isfinite(solution)) and np.max(np.abs(matrix @ solution - right)) < 1e-6:
                return solution, None
        except RuntimeError:  # singular
            pass
    system = bmat(
        [[identity(len(right)), matrix], [matrix.T, -DAMPING * identity(size)]], format="csc"
    )
    factors = splu(system)

    def open_part() -> np.ndarray:
        # any right-hand side without symmetry: what the equations leave open dominates its solution
        mixed = np.sin(np.arange(1.0, size + 1.0))
        return factors.solve(np.concatenate((np.zeros(len(right)), mixed)))[len(right) :]

    solution = factors.solve(np.concatenate((right, np.zeros(size))))[len(right) :]
    return solution, open_part


def _through_shut(problem) -> None:
    """Set the potentials of sets of nodes behind shut links, in which nothing else determines them.

    They are the limit of equal small leaks through these links, with zero sum of the flows sign(dP) sqrt|dP|.
    """
    edges, potential = problem.edges, problem.potential
    groups = [group for group in problem.free_sets if group & problem.floating]
    for _ in range(60):
        moved = 0.0
        for group in groups:
            around = [
                potential[edge.j if edge.i in group else edge.i]
                for edge in edges
                if edge.shut and ((edge.i in group) != (edge.j in group))
            ]
            if not around:
                continue
            low, high = min(around), max(around)
            for _ in range(200):
                middle = 0.5 * (low + high)
                total = sum(np.sign(p - middle) * np.sqrt(abs(p - middle)) for p in around)
                low, high = (middle, high) if total > 0 else (low, middle)
            shift = 0.5 * (low + high) - potential[min(group)]
            for i in group:
                potential[i] += shift
            moved = max(moved, abs(shift))
        if moved <= 1e-9:
            return

"""Steady state of a network of resistances: pressures and flows.

Potentials are P = p + rho g z [Pa], flows are mass flows M [kg/s]. A node has a given potential or balances its flows;
along an edge (link) the potential decreases by drop(M). All edges and nodes are solved together by Newton's method
(Todini and Pilati 1988). In a loop without friction the flows are those of least norm.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

DENSE_LIMIT = 150  # number of unknowns up to which a dense solver is faster
DAMPING = 1e-12  # weight of |x|^2 in the least-squares solution of a singular system
ROUNDING = 1e-13  # Newton change below which only rounding is left, relative to the scales
SMALL_DROP = 1e-12  # relative difference of potentials that counts as rounding
SMALL = 1e-9  # relative residual below which a node counts as balanced


@dataclass
class Edge:
    """Link from node i to node j in the steady problem, with its linear equation in each Newton step.

    The equation is alpha dM - beta d(drop) = gamma, for changes of the mass flow M [kg/s] and of the potential drop
    [Pa], positive from i to j.
    row : function (flow, drop) -> (alpha, beta, gamma); None for a fixed flow
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
    row: Callable[[float, float], tuple[float, float, float]] | None
    flow: float = 0.0
    shut: bool = False
    drop: Callable[[float], float] | None = None
    sensed_nodes: tuple[int, ...] = ()
    held_potential: tuple[int, float] | None = None
    drives: bool = False


@dataclass
class SteadyState:
    """Solution of a steady problem: potentials of nodes [Pa] and mass flows of edges [kg/s].

    converged : True if Newton's method converged
    no_solution : nodes in sets that have no known potential and whose demands do not add up to zero
    split : True if the flows of a loop are not unique; then they are those of least norm
    """

    potential: np.ndarray
    flow: np.ndarray
    converged: bool
    split: bool = False
    no_solution: list[int] = field(default_factory=list)


def solve_steady(held: np.ndarray, demand: np.ndarray, edges: list[Edge], scale: tuple[float, float]) -> SteadyState:
    """Solve for the flows of edges that balance the demands of nodes, and for the potentials of these nodes.

    held : float64[n]  given potential [Pa], nan for nodes to be solved
    demand : float64[n]  mass flow out of each node [kg/s], ignored at nodes of given potential
    scale : typical pressure [Pa] and mass flow [kg/s]
    A problem without solution raises no error, see `SteadyState`.
    """
    quiet = _quiet(held, demand, edges)
    edges = [
        replace(edge, row=None, flow=0.0, drop=lambda flow: 0.0) if e in quiet else edge for e, edge in enumerate(edges)
    ]
    parts, free_sets = _components(held, edges)
    missing = np.isnan(held)
    given = held.size - np.count_nonzero(missing)
    potential = np.where(missing, np.where(missing, 0.0, held).sum() / given if given else 0.0, held)
    flow = np.array([edge.flow for edge in edges])
    dropped, entries = _references(held, demand, edges, parts, free_sets)
    floating = {i for group in free_sets if group not in entries.values() for i in group}
    result = SteadyState(potential, flow, True)
    result.no_solution = [
        i for i in floating if abs(sum(demand[k] for k in _group_of(free_sets, i))) > SMALL * scale[1]
    ]
    active = [e for e, edge in enumerate(edges) if edge.row is not None and not edge.shut]
    rows = active + [e for e in entries]
    nodes = [i for i in range(held.size) if np.isnan(held[i])]
    balances = [i for i in nodes if i not in dropped and i not in floating]
    anchors = sorted({min(_group_of(free_sets, i)) for i in floating})
    balances += [i for i in floating if i not in anchors]
    _newton(result, edges, active, rows, nodes, balances, demand, scale, anchors)
    _through_shut(result, held, edges, free_sets, floating)
    return result


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
        driven = any(edge.i in group and (edge.drives or edge.held_potential is not None) for edge in edges)
        if driven or not given or any(demand[i] != 0.0 or (i in fed and held[i] != held[i]) for i in group):
            continue
        if max(given) - min(given) <= SMALL_DROP * (1e5 + max(map(abs, given))):
            quiet |= {e for e, edge in enumerate(edges) if edge.row is not None and not edge.shut and edge.i in group}
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
    known = {i for group in parts if group not in free_sets for i in group}
    waiting = list(free_sets)
    while waiting:
        for group in waiting:
            entry = next((e for e, edge in enumerate(edges) if _enters(edge, group, known)), None)
            if entry is not None:
                entries[entry] = group
                dropped.add(_dead_end(group, demand, edges))
                known |= group
                waiting.remove(group)
                break
        else:
            break
    return dropped, entries


def _enters(edge, group, known) -> bool:
    """True if an edge with a fixed flow and a known drop joins the sets of nodes `group` and `known`."""
    if edge.row is not None or edge.drop is None:
        return False
    return (edge.i in group and edge.j in known) or (edge.j in group and edge.i in known)


def _dead_end(group, demand, edges):
    """Node of the set `group` that is most similar to a dead end: without demand, with the fewest links."""
    count = {i: sum(i in (edge.i, edge.j) for edge in edges) for i in group}
    return min(sorted(group), key=lambda i: (demand[i] != 0.0, count[i]))


def _newton(result, edges, active, rows, nodes, balances, demand, scale, anchors):
    """Solve for the flows of `active` edges and the potentials of `nodes` by Newton's method; write them to `result`.

    The system has a row for each edge in `rows`, for the balance of each node in `balances`, and for each node in
    `anchors`, whose potential is kept because nothing determines it.
    active, rows : lists of indices of edges; nodes, balances, anchors : lists of indices of nodes
    result : `SteadyState`; edges, demand, scale : as for `solve_steady`
    """
    column = {("flow", e): k for k, e in enumerate(active)}
    column |= {("node", i): len(active) + k for k, i in enumerate(nodes)}
    if not column:
        return
    p_scale, f_scale = scale
    size, change, at = np.inf, np.zeros(0), {i: k for k, i in enumerate(balances, start=len(rows))}
    columns = [_columns(column, e, edges[e]) for e in rows]
    ends = [(at[i], e, sign, column.get(("flow", e), -1)) for e, edge in enumerate(edges)
            for i, sign in ((edge.i, -1.0), (edge.j, 1.0)) if i in at and not edge.shut]  # fmt: skip
    to, of, signs = (np.array([end[k] for end in ends], kind) for k, kind in enumerate((int, int, float)))
    last = enumerate(anchors, start=len(rows) + len(balances))
    entries = [(k, c) for k, row in enumerate(columns) for c in row if c >= 0]
    entries += [(k, own) for k, _, _, own in ends if own >= 0] + [(k, column["node", anchor]) for k, anchor in last]
    places = np.array([k * len(column) + c for k, c in entries], dtype=int)
    constant = [sign for _, _, sign, own in ends if own >= 0] + [1.0] * len(anchors)
    drawn = demand[balances] / f_scale
    for sweep in range(200):
        values, right = [], np.zeros(len(rows) + len(balances) + len(anchors))
        for k, e in enumerate(rows):
            right[k] = _edge_row(values, columns[k], e, edges[e], result, scale)
        right[len(rows) : len(rows) + len(balances)] = drawn
        np.subtract.at(right, to, signs * result.flow[of] / f_scale)
        change = _solve(places, np.array(values + constant), right, len(column), result)
        if not np.isfinite(change).all():  # the last values are the best available
            result.converged = False
            return
        result.flow[active] += change[: len(active)] * f_scale
        result.potential[nodes] += change[len(active) :] * p_scale
        before, size = size, float(np.abs(change).max())
        if size <= 1e-15 * (1.0 + np.abs(result.flow).max(initial=0.0) / f_scale) or (sweep > 20 and size < 1e-12):
            return
        if before <= 2.0 * size < ROUNDING:  # no further decrease: only rounding is left
            return
    result.converged = bool(np.max(np.abs(change), initial=0.0) < 1e-9)


def _columns(column, e, edge) -> tuple[int, ...]:
    """Columns of the Newton row of edge e, in the order of `_edge_row`; -1 for a quantity that is not an unknown.

    column : unknown -> its column; unknowns are ("flow", edge) and ("node", node)
    """
    if edge.held_potential is not None:
        return (column["node", edge.held_potential[0]],)
    flow = column.get(("flow", e), -1)
    sensed = (-1 if flow < 0 else column.get(("node", i), -1) for i in edge.sensed_nodes)
    return *sensed, flow, column.get(("node", edge.i), -1), column.get(("node", edge.j), -1)


def _edge_row(values, columns, e, edge, result, scale) -> float:
    """Append the values of the Newton row of edge e in scaled unknowns to `values`; return its right-hand side.

    columns : as from `_columns`; result : `SteadyState` of the last iteration; scale : as for `solve_steady`
    """
    if edge.held_potential is not None:
        values.append(1.0)
        return (edge.held_potential[1] - result.potential[edge.held_potential[0]]) / scale[0]
    flow, drop = result.flow[e], result.potential[edge.i] - result.potential[edge.j]
    *sensed, own, start, end = columns
    if own >= 0:
        potentials = (result.potential[i] for i in edge.sensed_nodes)
        alpha, beta, gamma, *lifts = edge.row(flow, drop, *potentials)
        values += [-lift for lift, at in zip(lifts, sensed, strict=True) if at >= 0]
        values.append(alpha * scale[1] / scale[0])
    else:
        beta, gamma = 1.0, drop - edge.drop(flow)
    if start >= 0:
        values.append(-beta)
    if end >= 0:
        values.append(beta)
    return gamma / scale[0]


def _solve(places, values, right, size, result):
    """Solution of the Newton system; if it is singular or not square, the least-squares solution of least norm.

    `result.split` is set to True for a singular system, and for a large system also if it is not square.
    places : index of each of the `values` in the matrix, row * size + column; right : right-hand side
    size : number of unknowns. The solution is NaN if a number in `values` or `right` is not finite.
    """
    if not (np.isfinite(values).all() and np.isfinite(right).all()):
        return np.full(size, np.nan)
    if max(len(right), size) > DENSE_LIMIT:
        solution, singular = _solve_sparse(values, places // size, places % size, right, size)
        result.split = result.split or singular
        return solution
    matrix = np.bincount(places, values, len(right) * size).reshape(len(right), size)
    if len(right) == size:
        try:
            solution = np.linalg.solve(matrix, right)
            if np.isfinite(solution).all() and np.abs(matrix @ solution - right).max() < 1e-6:
                return solution
        except np.linalg.LinAlgError:
            pass
    solution, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=1e-12)
    result.split = result.split or rank < size
    return solution


def _solve_sparse(values, i, j, right, size):
    """Solution of a large sparse system A x = b : (x, True if the system is singular or not square).

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
                return solution, False
        except RuntimeError:  # singular
            pass
    system = bmat([[identity(len(right)), matrix], [matrix.T, -DAMPING * identity(size)]], format="csc")
    return splu(system).solve(np.concatenate((right, np.zeros(size))))[len(right) :], True


def _through_shut(result, held, edges, free_sets, floating):
    """Set the potentials of sets of nodes behind shut links, in which nothing else determines them.

    They are the limit of equal small leaks through these links, with zero sum of the flows sign(dP) sqrt|dP|.
    held, edges : as for `solve_steady`; free_sets : as from `_components`
    floating : nodes whose potential nothing determines
    """
    groups = [group for group in free_sets if group & floating]
    for _ in range(60):
        moved = 0.0
        for group in groups:
            around = [result.potential[edge.j if edge.i in group else edge.i] for edge in edges
                      if edge.shut and ((edge.i in group) != (edge.j in group))]  # fmt: skip
            if not around:
                continue
            low, high = min(around), max(around)
            for _ in range(200):
                middle = 0.5 * (low + high)
                total = sum(np.sign(p - middle) * np.sqrt(abs(p - middle)) for p in around)
                low, high = (middle, high) if total > 0 else (low, middle)
            first = min(group)
            shift = 0.5 * (low + high) - result.potential[first]
            for i in group:
                result.potential[i] += shift
            moved = max(moved, abs(shift))
        if moved <= 1e-9:
            return

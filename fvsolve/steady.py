"""The state that does not move: pressures and flows of a network of resistances. Knows numbers, no parts.

Potentials are P = p + rho g z [Pa], flows mass flows [kg/s]. Nodes hold a potential or balance their flows;
an edge drops drop(M). All edges and nodes together are solved by Newton (Todini and Pilati 1988); a loop
without friction takes the least-norm split.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

DENSE = 300  # unknowns up to which a dense solver is quicker
DAMPING = 1e-12
ROUNDING = 1e-13  # of changes of Newton, relative to the scales
SMALL_DROP = 1e-12  # relative difference of potentials that is rounding
SMALL = 1e-9  # relative residual below which a node counts as balanced


@dataclass
class Edge:
    """One link: alpha(M, drop), beta, gamma of its Newton row alpha dM - beta d(drop) = gamma.

    row : function of the flow [kg/s] and the present potential drop [Pa]; None holds `flow` as it is
    shut : no flow, but its potentials may have to be guessed through it
    """

    i: int
    j: int
    row: Callable[[float, float], tuple[float, float, float]] | None
    flow: float = 0.0
    shut: bool = False
    drop: Callable[[float], float] | None = None  # pressure drop at a held flow
    senses: int = -1  # node whose potential `row` takes as third, and weighs by a fourth number
    holds: tuple[int, float] | None = None  # node and the potential [Pa] that its flow keeps it at, in place of `row`
    drives: bool = False  # it makes flow between equal potentials


@dataclass
class Steady:
    """Potentials [Pa] of nodes, flows [kg/s] of edges, what stays unbalanced, and whether loops were split."""

    potential: np.ndarray
    flow: np.ndarray
    converged: bool
    split: bool = False
    no_solution: list[int] = field(default_factory=list)  # nodes that ask for flow nobody can bring


def solve_steady(held: np.ndarray, demand: np.ndarray, edges: list[Edge], scale: tuple[float, float]) -> Steady:
    """Balance demands [kg/s] of nodes whose `held` potential is nan with the flows of edges.

    held : float64[n], potential or nan; demand : float64[n]; scale : a typical pressure and mass flow.
    """
    quiet = _quiet(held, demand, edges)
    edges = [replace(edge, row=None, flow=0.0, drop=_no_drop) if e in quiet else edge for e, edge in enumerate(edges)]
    parts, free_sets = _components(held, edges)
    missing = np.isnan(held)
    given = held.size - np.count_nonzero(missing)
    potential = np.where(missing, np.where(missing, 0.0, held).sum() / given if given else 0.0, held)
    flow = np.array([edge.flow for edge in edges])
    dropped, kept = _references(held, demand, edges, parts, free_sets)
    floating = {i for group in free_sets if group not in kept.values() for i in group}
    result = Steady(potential, flow, True)
    result.no_solution = [
        i for i in floating if abs(sum(demand[k] for k in _group_of(free_sets, i))) > SMALL * scale[1]
    ]
    active = [e for e, edge in enumerate(edges) if edge.row is not None and not edge.shut]
    rows = active + [e for e in kept]
    nodes = [i for i in range(held.size) if np.isnan(held[i])]
    balances = [i for i in nodes if i not in dropped and i not in floating]
    anchors = sorted({min(_group_of(free_sets, i)) for i in floating})
    balances += [i for i in floating if i not in anchors]
    _newton(result, edges, active, rows, nodes, balances, demand, scale, anchors)
    _through_shut(result, held, edges, free_sets, floating)
    return result


def _no_drop(flow: float) -> float:
    return 0.0


def _quiet(held, demand, edges) -> set[int]:
    """Edges in which nothing flows: all held potentials they lead to agree to rounding, and nothing is drawn.

    Without this a head's last digit would drive a flow: through M |M| = G dP it is the root of the rounding.
    """
    fed = {i for edge in edges if edge.row is None and edge.flow != 0.0 for i in (edge.i, edge.j)}
    quiet = set()
    for group in _components(held, edges)[0]:
        given = [held[i] for i in group if held[i] == held[i]]
        driven = any(edge.i in group and (edge.drives or edge.holds is not None) for edge in edges)
        if driven or not given or any(demand[i] != 0.0 or (i in fed and held[i] != held[i]) for i in group):
            continue
        if max(given) - min(given) <= SMALL_DROP * (1e5 + max(map(abs, given))):
            quiet |= {e for e, edge in enumerate(edges) if edge.row is not None and not edge.shut and edge.i in group}
    return quiet


def _group_of(groups, i):
    return next(group for group in groups if i in group)


def union(n: int, pairs) -> list[int]:
    """Label of the set that each of n things belongs to when pairs are joined."""
    label = list(range(n))

    def root(i: int) -> int:
        while label[i] != i:
            label[i] = i = label[label[i]]
        return i

    for i, j in pairs:
        label[root(int(i))] = root(int(j))
    return [root(i) for i in range(n)]


def _components(held, edges):
    """Sets of nodes joined by edges that find their own flow, and those sets without a held potential."""
    joined = [(edge.i, edge.j) for edge in edges if edge.row is not None and not edge.shut]
    groups: dict[int, set[int]] = {}
    for i, label in enumerate(union(held.size, joined)):
        groups.setdefault(label, set()).add(i)
    parts = [frozenset(group) for group in groups.values()]
    return parts, [group for group in parts if all(np.isnan(held[i]) for i in group)]


def _references(held, demand, edges, parts, free_sets):
    """For sets that only held flows reach: nodes whose balance is given up, and the edge that sets the level."""
    dropped: set[int] = set()
    kept: dict[int, frozenset[int]] = {}
    known = {i for group in parts if group not in free_sets for i in group}
    waiting = list(free_sets)
    while waiting:
        for group in waiting:
            entry = next((e for e, edge in enumerate(edges) if _enters(edge, group, known)), None)
            if entry is not None:
                kept[entry] = group
                dropped.add(_dead_end(group, demand, edges))
                known |= group
                waiting.remove(group)
                break
        else:
            break
    return dropped, kept


def _enters(edge, group, known) -> bool:
    """Whether an edge with a held flow leads from a known potential into a set."""
    if edge.row is not None or edge.drop is None:
        return False
    return (edge.i in group and edge.j in known) or (edge.j in group and edge.i in known)


def _dead_end(group, demand, edges):
    """The node of a set that is most like a shut end: fewest links, no demand."""
    count = {i: sum(i in (edge.i, edge.j) for edge in edges) for i in group}
    return min(sorted(group), key=lambda i: (demand[i] != 0.0, count[i]))


def _newton(result, edges, active, rows, nodes, balances, demand, scale, anchors):
    """Newton on flows of `active` edges and potentials of `nodes`; one row an edge, a balance, an anchored set."""
    column = {("flow", e): k for k, e in enumerate(active)}
    column |= {("node", i): len(active) + k for k, i in enumerate(nodes)}
    if not column:
        return
    p_scale, f_scale = scale
    most, change, at = np.inf, np.zeros(0), {i: k for k, i in enumerate(balances, start=len(rows))}
    columns = [_columns(column, e, edges[e]) for e in rows]
    ends = [(at[i], e, sign, column.get(("flow", e), -1)) for e, edge in enumerate(edges)
            for i, sign in ((edge.i, -1.0), (edge.j, 1.0)) if i in at and not edge.shut]  # fmt: skip
    to, of, signs = (np.array([end[k] for end in ends], kind) for k, kind in enumerate((int, int, float)))
    last = enumerate(anchors, start=len(rows) + len(balances))
    entries = [(k, c) for k, row in enumerate(columns) for c in row if c >= 0]
    entries += [(k, felt) for k, _, _, felt in ends if felt >= 0] + [(k, column["node", anchor]) for k, anchor in last]
    places = np.array([k * len(column) + c for k, c in entries], dtype=int)
    constant = [sign for _, _, sign, felt in ends if felt >= 0] + [1.0] * len(anchors)
    drawn = demand[balances] / f_scale
    for sweep in range(200):
        found, right = [], np.zeros(len(rows) + len(balances) + len(anchors))
        for k, e in enumerate(rows):
            right[k] = _edge_row(found, columns[k], e, edges[e], result, scale)
        right[len(rows) : len(rows) + len(balances)] = drawn
        np.subtract.at(right, to, signs * result.flow[of] / f_scale)
        change = _solve(places, np.array(found + constant), right, len(column), result)
        if not np.isfinite(change).all():  # what was found last is the best there is
            result.converged = False
            return
        result.flow[active] += change[: len(active)] * f_scale
        result.potential[nodes] += change[len(active) :] * p_scale
        before, most = most, float(np.abs(change).max())
        if most <= 1e-15 * (1.0 + np.abs(result.flow).max(initial=0.0) / f_scale) or (sweep > 20 and most < 1e-12):
            return
        if before <= 2.0 * most < ROUNDING:  # no closer: what is left is rounding
            return
    result.converged = bool(np.max(np.abs(change), initial=0.0) < 1e-9)


def _columns(column, e, edge) -> tuple[int, ...]:
    """Columns of one edge's row in the order of its values, -1 for what is no unknown."""
    if edge.holds is not None:
        return (column["node", edge.holds[0]],)
    flow = column.get(("flow", e), -1)
    sensed = -1 if flow < 0 else column.get(("node", edge.senses), -1)
    return sensed, flow, column.get(("node", edge.i), -1), column.get(("node", edge.j), -1)


def _edge_row(found, columns, e, edge, result, scale) -> float:
    """Add the values of row alpha dM - beta d(drop) = gamma of one edge, in scaled unknowns; returns its right side."""
    if edge.holds is not None:
        found.append(1.0)
        return (edge.holds[1] - result.potential[edge.holds[0]]) / scale[0]
    flow, drop = result.flow[e], result.potential[edge.i] - result.potential[edge.j]
    sensed, own, start, end = columns
    if own >= 0:
        if edge.senses < 0:
            alpha, beta, gamma = edge.row(flow, drop)
        else:
            alpha, beta, gamma, lift = edge.row(flow, drop, result.potential[edge.senses])
            if sensed >= 0:
                found.append(-lift)
        found.append(alpha * scale[1] / scale[0])
    else:
        beta, gamma = 1.0, drop - edge.drop(flow)
    if start >= 0:
        found.append(-beta)
    if end >= 0:
        found.append(beta)
    return gamma / scale[0]


def _solve(places, values, right, size, result):
    """Least-norm solution of the Newton system, of values at row times size plus column; remembers if it had to choose.

    NaN where a number of the system is not finite.
    """
    if not (np.isfinite(values).all() and np.isfinite(right).all()):
        return np.full(size, np.nan)
    if max(len(right), size) > DENSE:
        found, chosen = _solve_sparse(values, places // size, places % size, right, size)
        result.split = result.split or chosen
        return found
    matrix = np.bincount(places, values, len(right) * size).reshape(len(right), size)
    if len(right) == size:
        try:
            found = np.linalg.solve(matrix, right)
            if np.isfinite(found).all() and np.abs(matrix @ found - right).max() < 1e-6:
                return found
        except np.linalg.LinAlgError:
            pass
    found, _, rank, _ = np.linalg.lstsq(matrix, right, rcond=1e-12)
    result.split = result.split or rank < size
    return found


def _solve_sparse(values, i, j, right, size):
    """The same of a large system, and whether it had to choose.

    Where it is singular: r + A x = b, A' r = DAMPING x, the x that makes |A x - b|^2 + DAMPING |x|^2 least.
    """
    from scipy.sparse import bmat, csc_matrix, identity
    from scipy.sparse.linalg import splu

    matrix = csc_matrix((values, (i, j)), shape=(len(right), size))
    if len(right) == size:
        try:
            found = splu(matrix).solve(right)
            if np.all(np.isfinite(found)) and np.max(np.abs(matrix @ found - right)) < 1e-6:
                return found, False
        except RuntimeError:  # singular
            pass
    whole = bmat([[identity(len(right)), matrix], [matrix.T, -DAMPING * identity(size)]], format="csc")
    return splu(whole).solve(np.concatenate((right, np.zeros(size))))[len(right) :], True


def _through_shut(result, held, edges, free_sets, floating):
    """Potentials of sets that only shut links reach: the limit of equal small leaks, sum sqrt|dP| sign = 0."""
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

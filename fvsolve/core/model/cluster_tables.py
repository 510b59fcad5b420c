"""Solution method of each node without storage: alone, with its valve by a closed formula, or in a group by Newton."""

import heapq
import math

import numpy as np

from fvsolve.core.assembly.lowering import LAMINAR_REYNOLDS
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.steady import union
from fvsolve.errors import listing


def classify_nodes(draft) -> None:
    """Choose the solution method of nodes without storage and of valves; fill the table of groups solved by Newton.

    Adds faults of nodes whose pressure nothing sets.
    """
    nodes, valves = draft.node_table, draft.valve_table
    inner, joins = nodes["kind"] == rec.JUNCTION, draft.coupling_table
    pairs = [
        (v["from_node"], v["to_node"])
        for v in (*valves, *joins)
        if inner[v["from_node"]] and inner[v["to_node"]]
    ]
    group, sensed = union(len(nodes), pairs), sensed_junctions(draft, inner)
    if sensed:
        refuse_sensed(draft, group, sensed)
        group = union(
            len(nodes),
            pairs
            + [pair for k, own in sensed.items() for pair in pairs_with(valves[k], own, inner)],
        )
    touched: dict[int, list[int]] = {}
    couples = rows_by_group(group, inner, enumerate(joins), touched)
    touched |= rows_by_group(group, inner, enumerate(valves), touched, sensed)
    for feature in draft.features:
        feature.grouped(draft, group)
    members: dict[int, list[int]] = {root: [] for root in touched}
    for i in np.flatnonzero(inner).tolist():
        if group[i] in members:
            members[group[i]].append(i)
    nodes["solve"], clusters = rec.ALONE, []
    for root, ks in touched.items():
        own = couples.get(root, [])
        valves["chained"][ks] = valves["chained"][ks].any() if ks else 0
        valves["flow_given"][ks] = (
            len(ks) == 1 and not own and not nodes["admittance"][members[root]].any()
        )
        if has_single_root(draft, members[root], ks, own):
            refuse_holds(draft, [k for k in ks if held_end(draft, k) is not None])
        else:
            clusters.append(add_cluster(draft, members[root], ks, own))
    fixed = ~inner[valves["from_node"]] & ~inner[valves["to_node"]]
    fixed[list(sensed)] = False
    for k in np.flatnonzero(fixed & ~has_closed_root(valves)):  # clusters without nodes
        valves["solve"][k] = rec.CLUSTER
        clusters.append(add_cluster(draft, [], [int(k)], []))
    if not draft.case.law.linear:
        for i in np.flatnonzero(
            inner & (nodes["solve"] == rec.ALONE) & (nodes["admittance"] > 0.0)
        ):
            clusters.append(add_cluster(draft, [int(i)], [], []))
    store_gates(draft)
    refuse_isolated_groups(draft, members)
    for k in np.flatnonzero(fixed):
        regularise(draft, [k])
    smooth_near_stores(draft)
    draft.cluster_table = np.array(clusters, dtype=rec.CLUSTER_RECORD)
    for i in np.flatnonzero(inner & (nodes["admittance"] == 0.0)):
        if nodes["solve"][i] == rec.ALONE:
            name = list(draft.case.places)[i]
            draft.fault(
                f"nodes.{name}",
                "only rigid columns join this node, so nothing sets its pressure; "
                "make it a chamber, or make one of its links a pipe",
            )


def sensed_junctions(draft, inner) -> dict[int, list[int]]:
    """Junctions whose pressures lift a valve at once : row of the valve -> nodes; inner : as for `rows_by_group`."""
    found = {}
    for row in draft.device_table:
        if row["second"] >= 0 and draft.valve_table["hooks"][row["valve"]] >= 0:
            own = [int(row[column]) for column in ("node", "second") if inner[row[column]]]
            found |= {int(row["valve"]): own} if own else {}
    return found


def pairs_with(valve, own: list[int], inner) -> list[tuple[int, int]]:
    """Pairs that join the junctions `own`, which a valve senses, to each other and to its end nodes."""
    places = [*own, *(int(valve[end]) for end in ("from_node", "to_node") if inner[valve[end]])]
    return [(places[0], place) for place in places[1:]]


def refuse_sensed(draft, group, sensed: dict[int, list[int]]) -> None:
    """Add a fault for each valve that follows at once a junction whose pressure its own flow changes.

    At its ends the pressure falls as the valve opens; elsewhere the flow may have several solutions, or none. group :
    label of the group of nodes that valves join; sensed : as from `sensed_junctions`
    """
    nodes, names = draft.node_table, list(draft.case.places)
    for k, own in sensed.items():
        valve, row = draft.valve_table[k], draft.device_table[draft.valve_table[k]["device"]]
        ends = [int(valve[end]) for end in ("from_node", "to_node")]
        touched = {group[i] for i in ends if nodes["kind"][i] == rec.JUNCTION}
        for i in own:
            weight = sum(
                float(row[f"{column}_weight"]) for column in ("node", "second") if row[column] == i
            )
            steady = (i == ends[0] and weight > 0.0) or (i == ends[1] and weight < 0.0)
            if not steady and group[i] in touched:
                name = draft.valve_names[k]
                draft.fault(
                    f"links.{name}",
                    f"senses {names[i]}, a junction whose pressure follows the flow of this "
                    f"valve at once; give the valve a time_constant, or make {names[i]} a chamber",
                )


def rows_by_group(
    group, inner, rows, touched: dict[int, list[int]], further=None
) -> dict[int, list[int]]:
    """Numbers of the rows that end at inner nodes of each group : label of the group -> numbers.

    group, inner : label of each node, and True for a node without storage; rows : pairs of number and row
    touched : gets an empty list for each group that it lacks, so that groups keep the order of their first row
    further : number of a row -> inner nodes that count as its ends too
    """
    found: dict[int, list[int]] = {root: [] for root in touched}
    for k, row in rows:
        for i in {int(row["from_node"]), int(row["to_node"]), *(further or {}).get(k, ())}:
            if inner[i]:
                touched.setdefault(group[i], [])
                own = found.setdefault(group[i], [])
                own += [] if k in own else [k]
    return found


def has_single_root(draft, members, ks, own) -> bool:
    """True if a group is a valve whose flow has a closed formula; sets the solution method of its nodes and valves.

    Valves of a group without any pipe are made laminar near zero flow. members : nodes; ks : valves; own : couplings
    """
    nodes, valves = draft.node_table, draft.valve_table
    regular, plain = np.all(nodes["admittance"][members] > 0.0), np.all(has_closed_root(valves[ks]))
    single = len(ks) == 1 and regular and plain and draft.case.law.linear and not own
    nodes["solve"][members] = valves["solve"][ks] = rec.SINGLE if single else rec.CLUSTER
    if not np.any(nodes["admittance"][members] > 0.0) and not follows_column(draft, members, ks):
        regularise(draft, ks)
    return single


FULL_MATRIX = 200  # nodes up to which a cluster with a sparse matrix also has space for a full one


def add_cluster(draft, members, ks, own) -> tuple[int, ...]:
    """Append a group to `integers`, its nodes, valves and couplings, and return its `CLUSTER_RECORD`."""
    n, at = len(members), len(draft.integers)
    draft.node_table["row"][members] = np.arange(n)
    inverse = add_inverse(draft, members, own) if own and not ks else -1
    draft.integers += [*members, *ks, *own]
    devices = draft.valve_table["device"][ks]
    senses = (draft.device_table["node"][devices[devices >= 0]] >= 0).any() if ks else False
    order = -1
    size = n * n
    held = 0
    holds = {k: end for k in ks if (end := held_end(draft, k)) is not None}
    if ks and draft.valve_table["chained"][ks].all() and not senses:
        matrix = SparseMatrix(draft, members, ks, own, holds)
        draft.integers.append(matrix.size)
        order = len(draft.integers)
        draft.integers += matrix.integers()
        size = max(matrix.size, n * n if n <= FULL_MATRIX else 0)
        refuse_shared_nodes(draft, holds)
        for k in holds:
            held += add_hold(draft, matrix, k, holds[k])
    else:
        refuse_holds(draft, holds)
    return (
        at,
        n,
        at + n,
        len(ks),
        at + n + len(ks),
        len(own),
        inverse,
        order,
        size,
        int(senses),
        held,
    )


def held_end(draft, k: int) -> str | None:
    """End of valve k at which it may hold the pressure, "" if it may hold its flow, None if it holds nothing."""
    device = draft.valve_table["device"][k]
    end = None if device < 0 else draft.devices[device][2].held_end(draft.devices[device][1])
    if end and draft.node_table["kind"][draft.valve_table[k][f"{end}_node"]] != rec.JUNCTION:
        return None  # its pressure is given
    return end


def add_hold(draft, matrix, k: int, end: str) -> int:
    """Append to `integers` what valve k may hold, see `node_clusters.hold_pressures`; returns the numbers it needs."""
    draft.valve_table["hold"][k] = len(draft.integers)
    if not end:
        draft.integers.append(rec.FLOW_HELD)
        return 0
    held, other = matrix.ends_held(k, end)
    columns = [held, *sorted(matrix.joined[held])]
    places = [
        (q, matrix.place[held, q], matrix.place[other, q] if other >= 0 else -1) for q in columns
    ]
    draft.integers += [rec.TO_HELD if end == "to" else rec.FROM_HELD, held, other, len(places)]
    draft.integers += [number for entry in places for number in entry]
    return 1 + len(places)


def refuse_holds(draft, holds) -> None:
    """Add a fault for each valve that would hold a value at once in a group with waves; holds : rows of the valves"""
    for k in holds:
        text = "0 s: the valve acts at once, which needs pipes without waves at its junctions"
        draft.fault(
            f"links.{draft.valve_names[k]}.time_constant",
            f'{text}; expected a time above 0 s, or pipe_model = "quasi-steady"',
        )


def refuse_shared_nodes(draft, holds) -> None:
    """Add a fault for each valve at whose ends another valve holds the pressure; holds : as for `SparseMatrix`"""
    names = list(draft.case.places)
    valves = draft.valve_table
    of_node = {}
    for k in (k for k, end in holds.items() if end):
        node, name = int(valves[k][f"{holds[k]}_node"]), draft.valve_names[k]
        if node in of_node:
            text = f"{of_node[node]} and {name} both hold the pressure at {names[node]} at once"
            draft.fault(
                f"links.{name}", f"{text}; expected one such valve, or a time_constant above 0 s"
            )
        of_node.setdefault(node, name)
    for k in (k for k, end in holds.items() if end):
        node = int(valves[k]["to_node" if holds[k] == "from" else "from_node"])
        name = draft.valve_names[k]
        if of_node.get(node, name) != name:
            text = f"its end {names[node]} is where {of_node[node]} holds the pressure at once"
            draft.fault(
                f"links.{name}",
                f"{text}; expected a pipe between both, or a time_constant above 0 s",
            )


class SparseMatrix:
    """Places of the entries of the matrix of a group of nodes, and its elimination, least degree first.

    members : indices of the nodes; ks, own : rows of the valves and couplings that join them
    holds : row of a valve that may hold a pressure -> end at which it holds it, "" for a flow
    joined : nodes that links join to each node, by their rows; place : (row, column) -> place; size : number of places
    """

    def __init__(self, draft, members, ks, own, holds) -> None:
        self.draft, self.rows = draft, {i: k for k, i in enumerate(members)}
        links = [draft.valve_table[k] for k in ks] + [draft.coupling_table[k] for k in own]
        self.links = [
            tuple(self.rows.get(int(row[end]), -1) for end in ("from_node", "to_node"))
            for row in links
        ]
        self.joined: list[set[int]] = [set() for _ in members]
        for i, j in self.links:
            self.join(self.joined, i, j)
        near = [set(others) for others in self.joined]
        for k, end in holds.items():  # the balance of a held node is added to that at the other end
            held, other = self.ends_held(k, end) if end else (-1, -1)
            for q in self.joined[held] if other >= 0 else ():
                self.join(near, other, q)
        self.pivots = self.eliminate(near)
        self.size, self.place = len(members), {(k, k): k for k in range(len(members))}
        for p, others in self.pivots:
            for u, q in enumerate(others):
                self.place[p, q], self.place[q, p] = self.size + u, self.size + len(others) + u
            self.size += 2 * len(others)

    @staticmethod
    def join(near: list[set[int]], i: int, j: int) -> None:
        """Join the rows i and j; -1 for a known pressure."""
        if i >= 0 and j >= 0 and i != j:
            near[i].add(j)
            near[j].add(i)

    def ends_held(self, k: int, end: str) -> tuple[int, int]:
        """(row of the node whose pressure valve k holds, row of its other end, -1 for a known pressure)."""
        row, ends = self.draft.valve_table[k], ("from", "to")
        held, other = (int(row[f"{side}_node"]) for side in (ends if end == "from" else ends[::-1]))
        return self.rows[held], self.rows.get(other, -1)

    def eliminate(self, near: list[set[int]]) -> list[tuple[int, list[int]]]:
        """Order of elimination: (row of the pivot, rows that its elimination changes); near : joined rows of each"""
        heap = [(len(others), k) for k, others in enumerate(near)]
        heapq.heapify(heap)
        pivots, eliminated = [], set()
        while heap:
            degree, k = heapq.heappop(heap)
            if k in eliminated or degree != len(near[k]):
                continue  # an entry of an earlier degree
            eliminated.add(k)
            pivots.append((k, sorted(near[k])))
            for other in near[k]:
                near[other] |= near[k]
                near[other] -= {other, k}
                heapq.heappush(heap, (len(near[other]), other))
        return pivots

    def integers(self) -> list[int]:
        """Numbers for `node_clusters.solve_in_order`, with the places of the entries of each link in between."""
        place = self.place
        links = []
        entries = []
        starts = []
        for i, j in self.links:
            both = i >= 0 and j >= 0
            links += [i, j, place[i, j] if both else -1, place[j, i] if both else -1]
        first = len(self.pivots) + len(links)
        for p, others in self.pivots:
            starts.append(first + len(entries))
            entries += [p, len(others), *others, place[p, others[0]] if others else -1]
            entries += [place[q, column] for q in others for column in others]
        return [*starts, *links, *entries]


def add_inverse(draft, members, couples) -> int:
    """Append the inverse of the admittance matrix of nodes that are coupled to `floats`; return its offset.

    members : indices of the nodes; couples : rows of the couplings. The inverse is stored row by row.
    """
    rows, place = {i: k for k, i in enumerate(members)}, len(draft.floats)
    matrix = np.diag(draft.node_table["admittance"][members])
    for k in couples:
        link = draft.coupling_table[k]
        ends = [rows[i] for i in (int(link["from_node"]), int(link["to_node"])) if i in rows]
        for i in ends:
            matrix[i, i] += link["conductance"]
        if len(ends) == 2:
            matrix[ends[0], ends[1]] -= link["conductance"]
            matrix[ends[1], ends[0]] -= link["conductance"]
    draft.floats += np.linalg.inv(matrix).ravel().tolist()
    return place


def has_closed_root(valves) -> np.ndarray:
    """True for each valve with the square-root law and equal conductance in both directions : bool[valves].

    A closed formula solves these valves.
    """
    return (valves["hooks"] < 0) & (valves["back"] == 1.0)


def store_gates(draft) -> None:
    """Store, for each node that only valves and rigid columns join, these valves and the number of columns.

    Nodes with a demand, and nodes with the valve of a vessel, are left out.
    """
    nodes = draft.node_table
    valves = draft.valve_table
    columns = draft.column_table
    nodes["gates"], places = -1, list(draft.case.places.values())
    bare = (nodes["kind"] == rec.JUNCTION) & (nodes["admittance"] == 0.0)
    valves_at, columns_at = rows_at_nodes(valves), rows_at_nodes(columns)
    for i in np.flatnonzero(bare).tolist():
        joined = valves_at.get(i, [])
        devices = [k for k in valves["device"][joined] if k >= 0 and not draft.devices[k][2].vessel]
        own = [k for k in devices if not draft.devices[k][2].sensed(draft.devices[k][1])]
        if any(draft.device_table["node"][own] >= 0):
            continue
        column_count, place = len(columns_at.get(i, [])), places[i]
        if column_count == 0 or not joined:
            continue
        if not np.any((place.demand if place.kind == "junction" else place.flow).value):
            nodes["gates"][i], nodes["gate_count"][i] = len(draft.integers), len(joined)
            nodes["columns"][i] = column_count
            draft.integers += joined


def rows_at_nodes(table) -> dict[int, list[int]]:
    """Rows of links that end at each node, in ascending order : node -> rows; table : links"""
    found: dict[int, list[int]] = {}
    for k, ends in enumerate(
        zip(table["from_node"].tolist(), table["to_node"].tolist(), strict=True)
    ):
        for i in set(ends):
            found.setdefault(i, []).append(k)
    return found


def refuse_isolated_groups(draft, members) -> None:
    """Add a fault for each group of nodes whose pressure nothing sets.

    Valves join the nodes to each other, and only air valves and rigid columns lead out of the group.
    members : label of a group -> indices of its nodes
    """
    nodes = draft.node_table
    valves = draft.valve_table
    names = list(draft.case.places)
    valves_at = rows_at_nodes(valves)
    for group in members.values():
        links = [valves[k] for k in sorted({k for i in group for k in valves_at.get(i, [])})]
        air = [v for v in links if v["device"] >= 0 and draft.devices[v["device"]][2].vessel]
        to_fixed = [v for v in links if not {int(v["from_node"]), int(v["to_node"])} <= set(group)]
        if len(group) < 2 or len(to_fixed) > len(air) or np.any(nodes["admittance"][group] > 0.0):
            continue
        first = int(air[0]["from_node"]) if air else group[0]
        place, other = (names[i] for i in sorted(group, key=lambda i: i != first)[:2])
        reason, span = "a valve joins this air valve", " while the air valve is shut"
        if not air:
            joins = [
                name
                for name, v in zip(draft.valve_names, valves, strict=True)
                if int(v["from_node"]) in group
            ]
            reason = f"{listing(joins)} {'joins' if len(joins) == 1 else 'join'} this node"
            span = ""
        draft.fault(
            f"nodes.{place}",
            f"{reason} to {other}, and otherwise only rigid columns join these nodes, so "
            f"nothing sets their pressure{span}; make {other} a chamber, or make one of the columns "
            "a pipe",
        )


def follows_column(draft, members, ks) -> bool:
    """True if a single valve with a closed formula joins a single node at the end of a rigid column.

    The flow of the column then sets the drop of the valve, which is smooth at zero flow.
    """
    ends = np.concatenate((draft.column_table["from_node"], draft.column_table["to_node"]))
    plain = has_closed_root(draft.valve_table)[ks[0]]
    return len(ks) == 1 and len(members) == 1 and members[0] in ends and bool(plain)


def smooth_near_stores(draft) -> None:
    """Make laws with a steep slope at zero drop smooth below the drop of `tolerated_drop`, in links next to a store.

    Between them and the store there may be further restrictions, such as an altitude valve. Two tanks at one level,
    joined by a short pipe, would otherwise move in steps of seconds: linearly implicit steps alternate in sign there.
    """
    nodes, valves = draft.node_table, draft.valve_table
    lowerings = [
        lowering for _, _, lowering in draft.links.get("valve", []) for _ in range(lowering.rows)
    ]
    steep = [k for k, lowering in enumerate(lowerings) if lowering.smooths]
    if not steep or draft.case.numerics.rtol is None:
        return
    others = [k for k, lowering in enumerate(lowerings) if not lowering.smooths]
    ends = np.column_stack([valves["from_node"], valves["to_node"]]).tolist()
    free = (nodes["kind"] != rec.FIXED).tolist()
    label = union(len(nodes), [ends[k] for k in others if free[ends[k][0]] and free[ends[k][1]]])
    groups: dict[int, list[int]] = {}
    for k in others:
        groups.setdefault(label[ends[k][0]], []).append(k)
    stores = {label[i] for i in np.flatnonzero((nodes["y"] >= 0) & (nodes["stiffness"] > 0.0))}
    for k in steep:
        near = {label[i] for i in ends[k]} & stores
        if near and (
            drop := tolerated_drop(
                draft, [k, *(other for at in near for other in groups.get(at, []))]
            )
        ):
            lowerings[k].smooth(draft, valves[k], drop)


# tolerances of a vessel: its tolerance grows with its deviation, here up to nine times its scale
TOLERANCES = 10.0


def regularise(draft, ks) -> None:
    """Make valves without an adjacent pipe laminar below `LAMINAR_REYNOLDS`, to bound their slope at zero drop.

    They are also laminar below the drop of `tolerated_drop`, and at a bladder accumulator below at least 1 Pa, as its
    neck stores hardly any mass. Valves with a law of their own (unless it is `regular`) or a stated transition are not
    changed. ks : rows of the valves
    """
    places, unseen = list(draft.case.places.values()), tolerated_drop(draft, ks)
    for k in ks:
        row = draft.valve_table[k]
        regular = row["device"] >= 0 and draft.devices[row["device"]][2].regular
        if row["transition"] == 0.0 and (row["hooks"] < 0 or regular):
            name = draft.valve_names[k]
            link = draft.case.conduits[name]
            neck = any(
                getattr(places[row[end]], "precharge", None) is not None
                for end in ("from_node", "to_node")
            )
            row["transition"] = draft.hydraulics.transition_flow(
                name, link, LAMINAR_REYNOLDS, draft.fault
            )
            row["rounding_drop"] = max(1.0 if neck else 0.0, unseen)


def tolerated_drop(draft, ks) -> float:
    """Pressure drop [Pa] whose decay changes each storing node at the valves ks by at most a few error tolerances.

    It is 0 without error control or without such nodes. Near zero drop the slope of the square-root law is unbounded.
    Linearly implicit steps then alternate in sign: each error is below the tolerance, but the flow never comes to rest.
    A chamber of 10 l took 1e6 steps in 10 s. ks : rows of the valves
    """
    rtol, nodes = draft.case.numerics.rtol, draft.node_table
    ends = {int(draft.valve_table[k][end]) for k in ks for end in ("from_node", "to_node")}
    vessels = [nodes[i] for i in ends if nodes[i]["y"] >= 0 and nodes[i]["stiffness"] > 0.0]
    if rtol is None or not vessels:
        return 0.0
    stiffness = sum(float(row["stiffness"]) for row in vessels)
    least = min(draft.scale[row["y"]] for row in vessels)
    return TOLERANCES * rtol * math.sqrt(len(draft.scale)) * least * stiffness

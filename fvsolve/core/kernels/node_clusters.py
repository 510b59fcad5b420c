"""Clusters: nodes without storage that several valves join, solved together by Newton on pressures and flows.

Under the density law `linear` only nodes with several valves belong to a cluster; the others have a closed root
(`linear_nodes.py`). Under the other laws every node without storage does, and the flows from pipe ends depend on
pressure.

Valve from node i to node j: M |M| = G (dp0 + p_i' - p_j'), with flow M [kg/s], conductance G and initial drop dp0.
Node: c_i - Y_i p_i' = flow that leaves it through valves, with the other inflow c_i at p_i' = 0 and the admittance Y_i
of its pipes. p' is the pressure change since the initial steady state. Both are solved together (gradient method of
Todini and Pilati 1988). The unknown flows are total flows, not changes: where a valve is nearly closed, a change would
lose all but its rounding. A cluster in which nothing has changed is not solved. Each cluster stops by its own change,
so its result does not depend on other clusters. Under `linear`, where MAX_SWEEPS steps do not converge, Newton starts
again from the flows of the laws, with a limited step of each node: half its last step if the direction has changed,
else twice (`limit_each_step`).

A law gives the inflow of a node except through valves with its fall per pressure (`linear_balance`,
`barotropic_balance`), and the driving pressure of a valve.

Arguments common to these functions: `cluster`, row of the cluster; arrays with an entry for each of its valves or each
of its n nodes:
g, m : conductance [kg2/s2/Pa], and flow of valves [kg/s]
c : inflow of nodes except through valves, less the demand [kg/s]
connected : 1 if open valves join a node to a pipe or to a known pressure, 0 for an isolated node
slope : float64[nodes]  derivative of the flow from pipes into a node with respect to its pressure [kg/s per Pa]; not
    used under the density law `linear`
wide : True while valves that a pressure lifts are held wide open, see `restrictions.restriction_step`
space : work arrays of `node_work`
"""

from math import copysign, sqrt

from fvsolve.core.kernels.dtypes import (
    FIRM,
    FIRM_SLOPE,
    FLOW_HELD,
    NEARBY,
    NO_SOLUTION,
    NOT_CONVERGED,
    NOT_HELD,
    STATUS,
    TO_HELD,
    WHERE,
)
from fvsolve.core.kernels.isolated_nodes import (
    JOINED,
    find_connected,
    group_by_open_valves,
    inner_row,
    isolated_pressures,
    mark_isolated,
)
from fvsolve.core.kernels.restrictions import (
    conductance,
    has_lifted_backflow,
    is_sensing,
    restriction_lift,
    restriction_step,
    valve_driving_pressure,
)
from fvsolve.core.kernels.table_handle import open_tables
from fvsolve.jit import njit, specialise

BAR = 1e5
ROUNDING = 1e-15  # relative rounding of pressures; of a flow, relative to the flow at 1 Pa
NEARLY_CONVERGED = 1e-9  # relative change of Newton below which it may be rounding
# relative change of Newton after which the second-order rest is 1e-6 of a difference of 1e-8
SMALL_CHANGE = 1e-7
# ratio of quadratic steps; relative change below which a constant one is rounding
QUADRATIC, STAGNANT = 1e-4, 1e-7
FIRST_RISE = 1e4  # greatest change of a pressure in the first limited step of Newton [Pa]
NOT_BALANCED = 1e300  # in place of a change of Newton: the step was limited
LEAST_RISE = 1e-9  # least limit of such a step [Pa]
# greatest step of a pressure without such limits: a trickle may leave levels nearly undetermined [Pa]
MOST_RISE = 1e8
BRACKETED = 3e-8  # limits of all nodes at which their pressures are known but for rounding [Pa]
STEEP_CHANGE = 1e-3  # relative change of flow by this rounding where a law is steep, at most
# relative change of flow above which Newton has failed; smaller changes may be rounding
FAILED_CHANGE = 1e-5
# Errors of valve flows against their laws up to this fraction of the node's imbalance cannot reverse a Newton step.
FLOW_ERROR = 0.01
BALANCE = DRIVING = ASSEMBLE = BAROTROPIC = None  # constants of the templates


@njit
def solve_dense(a, b, n):
    """Solve a x = b by elimination with partial pivoting; x replaces b. Returns the sign of det a, 0 if a is singular.

    a : float64[n * n]  matrix row by row, overwritten
    If it is singular, b[0] becomes the number of the first unknown that the equations do not determine.
    """
    sign = 1.0
    for i in range(n):
        pivot, row = i, n * i
        for k in range(i + 1, n):
            if abs(a[n * k + i]) > abs(a[n * pivot + i]):
                pivot = k
        if a[n * pivot + i] == 0.0:
            b[0] = float(i)
            return 0.0
        # An exchange of rows and a negative pivot each change the sign of the determinant.
        if (pivot != i) != (a[n * pivot + i] < 0.0):
            sign = -sign
        if pivot != i:
            for k in range(n):
                a[row + k], a[n * pivot + k] = a[n * pivot + k], a[row + k]
            b[i], b[pivot] = b[pivot], b[i]
        for k in range(i + 1, n):
            f = a[n * k + i] / a[row + i]
            # Nodes have few neighbours, so that most factors are zero.
            if f != 0.0:
                for m in range(i, n):
                    a[n * k + m] -= f * a[row + m]
                b[k] -= f * b[i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= a[n * i + k] * b[k]
        b[i] /= a[n * i + i]
    return sign


@njit
def solve_in_order(a, b, n, integers, at):
    """Solve a x = b for a sparse matrix by elimination without pivoting in a given order; x replaces b. Returns 1.0.

    The result is 0.0, and b[0] becomes the number of its unknown, if a pivot is not above 0.
    a : float64[places]  matrix, overwritten: its diagonal, then the other places of the pattern of the order
    integers[at - 1] : number of places
    integers[at:] : for each pivot the position, after `at`, of its numbers: its row p, the count of the rows q that its
    elimination changes, these rows, the place of the first entry (p, q), which the entries (q, p) follow, and for each
    of these rows the places of its entries in the columns q
    """
    for k in range(n):
        e = at + integers[at + k]
        p, count = integers[e], integers[e + 1]
        right, places = integers[e + 2 + count], e + 3 + count
        pivot = a[p]
        # Not `pivot <= 0.0`, so that a pivot that is not a number ends the elimination too.
        if not pivot > 0.0:
            b[0] = float(p)
            return 0.0
        for u in range(count):
            f = a[right + count + u] / pivot
            if f != 0.0:
                for v in range(count):
                    a[integers[places + v]] -= f * a[right + v]
                b[integers[e + 2 + u]] -= f * b[p]
            places += count
    for k in range(n - 1, -1, -1):
        e = at + integers[at + k]
        p, count = integers[e], integers[e + 1]
        right = integers[e + 2 + count]
        for u in range(count):
            b[p] -= a[right + u] * b[integers[e + 2 + u]]
        b[p] /= a[p]
    return 1.0


@njit(forceinline=True)
def has_converged(change, last_change):
    """True if the last relative change of Newton is rounding: below 1e-14, or below 1e-9 and no longer falling."""
    return change <= 1e-14 or (change <= NEARLY_CONVERGED and change >= 0.5 * last_change)


@njit(forceinline=True)
def places_of(cluster, tables, e, i, j, sparse):
    """Places in the matrix of a cluster of the entries (i, i), (j, j), (i, j), (j, i) of its link number e.

    e : number of a valve, or of a delay line after all valves; i, j : numbers of its end nodes, -1 for a known pressure
    sparse : True for a sparse matrix, see `solve_in_order`
    """
    n = cluster["nodes"]
    if sparse:
        at = cluster["order"] + n + 4 * e
        return (
            tables.integers[at],
            tables.integers[at + 1],
            tables.integers[at + 2],
            tables.integers[at + 3],
        )
    return n * i + i, n * j + j, n * i + j, n * j + i


@njit
def add_valve(i, j, places, m, a, s, lift, matrix, right):
    """Add a valve from node i to node j to the linear equations for the pressure steps of nodes.

    i, j : numbers in the cluster, -1 for a known pressure; places : result of `places_of`
    m : flow [kg/s]
    a, s : terms of the change of this flow, dM = a + s d(drop) [kg/s, kg/s/Pa]
    lift : derivative of the flow with respect to the upstream pressure at constant drop [kg/s/Pa]
    matrix, right : float64[places], float64[n]  equations, to which the terms of the valve are added
    """
    if i >= 0:
        right[i] -= m + a
        matrix[places[0]] += s + lift
    if j >= 0:
        right[j] += m + a
        matrix[places[1]] += s
    if i >= 0 and j >= 0:
        # Only the pressure at node i lifts the valve, so the matrix is not symmetric.
        matrix[places[2]] -= s
        matrix[places[3]] -= s + lift


@njit(forceinline=True)
def has_settled(change, last_change):
    """True if the iteration of a cluster without waves has converged: its changes are rounding, or will be.

    After a step that is as short, and as much shorter than the last, Newton's next step is rounding. The flow of a
    valve with hardly any loss changes by the rounding of pressures: it no longer falls.
    """
    if change <= NEARLY_CONVERGED and change <= QUADRATIC * last_change:
        return True
    return has_converged(change, last_change) or (
        change <= STAGNANT and change >= 0.999 * last_change
    )


@njit(forceinline=True)
def has_followed(out, change):
    """True if a change of Newton is the first-order change of a difference quotient, whose next change is negligible.

    The increment of a difference quotient changes flows by about 1e-8, so Newton's first step has the derivative.
    """
    return out[NEARBY] == 1.0 and change <= SMALL_CHANGE


@njit
def add_sensed(cluster, tables, k, i, j, lift, n, matrix):
    """Add the change of the flow of valve k by the pressures that its device senses to the linear equations.

    i, j : numbers of its end nodes in the cluster, -1 for a known pressure
    lift : derivative of the flow with respect to the lifting pressure at constant drop [kg/s/Pa]
    n, matrix : number of nodes, and full matrix; nodes outside the cluster have known pressures
    """
    device = tables.devices[tables.valves[k]["device"]]
    for node, weight in (
        (device["node"], device["node_weight"]),
        (device["second"], device["second_weight"]),
    ):
        row = row_in_cluster(cluster, tables, node) if node >= 0 else -1
        if row >= 0 and i >= 0:
            matrix[n * i + row] += weight * lift
        if row >= 0 and j >= 0:
            matrix[n * j + row] -= weight * lift


@njit
def sensed_step(cluster, tables, k, right):
    """Step of the lifting pressure [Pa] of valve k, by the steps `right` of the pressures in a cluster."""
    device, step = tables.devices[tables.valves[k]["device"]], 0.0
    for node, weight in (
        (device["node"], device["node_weight"]),
        (device["second"], device["second_weight"]),
    ):
        row = row_in_cluster(cluster, tables, node) if node >= 0 else -1
        step += weight * right[row] if row >= 0 else 0.0
    return step


@njit
def add_couplings(cluster, tables, out, matrix, right, sparse):
    """Add the flow at once between coupled nodes to the equations of a cluster.

    matrix, right : equations, as for `add_valve`; sparse : as for `places_of`
    """
    layout = tables.layout[0]
    nodes = tables.nodes
    integers = tables.integers
    for k in range(cluster["couples"]):
        link = tables.couplings[integers[cluster["first_couple"] + k]]
        g = link["conductance"]
        i, j = inner_row(nodes, link["from_node"]), inner_row(nodes, link["to_node"])
        p = out[layout["pressure"] + link["from_node"]]
        q = out[layout["pressure"] + link["to_node"]]
        places = places_of(cluster, tables, cluster["valves"] + k, i, j, sparse)
        # The flow is linear in the pressures, so that its Newton step is exact (a = 0).
        add_valve(i, j, places, g * (p - q), 0.0, g, 0.0, matrix, right)


# slope of a held flow over that of an open valve at 1 Pa: it keeps the equations regular
LOOSE = 1e-9


@njit(forceinline=True)
def is_held(tables, out, k):
    """True if valve k holds a pressure or its flow at present: the value is then out[drive + k]."""
    return tables.valves[k]["hold"] >= 0 and out[tables.layout[0]["drive"] + k] < NOT_HELD


@njit
def hold_pressures(cluster, tables, out, g, matrix, right, kept):
    """Put held pressures in place of the balances of their nodes, which are added to those before or behind the valves.

    The flow of the valve then follows from the balance of its held node, see `put_held_flows`.
    matrix, right : sparse equations, as for `add_valve`; kept : receives these balances
    """
    integers = tables.integers
    layout = tables.layout[0]
    at = 0
    for e in range(g.size):
        k = integers[cluster["first_valve"] + e]
        if (
            g[e] <= 0.0
            or not is_held(tables, out, k)
            or integers[tables.valves[k]["hold"]] == FLOW_HELD
        ):
            continue
        h = tables.valves[k]["hold"]
        held = integers[h + 1]
        other = integers[h + 2]
        count = integers[h + 3]
        kept[at] = right[held]
        for c in range(count):
            own, place = integers[h + 5 + 3 * c], integers[h + 6 + 3 * c]
            kept[at + 1 + c] = matrix[own]
            # In the sum of both balances the unknown flow of the valve cancels.
            if other >= 0:
                matrix[place] += matrix[own]
            matrix[own] = 0.0
        if other >= 0:
            right[other] += right[held]
        node = integers[cluster["first_node"] + held]
        # The row becomes that of a known pressure, which the step reaches exactly.
        matrix[held], right[held] = 1.0, out[layout["drive"] + k] - out[layout["pressure"] + node]
        at += 1 + count


@njit
def put_held_flows(cluster, tables, out, g, right, kept, a):
    """Write the changes of the flows of valves that hold a pressure to `a`, by the balances of the held nodes.

    right : steps of pressures [Pa]; kept : balances of `hold_pressures`
    """
    integers, at = tables.integers, 0
    for e in range(g.size):
        k = integers[cluster["first_valve"] + e]
        if (
            g[e] <= 0.0
            or not is_held(tables, out, k)
            or integers[tables.valves[k]["hold"]] == FLOW_HELD
        ):
            continue
        h = tables.valves[k]["hold"]
        count, change = integers[h + 3], -kept[at]
        for c in range(count):
            change += kept[at + 1 + c] * right[integers[h + 4 + 3 * c]]
        a[e] = change if integers[h] == TO_HELD else -change
        at += 1 + count


@njit(forceinline=True)
def linear_balance(cluster, tables, out, c, slope, row):
    """(inflow of a node except through valves [kg/s], its fall per pressure [kg/s/Pa]) under the density law `linear`.

    row : number of the node in its cluster; other arguments as for `newton_step`
    """
    i = tables.integers[cluster["first_node"] + row]
    admittance = tables.nodes[i]["admittance"]
    return c[row] - admittance * out[tables.layout[0]["pressure"] + i], admittance


@njit(forceinline=True)
def barotropic_balance(cluster, tables, out, c, slope, row):
    """Results of `linear_balance` under the other density laws, from the flows of the present pipe ends in out[net]."""
    i = tables.integers[cluster["first_node"] + row]
    return out[tables.layout[0]["net"] + i] + c[row], -slope[i]


@njit(forceinline=True)
def linear_drop(tables, out, k):
    """(drop over valve k [Pa], 1.0) under the density law `linear`; else `restrictions.valve_driving_pressure`."""
    valve, pressure = tables.valves[k], tables.layout[0]["pressure"]
    return valve["drop"] + (
        out[pressure + valve["from_node"]] - out[pressure + valve["to_node"]]
    ), 1.0


@njit
def step_arrays(cluster, work):
    """Parts of a work array for a Newton step of a cluster with n nodes and k valves.

    matrix, right : float64[places], float64[n]  equations for the pressure steps of nodes
    a, s, lift : float64[k]  terms of the changes of valve flows, see `add_valve`
    kept : balances of nodes whose pressures valves hold
    """
    size, k = cluster["matrix"], cluster["valves"]
    at = size + cluster["nodes"]
    end = at + 3 * k
    return (
        work[:size],
        work[size:at],
        work[at : at + k],
        work[at + k : at + 2 * k],
        work[at + 2 * k : end],
        work[end:],
    )


def _assemble(cluster, tables, out, g, m, c, connected, slope, wide, work, sparse):
    """Assemble the linear equations for the pressure steps of a cluster; the changes of valve flows are eliminated.

    Arguments as for `newton_step`; the equations are written to `work`, see `step_arrays`.
    sparse : True for the sparse matrix of `solve_in_order`
    """
    matrix, right, a, s, lift, kept = step_arrays(cluster, work)
    nodes = tables.nodes
    valves = tables.valves
    integers = tables.integers
    n = c.size
    senses = cluster["senses"] == 1
    for i in range(integers[cluster["order"] - 1] if sparse else n * n):
        matrix[i] = 0.0
    width = 1 if sparse else n + 1
    # The balance without valves, to which each valve then adds its terms.
    for i in range(n):
        right[i], matrix[width * i] = BALANCE(cluster, tables, out, c, slope, i)
    for e in range(m.size):
        k = integers[cluster["first_valve"] + e]
        i, j = inner_row(nodes, valves[k]["from_node"]), inner_row(nodes, valves[k]["to_node"])
        # The values of a closed valve: the step takes away its whole flow.
        a[e], s[e], lift[e] = -m[e], 0.0, 0.0
        if sparse and g[e] > 0.0 and is_held(tables, out, k):
            # The flow of a valve that holds a pressure follows from the balance of its node, after the solution.
            a[e] = 0.0
            if integers[valves[k]["hold"]] == FLOW_HELD:
                a[e], s[e] = out[tables.layout[0]["drive"] + k] - m[e], LOOSE * sqrt(g[e])
        elif g[e] > 0.0:
            drop, denser = DRIVING(tables, out, k)
            a[e], s[e] = restriction_step(tables, out, k, g[e], m[e], drop, denser, wide)
            lift[e] = restriction_lift(tables, out, k, g[e], drop, denser, wide)
        upstream = lift[e]
        if senses and upstream != 0.0 and is_sensing(tables, k):
            add_sensed(cluster, tables, k, i, j, upstream, n, matrix)
            # The lift follows the sensed pressures, to which it has been added, and not the upstream pressure.
            upstream = 0.0
        add_valve(
            i,
            j,
            places_of(cluster, tables, e, i, j, sparse),
            m[e],
            a[e],
            s[e],
            upstream,
            matrix,
            right,
        )
    add_couplings(cluster, tables, out, matrix, right, sparse)
    for i in range(n):
        # No equation determines the pressure of an isolated node; this row keeps the matrix regular.
        if connected[i] == 0.0:
            right[i], matrix[width * i] = 0.0, 1.0
    # Last, because it moves balances that must be complete.
    if cluster["held"] > 0:
        hold_pressures(cluster, tables, out, g, matrix, right, kept)


assemble_linear = specialise(
    _assemble, "assemble_linear", BALANCE=linear_balance, DRIVING=linear_drop
)
assemble_barotropic = specialise(
    _assemble, "assemble_barotropic", BALANCE=barotropic_balance, DRIVING=valve_driving_pressure
)


@njit(forceinline=True)
def largest_magnitude(a):
    """Greatest magnitude of the entries of an array."""
    most = 0.0
    for i in range(a.size):
        most = max(most, abs(a[i]))
    return most


@njit(forceinline=True)
def place_of_greatest(a):
    """Index of the entry of an array that is not a number, or else of the greatest magnitude; 0 for an empty array."""
    place, most = 0, -1.0
    for i in range(a.size):
        if not abs(a[i]) <= most:
            place, most = i, abs(a[i])
        if a[i] != a[i]:
            return i
    return place


@njit
def limit_step(most, a, right):
    """Scale a Newton step so that no pressure rises by more than `most` [Pa].

    most : bulk modulus, because a rise by it multiplies the density by about e
    a : changes of valve flows at constant drop [kg/s]; right : changes of node pressures [Pa]; both are scaled
    """
    greatest = 0.0
    for r in range(right.size):
        greatest = max(greatest, right[r])
    if greatest > most:
        for r in range(right.size):
            right[r] *= most / greatest
        for e in range(a.size):
            a[e] *= most / greatest


@njit
def cut_steps(right):
    """Cut the steps of pressures `right` [Pa] to MOST_RISE; return True if one was longer, or not finite."""
    limited = False
    for i in range(right.size):
        if not abs(right[i]) <= MOST_RISE:
            # A step that is not a number becomes 0, otherwise it would spread to all pressures.
            right[i] = copysign(MOST_RISE, right[i]) if right[i] == right[i] else 0.0
            limited = True
    return limited


@njit
def limit_each_step(limits, right):
    """Limit the step of each pressure, and renew its limit; return True if a step was longer than its limit.

    limits : greatest step of each node, with the sign of its last step [Pa]: half of this step if the direction has
    changed, so that a root between two constant flows is bracketed, else twice, and at least LEAST_RISE. A common limit
    would stop all nodes where the flow of one hardly depends on pressure.
    right : changes of node pressures [Pa], limited
    """
    limited = False
    for i in range(right.size):
        limit = abs(limits[i])
        if abs(right[i]) > limit:
            right[i] = copysign(limit, right[i])
            limited = True
        limit = (0.5 if right[i] * limits[i] < 0.0 else 2.0) * abs(right[i])
        limits[i] = copysign(max(limit, LEAST_RISE), right[i])
    return limited


@njit
def apply_step(cluster, tables, out, m, a, s, lift, right):
    """Apply a Newton step to pressures and valve flows; return the greatest relative change of each.

    m : flows of valves [kg/s], updated; right : pressure steps of nodes [Pa]
    a, s, lift : terms of the changes of flow, see `add_valve`
    A change of flow by the rounding of pressures does not count. Flows are compared with at least the flow at 1 Pa.
    """
    layout = tables.layout[0]
    nodes = tables.nodes
    valves = tables.valves
    integers = tables.integers
    scale = 1e-300
    rounded = 0.0
    change = 0.0
    most = 0.0
    for i in range(right.size):
        node = integers[cluster["first_node"] + i]
        out[layout["pressure"] + node] += right[i]
        most = max(
            most,
            abs(right[i]) / (BAR + abs(nodes[node]["pressure"] + out[layout["pressure"] + node])),
        )
    for e in range(m.size):
        k = integers[cluster["first_valve"] + e]
        valve = valves[k]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        rise = right[i] if i >= 0 else 0.0
        senses = cluster["senses"] == 1 and lift[e] != 0.0 and is_sensing(tables, k)
        lifting = sensed_step(cluster, tables, k, right) if senses else rise
        step = a[e] + s[e] * (rise - (right[j] if j >= 0 else 0.0)) + lift[e] * lifting
        m[e] += step
        # A valve that is nearly at rest is compared with its flow at 1 Pa, not with its own.
        scale = max(scale, abs(m[e]), sqrt(valve["conductance"]))
        p = nodes[valve["from_node"]]["pressure"] + out[layout["pressure"] + valve["from_node"]]
        # A steep law turns the rounding of pressures into changes of flow.
        rounding = s[e] * ROUNDING * (BAR + abs(p))
        change, rounded = max(change, max(abs(step), abs(a[e])) - rounding), max(rounded, rounding)
    relative = change / scale
    # perhaps rounding: no failure, but iterate further
    if relative > FAILED_CHANGE and change <= rounded:
        relative = FAILED_CHANGE
    return most, relative


@njit
def close_unstable(cluster, tables, g, m):
    """Close lifted valves with negative flow, which cannot stay open (g = 0); returns True if there are such valves.

    g, m : conductances and flows of the valves of a cluster
    Newton, which starts from wide open valves, has reached a matrix with a negative determinant: at smaller lifts the
    imbalance would be even greater.
    """
    closed = False
    for e in range(m.size):
        if g[e] > 0.0 and has_lifted_backflow(
            tables, tables.integers[cluster["first_valve"] + e], m[e]
        ):
            g[e], closed = 0.0, True
    return closed


def _newton_step(cluster, tables, out, g, m, c, connected, slope, wide, limits, work):
    """Make a Newton step for the pressures and valve flows of a cluster.

    limits : greatest step of each node, see `limit_each_step`; empty for no limit
    Returns (greatest relative change, that of flows alone, True if the step points to the root). Both changes are
    NOT_BALANCED after a step that was limited: nodes balance only after one that was not. A step points to the root if
    the errors of valve flows against their laws are below the fraction FLOW_ERROR of the imbalance of the nodes: then
    the second-order error of Newton cannot reverse this imbalance. Under `linear` the third result has no meaning.
    """
    n, k = c.size, g.size
    matrix, right, a, s, lift, kept = step_arrays(cluster, work)
    sparse, full = cluster["order"] >= 0, cluster["matrix"] >= n * n and cluster["held"] == 0
    ASSEMBLE(cluster, tables, out, g, m, c, connected, slope, wide, work, sparse)
    imbalance, sign = largest_magnitude(right) if BAROTROPIC else 0.0, 0.0
    if sparse:
        sign = solve_in_order(matrix, right, n, tables.integers, cluster["order"])
        # The elimination in order has no pivoting; with pivoting the equations may have a solution.
        if sign == 0.0 and full:
            ASSEMBLE(cluster, tables, out, g, m, c, connected, slope, wide, work, False)
    if sign == 0.0 and full:
        sign = solve_dense(matrix, right, n)
    if full and sign <= 0.0 and not wide and close_unstable(cluster, tables, g, m):
        ASSEMBLE(cluster, tables, out, g, m, c, connected, slope, wide, work, False)
        imbalance = largest_magnitude(right) if BAROTROPIC else 0.0
        sign = solve_dense(matrix, right, n)
    if sign == 0.0:
        out[STATUS], out[WHERE] = (
            NO_SOLUTION,
            tables.integers[cluster["first_node"] + int(right[0])],
        )
        return 0.0, 0.0, True
    flow_error = 0.0
    if BAROTROPIC:
        for e in range(k):
            flow_error += a[e] * a[e] / max(abs(m[e] + a[e]), 1e-300)
        limit_step(tables.settings[0]["beta"], a, right)
    limited = False
    if limits.size > 0:
        limited = limit_each_step(limits, right)
    elif not BAROTROPIC:
        limited = cut_steps(right)
    # After the limits, because these flows follow from the steps that are made.
    if cluster["held"] > 0:
        put_held_flows(cluster, tables, out, g, right, kept, a)
    pressures, flows = apply_step(cluster, tables, out, m, a, s, lift, right)
    if limited:
        return NOT_BALANCED, NOT_BALANCED, False
    return max(flows, pressures), flows, flow_error <= FLOW_ERROR * imbalance


newton_step_linear = specialise(
    _newton_step, "newton_step_linear", ASSEMBLE=assemble_linear, BAROTROPIC=False
)
newton_step_barotropic = specialise(
    _newton_step, "newton_step_barotropic", ASSEMBLE=assemble_barotropic, BAROTROPIC=True
)


MAX_SWEEPS = 100
# a step of 2e7 Pa is halved to 1e-6 Pa in 45 of them, one node after the other
LIMITED_SWEEPS = 400


@njit
def node_work(tables):
    """Work arrays for solving all clusters, as parts of `tables.scratch`.

    Four arrays float64[nodes]: derivative of the pipe flow into a node with respect to its pressure [kg/s per Pa];
    inflow c from all links except valves, with the initial flows of pipes [kg/s]; 1 if open valves join a node to a
    pipe or to a known pressure, else 0; group number of isolated nodes.
    Two arrays float64[valves]: conductance [kg2/s2/Pa]; flow [kg/s]. Last, the remaining scratch array.
    """
    n = tables.nodes.size
    v = tables.valves.size
    work = tables.scratch
    g = work[4 * n : 4 * n + v]
    m = work[4 * n + v : 4 * n + 2 * v]
    rest = work[4 * n + 2 * v :]
    rest = rest[5 * tables.clusters.size :]
    return work[:n], work[n : 2 * n], work[2 * n : 3 * n], work[3 * n : 4 * n], g, m, rest


@njit
def cluster_work(tables):
    """State of the Newton iteration of each cluster: five arrays float64[clusters].

    done : 1 if the cluster has converged
    change, last_change : greatest relative change in the last step, and in the step before
    wide : 1 while valves that a pressure lifts are held wide open
    sure : 1 if the last step points to the root; it may point away until the flows of valves have reversed
    """
    n, work = tables.clusters.size, tables.scratch[4 * tables.nodes.size + 2 * tables.valves.size :]
    return work[:n], work[n : 2 * n], work[2 * n : 3 * n], work[3 * n : 4 * n], work[4 * n : 5 * n]


@njit
def total_inflows(cluster, tables, out, c):
    """Write the inflow of each node of a cluster except through its valves, at unchanged pressure, to c [kg/s].

    The demand of a node is subtracted. Returns True if these inflows have not changed since the start.
    """
    layout = tables.layout[0]
    nodes = tables.nodes
    valves = tables.valves
    integers, unchanged = tables.integers, True
    for i in range(c.size):
        node = integers[cluster["first_node"] + i]
        unchanged = unchanged and out[layout["net"] + node] == 0.0
        c[i] = out[layout["supply"] + node]  # exact where only valves and columns join
        if nodes[node]["admittance"] > 0.0:
            c[i] = out[layout["net"] + node]
    # Where pipes join, out[net] already contains the changes of column flows.
    for k in range(tables.columns.size):
        column = tables.columns[k]
        i = row_in_cluster(cluster, tables, column["from_node"])
        j = row_in_cluster(cluster, tables, column["to_node"])
        if i >= 0 and nodes[column["from_node"]]["admittance"] == 0.0:
            c[i] -= out[layout["column"] + k]
        if j >= 0 and nodes[column["to_node"]]["admittance"] == 0.0:
            c[j] += out[layout["column"] + k]
    # The unknown flows are totals, out[net] counts changes: valve flows of the profile are added back.
    for e in range(cluster["valves"]):
        valve = valves[integers[cluster["first_valve"] + e]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        if i >= 0 and nodes[valve["from_node"]]["admittance"] > 0.0:
            c[i] += valve["flow"]
        if j >= 0 and nodes[valve["to_node"]]["admittance"] > 0.0:
            c[j] -= valve["flow"]
    return unchanged


@njit
def row_in_cluster(cluster, tables, i):
    """Number of node i within a cluster, -1 if it does not belong to it."""
    row = inner_row(tables.nodes, i)
    if row < 0 or row >= cluster["nodes"] or tables.integers[cluster["first_node"] + row] != i:
        return -1
    return row


@njit
def prepare_cluster(cluster, tables, out, g, m):
    """Write conductances g and start flows m of the valves of a cluster; reset its pressures.

    Returns True if all conductances, pump speeds and pressures at the valves are those of the initial steady state.
    """
    layout, valves = tables.layout[0], tables.valves
    integers = tables.integers
    unchanged = True
    senses = cluster["senses"] == 1
    # Newton starts from the profile, so that its result depends on (t, y) alone.
    for i in range(cluster["nodes"]):
        out[layout["pressure"] + integers[cluster["first_node"] + i]] = 0.0
    for e in range(g.size):
        k = integers[cluster["first_valve"] + e]
        valve = valves[k]
        g[e], m[e] = conductance(tables, out, k), valve["flow"]
        if valve["hooks"] < 0 and 0.0 < g[e] < valve["open"]:
            # flow at the drop of the profile: its own flow needs a huge drop
            m[e] *= sqrt(g[e] / valve["open"])
        # Exact comparison: a start in the steady state must stay there without rounding.
        unchanged = (
            unchanged and g[e] == valve["open"] and out[layout["drive"] + k] == valve["drive"]
        )
        for i in (valve["from_node"], valve["to_node"]):
            unchanged = unchanged and out[layout["pressure"] + i] == 0.0
        if senses and valve["hooks"] >= 0 and is_sensing(tables, k):
            device = tables.devices[valve["device"]]
            for i in (device["node"], device["second"]):
                unchanged = unchanged and (i < 0 or out[layout["pressure"] + i] == 0.0)
    for k in range(cluster["couples"]):
        link = tables.couplings[integers[cluster["first_couple"] + k]]
        for i in (link["from_node"], link["to_node"]):
            unchanged = unchanged and out[layout["pressure"] + i] == 0.0
    return unchanged


@njit
def begin_accepted(cluster, tables, out, g, m):
    """Set the pressures of a cluster and the flows m of its open valves to those of the last accepted state, if any."""
    accepted = tables.accepted
    integers = tables.integers
    pressure = tables.layout[0]["pressure"]
    # No state has been accepted so far: the iteration starts from the profile.
    if accepted[0] == 0.0:
        return
    for i in range(cluster["nodes"]):
        node = integers[cluster["first_node"] + i]
        out[pressure + node] = accepted[1 + node]
    for e in range(g.size):
        flow = accepted[1 + tables.nodes.size + integers[cluster["first_valve"] + e]]
        if g[e] > 0.0 and flow != 0.0:
            m[e] = flow


@njit
def record_clusters(t, y, out, handle, values):
    """Store the pressures of nodes and the flows of valves of an accepted state, from which later iterations start.

    The values before, from which the iterations of this state began, move to the second half of the array.
    """
    tables = open_tables(handle)
    accepted = tables.accepted
    layout = tables.layout[0]
    n = tables.nodes.size
    if accepted.size == 0:
        return
    half = accepted.size // 2
    for i in range(half):
        accepted[half + i] = accepted[i]
    accepted[0] = 1.0
    for i in range(n):
        accepted[1 + i] = out[layout["pressure"] + i]
    for k in range(tables.valves.size):
        accepted[1 + n + k] = out[layout["valve"] + k]


@njit
def begin_level(cluster, tables, out):
    """Set nodes behind valves with a level start to the potential at the known end of the valve.

    The flow of such a valve has a bound on the side of low potentials, where its slope is zero: from there Newton would
    approach its root by the slopes of other valves alone.
    """
    pressure = tables.layout[0]["pressure"]
    for e in range(cluster["valves"]):
        valve = tables.valves[tables.integers[cluster["first_valve"] + e]]
        i, j = valve["from_node"], valve["to_node"]
        if valve["level_start"] == 1 and inner_row(tables.nodes, i) >= 0:
            out[pressure + i] = out[pressure + j] - valve["drop"]


@njit
def has_backflow(cluster, tables, m):
    """True if a lifted valve of a cluster, opened by its upstream pressure, has a negative flow."""
    for e in range(m.size):
        if has_lifted_backflow(tables, tables.integers[cluster["first_valve"] + e], m[e]):
            return True
    return False


@njit
def zero_isolated(cluster, tables, g, m, connected):
    """Set the flow m of valves at isolated nodes to zero, and their conductance g to -1 if they are open, else 0.

    connected : 0 for the isolated nodes of the cluster
    """
    for e in range(g.size):
        if not is_connected(cluster, tables, e, connected):
            m[e] = 0.0
            g[e] = -1.0 if g[e] > 0.0 else 0.0


@njit
def is_connected(cluster, tables, e, connected):
    """True if valve e of a cluster lies between connected nodes or known pressures."""
    valve = tables.valves[tables.integers[cluster["first_valve"] + e]]
    i, j = inner_row(tables.nodes, valve["from_node"]), inner_row(tables.nodes, valve["to_node"])
    return (i < 0 or connected[i] > 0.0) and (j < 0 or connected[j] > 0.0)


@njit
def begin_clusters(out, tables, space):
    """Set flows and conductances of the valves of all clusters before the first Newton step.

    A cluster counts as converged if all its values are those of the initial steady state; `step_clusters` checks the
    flows from pipe ends later.
    """
    clusters, (_, c, connected, group, g, m, _) = tables.clusters, space
    done, change, _, wide, _ = cluster_work(tables)
    a, b, out[FIRM] = 0, 0, FIRM_SLOPE
    for k in range(clusters.size):
        cluster = clusters[k]
        i, j = a + cluster["nodes"], b + cluster["valves"]
        unchanged = prepare_cluster(cluster, tables, out, g[b:j], m[b:j])
        done[k] = 1.0 if total_inflows(cluster, tables, out, c[a:i]) and unchanged else 0.0
        # No change is known before the first step, so the test of convergence must fail there.
        change[k], wide[k] = 1e300, 1.0
        if done[k] == 0.0:
            begin_level(cluster, tables, out)
        find_connected(cluster, tables, c[a:i], g[b:j], connected[a:i], group[a:i])
        zero_isolated(cluster, tables, g[b:j], m[b:j], connected[a:i])
        a, b = i, j


@njit
def is_undisturbed(cluster, tables, out):
    """True if pipes bring exactly their initial steady flow into every node of a cluster."""
    for i in range(cluster["nodes"]):
        node = tables.integers[cluster["first_node"] + i]
        # Exact: a steady state must stay steady to the bit, and any change has to be solved.
        if out[tables.layout[0]["net"] + node] != 0.0:
            return False
    return True


@njit
def step_clusters(sweep, out, tables, space):
    """Make a Newton step in every cluster that is disturbed and has not converged.

    sweep : number of the step, from 1
    """
    clusters, (slope, c, connected, _, g, m, rest), (done, change, last_change, wide, sure) = (
        tables.clusters,
        space,
        cluster_work(tables),
    )
    a, b = 0, 0
    for k in range(clusters.size):
        cluster = clusters[k]
        i, j = a + cluster["nodes"], b + cluster["valves"]
        # The flows from pipe ends were not known when the cluster was marked as unchanged.
        if sweep == 1 and done[k] == 1.0:
            if is_undisturbed(cluster, tables, out):
                change[k] = 0.0
            else:
                done[k] = 0.0
        if done[k] == 0.0:
            last_change[k] = change[k]
            step, _, near = newton_step_barotropic(
                cluster,
                tables,
                out,
                g[b:j],
                m[b:j],
                c[a:i],
                connected[a:i],
                slope,
                wide[k] == 1.0,
                rest[:0],
                rest,
            )
            change[k] = max(0.0, step)  # 0 for NaN: the iteration ends, the rates show the fault
            sure[k] = 1.0 if near else 0.0
        a, b = i, j


@njit
def check_clusters(out, tables, space):
    """Mark clusters as converged, each by its own last change.

    Returns True if any cluster has not converged.
    """
    clusters, m, (done, change, last_change, wide, _), b, active = (
        tables.clusters,
        space[5],
        cluster_work(tables),
        0,
        False,
    )
    for k in range(clusters.size):
        j = b + clusters[k]["valves"]
        if done[k] == 0.0 and has_converged(change[k], last_change[k]):
            # Wide open valves with backflow are no solution: the iteration goes on with their real lifts.
            if wide[k] == 1.0 and has_backflow(clusters[k], tables, m[b:j]):
                change[k], wide[k] = 1e300, 0.0
            else:
                done[k] = 1.0
        active = active or done[k] == 0.0
        b = j
    return active


@njit
def write_cluster(cluster, tables, out, g, m, c, connected, group, change, worst, work):
    """Write the valve flows of a cluster, the pressures and codes of its isolated nodes, and STATUS on failure.

    g, m : conductances and flows [kg/s] of valves; c : inflow of nodes except through valves, less the demand [kg/s]
    connected, group : 0 for isolated nodes; work array for their groups; work : further work array
    change : last relative change of Newton; under the law `linear` that of flows, because a level on which no flow
    depends may still change; worst : number of the node whose pressure changes most, named if Newton has failed
    Flows that are rounding (dead ends) become zero: their sign does not depend on the pressures.
    """
    scale = 1e-300
    for e in range(m.size):
        k = tables.integers[cluster["first_valve"] + e]
        if abs(m[e]) <= ROUNDING * sqrt(tables.valves[k]["conductance"]):  # of its flow at 1 Pa
            m[e] = 0.0
        out[tables.layout[0]["valve"] + k] = m[e]
        scale = max(scale, abs(tables.valves[k]["flow"]), sqrt(tables.valves[k]["conductance"]))
    if change > FAILED_CHANGE:
        out[STATUS], out[WHERE] = NOT_CONVERGED, tables.integers[cluster["first_node"] + worst]
    isolated = False
    for i in range(connected.size):
        isolated = isolated or connected[i] == 0.0
        out[tables.layout[0]["isolated"] + tables.integers[cluster["first_node"] + i]] = JOINED
    # Last, because the leaks of closed valves depend on the solved pressures of connected nodes.
    if isolated:
        group_by_open_valves(cluster, tables, g, group)
        mark_isolated(cluster, tables, out, g, c, connected, group, scale, work)
        isolated_pressures(cluster, tables, out, g, connected, group, work)


@njit
def write_clusters(out, tables, space):
    """Write the valve flows of all clusters to `out`, and pressures of isolated nodes."""
    clusters, (_, c, connected, group, g, m, rest), change = (
        tables.clusters,
        space,
        cluster_work(tables)[1],
    )
    a, b = 0, 0
    for k in range(clusters.size):
        i, j = a + clusters[k]["nodes"], b + clusters[k]["valves"]
        write_cluster(
            clusters[k],
            tables,
            out,
            g[b:j],
            m[b:j],
            c[a:i],
            connected[a:i],
            group[a:i],
            change[k],
            0,
            rest,
        )
        a, b = i, j


@njit
def put_law_flows(cluster, tables, out, g, m, c, connected, slope, wide, work):
    """Set the flows m of valves to those of their laws at the present pressures; arguments as for `newton_step`.

    A valve with a level start keeps the flow that its node needs: its law takes a chord to it where it has no slope.
    """
    assemble_linear(
        cluster, tables, out, g, m, c, connected, slope, wide, work, cluster["order"] >= 0
    )
    a = step_arrays(cluster, work)[2]
    for e in range(m.size):
        if tables.valves[tables.integers[cluster["first_valve"] + e]]["level_start"] == 0:
            m[e] += a[e]


@njit
def have_bracketed(limits):
    """True if limits have bracketed all pressures but for rounding; then they are set to BRACKETED."""
    if largest_magnitude(limits) > BRACKETED:
        return False
    for i in range(limits.size):
        limits[i] = copysign(BRACKETED, limits[i])
    return True


@njit
def solve_cluster(out, tables, index):
    """Solve the pressures of cluster number `index` and the flows of its valves under the density law `linear`.

    The iteration starts from the initial steady state, so the result depends on (t, y) alone; without waves, in a
    cluster with quasi-steady pipes, it starts from the last accepted state, which a restart file contains.
    """
    cluster, work = tables.clusters[index], tables.scratch
    n, k = cluster["nodes"], cluster["valves"]
    c = work[:n]
    connected = work[n : 2 * n]
    group = work[2 * n : 3 * n]
    at = 3 * n
    g = work[at : at + k]
    m = work[at + k : at + 2 * k]
    rest = work[at + 2 * k :]
    unchanged = prepare_cluster(cluster, tables, out, g, m)
    undisturbed = total_inflows(cluster, tables, out, c) and unchanged
    from_accepted = tables.accepted.size > 0 and cluster["order"] >= 0
    if from_accepted and not undisturbed:
        begin_accepted(cluster, tables, out, g, m)
    find_connected(cluster, tables, c, g, connected, group)
    zero_isolated(cluster, tables, g, m, connected)
    change, flows, wide, limits, out[FIRM] = 1e300, 0.0, True, group[:0], 0.0
    for sweep in range(MAX_SWEEPS + LIMITED_SWEEPS):
        # Nothing has changed, so the profile is the solution, to the bit.
        if undisturbed:
            change = 0.0
            break
        slope, last_change = c, change  # `slope` is not used under this law
        if sweep == MAX_SWEEPS:  # steps may have alternated, or led far away
            prepare_cluster(cluster, tables, out, g, m)
            zero_isolated(cluster, tables, g, m, connected)
            change, wide, limits, out[FIRM] = 1e300, True, group, FIRM_SLOPE
            for i in range(n):
                limits[i] = FIRST_RISE
        bracketed = limits.size > 0 and have_bracketed(limits)
        if limits.size > 0:
            put_law_flows(cluster, tables, out, g, m, c, connected, slope, wide, rest)
        change, flows, _ = newton_step_linear(
            cluster, tables, out, g, m, c, connected, slope, wide, limits, rest
        )
        # at a drop of zero a flow changes with the last digits of a pressure
        if bracketed and flows <= STEEP_CHANGE:
            change, flows = 0.0, 0.0
        settled = has_settled(change, last_change) or has_followed(out, change)
        if settled if from_accepted else has_converged(change, last_change):
            # Wide open valves with backflow are no solution: iterate again with their real lifts.
            if not (wide and has_backflow(cluster, tables, m)):
                break
            change, flows, wide = 1e300, 1e300, False
    out[FIRM] = 0.0
    failed = flows != flows  # not a number; under other laws the rates show this fault
    worst = place_of_greatest(step_arrays(cluster, rest)[1])
    change = NOT_BALANCED if failed else flows
    write_cluster(cluster, tables, out, g, m, c, connected, group, change, worst, rest)


@njit
def solve_clusters(t, y, dydt, out, handle):
    """Solve the pressures of clusters and their valve flows under the density law `linear`.

    Clusters with a stored inverse matrix are left to `solve_coupled_clusters`.
    """
    tables = open_tables(handle)
    for k in range(tables.clusters.size):
        if tables.clusters[k]["inverse"] < 0:
            solve_cluster(out, tables, k)


@njit
def solve_coupled_clusters(t, y, dydt, out, handle):
    """Solve for the pressures of nodes that are coupled and joined by no valve.

    p' of each group of such nodes is the inverse of their admittance matrix times the arriving flows. These include the
    flow of couplings from nodes of known pressure.
    """
    tables = open_tables(handle)
    layout = tables.layout[0]
    integers = tables.integers
    work = tables.scratch
    for number in range(tables.clusters.size):
        cluster = tables.clusters[number]
        if cluster["inverse"] < 0:
            continue
        n, first = cluster["nodes"], cluster["first_node"]
        for i in range(n):
            work[i] = out[layout["net"] + integers[first + i]]
        for c in range(cluster["couples"]):
            link = tables.couplings[integers[cluster["first_couple"] + c]]
            i = row_in_cluster(cluster, tables, link["from_node"])
            j = row_in_cluster(cluster, tables, link["to_node"])
            # The inverse contains couplings within the group only; a known pressure acts as an inflow.
            if i >= 0 and j < 0:
                work[i] += link["conductance"] * out[layout["pressure"] + link["to_node"]]
            if j >= 0 and i < 0:
                work[j] += link["conductance"] * out[layout["pressure"] + link["from_node"]]
        for i in range(n):
            total, at = 0.0, cluster["inverse"] + i * n
            for j in range(n):
                total += tables.floats[at + j] * work[j]
            out[layout["pressure"] + integers[first + i]] = total

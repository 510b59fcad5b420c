"""Newton step for the pressures and valve flows of a cluster of nodes without storage, under any density law.

A law gives the inflow of a node except through valves with its fall per pressure (`linear_balance`,
`barotropic_balance`), and the driving pressure of a valve. Common arguments of these functions: `node_clusters.py`.
"""

from math import sqrt

from fvsolve.jit import njit, specialise
from fvsolve.kernels.dtypes import NO_SOLUTION, STATUS, WHERE
from fvsolve.kernels.isolated_nodes import inner_row
from fvsolve.kernels.restrictions import (
    has_lifted_backflow,
    restriction_lift,
    restriction_step,
    valve_driving_pressure,
)

BAR = 1e5
ROUNDING = 1e-15  # relative rounding of pressures; of a flow, relative to the flow at 1 Pa
FAILED_CHANGE = 1e-5  # relative change of flow above which Newton has failed; smaller changes may be rounding
# Errors of valve flows against their laws up to this fraction of the node's imbalance cannot reverse a Newton step.
FLOW_ERROR = 0.01
BALANCE = DRIVING = ASSEMBLE = BAROTROPIC = None  # constants of the templates


@njit
def solve_dense(a, b, n):
    """Solve a x = b by elimination with partial pivoting; x replaces b. Returns the sign of det a, 0 if a is singular.

    a : float64[n * n]  matrix row by row, overwritten
    """
    sign = 1.0
    for i in range(n):
        pivot, row = i, n * i
        for k in range(i + 1, n):
            if abs(a[n * k + i]) > abs(a[n * pivot + i]):
                pivot = k
        if a[n * pivot + i] == 0.0:
            return 0.0
        if (pivot != i) != (a[n * pivot + i] < 0.0):
            sign = -sign
        if pivot != i:
            for k in range(n):
                a[row + k], a[n * pivot + k] = a[n * pivot + k], a[row + k]
            b[i], b[pivot] = b[pivot], b[i]
        for k in range(i + 1, n):
            f = a[n * k + i] / a[row + i]
            if f != 0.0:
                for m in range(i, n):
                    a[n * k + m] -= f * a[row + m]
                b[k] -= f * b[i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= a[n * i + k] * b[k]
        b[i] /= a[n * i + i]
    return sign


@njit(forceinline=True)
def has_converged(change, last_change):
    """True if the last relative change of Newton is rounding: below 1e-14, or below 1e-9 and no longer falling."""
    return change <= 1e-14 or (change <= 1e-9 and change >= 0.5 * last_change)


@njit
def add_valve(i, j, m, a, s, lift, n, matrix, right):
    """Add a valve from node i to node j to the linear equations for the pressure steps of n nodes.

    i, j : numbers in the cluster, -1 for a known pressure
    m : flow [kg/s]
    a, s : terms of the change of this flow, dM = a + s d(drop) [kg/s, kg/s/Pa]
    lift : derivative of the flow with respect to the upstream pressure at constant drop [kg/s/Pa]
    matrix, right : float64[n * n], float64[n]  equations, to which the terms of the valve are added
    """
    if i >= 0:
        right[i] -= m + a
        matrix[n * i + i] += s + lift
    if j >= 0:
        right[j] += m + a
        matrix[n * j + j] += s
    if i >= 0 and j >= 0:
        matrix[n * i + j] -= s
        matrix[n * j + i] -= s + lift


@njit
def add_couplings(cluster, tables, out, n, matrix, right):
    """Add the instantaneous flow between the ends of short delay lines to the equations of a cluster of n nodes.

    matrix, right : equations, as for `add_valve`
    """
    layout, nodes, integers = tables.layout[0], tables.nodes, tables.integers
    for k in range(cluster["couples"]):
        line = tables.delays[integers[cluster["first_couple"] + k]]
        pipe, g = tables.pipes[line["pipe"]], line["couple"]
        i, j = inner_row(nodes, pipe["from_node"]), inner_row(nodes, pipe["to_node"])
        p, q = out[layout["pressure"] + pipe["from_node"]], out[layout["pressure"] + pipe["to_node"]]
        add_valve(i, j, g * (p - q), 0.0, g, 0.0, n, matrix, right)


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
    return valve["drop"] + (out[pressure + valve["from_node"]] - out[pressure + valve["to_node"]]), 1.0


@njit
def step_arrays(n, k, work):
    """Parts of a work array for a Newton step of n nodes and k valves.

    matrix, right : float64[n * n], float64[n]  equations for the pressure steps of nodes
    a, s, lift : float64[k]  terms of the changes of valve flows, see `add_valve`
    """
    at = n * n + n
    return work[: n * n], work[n * n : at], work[at : at + k], work[at + k : at + 2 * k], work[at + 2 * k : at + 3 * k]


def _assemble(cluster, tables, out, g, m, c, connected, slope, wide, work):
    """Assemble the linear equations for the pressure steps of a cluster; the changes of valve flows are eliminated.

    Arguments as for `newton_step`; the equations are written to `work`, see `step_arrays`.
    """
    matrix, right, a, s, lift = step_arrays(c.size, g.size, work)
    nodes, valves, integers, n = tables.nodes, tables.valves, tables.integers, c.size
    for i in range(matrix.size):
        matrix[i] = 0.0
    for i in range(n):
        right[i], matrix[n * i + i] = BALANCE(cluster, tables, out, c, slope, i)
    for e in range(m.size):
        k = integers[cluster["first_valve"] + e]
        i, j = inner_row(nodes, valves[k]["from_node"]), inner_row(nodes, valves[k]["to_node"])
        a[e], s[e], lift[e] = -m[e], 0.0, 0.0
        if g[e] > 0.0:
            drop, denser = DRIVING(tables, out, k)
            a[e], s[e] = restriction_step(tables, out, k, g[e], m[e], drop, denser, wide)
            lift[e] = restriction_lift(tables, out, k, g[e], drop, denser, wide)
        add_valve(i, j, m[e], a[e], s[e], lift[e], n, matrix, right)
    add_couplings(cluster, tables, out, n, matrix, right)
    for i in range(n):
        if connected[i] == 0.0:
            right[i], matrix[n * i + i] = 0.0, 1.0


assemble_linear = specialise(_assemble, "assemble_linear", BALANCE=linear_balance, DRIVING=linear_drop)
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
def apply_step(cluster, tables, out, m, a, s, lift, right):
    """Apply a Newton step to pressures and valve flows; return the greatest relative change of both.

    m : flows of valves [kg/s], updated; right : pressure steps of nodes [Pa]
    a, s, lift : terms of the changes of flow, see `add_valve`
    A change of flow by the rounding of pressures does not count. Flows are compared with at least the flow at 1 Pa.
    """
    layout, nodes, valves = tables.layout[0], tables.nodes, tables.valves
    integers, scale, rounded, change, most = tables.integers, 1e-300, 0.0, 0.0, 0.0
    for i in range(right.size):
        node = integers[cluster["first_node"] + i]
        out[layout["pressure"] + node] += right[i]
        most = max(most, abs(right[i]) / (BAR + abs(nodes[node]["pressure"] + out[layout["pressure"] + node])))
    for e in range(m.size):
        valve = valves[integers[cluster["first_valve"] + e]]
        i, j = inner_row(nodes, valve["from_node"]), inner_row(nodes, valve["to_node"])
        rise = right[i] if i >= 0 else 0.0
        step = a[e] + s[e] * (rise - (right[j] if j >= 0 else 0.0)) + lift[e] * rise
        m[e] += step
        scale = max(scale, abs(m[e]), sqrt(valve["conductance"]))
        p = nodes[valve["from_node"]]["pressure"] + out[layout["pressure"] + valve["from_node"]]
        rounding = s[e] * ROUNDING * (BAR + abs(p))
        change, rounded = max(change, max(abs(step), abs(a[e])) - rounding), max(rounded, rounding)
    relative = change / scale
    if relative > FAILED_CHANGE and change <= rounded:  # perhaps rounding: no failure, but iterate further
        relative = FAILED_CHANGE
    return max(relative, most)


@njit
def close_unstable(cluster, tables, g, m):
    """Close lifted valves with negative flow, which cannot stay open (g = 0); returns True if there are such valves.

    g, m : conductances and flows of the valves of a cluster
    Newton, which starts from wide open valves, has reached a matrix with a negative determinant: at smaller lifts the
    imbalance would be even greater.
    """
    closed = False
    for e in range(m.size):
        if g[e] > 0.0 and has_lifted_backflow(tables, tables.integers[cluster["first_valve"] + e], m[e]):
            g[e], closed = 0.0, True
    return closed


def _newton_step(cluster, tables, out, g, m, c, connected, slope, wide, work):
    """Make a Newton step for the pressures and valve flows of a cluster.

    Returns the greatest relative change, and True if the step points to the root. This is so if the errors of valve
    flows against their laws are below the fraction FLOW_ERROR of the imbalance of the nodes: then the second-order
    error of Newton cannot reverse this imbalance. Under the density law `linear` the second result has no meaning.
    """
    n, k = c.size, g.size
    matrix, right, a, s, lift = step_arrays(n, k, work)
    ASSEMBLE(cluster, tables, out, g, m, c, connected, slope, wide, work)
    imbalance = largest_magnitude(right) if BAROTROPIC else 0.0
    sign = solve_dense(matrix, right, n)
    if sign <= 0.0 and not wide and close_unstable(cluster, tables, g, m):
        ASSEMBLE(cluster, tables, out, g, m, c, connected, slope, wide, work)
        imbalance = largest_magnitude(right) if BAROTROPIC else 0.0
        sign = solve_dense(matrix, right, n)
    if sign == 0.0:
        out[STATUS], out[WHERE] = NO_SOLUTION, tables.integers[cluster["first_node"]]
        return 0.0, True
    flow_error = 0.0
    if BAROTROPIC:
        for e in range(k):
            flow_error += a[e] * a[e] / max(abs(m[e] + a[e]), 1e-300)
        limit_step(tables.settings[0]["beta"], a, right)
    return apply_step(cluster, tables, out, m, a, s, lift, right), flow_error <= FLOW_ERROR * imbalance


newton_step_linear = specialise(_newton_step, "newton_step_linear", ASSEMBLE=assemble_linear, BAROTROPIC=False)
newton_step_barotropic = specialise(
    _newton_step, "newton_step_barotropic", ASSEMBLE=assemble_barotropic, BAROTROPIC=True
)

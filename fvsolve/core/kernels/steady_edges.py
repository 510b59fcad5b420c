"""Newton iterations of the steady problem of `fvsolve.core.steady`, with the laws of pipes, restrictions and leaks.

A row is the linear equation alpha dM - beta d(drop) = gamma, for changes of the mass flow M [kg/s] and of the potential
drop [Pa]. A law is float64[LAW_SIZE]: its kind, then its numbers.
"""

import math

import numpy as np

from fvsolve.core.kernels.restrictions import flow_at_drop, flow_slope
from fvsolve.core.kernels.steady_friction import drag, drag_slope
from fvsolve.jit import njit

FRICTION, RESTRICTION, LEAK = 0.0, 1.0, 2.0  # kinds of laws
LAW_SIZE = 11
ROUNDING = 1e-13  # Newton change below which only rounding is left, relative to the scales


def law_of(kind: float, *numbers: float) -> np.ndarray:
    """Law as an array: its kind, its numbers, zeros."""
    law = np.zeros(LAW_SIZE)
    law[0], law[1 : 1 + len(numbers)] = kind, numbers
    return law


@njit
def friction_drop(law, flow):
    """Potential drop [Pa] of a pipe or rigid column at a mass flow [kg/s].

    It is the sum of length / area times the drag, a constant drop, and M |M| times the loss of the flow that leaves.
    law : FRICTION, length / area, arguments of `drag`, its least slope, constant drop [Pa], losses [Pa s2/kg2] at the
    `from` and the `to` end
    """
    jet = law[10] if flow > 0.0 else law[9]
    return (
        law[1] * drag(law[2], law[3], law[4], law[5], law[6], flow)
        + law[8]
        + jet * abs(flow) * flow
    )


@njit
def edge_row(law, flow, drop):
    """Newton row (alpha, beta, gamma) of an edge at a mass flow [kg/s] and a potential drop [Pa].

    law : that of a pipe as for `friction_drop`; LEAK with the mass flow per drop [kg/s/Pa]; or RESTRICTION with the
    conductance [kg2/s2/Pa], the factor on it for negative drops, and the flows below which the law is laminar, for
    positive and for negative drops [kg/s]. A chord replaces the slope of the square root.
    """
    if law[0] == FRICTION:
        jet = 2.0 * (law[10] if flow > 0.0 else law[9]) * abs(flow)
        # Turbulent friction has the slope zero at rest, where Newton's step would be infinite.
        slope = max(drag_slope(law[2], law[3], law[4], law[5], law[6], flow), law[7])
        return law[1] * slope + jet, 1.0, drop - friction_drop(law, flow)
    if law[0] == LEAK:
        return 1.0 / law[1], 1.0, drop - flow / law[1]
    here, transition = (law[1] * law[2], law[4]) if drop < 0.0 else (law[1], law[3])
    target = flow_at_drop(here, transition, drop)
    if transition > 0.0 and abs(target) < transition:
        slope = flow_slope(here, transition, drop)
        return 1.0 / slope, 1.0, (target - flow) / slope
    # Without flow and drop the chord would be zero.
    chord = max(abs(target) + abs(flow), 1e-6 * math.sqrt(law[1]))
    return chord / here, 1.0, drop - abs(flow) * flow / here


@njit
def fill_systems(
    numbers, rows, laws, terms, places, drawn, scales, flow, potential, values, right, matrices
):
    """Write Newton systems of problems of equal structure: values of rows with laws, balances, and dense matrices.

    numbers : int64[m]  numbers of the problems, of n
    rows : int64[laws, 7]  of each law its row, its first value, its edge, its nodes i and j, and 1 for each of them
        whose potential is unknown; laws : float64[n, laws, LAW_SIZE]
    terms : int64[terms, 3]  row, edge and sign of each flow in a balance
    places : int64[entries]  index of each value in a matrix; drawn : float64[n, size]  right sides without flows
    scales : float64[n, 2]  typical pressure [Pa] and mass flow [kg/s]
    flow, potential : float64[n, edges], float64[n, nodes]  mass flows [kg/s] and potentials [Pa]
    values : float64[n, entries]; right : float64[n, size]; matrices : float64[n, size of a matrix], or float64[n, 0]
    """
    for k in numbers:
        pressure, typical = scales[k, 0], scales[k, 1]
        for r in range(rows.shape[0]):
            at = rows[r, 1]
            i = rows[r, 3]
            j = rows[r, 4]
            alpha, beta, gamma = edge_row(
                laws[k, r], flow[k, rows[r, 2]], potential[k, i] - potential[k, j]
            )
            values[k, at] = alpha * typical / pressure
            if rows[r, 5] == 1:
                values[k, at + 1] = -beta
            if rows[r, 6] == 1:
                values[k, at + 1 + rows[r, 5]] = beta
            right[k, rows[r, 0]] = gamma / pressure
        # A balance has several terms, so its row is set before any flow is subtracted.
        for t in range(terms.shape[0]):
            right[k, terms[t, 0]] = drawn[k, terms[t, 0]]
        for t in range(terms.shape[0]):
            right[k, terms[t, 0]] -= terms[t, 2] * flow[k, terms[t, 1]] / typical
        if matrices.shape[1] > 0:
            matrices[k] = 0.0
            for e in range(places.size):
                matrices[k, places[e]] += values[k, e]


@njit
def take_changes(numbers, changes, active, unknown, scales, flow, potential, sizes, sweep, ended):
    """Add the changes of a Newton iteration to mass flows and potentials, and decide which problems have ended.

    changes : float64[m, unknowns]  scaled changes for the problems `numbers`: of the edges `active`, then of the nodes
    `unknown`; sizes : float64[n]  largest change of each problem, here and in the iteration before
    ended : int64[n]  1 if a problem has ended, 2 if its changes are not finite; then it keeps its last values
    Other arguments as for `fill_systems`; sweep : number of the iteration
    """
    for m in range(numbers.size):
        k, size = numbers[m], 0.0
        for change in changes[m]:
            if not math.isfinite(change):
                ended[k] = 2
            size = max(size, abs(change))
        if ended[k] == 2:
            continue
        for a in range(active.size):
            flow[k, active[a]] += changes[m, a] * scales[k, 1]
        for u in range(unknown.size):
            potential[k, unknown[u]] += changes[m, active.size + u] * scales[k, 0]
        largest = 0.0
        for value in flow[k]:
            largest = max(largest, abs(value))
        if size <= 1e-15 * (1.0 + largest / scales[k, 1]) or (sweep > 20 and size < 1e-12):
            ended[k] = 1
        # no further decrease: only rounding is left
        if sizes[k] <= 2.0 * size and 2.0 * size < ROUNDING:
            ended[k] = 1
        sizes[k] = size

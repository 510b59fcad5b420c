"""Closures at pipe ends: the value of the outgoing wave there, and ghost cells beyond an end.

A wave leaves through one end and enters through the other. Where it leaves, a polynomial through the last cells gives
its value at the end. Where it enters, the polynomial passes through the value from the node (the datum). A closure from
cells alone is slightly unstable; with the datum no growing mode is known (tests/step_limits/test_ends.py).

Arguments common to these functions: edge : float64[5]  cells nearest to an end, nearest first; n : number of cells of
the pipe; family, degree, limiter : scheme family, degree of the polynomial at an end, and limiter; small : square of a
negligible value.
"""

from fractions import Fraction

import numpy as np

from fvsolve.core.kernels.dtypes import LINEAR, SHORT, UPWIND, WENO5
from fvsolve.core.kernels.reconstruction import value_muscl, value_weno5
from fvsolve.jit import njit

MAX_DEGREE = 4  # greatest degree of a polynomial
GHOSTS = 3


def solve_fractions(matrix, right):
    """Matrix product `right` times the inverse of `matrix`, computed exactly in fractions, as lists of floats."""
    n = len(matrix)
    rows = [list(row) + [Fraction(int(i == j)) for j in range(n)] for i, row in enumerate(matrix)]
    for i in range(n):
        pivot = next(k for k in range(i, n) if rows[k][i] != 0)
        rows[i], rows[pivot] = rows[pivot], rows[i]
        rows[i] = [value / rows[i][i] for value in rows[i]]
        for k in range(n):
            if k != i and rows[k][i] != 0:
                rows[k] = [a - rows[k][i] * b for a, b in zip(rows[k], rows[i], strict=True)]
    inverse = [row[n:] for row in rows]
    return [
        [float(sum(a * inverse[k][j] for k, a in enumerate(row))) for j in range(n)]
        for row in right
    ]


def cell_averages(cell, degree):
    """Averages of the powers 1, x, ..., x^degree over the unit cell from `cell` to `cell` + 1, as fractions."""
    return [Fraction((cell + 1) ** (k + 1) - cell ** (k + 1), k + 1) for k in range(degree + 1)]


def end_weights():
    """Weights of cells in the value of a wave at a pipe end and in three ghost cells beyond it, by polynomial degree.

    Returns three arrays, nearest cell first: end value [degree, cell]; ghost cells where the wave leaves [degree,
    ghost, cell]; ghost cells where it enters [degree, ghost, k], with the end value as k = 0 and then cells.
    """
    value = np.zeros((MAX_DEGREE + 1, MAX_DEGREE + 1))
    leaving = np.zeros((MAX_DEGREE + 1, GHOSTS, MAX_DEGREE + 1))
    entering = np.zeros((MAX_DEGREE + 1, GHOSTS, MAX_DEGREE + 1))
    for d in range(MAX_DEGREE + 1):
        at_end = [Fraction(int(k == 0)) for k in range(d + 1)]
        beyond = [cell_averages(-1 - g, d) for g in range(GHOSTS)]
        cells = [cell_averages(k, d) for k in range(d + 1)]
        solved = solve_fractions(cells, [at_end, *beyond])
        value[d, : d + 1] = solved[0]
        leaving[d, :, : d + 1] = solved[1:]
        entering[d, :, : d + 1] = solve_fractions([at_end, *cells[:d]], beyond)
    return value, leaving, entering


END_VALUE, END_LEAVING, END_ENTERING = end_weights()


def difference_rows(weights, degree):
    """(inside, enter, leave) : weights in the difference F[i] - F[i+1] of face values F, for a linear scheme.

    inside : [6]  for cell i inside a pipe: weights of cells i-3 .. i+2
    enter : [3, 6]  for the three cells at the end where the wave enters: weights of the end value and of five cells
    leave : [2, 5]  for the two cells at the end where the wave leaves: weights of five cells

    weights : float64[5]  weights of cells u-2 .. u+2, in the direction of the wave, in the value at the face after cell
        u
    degree : degree of the polynomials at the ends
    """
    inside = np.append(weights, 0.0) - np.append(0.0, weights)
    unit = np.eye(6)
    beyond = np.pad(END_ENTERING[degree], ((0, 0), (0, 1)))
    # cells -3 .. 4 at the end where a wave enters, as sums of datum and cells 0 .. 4
    near = [*beyond[::-1], *unit[1:]]
    face = [unit[0], *(sum(w * near[j + m] for m, w in enumerate(weights)) for j in range(1, 4))]
    enter = np.array([face[j] - face[j + 1] for j in range(3)])
    # cells at the end where it leaves, as sums of five cells
    near = [*END_LEAVING[degree][::-1], *unit[:5, :5]]
    face = [
        END_VALUE[degree],
        *(sum(w * near[j + 5 - m] for m, w in enumerate(weights)) for j in range(1, 3)),
    ]
    leave = np.array([face[j + 1] - face[j] for j in range(2)])
    return inside, enter, leave


@njit
def edge_cells(c, right, edge):
    """Write the values of the five cells of c nearest to the left (0) or right (1) end, nearest first, to edge[5].

    If there are fewer cells, the last one is repeated.
    """
    n = c.size
    for k in range(5):
        # Closures of few cells give the repeated cells weight zero, or see no slope between them.
        m = min(k, n - 1)
        edge[k] = c[n - 1 - m] if right == 1 else c[m]


@njit
def end_degree(degree, n):
    """Degree of the end polynomial for n cells, at most `degree`.

    Below five cells fifth order would be unstable, third order is not.
    """
    return min(min(degree, 2) if n < 5 else degree, n - 1)


@njit
def roughness(d1, d2, d3, d4, small):
    """Smoothness indicator of cell values, from 0 (smooth) to 1 (a jump).

    d1, d2 : undivided differences of low order; d3, d4 : of high order; small : square of a negligible difference
    The indicator rises with the ratio of the squares of high differences to those of low differences.
    """
    ratio = 4.0 * (d3 * d3 + d4 * d4) / (d1 * d1 + d2 * d2 + small)
    return ratio * ratio / (1.0 + ratio * ratio)


@njit
def leaving_ghosts(edge, n, family, degree, limiter, small, ghosts):
    """Write three ghost cells beyond the end where a wave leaves, nearest first, to ghosts[3]."""
    if family == UPWIND or family == LINEAR or family == SHORT:
        d = end_degree(degree, n)
        for g in range(3):
            total = 0.0
            for k in range(d + 1):
                total += END_LEAVING[d, g, k] * edge[k]
            ghosts[g] = total
        return
    a = edge[0]
    b = edge[1]
    e = edge[2]
    low = 3.0 * a - 3.0 * b + e if n > 2 else 2.0 * a - b
    for g in range(3):
        ghosts[g] = low
    if family == WENO5:
        # Two extrapolations: by a polynomial, and by a limited line near a jump, where it would overshoot.
        slope = value_muscl(limiter, b, a, low) - a
        d3, d4 = edge[3], edge[4]
        rough = roughness(
            a - b,
            a - 2.0 * b + e,
            a - 3.0 * b + 3.0 * e - d3,
            a - 4.0 * b + 6.0 * e - 4.0 * d3 + d4,
            small,
        )
        for g in range(3):
            high = 0.0
            for k in range(5):
                high += END_LEAVING[4, g, k] * edge[k]
            # `slope` is the rise over half a cell: ghost cell g lies 2 (g + 1) of them beyond the last cell.
            ghosts[g] = high + rough * (a + 2.0 * (g + 1.0) * slope - high)


@njit
def entering_ghosts(edge, n, family, degree, datum, small, ghosts):
    """Write three ghost cells beyond the end where a wave enters with the value `datum`, nearest first, to ghosts."""
    if family == UPWIND or family == LINEAR or family == SHORT:
        d = min(min(degree, 2) if n < 5 else degree, n)
        for g in range(3):
            total = END_ENTERING[d, g, 0] * datum
            for k in range(d):
                total += END_ENTERING[d, g, k + 1] * edge[k]
            ghosts[g] = total
        return
    a = edge[0]
    b = edge[1]
    e = edge[2]
    d3 = edge[3]
    for g in range(3):
        # The mean of ghost cell and first cell is then the datum at the face between them.
        ghosts[g] = 2.0 * datum - a
    if family == WENO5:
        bend = 5.5 * a - 3.5 * b + e - 3.0 * datum  # zero for every parabola
        rough = roughness(2.0 * (a - datum), b - a, bend, a - 3.0 * b + 3.0 * e - d3, small)
        for g in range(3):
            high = END_ENTERING[4, g, 0] * datum
            for k in range(4):
                high += END_ENTERING[4, g, k + 1] * edge[k]
            # In rough data the datum itself: a polynomial would overshoot at an arriving jump.
            ghosts[g] = high + rough * (datum - high)


@njit
def end_value(c, right, family, degree, limiter, small, scratch):
    """Value of a wave at the left (0) or right (1) end of a pipe, through which it leaves, from its cell averages c."""
    n = c.size
    edge = scratch[:5]
    ghosts = scratch[5:8]
    edge_cells(c, right, edge)
    if family == UPWIND or family == LINEAR or family == SHORT:
        d = end_degree(degree, n)
        total = 0.0
        for k in range(d + 1):
            total += END_VALUE[d, k] * edge[k]
        return total
    # A single cell has no slope.
    if n == 1:
        return edge[0]
    leaving_ghosts(edge, n, family, degree, limiter, small, ghosts)
    if family == WENO5:
        return value_weno5(edge[2], edge[1], edge[0], ghosts[0], ghosts[1], small)
    return value_muscl(limiter, edge[1], edge[0], ghosts[0])

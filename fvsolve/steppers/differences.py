"""Jacobian by finite differences, one colour of columns at a time, and its product with a vector."""

from fvsolve.jit import njit
from fvsolve.steppers.structure import COLOR_COLUMNS, COLOR_STARTS, COLORS, FINE, LEDGERS, ROWS, SIZE, STARTS

ROOT = 2.0**-26  # square root of the rounding error of a float64
# Relative increment of states whose laws are curved over few pascals: 1e-3 Pa at 150 bar, whose rounding is 2e-9 Pa.
LEAST = 2.0**-34


@njit(forceinline=True)
def differences(rhs, handle, structure, ledger_offset, t, y, f, rates0, scale, y_work, f_work, out, jacobian):
    """Compute the Jacobian of f and of the ledger rates by one-sided differences; returns the number of rhs calls.

    f, rates0 : float64[n], float64[m]  f(t, y) and the ledger rates out[ledger_offset : ledger_offset + m] at y,
    evaluated there and not taken from a stage
    structure : flat array of `Structure.shape`
    scale : float64[n]  size of a small deviation; the increment is 2^-26 max(|y|, scale), with 2^-34 |y| in place of
    2^-26 |y| for states marked fine in the structure, and 2^-26 |scale| for a negative scale
    y_work, f_work : float64[n]  work arrays
    jacobian : float64[nnz]  result, in the order of the pattern, column by column
    """
    n = structure[SIZE]
    starts, rows = structure[structure[STARTS] :], structure[structure[ROWS] :]
    color_starts, columns = structure[structure[COLOR_STARTS] :], structure[structure[COLOR_COLUMNS] :]
    fine = structure[structure[FINE] :]
    for j in range(n):
        y_work[j] = y[j]
    for color in range(structure[COLORS]):
        for e in range(color_starts[color], color_starts[color + 1]):
            j = columns[e]
            if scale[j] < 0.0:
                y_work[j] = y[j] - ROOT * scale[j]
            else:
                y_work[j] = y[j] + max((LEAST if fine[j] == 1 else ROOT) * abs(y[j]), ROOT * scale[j])
        rhs(t, y_work, f_work, out, handle)
        for e in range(color_starts[color], color_starts[color + 1]):
            j = columns[e]
            per = 1.0 / (y_work[j] - y[j])  # the increment as rounded in the sum
            for p in range(starts[j], starts[j + 1]):
                i = rows[p]
                change = f_work[i] - f[i] if i < n else out[ledger_offset + i - n] - rates0[i - n]
                jacobian[p] = change * per
            y_work[j] = y[j]
    return structure[COLORS]


@njit
def multiply(structure, jacobian, x, product):
    """Write the product J x of the Jacobian J and a vector x to `product`.

    product : float64[n + m]  entries of n states, then of m ledger rates; x : float64[n]
    jacobian : float64[nnz]  entries of J, in the order of the pattern; structure : flat array of `Structure.shape`
    """
    n = structure[SIZE]
    starts, rows = structure[structure[STARTS] :], structure[structure[ROWS] :]
    for i in range(n + structure[LEDGERS]):
        product[i] = 0.0
    for j in range(n):
        for p in range(starts[j], starts[j + 1]):
            product[rows[p]] += jacobian[p] * x[j]

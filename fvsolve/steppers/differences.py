"""Jacobian by finite differences, one colour of columns at a time, and its product with a vector."""

from fvsolve.jit import njit
from fvsolve.steppers.structure import COLOR_COLUMNS, COLOR_STARTS, COLORS, FINE, LEDGERS, ROWS, SIZE, STARTS

ROOT = 2.0**-26  # square root of the rounding error of a float64
# Relative increment of states whose laws are curved over few pascals: 1e-3 Pa at 150 bar, whose rounding is 2e-9 Pa.
LEAST = 2.0**-34


@njit(forceinline=True)
def differences(rhs, handle, r, t, y, f, ledger_rates, f_work):
    """Write the Jacobian of f and of the ledger rates to `r.jacobian`, column by column; returns the number of calls.

    rhs : right-hand side, which is called once for each colour of columns, for one-sided differences
    handle, r : handle of the model, open handle of the run; f_work : float64[n]  work array for rates
    f, ledger_rates : float64[n], float64[m]  rates at (t, y), evaluated there and not taken from a stage
    The increment of a state is 2^-26 max(|y|, scale), with 2^-34 |y| in place of 2^-26 |y| for states marked fine in
    the structure, and 2^-26 |scale| for a negative scale.
    """
    structure, scale, y_work, out, jacobian = r.structure, r.scale, r.moved, r.out, r.jacobian
    n, offset = structure[SIZE], r.control[0]["ledger_offset"]
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
                change = f_work[i] - f[i] if i < n else out[offset + i - n] - ledger_rates[i - n]
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

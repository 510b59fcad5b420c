"""Size and reciprocal of pivots, real or complex, and check of Jacobian entries."""

from fvsolve.jit import njit
from fvsolve.steppers.structure import ROWS, SIZE, STARTS

LEAST = 1e-150  # least size of a pivot: its square and the square of its reciprocal are still in range


@njit(forceinline=True)
def size_of(x):
    """Size |Re x| + |Im x| of a number, which is quicker to compute than its modulus."""
    return abs(x.real) + abs(x.imag)


@njit(forceinline=True)
def reciprocal(x):
    """Reciprocal 1 / x of a real or complex number whose square neither overflows nor underflows."""
    return x.conjugate() / (x.real * x.real + x.imag * x.imag)


@njit
def bad_row(structure, jacobian):
    """1 + number of a state whose row contains an invalid Jacobian entry; 0 if all entries are valid.

    An entry is invalid if it is not finite or its size is 1e150 or more. Ledger rows are not tested.
    """
    n = structure[SIZE]
    last, rows, good = structure[structure[STARTS] + n], structure[structure[ROWS] :], True
    for p in range(last):
        good &= abs(jacobian[p]) < 1.0 / LEAST
    if not good:
        for p in range(last):
            if not abs(jacobian[p]) < 1.0 / LEAST and rows[p] < n:
                return rows[p] + 1
    return 0

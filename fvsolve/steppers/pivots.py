"""What makes a pivot good, for real and for complex numbers. Knows numbers; knows no structure."""

from fvsolve.jit import njit
from fvsolve.steppers.structure import ROWS, SIZE, STARTS

LEAST = 1e-150  # of a pivot: its square is still a number, and so is that of its reciprocal


@njit(forceinline=True)
def size_of(x):
    """|Re x| + |Im x|, quicker than the modulus."""
    return abs(x.real) + abs(x.imag)


@njit(forceinline=True)
def reciprocal(x):
    """1 / x of a number whose square neither overflows nor vanishes."""
    return x.conjugate() / (x.real * x.real + x.imag * x.imag)


@njit
def bad_row(structure, jacobian):
    """0, or 1 + the state of the first row with an entry that is not finite (or beyond all use)."""
    n = structure[SIZE]
    last, rows, good = structure[structure[STARTS] + n], structure[structure[ROWS] :], True
    for p in range(last):
        good &= abs(jacobian[p]) < 1.0 / LEAST
    if not good:
        for p in range(last):
            if not abs(jacobian[p]) < 1.0 / LEAST and rows[p] < n:
                return rows[p] + 1
    return 0

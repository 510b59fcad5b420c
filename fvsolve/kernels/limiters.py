"""Limited slopes from the two differences beside a cell. Knows two numbers at a time."""

from fvsolve.jit import njit


@njit
def slope_minmod(a, b):
    """The smaller of two differences of one sign, else zero."""
    s = a if abs(a) < abs(b) else b
    return s if a * b > 0.0 else 0.0


@njit
def slope_van_leer(a, b):
    """Harmonic mean 2 a b / (a + b) of two differences of one sign, else zero (van Leer 1974)."""
    ab = a * b
    s = 2.0 * ab / (a + b)
    return s if ab > 0.0 else 0.0


@njit
def slope_monotonized_central(a, b):
    """The central difference, at most twice the smaller one, else zero (van Leer 1977)."""
    s = a if abs(a) < abs(b) else b
    c = 0.5 * (a + b)
    m = 2.0 * s if 2.0 * abs(s) < abs(c) else c
    return m if a * b > 0.0 else 0.0

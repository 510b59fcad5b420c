"""Riemann invariants of a liquid of any density law, by cubics on uniform grids.

w = integral of c / rho d rho from the density at rest; deviations r of density [kg/m3] and p of pressure [Pa] from
rest. A table contains
    1/dr, first interval, number of further intervals, offset, 1/dw, first interval, number of further intervals, offset
for grids of steps dr and dw, and four coefficients of s in [0, 1] per interval: of w over r, then of r and of p over w.
Intervals are counted from rest, where all values are exactly 0. The first and the last interval are straight and have
no end. `lower` builds the table.
"""

from math import sqrt

from fvsolve.jit import njit

HEAD = 8  # floats before the cubics
W_OF_R, OF_W = 0, 4  # places of both grids in it


@njit(forceinline=True)
def locate(table, grid, x, size):
    """(offset in the table of the cubics of the interval that contains x, position s of x in that interval).

    grid : W_OF_R if x is a deviation of density, OF_W if x is an invariant; size : number of coefficients per interval
    For NaN the result is the first interval and s = NaN.
    """
    z = x * table[grid]
    first = table[grid + 1]
    last = table[grid + 2]
    k = z - first
    k = k if k > 0.0 else 0.0
    k = k if k < last else last
    i = int(k)
    return int(table[grid + 3]) + size * i, z - (i + first)


@njit(forceinline=True)
def invariant(table, r):
    """(w [m/s], dw/dr = c / rho) at a deviation r of density from rest [kg/m3]; table : see `riemann_invariants`."""
    k, s = locate(table, W_OF_R, r, 4)
    b = table[k + 1]
    c = table[k + 2]
    d = table[k + 3]
    return table[k] + s * (b + s * (c + s * d)), table[W_OF_R] * (b + s * (2.0 * c + 3.0 * s * d))


@njit(forceinline=True)
def state(table, w):
    """(deviation of density r [kg/m3], deviation of pressure p [Pa]) from rest at the invariant w [m/s].

    table : see `riemann_invariants`
    """
    k, s = locate(table, OF_W, w, 8)
    r = table[k] + s * (table[k + 1] + s * (table[k + 2] + s * table[k + 3]))
    return r, table[k + 4] + s * (table[k + 5] + s * (table[k + 6] + s * table[k + 7]))


@njit(forceinline=True)
def speed(table, rho, w):
    """Wave speed c [m/s] at the invariant w [m/s]; table : see `riemann_invariants`; rho : density at rest [kg/m3]"""
    k, s = locate(table, OF_W, w, 8)
    b = table[k + 1]
    c = table[k + 2]
    d = table[k + 3]
    dense = rho + table[k] + s * (b + s * (c + s * d))
    return dense / (table[OF_W] * (b + s * (2.0 * c + 3.0 * s * d)))


@njit(forceinline=True)
def invariant_at_potential(c0, rho, table, w, phi):
    """Invariant of a liquid at rest where the potential is higher by phi [J/kg] than where the invariant is w.

    It satisfies c dw = dp / rho = -d(phi). Under the density law `log` (table None) it is exact: the new c^2 is the old
    c^2 plus phi. Under `table` it is that of the midpoint rule, with an error of the order of c (phi / c^2)^3.
    c0, rho : wave speed [m/s] and density [kg/m3] at rest
    """
    if table is None:
        c = c0 - 0.5 * w
        return w - 2.0 * phi / (c + sqrt(c * c + phi))
    return w - phi / speed(table, rho, w - 0.5 * phi / speed(table, rho, w))


@njit(forceinline=True)
def pressure(table, rho, r):
    """(deviation of pressure p [Pa], dp/dr = c^2 [m2/s2]) at a deviation r of density from rest [kg/m3].

    table : see `riemann_invariants`; rho : density at rest [kg/m3]
    """
    w, slope = invariant(table, r)
    c = (rho + r) * slope
    return state(table, w)[1], c * c

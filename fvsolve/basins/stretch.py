"""Cells that are stretched as lines move: what they contain, and what they hold per area. Knows vectors; knows no law.

Contents count as deviations over areas as drawn, (A U - A0 U0) / A0, see `walls`; all columns of a grid stretch alike,
or all rows. wide : areas over those as drawn; narrow : 1 / wide
"""

from fvsolve.jit import njit


@njit(forceinline=True)
def seen_of(basin, seen, y):
    """Deviations of what cells hold per area: `seen` of the tables where walls move, for y then has contents."""
    if basin["walls"] > 0:
        return seen
    return y


@njit(forceinline=True)
def row_across(basin, i):
    """In which of the rows that stretch cell i lies."""
    if basin["nx"] == 0:
        return i
    return i // basin["nx"] if basin["turn"] == 1 else i % basin["nx"]


@njit(forceinline=True)
def stretched(plane, basin, i):
    """Area of cell i over that as drawn."""
    return plane[basin["stretch"] + row_across(basin, i)] if basin["walls"] > 0 else 1.0


@njit
def fill(value, values):
    """All the same."""
    for i in range(values.size):
        values[i] = value


@njit
def multiply(values, factors, products):
    """products = values * factors, which must be another array, or the loop is no whole vectors."""
    for i in range(products.size):
        products[i] = values[i] * factors[i]


@njit
def widen(factors, values):
    """values *= factors."""
    for i in range(values.size):
        values[i] *= factors[i]


@njit
def scale(factor, values):
    """values *= factor."""
    for i in range(values.size):
        values[i] *= factor


@njit
def see_depths(rest, wide, narrow, content, seen):
    """Deviations of depths from those at rest."""
    for i in range(seen.size):
        seen[i] = (content[i] - rest[i] * (wide[i] - 1.0)) * narrow[i]


@njit
def see_densities(rest, wide, narrow, content, seen):
    """Deviations of densities from that at rest."""
    for i in range(seen.size):
        seen[i] = (content[i] - rest * (wide[i] - 1.0)) * narrow[i]


@njit
def swell(wide, one, other, third):
    """Three rates of cells become those of what these contain."""
    widen(wide, one)
    widen(wide, other)
    widen(wide, third)


@njit
def swell_row(columns, wide, first, j, one, other, third):
    """The same of row j of a grid, from column `first` on; columns : whether these stretch, and not the rows."""
    if columns:
        swell(wide[first:], one, other, third)
    else:
        scale(wide[j], one)
        scale(wide[j], other)
        scale(wide[j], third)

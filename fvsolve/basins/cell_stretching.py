"""Cells that stretch as lines move: conversion between contents and values per area.

Contents are deviations over undeformed areas, (A U - A0 U0) / A0, see `moving_walls`; all columns of a grid stretch
alike, or all rows.

wide : areas over undeformed areas; narrow : 1 / wide
"""

from fvsolve.jit import njit


@njit(forceinline=True)
def deviations_of(basin, seen, y):
    """Deviations of values per area: `seen` of the tables where walls move, because y then contains contents."""
    if basin["walls"] > 0:
        return seen
    return y


@njit(forceinline=True)
def row_across(basin, i):
    """Index of the stretching row or column of cell i; on a mesh i itself."""
    if basin["nx"] == 0:
        return i
    return i // basin["nx"] if basin["turn"] == 1 else i % basin["nx"]


@njit(forceinline=True)
def stretch_of_cell(plane, basin, i):
    """Area of cell i over its undeformed area."""
    return plane[basin["stretch"] + row_across(basin, i)] if basin["walls"] > 0 else 1.0


@njit
def fill(value, values):
    """Set all values to `value`."""
    for i in range(values.size):
        values[i] = value


@njit
def multiply(values, factors, products):
    """products = values * factors. products must be another array, or the loop is not vectorised."""
    for i in range(products.size):
        products[i] = values[i] * factors[i]


@njit
def multiply_in_place(factors, values):
    """values *= factors."""
    for i in range(values.size):
        values[i] *= factors[i]


@njit
def scale_in_place(factor, values):
    """values *= factor."""
    for i in range(values.size):
        values[i] *= factor


@njit
def depth_deviations(rest, wide, narrow, content, seen):
    """Deviations of depths from those at rest."""
    for i in range(seen.size):
        seen[i] = (content[i] - rest[i] * (wide[i] - 1.0)) * narrow[i]


@njit
def density_deviations(rest, wide, narrow, content, seen):
    """Deviations of densities from that at rest."""
    for i in range(seen.size):
        seen[i] = (content[i] - rest * (wide[i] - 1.0)) * narrow[i]


@njit
def stretch_rates(wide, first, second, third):
    """Convert three rates per area to rates of contents."""
    multiply_in_place(wide, first)
    multiply_in_place(wide, second)
    multiply_in_place(wide, third)


@njit
def stretch_row_rates(columns, wide, first, j, rate_1, rate_2, rate_3):
    """Convert three rates of row j of a grid from column `first` on.

    columns : True if columns stretch, False if rows do
    """
    if columns:
        stretch_rates(wide[first:], rate_1, rate_2, rate_3)
    else:
        scale_in_place(wide[j], rate_1)
        scale_in_place(wide[j], rate_2)
        scale_in_place(wide[j], rate_3)

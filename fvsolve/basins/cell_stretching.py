"""Cells that stretch as grid lines move: conversion between amounts in cells and values per area.

The states of such basins are changes of the amount in a cell over its undeformed area, (A U - A0 U0) / A0: U is a value
per area, A the area, U0 and A0 are the values at rest and undeformed (`moving_walls`). All columns of a grid stretch
alike, or all rows.

wide : A / A0; narrow : A0 / A
"""

from fvsolve.jit import njit


@njit(forceinline=True)
def deviations_of(basin, seen, y):
    """Deviations of values per area from rest: the table `seen` if the basin has moving walls, else the states y."""
    if basin["walls"] > 0:
        return seen
    return y


@njit(forceinline=True)
def row_across(basin, i):
    """Index of the column or row of cell i that stretches as a whole; on a mesh other than a grid, i itself."""
    if basin["nx"] == 0:
        return i
    return i // basin["nx"] if basin["turn"] == 1 else i % basin["nx"]


@njit(forceinline=True)
def stretch_of_cell(plane, basin, i):
    """Area of cell i over its undeformed area; 1 without moving walls."""
    return plane[basin["stretch"] + row_across(basin, i)] if basin["walls"] > 0 else 1.0


@njit
def fill(value, values):
    """Set all values to `value`."""
    for i in range(values.size):
        values[i] = value


@njit
def multiply(values, factors, products):
    """Write values * factors to products; products must be another array, or the loop is not vectorised."""
    for i in range(products.size):
        products[i] = values[i] * factors[i]


@njit
def multiply_in_place(factors, values):
    """Multiply values by factors in place."""
    for i in range(values.size):
        values[i] *= factors[i]


@njit
def scale_in_place(factor, values):
    """Multiply all values by one factor in place."""
    for i in range(values.size):
        values[i] *= factor


@njit
def depth_deviations(rest, wide, narrow, content, seen):
    """Write deviations of depths from those at rest to `seen`.

    rest : depths at rest [m]; content : states, changes of the amount in a cell over its undeformed area [m]
    """
    for i in range(seen.size):
        seen[i] = (content[i] - rest[i] * (wide[i] - 1.0)) * narrow[i]


@njit
def density_deviations(rest, wide, narrow, content, seen):
    """Write deviations of densities from the density `rest` to `seen`; other arguments as for `depth_deviations`."""
    for i in range(seen.size):
        seen[i] = (content[i] - rest * (wide[i] - 1.0)) * narrow[i]


@njit
def stretch_rates(wide, first, second, third):
    """Convert three arrays of rates per present area to rates of the states, in place."""
    multiply_in_place(wide, first)
    multiply_in_place(wide, second)
    multiply_in_place(wide, third)


@njit
def stretch_row_rates(columns, wide, first, j, rate_1, rate_2, rate_3):
    """Convert three arrays of rates of row j of a grid, from column `first` on, as `stretch_rates` does.

    wide : ratios of all columns or rows; columns : True if columns stretch, False if rows do
    """
    if columns:
        stretch_rates(wide[first:], rate_1, rate_2, rate_3)
    else:
        scale_in_place(wide[j], rate_1)
        scale_in_place(wide[j], rate_2)
        scale_in_place(wide[j], rate_3)

"""What the cells of basins hold at the end, on other cells too, and how far apart that is. Knows fields; runs nothing.

A variable is called "BASIN at the end: QUANTITY", its values are the deviations that states are.
"""

from __future__ import annotations

import numpy as np

NEAR = 1e-9  # of its length: how near an edge of coarser cells must be to one of finer ones to be the same
DEGREE = 5  # of the spline through contents, where it is not


def contents(basin, y: np.ndarray) -> dict[str, np.ndarray]:
    """What states of a model say of a basin's cells, by quantity, what they carry included."""
    found = dict(zip(basin.quantities, basin.of(y), strict=True))
    carried = getattr(basin, "scalars", ())
    return found | (dict(zip(carried, basin.amounts(y), strict=True)) if carried else {})


def variable_of(basin, quantity: str) -> str:
    """Name of a variable."""
    return f"{basin.name} at the end: {quantity}"


def unit_of(case, variable: str) -> str | None:
    """Unit of a variable, None where it is none of a basin."""
    name, _, quantity = variable.partition(" at the end: ")
    node = case.nodes.get(name)
    if not quantity or node is None or node.kind != "basin":
        return None
    return node.own.states.get(quantity, "-")


def lowered(fine, values, coarse) -> np.ndarray:
    """Averages float64[quantities, n] of a basin over the cells of another one of the same outline."""
    if fine.n == coarse.n and np.array_equal(fine.mesh.centre, coarse.mesh.centre):
        return np.asarray(values)
    one, other = fine.mesh.grid, coarse.mesh.grid
    degree = DEGREE if fine.is_grid else 1  # splines do not see holes
    found = []
    for value in values:
        held = np.where(one.index >= 0, value[one.index], 0.0) * np.outer(np.diff(one.y), np.diff(one.x))
        held = gathered(gathered(held, one.x, other.x, degree, 1), one.y, other.y, degree, 0)
        found.append((held / np.outer(np.diff(other.y), np.diff(other.x)))[other.index >= 0])
    return np.array(found)


def gathered(held: np.ndarray, fine: np.ndarray, coarse: np.ndarray, degree: int, axis: int) -> np.ndarray:
    """Contents of the cells between coarser edges, from those of finer cells, along an axis."""
    first = np.zeros_like(np.take(held, [0], axis=axis))
    contents = np.concatenate([first, np.cumsum(held, axis=axis)], axis=axis)
    at = np.clip(np.searchsorted(fine, coarse - NEAR * (fine[-1] - fine[0])), 0, fine.size - 1)
    if np.all(np.abs(fine[at] - coarse) <= NEAR * (fine[-1] - fine[0])):
        return np.diff(np.take(contents, at, axis=axis), axis=axis)
    from scipy.interpolate import make_interp_spline

    return np.diff(make_interp_spline(fine, contents, k=min(degree, fine.size - 1), axis=axis)(coarse), axis=axis)

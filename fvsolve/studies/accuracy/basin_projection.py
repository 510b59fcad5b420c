"""Quantities in the cells of basins at the end of a run, averaged over the cells of coarser meshes.

A variable has the name "BASIN at the end: QUANTITY". Its values are those of `basin_fields`.
"""

from __future__ import annotations

import numpy as np

EDGE_TOLERANCE = 1e-9  # fraction of the length: edges of coarse and fine cells that lie nearer are equal
SPLINE_DEGREE = 5  # degree of the spline through cumulative contents, for edges that are not equal


def basin_fields(basin, y: np.ndarray) -> dict[str, np.ndarray]:
    """Values in the cells of a basin, quantity -> float64[cells], from the state vector `y` of a model.

    Quantities of the flow are deviations from the initial steady state; scalars are amounts per area.
    """
    fields = dict(zip(basin.quantities, basin.deviations(y), strict=True))
    scalars = getattr(basin, "scalars", ())
    return fields | (dict(zip(scalars, basin.amounts(y), strict=True)) if scalars else {})


def variable_name(basin, quantity: str) -> str:
    """Name of the variable that is a quantity of a basin at the end of a run."""
    return f"{basin.name} at the end: {quantity}"


def unit_of(case, variable: str) -> str | None:
    """SI unit of a variable by its name, "-" for a scalar; None if the variable does not belong to a basin."""
    name, _, quantity = variable.partition(" at the end: ")
    node = case.nodes.get(name)
    if not quantity or node is None or node.kind != "basin":
        return None
    return node.physics_type.states.get(quantity, "-")


def project_to(fine, values, coarse) -> np.ndarray:
    """Average values in the cells of a fine basin over the cells of a coarse basin with the same outline.

    values : float64[quantities, fine cells]; returns float64[quantities, coarse cells]
    """
    if fine.n == coarse.n and np.array_equal(fine.mesh.centre, coarse.mesh.centre):
        return np.asarray(values)
    fine_grid, coarse_grid = fine.mesh.grid, coarse.mesh.grid
    degree = SPLINE_DEGREE if fine.is_grid else 1  # higher splines would smooth across holes
    averages = []
    for value in values:
        contents = np.where(fine_grid.index >= 0, value[fine_grid.index], 0.0) * np.outer(
            np.diff(fine_grid.y), np.diff(fine_grid.x)
        )
        contents = coarse_contents(
            coarse_contents(contents, fine_grid.x, coarse_grid.x, degree, 1), fine_grid.y, coarse_grid.y, degree, 0
        )
        averages.append((contents / np.outer(np.diff(coarse_grid.y), np.diff(coarse_grid.x)))[coarse_grid.index >= 0])
    return np.array(averages)


def coarse_contents(
    fine_contents: np.ndarray, fine: np.ndarray, coarse: np.ndarray, degree: int, axis: int
) -> np.ndarray:
    """Integrals over the cells between the edges `coarse`, from integrals over the cells between the edges `fine`.

    axis : axis of `fine_contents` along which the cells lie
    degree : degree of the spline through cumulative integrals, used if the coarse edges are not among the fine edges
    """
    first = np.zeros_like(np.take(fine_contents, [0], axis=axis))
    cumulative = np.concatenate([first, np.cumsum(fine_contents, axis=axis)], axis=axis)
    edges = np.clip(np.searchsorted(fine, coarse - EDGE_TOLERANCE * (fine[-1] - fine[0])), 0, fine.size - 1)
    if np.all(np.abs(fine[edges] - coarse) <= EDGE_TOLERANCE * (fine[-1] - fine[0])):
        return np.diff(np.take(cumulative, edges, axis=axis), axis=axis)
    from scipy.interpolate import make_interp_spline

    return np.diff(make_interp_spline(fine, cumulative, k=min(degree, fine.size - 1), axis=axis)(coarse), axis=axis)

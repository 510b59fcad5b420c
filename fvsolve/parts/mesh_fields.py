"""Fields of a basin by its mesh file: a value for each group of cells, and the elevations of its nodes."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.table_model import check_table
from fvsolve.parts.value import Quantity, ReadContext, ValueFault, faults_of
from fvsolve.units import show

NODES = "nodes"  # value of the key `bed`
MOST_NAMES = 10  # of groups in a message


@dataclass(frozen=True, eq=False)
class GroupValues:
    """Value in each cell by the group of cells of the mesh file that contains it.

    values : name of a group -> value [SI]
    """

    values: dict[str, float]

    def over(self, mesh: Any) -> np.ndarray:
        """Values in the cells of a mesh : float64[n].

        Raises ValueError for a group that the mesh lacks, for cells in no group or in a group without value, and for
        cells in two groups with different values.
        """
        if unknown := [name for name in self.values if name not in mesh.regions]:
            known = f"its groups of cells are {listing(mesh.regions, MOST_NAMES) or 'none'}"
            hint = did_you_mean(unknown[0], mesh.regions)
            raise ValueError(f"the mesh has no group of cells {show(unknown[0])}{hint}; {known}")
        found = np.full(len(mesh.cells), np.nan)
        for name, value in self.values.items():
            cells = mesh.regions[name]
            twice = cells[np.isfinite(found[cells]) & (found[cells] != value)]
            if twice.size:
                text = f"{twice.size} cells of the group {show(name)} are in another group with another value"
                raise ValueError(
                    f"{text}, first at {place(mesh, twice[0])}; expected one value for each cell"
                )
            found[cells] = value
        if lacking := np.flatnonzero(np.isnan(found)).tolist():
            others = [name for name in mesh.regions if np.isin(lacking, mesh.regions[name]).any()]
            text = f"{len(lacking)} of {len(mesh.cells)} cells have no value, first at {place(mesh, lacking[0])}"
            remedy = (
                f"expected values of {listing(others, MOST_NAMES)} too"
                if others
                else ("they are in no group; expected a group for each cell of the mesh file")
            )
            raise ValueError(f"{text}; {remedy}")
        return found

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Not defined at points: the value of a group belongs to cells."""
        raise ValueError(
            "values of groups belong to cells of the mesh; expected a formula or a file for points"
        )


@dataclass(frozen=True, eq=False)
class NodeElevations:
    """Elevations of the nodes of the mesh file, linear on triangles and on both halves of a quadrilateral.

    last : mesh of the last means, on which values at points are interpolated
    """

    last: list = field(default_factory=list, repr=False)

    def over(self, mesh: Any) -> np.ndarray:
        """Means over the cells of a mesh : float64[n]. Raises ValueError for a mesh without elevations of nodes."""
        if mesh.heights is None:
            raise ValueError(
                "the mesh has no elevations of nodes; expected a mesh file with z, or another bed"
            )
        self.last[:] = [mesh]
        total, whole = np.zeros(len(mesh.cells)), np.zeros(len(mesh.cells))
        for corners in ((0, 1, 2), (0, 2, 3)):
            own = np.flatnonzero(mesh.cells[:, corners[-1]] >= 0)
            nodes = mesh.cells[own][:, corners]
            at = mesh.points[nodes]
            along, other = at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]
            area = 0.5 * (along[:, 0] * other[:, 1] - along[:, 1] * other[:, 0])
            total[own] += area * mesh.heights[nodes].mean(axis=1)
            whole[own] += area
        low, high = (pick(mesh) for pick in (lowest_corners, highest_corners))
        return np.clip(total / whole, low, high)  # a flat cell has exactly its elevation

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Elevations at points, linear between nodes; at points outside that of the nearest node [m]."""
        from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

        [mesh] = self.last
        found = LinearNDInterpolator(mesh.points, mesh.heights)(x, y)
        nearest = NearestNDInterpolator(mesh.points, mesh.heights)(x, y)
        return np.where(np.isnan(found), nearest, found)


def lowest_corners(mesh: Any) -> np.ndarray:
    """Elevation of the lowest node of each cell : float64[n] [m]."""
    return np.where(mesh.cells >= 0, mesh.heights[mesh.cells], np.inf).min(axis=1)


def highest_corners(mesh: Any) -> np.ndarray:
    """Elevation of the highest node of each cell : float64[n] [m]."""
    return np.where(mesh.cells >= 0, mesh.heights[mesh.cells], -np.inf).max(axis=1)


def place(mesh: Any, cell: int) -> str:
    """Text of the centre of a cell."""
    x, y = mesh.centre[cell]
    return f"x = {x:.6g} m, y = {y:.6g} m"


def read_group_values(
    given: dict[str, Any], value: Quantity, setting: ReadContext
) -> tuple[dict[str, Any], GroupValues]:
    """(table for the resolved case, values) of a table { groups = { NAME = VALUE } } of a case file.

    Raises ValueFault with all faults.
    """
    faults = [((key,), "unknown key; expected only `groups`") for key in given if key != "groups"]
    groups = given["groups"]
    try:
        check_table(groups, "for example { road = 0.016, grass = 0.035 }")
        if not groups:
            raise ValueError("has no groups; expected for example { road = 0.016, grass = 0.035 }")
    except ValueError as error:
        raise ValueFault([*faults, (("groups",), str(error))]) from None
    values = {}
    for name, item in groups.items():
        try:
            values[str(name)] = value.read(item, setting)
        except ValueError as error:
            faults += faults_of(error, "groups", name)
    if faults:
        raise ValueFault(faults)
    return {"groups": dict(values)}, GroupValues(values)

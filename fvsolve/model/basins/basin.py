"""What all physics of basins share: cells, boundaries and patches as rows of tables. Knows no law."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from fvsolve.case.basins import behind
from fvsolve.kernels import records as rec

if TYPE_CHECKING:
    from fvsolve.mesh.points import Points

LIMITERS = {"minmod": rec.MINMOD, "van-leer": rec.VAN_LEER, "monotonized-central": rec.MONOTONIZED_CENTRAL}
FIFTH = {"upwind5": rec.LINEAR, "weno5": rec.WENO5}  # on grids; other schemes of pipes are `muscl` in the plane
MOVES = {"u": rec.CELL_U, "v": rec.CELL_V, "speed": rec.CELL_SPEED}
SIDES = ("west", "east", "south", "north")  # in the order of a grid's boundary faces


class Basin:
    """A basin of a model: its part, its mesh, and its row once it is lowered."""

    physics: ClassVar[dict[str, type[Basin]]] = {}
    quantities: ClassVar[tuple[str, ...]] = ()  # of cells, as states have them; the first is what is stored
    units: ClassVar[dict[str, str]] = {}  # of fields

    def __init_subclass__(cls, physics: str) -> None:
        Basin.physics[physics] = cls

    def __init__(self, case, name: str) -> None:
        self.case, self.name, self.part, self.mesh = case, name, case.nodes[name], case.meshes[name]
        self.x, self.y = np.ascontiguousarray(self.mesh.centre.T)
        self.n = self.x.size
        self.memory = 0  # its tables and its state [bytes]
        grid = self.mesh.grid
        self.is_grid = grid is not None and self.n == grid.nx * grid.ny

    # what a physics says ------------------------------------------------------------------------------------

    def lower(self, scene, row) -> None:
        """Fill what its law needs of the row, and reserve what its kernels work in."""
        raise NotImplementedError

    def scales(self) -> list[float]:
        """What counts as a small deviation of each quantity."""
        raise NotImplementedError

    def start(self) -> np.ndarray:
        """Deviations at the start : float64[quantities, n]."""
        raise NotImplementedError

    def fields(self, y: np.ndarray) -> dict[str, np.ndarray]:
        """What cells hold at deviations float64[quantities, n], SI."""
        raise NotImplementedError

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Least and greatest of what tells of its waves at the start, SI."""
        raise NotImplementedError

    def lower_probe(self, row, field: str, cells: np.ndarray, weights: np.ndarray) -> None:
        """Fill what a probe of a field is, beside the cells that it reads; scalar fields are its physics' own."""
        row["kind"], row["scale"] = MOVES[field], 1.0

    def mass(self) -> tuple[float, np.ndarray]:
        """Mass of the start's profile [kg], and mass per deviation of the first quantity : float64[n]."""
        raise NotImplementedError

    # ----------------------------------------------------------------------------------------------------------

    @cached_property
    def points(self) -> Points:
        """Finds points of its mesh, and the cells that are read there."""
        from fvsolve.mesh.points import Points

        return Points(self.mesh)

    def formula(self, shape) -> np.ndarray:
        """A formula at centres : float64[n]."""
        return np.zeros(self.n) if shape is None else shape.at(self.x, self.y)

    def reflects(self) -> np.ndarray:
        """What comes back of waves at faces of the boundary in the kernels' order : float64[outer]; none for walls."""
        mesh, found = self.mesh, np.ones(self.mesh.left.size)
        for name, patch in self.part.patches.items():
            found[mesh.patch(name)] = self.reflection(patch)
        outer = found[mesh.inner :]
        if (outer == 1.0).all():
            return np.zeros(0)
        return outer[self.ring()] if self.is_grid else outer

    def ring(self) -> np.ndarray:
        """Numbers of a grid's boundary faces among all those of the boundary: west, east, south, north."""
        mesh, grid = self.mesh, self.mesh.grid
        normal, left = mesh.normal[mesh.inner :], mesh.left[mesh.inner :]
        row, column = np.divmod(left, grid.nx)
        west, east = normal[:, 0] < -0.5, normal[:, 0] > 0.5
        south, at = normal[:, 1] < -0.5, np.where(np.abs(normal[:, 0]) > 0.5, row, column)
        side = np.where(west, 0, np.where(east, 1, np.where(south, 2, 3)))
        return np.lexsort((at, side))

    def reflection(self, patch) -> float:
        """What comes back of waves at a patch."""
        return 0.0 if patch.boundary == "open" else 1.0

    def of(self, y: np.ndarray) -> np.ndarray:
        """Its deviations in the states of a model : float64[quantities, n]."""
        at = int(self.row["y"])
        return y[at : at + len(self.quantities) * self.n].reshape(-1, self.n)

    def lower_common(self, scene, row) -> None:
        """Fill what all kinds need."""
        numerics, mesh, before = self.case.numerics, self.mesh, scene.plane_size + len(scene.integers)
        self.row, row["n"] = row, self.n
        row["scheme"] = rec.UPWIND if numerics.scheme == "upwind" else FIFTH.get(numerics.scheme, rec.MUSCL)
        row["limiter"] = LIMITERS.get(numerics.limiter, rec.MONOTONIZED_CENTRAL)
        row["area"] = scene.to_plane(mesh.area)
        if self.is_grid:
            grid = mesh.grid
            row["nx"], row["ny"] = grid.nx, grid.ny
            row["spacing"] = scene.to_plane(np.concatenate([1.0 / np.diff(grid.x), 1.0 / np.diff(grid.y)]))
        given = self.reflects()
        row["reflect"], row["outer_given"] = scene.to_plane(given), given.size
        self.lower(scene, row)
        first, *others = ([f"{self.name}.{what}[{i}]" for i in range(self.n)] for what in self.quantities)
        scales = self.scales()
        row["y"] = scene.states(first, scales[0])
        for names, scale in zip(others, scales[1:], strict=True):
            scene.states(names, scale)
        self.memory = 8 * (scene.plane_size + len(scene.integers) - before + len(self.quantities) * self.n)
        scene.warnings += [f"basin {self.name}: {note}" for note in mesh.notes]

    def lower_patch(self, scene, patch: str, row) -> None:
        """Fill the row of a patch that links may join."""
        cells = behind(self.mesh, patch)
        row["first"], row["count"], row["area"] = len(scene.integers), cells.size, self.mesh.area[cells].sum()
        scene.integers += cells.tolist()


def lower_basins(scene) -> None:
    """Fill the tables of basins and their patches, and states for their cells."""
    case = scene.case
    scene.basins = [Basin.physics[case.nodes[name].physics](case, name) for name in case.meshes]
    scene.basin_table = np.zeros(len(scene.basins), rec.BASIN)
    for basin, row in zip(scene.basins, scene.basin_table, strict=True):
        basin.lower_common(scene, row)
    patches = [(name, place) for name, place in case.places.items() if place.kind == "patch"]
    scene.patch_table, names = np.zeros(len(patches), rec.PATCHES), list(case.meshes)
    for row, (name, place) in zip(scene.patch_table, patches, strict=True):
        row["basin"], row["node"] = names.index(place.basin), scene.node_index[name]
        scene.basins[row["basin"]].lower_patch(scene, place.patch, row)


def at_start(basins: list[Basin], size: int) -> np.ndarray:
    """States at the start: no deviation from the profile but where basins start from one."""
    found: Any = np.zeros(size)
    for basin in basins:
        basin.of(found)[:] = basin.start()
    return found

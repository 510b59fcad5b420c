"""Parts of a model with a mesh of cells in a plane: what the core asks of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

if TYPE_CHECKING:
    from fvsolve.core.mesh.mesh import Mesh


class MeshedPart:
    """Part whose state is divided into cells of a mesh, see `Feature.meshed`.

    name : of the part in the case; part, mesh : its keys, and its mesh; n : number of its cells
    is_grid : True if the mesh is a full rectangle; quantities : names of the states of each cell
    courant_factor : rate that limits its steps over its wave rate
    has_constant_speed : True if the wave speed and the sizes of cells are the same in all states
    records_maxima : True if the greatest values of its cells are recorded
    row_size : number of cells of a row, which threads share; the last row may have fewer
    undivided_reason : reason why its rows cannot be distributed over threads; "" if they can
    states_per_cell : number of states in each cell, with scalars
    first_state : number of its first state; the states of its cells lie side by side, quantity by quantity
    forms_stages : True if the kernel of the rates of cells can form sums of stages too, because nothing is added to its
    rates later; rows at nodes, to which many functions add, are excepted: their sums are formed elsewhere
    margin : rows at an edge of a band that functions of other bands read or change
    Arguments of the methods: y : deviations of cells from rest, float64[quantities, n], or the states of the model,
    where so stated; out, layout : output array of the right-hand side, and the places of its parts
    """

    name: str
    part: Any
    mesh: Mesh
    n: int
    is_grid: bool
    quantities: tuple[str, ...]
    units: ClassVar[dict[str, str]] = {}  # of fields
    courant_factor: float = 1.0
    has_constant_speed: bool = False
    records_maxima: bool = False
    row_size: int
    undivided_reason: str
    states_per_cell: int
    first_state: int
    forms_stages: bool = False
    margin: ClassVar[int] = 0
    # greatest possible rate of its waves where that is known, which limits steps [1/s]
    full_rate: float = 0.0

    def deviations(self, y: np.ndarray) -> np.ndarray:
        """Deviations of quantities of cells from rest at the states y of the model : float64[quantities, n]."""
        raise NotImplementedError

    # steps ----------

    def max_rate(self, y: np.ndarray) -> tuple[float, float]:
        """(greatest rate of waves or flows at a state y of the model [1/s], fraction of it by motion along x).

        The fraction is 1 on meshes other than grids.
        """
        raise NotImplementedError

    @property
    def has_waves(self) -> bool:
        """True if the part has waves, and not only scalars in a given velocity."""
        return bool(self.quantities)

    def filling_step(self) -> float:
        """Longest explicit step while no wave limits steps, at Courant number 1 [s]."""
        return math.inf

    def watches(self, y: np.ndarray) -> list[Any]:
        """Checks (`ErrorWatch`) of a run that starts from the deviations y of cells."""
        return []

    # rows of cells, which threads share ----------

    @property
    def row_count(self) -> int:
        """Number of rows."""
        return -(-self.n // self.row_size)

    def row_text(self, count: int) -> str:
        """Number of rows as a text, with their name."""
        raise NotImplementedError

    def cells_of_rows(self, first: int, stop: int) -> tuple[int, int]:
        """(first, last + 1) of the cells of the rows from `first` to `stop` - 1."""
        return min(first * self.row_size, self.n), min(stop * self.row_size, self.n)

    def states_of_rows(self, q: int, first: int, stop: int) -> tuple[int, int]:
        """(first state, last state + 1) of the rows from `first` to `stop` - 1 of quantity q."""
        begin, end = self.cells_of_rows(first, stop)
        at = self.first_state + q * self.n
        return at + begin, at + end

    def rows_read(self, first: int, stop: int) -> tuple[int, int]:
        """(first, last + 1) of the rows whose values the rates of the rows from `first` to `stop` - 1 read."""
        raise NotImplementedError

    def common_cells(self, tables) -> Iterator[np.ndarray]:
        """Yield the numbers of cells that all bands read, as arrays; tables : tables of the model"""
        yield from ()

    def boundary_rows(self) -> tuple[int, np.ndarray]:
        """(offset in `work` of the flows through its open boundary, row of each); a negative offset for none."""
        return -1, np.zeros(0, dtype=int)

    def maxima_of_rows(self, first: int, stop: int) -> list[slice]:
        """Ranges of the array `maxima` that the rows from `first` to `stop` - 1 write."""
        return []

    def band(self, first: int, stop: int) -> tuple[int, int]:
        """Entries of the array `bands` for the rows from `first` to `stop` - 1."""
        raise NotImplementedError

    def bounds(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield bounds of its states, see `model.state_bounds`."""
        yield from ()

    # energy ----------

    def weights(self, y: np.ndarray) -> np.ndarray:
        """Weights w, for which a small deviation d from y stores the energy w d^2 [J] : float64[quantities, n]."""
        return np.tile(0.5 * self.mesh.area, (len(self.quantities), 1))

    def energy_of_waves(self, y: np.ndarray) -> float:
        """Energy at deviations y [J], relative to the same amount of fluid at rest and level: scale of its waves."""
        return 0.0

    def above(self, y: np.ndarray, datum: float) -> float:
        """Energy at deviations y [J], relative to water at rest with its surface at the elevation `datum`.

        Where the bed is above that surface, it is relative to a dry bed. For a liquid it is relative to rest at the
        potential 0, that is p - p_ambient + rho g z = 0 with z above `datum`.
        """
        return 0.0

    def mass(self) -> tuple[float, np.ndarray]:
        """(mass in the initial steady state [kg], float64[n] mass of each cell per deviation of its first quantity)."""
        return 0.0, np.zeros(self.n)

    # output ----------

    def fields(self, y: np.ndarray) -> dict[str, np.ndarray]:
        """Output fields by name, with a value (a vector of three for the velocity) for each cell, in SI units."""
        return {}

    def maxima(self, t: float, recorded: np.ndarray) -> dict[str, np.ndarray]:
        """Quantities `maxima` of its physics up to time t [s] by name : float64[n] in SI.

        recorded : array `maxima` of a run
        """
        return {}

    def node_points(self) -> dict[str, np.ndarray]:
        """Point in its plane of each node at its faces, by the name of the node : float64[2] [m]."""
        return {}

    def ground(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Elevation of the bottom of the part at points (x, y) of its plane [m]."""
        return np.full(x.shape, self.part.elevation or 0.0)

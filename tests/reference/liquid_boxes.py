"""Rectangles of liquid: rates of the kernels of grids, and random states."""

import math
from dataclasses import dataclass, field

import numpy as np

from fvsolve.core.kernels.dtypes import (
    LINEAR,
    MINMOD,
    MONOTONIZED_CENTRAL,
    MUSCL,
    UPWIND,
    VAN_LEER,
    WENO5,
)
from fvsolve.features.basins.liquid import liquid_grid
from fvsolve.features.basins.liquid.liquid_sides import (
    LiquidGrid,
    LiquidScheme,
    side_kinds,
    work_size,
)

SCHEMES = {"upwind": UPWIND, "muscl": MUSCL, "upwind5": LINEAR, "weno5": WENO5}
LIMITERS = {"minmod": MINMOD, "van-leer": VAN_LEER, "monotonized-central": MONOTONIZED_CENTRAL}
C, RHO = 10.0, 1000.0
WALLS = np.zeros(0)


@dataclass(frozen=True)
class Box:
    """Rectangle of cells; states are arrays [3, ny, nx] of density deviation and two mass-flow densities."""

    nx: int
    ny: int
    scheme: str
    size: tuple[float, float] = (1.0, 1.0)
    log: bool = False
    limiter: str = "monotonized-central"
    reflect: np.ndarray | float = field(default_factory=lambda: WALLS)  # a number is for all sides
    stretch: float = 0.0  # cell edges at s + stretch sin(2 pi s) / (2 pi) of the size

    def edges(self) -> tuple[np.ndarray, np.ndarray]:
        """Edges of columns and of rows [m]."""
        x, y = (
            size * np.arange(n + 1) / n
            + size * self.stretch * np.sin(2 * np.pi * np.arange(n + 1) / n) / (2 * np.pi)
            for n, size in zip((self.nx, self.ny), self.size, strict=True)
        )
        return x, y

    def rates(self, state: np.ndarray, table: np.ndarray | None = None) -> tuple[np.ndarray, float]:
        """Return (rates, greatest rate); work starts as NaN, to detect values that are read before they are written."""
        kx, ky = (1.0 / np.diff(e) for e in self.edges())
        reflect = self.reflect
        if isinstance(reflect, float):
            reflect = np.full(2 * (self.nx + self.ny), reflect)
        small = 1e-18 * C**2 * (1.0 if self.log else RHO**2)
        fluid = LiquidScheme(
            C, RHO, table, self.log, SCHEMES[self.scheme], LIMITERS[self.limiter], small, 1.0
        )
        grid = LiquidGrid(
            self.nx, self.ny, 0, self.ny, kx, ky, reflect, side_kinds(reflect, self.nx, self.ny)
        )
        work, found = np.full(work_size(self.nx), np.nan), np.full((3, self.nx * self.ny), np.nan)
        states = tuple(np.ascontiguousarray(state).reshape(3, -1))
        kernel = liquid_grid.nonlinear_grid_rates if self.log else liquid_grid.linear_grid_rates
        rate = kernel(fluid, grid, states, WALLS, work, tuple(found), None, None)
        return found.reshape(state.shape), rate

    def run(self, state: np.ndarray, end: float, courant: float = 0.8) -> np.ndarray:
        """State at `end` by RK4 with equal steps."""
        steps = math.ceil(end * self.rates(state)[1] / courant)
        h = end / steps
        for _ in range(steps):
            k1 = self.rates(state)[0]
            k2 = self.rates(state + 0.5 * h * k1)[0]
            k3 = self.rates(state + 0.5 * h * k2)[0]
            state = state + h / 6.0 * (k1 + 2.0 * (k2 + k3) + self.rates(state + h * k3)[0])
        return state

    def averages(self, function, points: int = 5) -> np.ndarray:
        """Cell averages of function(x, y) -> (r, m, n) by Gauss points."""
        nodes, weights = np.polynomial.legendre.leggauss(points)
        (x, wx), (y, wy) = (
            (
                (e[:-1, None] + np.diff(e)[:, None] * (nodes + 1) / 2).ravel(),
                np.tile(weights / 2, len(e) - 1),
            )
            for e in self.edges()
        )
        values = np.array(np.broadcast_arrays(*function(*np.meshgrid(x, y)))) * np.outer(wy, wx)
        return values.reshape(3, self.ny, points, self.nx, points).sum(axis=(2, 4))


def noise(box: Box, size: float = 1.0) -> np.ndarray:
    """Random independent values in all cells, up to `size` of the scales of density and mass flow."""
    numbers = np.random.default_rng(7).uniform(-size, size, (3, box.ny, box.nx))
    return numbers * (RHO * np.array([1.0, C, C])[:, None, None])

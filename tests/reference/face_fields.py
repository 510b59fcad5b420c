"""Fields on meshes of distorted cells with the rates of the kernels, and their steps."""

import math
from dataclasses import dataclass

import numpy as np

from fvsolve.core.kernels.dtypes import LAW_LOG
from fvsolve.core.mesh import Mesh, read, rectangle
from fvsolve.core.schemes import LIMITERS
from fvsolve.features.basins import advection_faces
from fvsolve.features.basins.cell_sides import STEEPEST
from fvsolve.features.basins.free_surface import surface_mesh
from fvsolve.features.basins.free_surface.surface_rates import water_mesh_rates
from fvsolve.features.basins.liquid import liquid_mesh
from fvsolve.features.basins.liquid.liquid_rates import mesh_rates
from fvsolve.features.basins.liquid.liquid_sides import LiquidScheme
from fvsolve.features.basins.lower_motion import lower_mesh
from fvsolve.features.basins.mesh_blocks import work_size
from reference.meshes import corner_lists, write

G, C, RHO = 9.8, 10.0, 1000.0
WIDE = LIMITERS["van-leer"].overshoot
NONE, FREE = np.zeros(0), (-math.inf, math.inf)


@dataclass
class Field:
    """Mesh with its lowered arrays, and rates of the kernels on it."""

    mesh: Mesh

    def __post_init__(self):
        self.floats, self.integers = lower_mesh(self.mesh)
        self.bounded, _ = lower_mesh(self.mesh, STEEPEST)  # of liquids
        self.centre, self.area = self.mesh.centre, self.mesh.area
        self.edge = self.mesh.middle[self.mesh.inner :]
        self.band = 0, len(self.area)

    def lake(self, bed) -> np.ndarray:
        """Return (depth, dry height) of a lake at level 0 over a bed."""
        return np.stack([np.maximum(-bed, 0.0), np.maximum(bed, 0.0)])

    def shallow(self, scheme, plan, y, reflect=NONE, flow=NONE, wide=WIDE):
        """Return (rates, greatest rate); work starts as NaN, to detect values that are read before they are written."""
        work, found = (
            np.full(work_size(surface_mesh, self.integers), np.nan),
            np.full_like(y, np.nan),
        )
        kerbs, wide = (
            surface_mesh.kerbs_of(self.mesh, plan[1] - plan[0]),
            min(wide, surface_mesh.MOST_OVERSHOOT),
        )
        water, states = (
            surface_mesh.MeshWater(G, scheme, wide, plan, kerbs, None),
            tuple(np.ascontiguousarray(y)),
        )
        rate = water_mesh_rates(
            water,
            self.floats,
            self.integers,
            reflect,
            states,
            flow,
            NONE,
            work,
            tuple(found),
            self.band,
            None,
            None,
        )
        return found, rate

    def liquid(self, law, scheme, y, reflect=NONE, wide=WIDE, table=None):
        work, found = (
            np.full(work_size(liquid_mesh, self.integers), np.nan),
            np.full_like(y, np.nan),
        )
        fluid = LiquidScheme(
            C, RHO, table, table is not None or law == LAW_LOG, scheme, 0, 0.0, wide
        )
        states = tuple(np.ascontiguousarray(y))
        return found, mesh_rates(
            fluid,
            self.bounded,
            self.integers,
            reflect,
            states,
            NONE,
            NONE,
            work,
            tuple(found),
            self.band,
            None,
            None,
        )

    def advection(
        self, scheme, flow, s, outside=None, depth=NONE, diffusivity=0.0, wide=WIDE, bounds=FREE
    ):
        work, found = (
            np.full(advection_faces.work_size(self.integers), np.nan),
            np.full_like(s, np.nan),
        )
        outside = np.zeros(len(self.edge)) if outside is None else outside
        flows, mesh = advection_faces.MeshFlows(1.0, flow, outside), (self.floats, self.integers)
        return found, advection_faces.advection_rates(
            scheme, wide, diffusivity, mesh, flows, depth, bounds, s, work, found
        )

    def stream(self, psi) -> np.ndarray:
        """Return flows through faces by a stream function, which have no divergence."""
        at = psi(*self.mesh.points.T)
        return at[self.mesh.ends[:, 1]] - at[self.mesh.ends[:, 0]]


def march(rates, y, end, courant, seen=lambda y: None):
    """Integrate (rates, greatest rate) = rates(y) to `end` by ssp-rk2 at a Courant number."""
    t = 0.0
    while t < end:
        k, rate = rates(y)
        step = min(courant / rate, end - t)
        y = 0.5 * (y + (one := y + step * k) + step * rates(one)[0])
        seen(y)
        t = end if t + step >= end else t + step
    return y


def triangles(path, nx, ny, size=(1.0, 1.0), shake=0.2, angle=0.0, quads=False) -> Field:
    """Return a rectangle of distorted triangles, or quadrilaterals if `quads` is True, rotated and read from a file.

    shake : displacement of inner points over the size of cells; angle : rotation [rad]
    """
    mesh = rectangle(size, (nx, ny))
    points, width = mesh.points.copy(), np.array(size) / (nx, ny)
    inside = ((points > 0.5 * width) & (points < np.array(size) - 0.5 * width)).all(1)
    points[inside] += width * np.random.default_rng(nx).uniform(-shake, shake, (inside.sum(), 2))
    turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    cells = corner_lists(mesh)
    cut = (
        cells
        if quads
        else [
            c
            for k, (p, q, r, s) in enumerate(cells)
            for c in ([[p, q, r], [p, r, s]] if k % 2 else [[p, q, s], [q, r, s]])
        ]
    )
    return Field(read(write(path / f"{nx}x{ny}{quads}.vtk", points @ turn.T, cut)))

"""Rows of the tables of a model for water with a free surface over a bed; states deviate from the lake at rest."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.basins import mesh_blocks
from fvsolve.basins.basin_terms import FRAME_FORCES, SHORTAGES
from fvsolve.basins.free_surface import lower_notices, surface_grid, surface_mesh
from fvsolve.basins.free_surface.bed_friction import RATE_CAP
from fvsolve.basins.free_surface.surface_patches import DEPTH
from fvsolve.basins.free_surface.surface_rows import THIN
from fvsolve.basins.lower_basin import BasinRows
from fvsolve.case.bodies import free_joints
from fvsolve.errors import Notice
from fvsolve.kernels import dtypes as rec
from fvsolve.kernels.rhs_assembly import RhsTerms
from fvsolve.parts.formula import means, samples
from fvsolve.steppers.analysis.stability_properties import in_euler_steps
from fvsolve.steppers.tableau import AUTO, METHODS

PACKAGE = __package__
WATER_TERMS = RhsTerms(
    package=PACKAGE,
    prepare="surface_patches: patch_pressures",
    boundary_inflow="surface_patches: patch_flows",
    observe="surface_patches: observe_water",
    power="surface_energy: add_power",
    stored="surface_energy: add_stored",
)
DEPTH_SCALE = 0.1  # [m] of depth
ROUNDING = 1e-12  # depth over levels and beds below which there is no water
TINY = 1e-300
NO_CAP = 1e100  # rate of friction [1/s] above all possible rates
COURANT_FACTOR = 2.0  # Courant numbers of water refer to half cells, so that no depth falls below zero at 1,
SHORE_COURANT_FACTOR = 6.0  # and to sixths of cells under fifth order with a shore


def depth_at_start(level: np.ndarray, bed: np.ndarray) -> np.ndarray:
    """Depth of the water at the start in each cell, whose bed is replaced by its mean : float64[n] [m].

    It is the mean of max(level - bed, 0). If a part of the cell is dry and the water in it has a uniform level, it is
    instead the height of this level above the mean bed, at least 0, because the water then stays at rest. If the level
    varies in the cell, this correction is reduced, to zero where the level varies as much as the bed.
    level, bed : `samples` of both in cells
    """
    deep = level - bed
    wet = deep > ROUNDING * (np.abs(level) + np.abs(bed))
    deep, flooded = np.where(wet, deep, 0.0), wet.any(axis=0)
    low, high = np.where(wet, level, np.inf).min(axis=0), np.where(wet, level, -np.inf).max(axis=0)
    middle = means(np.where(wet, level, 0.0)) / np.where(flooded, means(1.0 * wet), 1.0)
    middle = np.where(flooded, np.where(high > low, middle, low), -np.inf)
    still, there = np.maximum(middle - means(bed), 0.0), means(np.maximum(middle - bed, 0.0))
    rise = np.where(flooded, high - low, 0.0)
    follows = np.minimum(rise / np.maximum(np.ptp(bed, axis=0), TINY), 1.0)
    return np.maximum(still + (means(deep) - there) - follows * (still - there), 0.0)


class FreeSurfaceRows(BasinRows):
    """Rows of the tables of a model for shallow water; states are deviation of depth [m] and flows per width [m2/s]."""

    units = {"depth": "m", "surface": "m", "bed": "m", "velocity": "m/s"}
    deep, has_wide_closure, banded = True, False, True

    def __init__(self, case, name: str) -> None:
        super().__init__(case, name)
        self.bed = self.formula(self.part.bed)
        self.depth = np.maximum(self.part.level - self.bed, 0.0)

    def pieces(self, valves: bool) -> Iterator[RhsTerms]:
        kind = f"{'moving_' if self.moves else ''}{'grids' if self.is_grid else 'meshes'}"
        yield RhsTerms(package=PACKAGE, rates=f"surface_rates: water_{kind}")
        yield WATER_TERMS
        if self.part.on is not None:
            yield FRAME_FORCES
        if self.damped:
            yield RhsTerms(package=PACKAGE, damp="surface_rates: damp_stages")
        if self.moves:
            yield RhsTerms(
                package=PACKAGE, power="surface_energy: add_wall_power", stored="surface_energy: add_wall_stored"
            )
        yield SHORTAGES
        if valves:
            yield RhsTerms(package=PACKAGE, rate_limits="surface_patches: limit_inflow_rate")

    @property
    def forms_stages(self) -> bool:
        return not (self.undivided_reason or self.scalars)

    def scales(self) -> list[float]:
        flow = DEPTH_SCALE * np.sqrt(self.case.gravity * DEPTH_SCALE)
        return [DEPTH_SCALE, flow, flow]

    def lower(self, draft, row) -> None:
        plan = np.zeros((surface_grid.PLANS, self.n))
        plan[0], plan[1] = self.depth, np.maximum(self.bed - self.part.level, 0.0)
        part, weight = self.part, self.case.properties.density * self.case.gravity
        row["rest"] = weight * (part.level + (part.elevation or 0.0))
        if part.manning is not None or part.factor is not None:
            row["friction"] = rec.DARCY if part.manning is None else rec.MANNING
            row["roughness"] = part.factor if part.manning is None else part.manning
            row["held"], row["damped"] = self.rate_cap, self.damped
        if self.is_grid:
            self.lower_grid(draft, row)
        else:
            self.lower_faces(draft, row)
        row["plan"] = draft.to_plane(plan)
        if not (self.depth + self.start()[0]).max() > 0.0:
            amount = draft.case.amount
            text = f"basin {self.name} starts dry: level {amount(part.level, 'level')} is not above its bed, lowest at "
            text += amount(float(self.bed.min()), "level")
            draft.warnings.append(Notice("start", f"nodes.{self.name}", text, "level", part.level, self.bed.min()))

    @property
    def rubs(self) -> bool:
        """True if the bed has friction."""
        return self.part.physics_type.has_friction(self.part)

    @property
    def damped(self) -> bool:
        """True if the rates of Runge-Kutta stages are divided by 1 + h R for bed friction, see `damp_flows`.

        This is the case for SSP methods, unless forces move the body that carries the basin.
        """
        method, on = METHODS.get(self.case.numerics.method), self.part.on
        is_moved_by_forces = on is not None and any(free_joints(on, self.case.nodes))
        return self.rubs and method is not None and in_euler_steps(method) and not is_moved_by_forces

    @property
    def has_rate_cap(self) -> bool:
        """True if the decay rate of flows by friction is capped at RATE_CAP, so that explicit steps can follow it."""
        method = METHODS.get(self.case.numerics.method)
        return self.rubs and method is not None and method.explicit and not self.damped

    @property
    def rate_cap(self) -> float:
        """Cap of the decay rate of flows by friction [1/s]; without a cap inf, or NO_CAP with the method `auto`.

        A finite cap also makes friction limit the time step.
        """
        if self.has_rate_cap:
            return RATE_CAP
        return NO_CAP if self.case.numerics.method == AUTO else math.inf

    def lower_grid(self, draft, row) -> None:
        dry = not (self.depth.min() > 0.0 and (self.depth + self.start()[0]).min() > 0.0)
        row["unsplit"] = SHORE_COURANT_FACTOR if dry and self.is_fifth_order else COURANT_FACTOR
        row["work"] = draft.to_work(surface_grid.MOVING if self.moves else surface_grid.WORK)

    def lower_faces(self, draft, row) -> None:
        row["unsplit"] = COURANT_FACTOR
        row["work"] = draft.to_work(mesh_blocks.work_size(surface_mesh, self.integers))

    def start(self, attitude: np.ndarray | None = None) -> np.ndarray:
        states, given = np.zeros((3, self.n)), self.part.start
        depth = self.depth
        if self.part.on is not None:
            from fvsolve.basins.lower_motion import level_at_start

            depth = level_at_start(self, attitude)
            states[0] = depth - self.depth
        if given is not None and given.level is not None:
            depth = depth_at_start(samples(given.level, self.mesh), samples(self.part.bed, self.mesh))
            states[0] = depth - self.depth
        if given is not None:
            states[1], states[2] = depth * self.formula(given.u), depth * self.formula(given.v)
        return states

    def fields(self, y: np.ndarray) -> dict[str, np.ndarray]:
        depth = np.maximum(self.depth + y[0], 0.0)
        bed, wet = self.bed + (self.part.elevation or 0.0), np.maximum(depth, THIN)
        share = 2.0 * depth / (depth * depth + wet * wet)
        velocity = np.column_stack([share * y[1], share * y[2], np.zeros(self.n)])
        return {"depth": depth, "bed": bed, "surface": bed + depth, "velocity": velocity}

    def speeds(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return self.fields(y)["velocity"], np.sqrt(self.case.gravity * self.depth_of(y))

    def ground(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return super().ground(x, y) + (0.0 if self.part.bed is None else self.part.bed.at(x, y))

    def ranges(self) -> dict[str, tuple[float, float]]:
        depth = self.depth + self.start()[0]
        low, high = float(depth.min()), float(depth.max())
        speeds = np.sqrt(self.case.gravity * np.array([low, high]))
        return {"depth": (low, high), "wave_speed": (float(speeds[0]), float(speeds[1]))}

    def lower_probe(self, row, field: str, cells: np.ndarray, weights: np.ndarray) -> None:
        if field not in ("depth", "surface", "bed"):
            return super().lower_probe(row, field, cells, weights)
        row["side"], row["scale"] = DEPTH, float(field != "bed")
        if field != "depth":
            row["offset"] = weights @ self.bed[cells] + (self.part.elevation or 0.0)

    def at_rest(self) -> np.ndarray:
        return self.depth

    def thrust_at_rest(self) -> np.ndarray:
        return 0.5 * self.case.properties.density * self.case.gravity * self.depth**2

    def mass(self) -> tuple[float, np.ndarray]:
        per = self.case.properties.density * self.mesh.area
        return float(np.sum(per * self.depth)), per

    def weights(self, y: np.ndarray) -> np.ndarray:
        per, depth = self.case.properties.density * self.mesh.area, np.maximum(self.depth + y[0], THIN)
        return np.array([0.5 * self.case.gravity * per, 0.5 * per / depth, 0.5 * per / depth])

    def above(self, y: np.ndarray, datum: float) -> float:
        depth, bed = np.maximum(self.depth + y[0], 0.0), self.bed + (self.part.elevation or 0.0) - datum
        height = 0.5 * self.case.gravity * ((bed + depth) ** 2 - np.maximum(bed, 0.0) ** 2)
        wet = np.maximum(depth, THIN)
        moves = depth / (depth**2 + wet**2) * (y[1] ** 2 + y[2] ** 2)
        return float(self.case.properties.density * np.sum(self.mesh.area * (height + moves)))

    def notices(self, y: np.ndarray) -> list[Notice]:
        waves, bodies = lower_notices.wave_notices(self, y), lower_notices.body_notices(self)
        return [*waves, *bodies, *lower_notices.film_notices(self, y)]

    def watches(self, y: np.ndarray) -> list[Any]:
        return [*lower_notices.wave_watches(self, y), *lower_notices.film_watches(self, y)]

    def depth_of(self, y: np.ndarray) -> np.ndarray:
        return np.maximum(self.depth + y[0], 0.0)

    def mass_per_depth(self) -> np.ndarray:
        return self.case.properties.density * self.mesh.area

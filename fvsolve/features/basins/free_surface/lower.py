"""Rows of the tables of a model for water with a free surface over a bed; states deviate from the lake at rest."""

import math
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np

from fvsolve.case.basins import patch_names
from fvsolve.core.assembly.lowering import Restriction
from fvsolve.core.assembly.state_names import Numbered
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.rhs_assembly import RhsTerms
from fvsolve.core.kernels.structures import FACE_SHARE
from fvsolve.errors import Notice
from fvsolve.features.basins import mesh_blocks
from fvsolve.features.basins import tables as records
from fvsolve.features.basins.basin_terms import FRAME_FORCES, SHORTAGES
from fvsolve.features.basins.free_surface import (
    law_patch_face,
    patch_closures,
    surface_grid,
    surface_maxima,
    surface_mesh,
    water_sources,
)
from fvsolve.features.basins.free_surface.bed_friction import add_friction
from fvsolve.features.basins.free_surface.lower_error_checks import error_notices, error_watches
from fvsolve.features.basins.free_surface.lower_marks import (
    Marks,
    chain_texts,
    lower_marks,
    marks_of,
)
from fvsolve.features.basins.free_surface.lower_notices import inflow_watches, unusual_values
from fvsolve.features.basins.free_surface.surface_patches import DEPTH, TOTALS
from fvsolve.features.basins.free_surface.surface_rows import THIN
from fvsolve.features.basins.lower_friction import RowsWithFriction
from fvsolve.parts.field_series import SpatialSeries
from fvsolve.parts.formula import SpatialField, means, samples
from fvsolve.parts.schedule import Schedule

FILLING_DEPTH = 0.1  # depth of water that flows into dry cells, for the first step [m]
PACKAGE = __package__
WATER_TERMS = RhsTerms(
    package=PACKAGE,
    prepare="surface_patches: patch_pressures",
    boundary_inflow="surface_patches: patch_flows",
    observe="surface_patches: observe_water",
    power="surface_energy: add_power",
    stored="surface_energy: add_stored",
)
DRIVEN_TERMS = RhsTerms(
    package=PACKAGE,
    move="patch_closures: close_patches",  # before the rates of cells
    observe="patch_closures: observe_froude",
)
DEPTH_SCALE = 0.1  # [m] of depth
HEIGHT_SCALE = 1e-3  # [m] of rain and infiltrated water
INCH = 0.0254  # unit of the potential storage 1000 / CN - 10 of the SCS [m]
TIME_SCALE = 10.0  # [s] of condensed times of soils
ROUNDING = 1e-12  # depth over levels and beds below which there is no water
TINY = 1e-300
CLOSURES = {  # key of a driven patch, or word of its key `boundary` -> code
    "stage": records.STAGE,
    "discharge": records.DISCHARGE,
    "rating": records.RATING,
    "normal_slope": records.NORMAL_SLOPE,
    "critical": records.CRITICAL,
}
# Courant numbers of water refer to half cells, so that no depth falls below zero at 1,
COURANT_FACTOR = 2.0
SHORE_COURANT_FACTOR = 6.0  # and to sixths of cells under fifth order with a shore


def soil_numbers(model: str, fields: list[np.ndarray]) -> tuple[int, np.ndarray]:
    """(code of a soil, its numbers : float64[rows, cells]) as `water_sources.limit_infiltration` reads them.

    fields : values of the keys of its model in cells. The numbers of a uniform soil are those of CHUNK cells.
    """
    if all(np.ptp(values) == 0.0 for values in fields):
        fields = [np.full(water_sources.CHUNK, values[0]) for values in fields]
    if model == "constant":
        return records.CONSTANT_RATE, np.array(fields)
    if model == "green-ampt":
        conductivity, suction, deficit = fields
        store, ponded = suction * deficit, conductivity * water_sources.EARLY
        return records.GREEN_AMPT, np.array(
            [conductivity, store, np.sqrt(2.0 * store * ponded) + ponded]
        )
    if model == "curve-number":
        number, *loss = fields
        storage = INCH * (1000.0 / number - 10.0)
        return records.CURVE_NUMBER, np.array([storage, *(loss or [np.zeros_like(number)])])
    initial, final, decay = fields
    return records.HORTON, np.array([final, initial - final, decay])


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


class PatchFaceRows(Restriction, kind="patch-face"):
    """Conversion to table rows of the faces of patches that links join: restrictions with their own law."""

    law = law_patch_face

    def restriction(self, draft, name, link, row) -> None:
        row["conductance"] = draft.fluid.density * link.length**2 * DEPTH_SCALE**2
        row["chained"] = 1  # the links at the junction limit its rate
        row["level_start"] = 1
        # unlike that of valves without a shaft: the velocity in the cells may change alone
        row["drive"] = 1.0

    def numbers(self, draft, name, link) -> list[float]:
        return [0.0] * law_patch_face.NUMBERS  # written by `lower_patch`

    def stepper(self, start, k: int, g: float, density_ratio: float):
        """Function as in `Restriction.stepper`, for water at rest."""
        link = start.case.conduits[start.draft.valve_names[k]]
        basin = next(basin for basin in start.draft.meshed if basin.name == link.basin)
        faces = basin.faces_at_rest(link.patch)
        gravity = start.case.gravity
        rho = start.draft.fluid.density
        rest = max(float(faces[1].min()), 0.0)

        def step(flow, drop):
            z = rest + float(drop) / (rho * gravity)
            firm = FACE_SHARE * rec.FIRM_SLOPE
            a, s = law_patch_face.level_step(gravity, faces, z, float(flow) / rho, firm)
            return rho * a, s / gravity

        return step


class FreeSurfaceRows(RowsWithFriction):
    """Rows of the tables of a model for shallow water; states are deviation of depth [m] and flows per width [m2/s]."""

    units = {"depth": "m", "surface": "m", "bed": "m", "velocity": "m/s"}
    deep, has_wide_closure, banded, banded_mesh = True, False, True, True
    fades = THIN

    def __init__(self, case, name: str) -> None:
        super().__init__(case, name)
        self.bed = self.formula(self.part.bed)
        self.depth = np.maximum(self.part.level - self.bed, 0.0)

    def pieces(self, valves: bool) -> Iterator[RhsTerms]:
        kind = f"{'moving_' if self.moves else ''}{'grids' if self.is_grid else 'meshes'}"
        of_faces = "marked_" if self.marks.faces.size else "driven_" if self.driven else ""
        yield RhsTerms(package=PACKAGE, rates=f"surface_rates: water_{of_faces}{kind}")
        yield WATER_TERMS
        if self.sections:
            yield RhsTerms(package=PACKAGE, observe="marked_faces: observe_sections")
        if self.driven:
            yield DRIVEN_TERMS
        if self.part.on is not None:
            yield FRAME_FORCES
        if self.damped:
            yield RhsTerms(package=PACKAGE, damp="surface_rates: damp_stages")
        if self.moves:
            yield RhsTerms(
                package=PACKAGE,
                power="surface_energy: add_wall_power",
                stored="surface_energy: add_wall_stored",
            )
        if self.records_maxima:
            yield RhsTerms(package=PACKAGE, record="surface_maxima: record_maxima")
        yield SHORTAGES
        if valves:
            yield RhsTerms(package=PACKAGE, rate_limits="surface_patches: limit_inflow_rate")

    @cached_property
    def marks(self) -> Marks:
        """Faces of walls and sections."""
        return marks_of(self)

    def chain_texts(self) -> list[str]:
        return list(chain_texts(self))

    @property
    def forms_stages(self) -> bool:
        return self.is_grid and not (self.undivided_reason or self.scalars)

    @property
    def rains(self) -> bool:
        return self.part.rain is not None

    @property
    def soil(self):
        return self.part.infiltration

    @property
    def soil_states(self) -> int:
        return (
            0 if self.soil is None else 1 if self.soil.model in ("constant", "curve-number") else 2
        )

    def lower_sources(self, draft, row) -> None:
        row["present"] = draft.to_work(water_sources.PRESENT_NUMBERS)
        row["source"] = sum(len(other.source_names) for other in draft.meshed[: self.number])
        if self.soil is not None:  # right after the states of cells
            row["soil"], numbers = soil_numbers(
                self.soil.model, [self.formula(shape) for shape in self.soil.shapes]
            )
            row["soil_numbers"], row["soil_row"] = draft.to_plane(numbers), numbers.shape[1]
            row["soil_work"] = draft.to_work(2 * self.n + water_sources.CHUNK)
            row["infiltrated"] = draft.states(
                Numbered(f"{self.name}.infiltrated", self.n), HEIGHT_SCALE
            )
            if self.soil_states > 1:
                draft.states(Numbered(f"{self.name}.condensed_time", self.n), TIME_SCALE)
        rain = self.part.rain
        if self.rains:
            if isinstance(rain, SpatialSeries):
                frames, times = rain.over(self.mesh), rain.times + self.case.numerics.start
                row["frames"], row["frame_rates"] = len(frames), draft.to_plane(frames)
                kind = "linear" if len(frames) > 1 else "constant"
                row["frame_position"] = draft.schedules.add(
                    Schedule(kind, times, np.arange(len(frames)))
                )
                breaks = draft.schedules.breaks
                # slopes in cells change at all frames
                breaks |= {t: breaks.get(t, False) for t in times.tolist()}
                rain = Schedule(kind, times, frames @ self.mesh.area / self.mesh.area.sum())
            row["rain"] = draft.schedules.add(rain)
            row["rained"] = draft.states(Numbered(f"{self.name}.rained", 1), HEIGHT_SCALE)

    def mass_in_soil(self, y: np.ndarray) -> float:
        at = int(self.row["infiltrated"])
        return float(self.mass_per_depth() @ y[at : at + self.n])

    def lower_patch(self, draft, patch: str, row) -> None:
        super().lower_patch(draft, patch, row)
        cells = draft.integers[row["first"] : row["first"] + row["count"]]
        row["rest"], row["depth"], row["neighbours"] = self.part.level, -1, -1
        row["lowest"] = max(float(self.bed[cells].min()) - self.part.level, 0.0)
        has_faces = f"{self.name}.{patch}" in self.case.patches_with_faces
        is_interior = patch in self.mesh.interior
        if is_interior and not has_faces:
            row["faces"] = 0  # links see its cells only
            if f"{self.name}.{patch}" not in self.places_of_links:
                text = f"basin {self.name}: no link joins the interior patch {patch}, so no water flows through it"
                draft.warnings.append(
                    Notice("patch", f"nodes.{self.name}.patches.{patch}", text, None)
                )
        if patch not in self.driven and not has_faces:
            return
        behind = np.array(draft.integers[row["ring"] + row["faces"] :][: row["faces"]])
        row["second"], row["inside"] = len(draft.integers), draft.to_work(5 * int(row["faces"]))
        row["stencil"] = patch_closures.STENCIL if self.extrapolates and not is_interior else 1
        if row["stencil"] > 1:
            cells, weights = self.mesh.extrapolation(
                patch, patch_closures.STENCIL, self.marks.walls
            )
            row["weights"] = draft.to_plane(weights)
        else:
            cells = (
                self.mesh.faces(patch).inside if is_interior else self.second_cells(patch, behind)
            )
        draft.integers += cells.ravel().tolist()
        of_triangles = self.mesh.cells[behind, 3] < 0
        # quadrilaterals, as cells of grids, have inflow of their own
        if of_triangles.any() and not is_interior:
            row["neighbours"] = len(draft.integers)
            faces = np.where(
                of_triangles, self.mesh.neighbouring_faces(patch), np.arange(behind.size)
            )
            draft.integers += faces.ravel().tolist()
        if has_faces:
            row["closure"] = records.INTERIOR if is_interior else records.LINKED
            row["valve"] = k = draft.valve_names.index(f"{self.name}.{patch}.face")
            at = int(draft.valve_table[k]["data"])
            draft.floats[at : at + law_patch_face.NUMBERS] = map(
                float, (row["lowest"], row["inside"], row["faces"])
            )
            return
        stated = self.part.patches[patch]
        row["closure"] = CLOSURES[stated.closure]
        for key, column in (("stage", "drive"), ("discharge", "drive"), ("depth", "depth")):
            if (schedule := getattr(stated, key)) is not None:
                row[column] = draft.schedules.add(schedule)
        if stated.rating is not None:
            row["numbers"] = draft.to_plane(np.array([stated.rating.level, stated.rating.flow]))
            row["points"] = len(stated.rating.level)
        if stated.normal_slope is not None:
            row["conveyance"] = draft.to_plane(
                math.sqrt(stated.normal_slope) / self.roughness[behind]
            )

    @property
    def places_of_links(self) -> set[str]:
        """Full names of the places that links join."""
        return {place for link in self.case.links.values() for place in link.ports.values()}

    def faces_at_rest(self, patch: str) -> tuple[np.ndarray, ...]:
        """(depth, surface above the level at rest, inward velocity, length) of the faces of a patch at rest."""
        faces, cells, inside, _ = self.mesh.faces(patch)
        bed = np.maximum(self.bed[cells], self.bed[inside]) - self.part.level
        return (
            np.maximum(-bed, 0.0),
            np.maximum(bed, 0.0),
            np.zeros(cells.size),
            self.mesh.length[faces],
        )

    @property
    def extrapolates(self) -> bool:
        """True if states at driven faces follow from cells around the cells behind them."""
        return bool(self.driven) and not (self.is_grid or self.moves or self.scheme == "upwind")

    def second_cells(self, patch: str, behind: np.ndarray) -> np.ndarray:
        """Cells next inside the cells `behind` the faces of a patch; the same cells at a wall, and with upwind."""
        if not self.is_grid or self.scheme == "upwind":
            return behind
        grid, (x, y) = (
            self.mesh.grid,
            -np.round(self.mesh.normal[self.mesh.patch(patch)].T).astype(int),
        )
        second = behind + x * (grid.nx > 1) + y * grid.nx * (grid.ny > 1)
        low, high = (self.mesh.left[self.marks.walls], self.mesh.right[self.marks.walls])
        apart = np.isin(
            behind * self.n + second, np.concatenate([low * self.n + high, high * self.n + low])
        )
        return np.where(apart, behind, second)

    def scales(self) -> list[float]:
        flow = DEPTH_SCALE * np.sqrt(self.case.gravity * DEPTH_SCALE)
        return [DEPTH_SCALE, flow, flow]

    def lower(self, draft, row) -> None:
        plan = np.zeros((surface_grid.PLANS, self.n))
        plan[0], plan[1] = self.depth, np.maximum(self.bed - self.part.level, 0.0)
        part, weight = self.part, self.case.properties.density * self.case.gravity
        row["rest"] = weight * (part.level + (part.elevation or 0.0))
        if part.manning is not None or part.factor is not None:
            row["friction"] = records.DARCY if part.manning is None else records.MANNING
            row["roughness"] = draft.to_plane(self.roughness)
            row["held"], row["damped"] = self.rate_cap, self.damped
        row["unsplit"] = COURANT_FACTOR
        if self.is_grid:
            dry = not (self.depth.min() > 0.0 and (self.depth + self.start()[0]).min() > 0.0)
            row["unsplit"] = SHORE_COURANT_FACTOR if dry and self.is_fifth_order else COURANT_FACTOR
            row["work"] = draft.to_work(surface_grid.MOVING if self.moves else surface_grid.WORK)
            kerbs = surface_grid.kerbs_of(self.bed.reshape(self.mesh.grid.ny, self.mesh.grid.nx))
            row["kerbs"] = draft.to_plane(kerbs)
        else:
            row["work"] = draft.to_work(mesh_blocks.work_size(surface_mesh, self.integers))
            row["kerbs"] = draft.to_plane(surface_mesh.kerbs_of(self.mesh, self.bed))
        row["plan"] = draft.to_plane(plan)
        lower_marks(draft, self, row)
        has_faces = self.driven or self.marks.faces.size
        row["driven"] = draft.to_work(patch_closures.ROWS * int(row["outer"])) if has_faces else -1
        row["wet_depth"] = self.case.output.wet_depth
        if self.records_maxima:
            rows = max(int(row["ny"]), 1)
            row["maxima_row"] = surface_maxima.QUANTITIES * (self.n // rows)
            row["maxima"] = draft.to_maxima(rows * int(row["maxima_row"]))
        if not (self.depth + self.start()[0]).max() > 0.0 and not self.fills:
            amount = draft.case.amount
            text = f"basin {self.name} starts dry: level {amount(part.level, 'level')} is not above its bed, lowest at "
            text += amount(float(self.bed.min()), "level")
            draft.warnings.append(
                Notice("start", f"nodes.{self.name}", text, "level", part.level, self.bed.min())
            )

    @property
    def fills(self) -> bool:
        """True if rain, a driven patch or a link can bring water into the basin."""
        if self.rains:
            return True
        joined, sources = self.places_of_links, self.case.patches_with_faces
        places = (f"{self.name}.{name}" for name in patch_names(self.mesh))
        return bool(self.closed) or any(place in joined or place in sources for place in places)

    @cached_property
    def roughness(self) -> np.ndarray:
        """Manning's n, or the friction factor, in cells : float64[n]."""
        stated = self.part.factor if self.part.manning is None else self.part.manning
        return self.formula(stated) if isinstance(stated, SpatialField) else np.full(self.n, stated)

    def start(self, attitude: np.ndarray | None = None) -> np.ndarray:
        states, given = np.zeros((3, self.n)), self.part.start
        depth = self.depth
        if self.part.on is not None:
            from fvsolve.features.basins.lower_motion import level_at_start

            depth = level_at_start(self, attitude)
            states[0] = depth - self.depth
        if given is not None and given.level is not None:
            depth = depth_at_start(
                samples(given.level, self.mesh), samples(self.part.bed, self.mesh)
            )
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

    def maxima(self, t: float, recorded: np.ndarray) -> dict[str, np.ndarray]:
        at, size = int(self.row["maxima"]), int(self.row["maxima_row"])
        rows = recorded[at : at + surface_maxima.QUANTITIES * self.n].reshape(-1, size)
        cells = (
            rows.reshape(len(rows), surface_maxima.QUANTITIES, -1)
            .swapaxes(0, 1)
            .reshape(-1, self.n)
        )
        depth, speed, hazard, wet, arrival, duration = cells
        bed = self.bed + (self.part.elevation or 0.0)
        values = depth, bed + depth, np.sqrt(speed), np.sqrt(hazard), arrival
        values = [*(np.where(depth > 0.0, array, np.nan) for array in values), duration + t * wet]
        return dict(zip(self.part.physics_type.maxima, values, strict=True))

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
        if field in TOTALS:
            row["side"] = TOTALS[field]
            return None
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
        per = self.case.properties.density * self.mesh.area
        depth = np.maximum(self.depth + y[0], THIN)
        return np.array([0.5 * self.case.gravity * per, 0.5 * per / depth, 0.5 * per / depth])

    def energy_of_waves(self, y: np.ndarray) -> float:
        depth = np.maximum(self.depth + y[0], 0.0)
        wet = depth > THIN
        if not wet.any():
            return 0.0
        area = self.mesh.area[wet]
        surface = (self.bed + depth)[wet]
        depth = depth[wet]
        square = (y[1][wet] ** 2 + y[2][wet] ** 2) / depth
        height = self.case.gravity * (surface - np.average(surface, weights=area)) ** 2
        return float(0.5 * self.case.properties.density * np.sum(area * (height + square)))

    def above(self, y: np.ndarray, datum: float) -> float:
        depth = np.maximum(self.depth + y[0], 0.0)
        bed = self.bed + (self.part.elevation or 0.0) - datum
        height = 0.5 * self.case.gravity * ((bed + depth) ** 2 - np.maximum(bed, 0.0) ** 2)
        wet = np.maximum(depth, THIN)
        moves = depth / (depth**2 + wet**2) * (y[1] ** 2 + y[2] ** 2)
        return float(self.case.properties.density * np.sum(self.mesh.area * (height + moves)))

    def filling_step(self) -> float:
        """Longest explicit step while no wave limits steps, at Courant number 1 [s]; infinite with a deep cell.

        It is the time in which a wave in `FILLING_DEPTH`, or in a tenth of the cell size, crosses the smallest cell.
        Water that flows into dry cells thus forms waves, which limit the next steps.
        """
        size = math.sqrt(float(self.mesh.area.min()))
        depth = min(FILLING_DEPTH, 0.1 * size)
        deep = float((self.depth + self.start()[0]).max()) > depth
        return math.inf if deep else size / math.sqrt(self.case.gravity * depth)

    def notices(self, y: np.ndarray) -> list[Notice]:
        return [*error_notices(self, y), *unusual_values(self)]

    def watches(self, y: np.ndarray) -> list[Any]:
        return [*error_watches(self, y), *inflow_watches(self)]

    def depth_of(self, y: np.ndarray) -> np.ndarray:
        return np.maximum(self.depth + y[0], 0.0)

    def friction_in_cells(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        depth = self.depth_of(y)
        zeros = np.zeros(self.n)
        law = records.DARCY if self.part.manning is None else records.MANNING
        rate = np.zeros(self.n)
        flows = (y[1], y[2])
        contents = (zeros - 1.0, zeros)
        add_friction(
            law, self.case.gravity, self.roughness, depth, zeros, flows, contents, (rate, zeros)
        )
        return depth, np.hypot(y[1], y[2]) * self.mesh.area, rate

    def mass_per_depth(self) -> np.ndarray:
        return self.case.properties.density * self.mesh.area

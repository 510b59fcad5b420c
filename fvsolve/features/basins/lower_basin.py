"""Tables of a model for basins of all types: cells, boundaries and patches."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from fvsolve.case.basins import boundary_cells, patch_names
from fvsolve.case.sections import DEFAULT_COURANT as COURANT
from fvsolve.core.assembly.scheme_codes import code_of_limiter, family
from fvsolve.core.assembly.state_names import Numbered
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.state_bounds import NO_STATE, bound_rows
from fvsolve.core.schemes import LIMITERS, SCHEMES
from fvsolve.core.steppers.analysis.stability_properties import ssp_radius
from fvsolve.core.steppers.tableau import METHODS
from fvsolve.errors import FvsolveError, Notice, listing
from fvsolve.features.basins import advection_faces
from fvsolve.features.basins import tables as records
from fvsolve.features.basins.advection import DRY, advection_work, diffusion_work
from fvsolve.features.basins.basin_output import SPEED, U, V
from fvsolve.features.basins.basin_patches import physics_code
from fvsolve.features.basins.fifth_order import fifth_order_work
from fvsolve.features.basins.lower_bands import BandedRows
from fvsolve.features.basins.lower_motion import lower_mesh
from fvsolve.parts.formula import is_grid, means, samples
from fvsolve.units import DIMENSIONS

if TYPE_CHECKING:
    from fvsolve.core.kernels.rhs_assembly import RhsTerms
    from fvsolve.core.mesh.face_chains import FaceChain
    from fvsolve.core.mesh.mesh import MeshPoints

ROUNDING = 1e-12  # relative error of rates
VELOCITIES = {"u": U, "v": V, "speed": SPEED}


class BasinRows(BandedRows):
    """Basin of a model: its part of the case, its mesh, and (after `lower_common`) its row of the table of basins.

    Arguments of the methods: draft : draft of a model; row : row of the basin in the table of basins
    y : deviations of cells from rest, float64[quantities, n]; or the states of the model, where so stated
    out, layout : output array of the right-hand side, and the places of its parts
    """

    physics: ClassVar[dict[str, type[BasinRows]]] = {}  # by the package that declares it
    # True if its first quantity is a depth (minus that in `plan`) that contains scalars
    deep: ClassVar[bool] = False
    # on meshes, bound of gradients in cells, see `cell_sides.gradient_share`
    steepest: ClassVar[float] = math.inf
    given: ClassVar[bool] = False  # True if flows through its faces are those of a given velocity
    # True if outgoing waves are extrapolated by a polynomial of five cells
    has_wide_closure: ClassVar[bool] = True
    # True if sides of cells at driven faces of a mesh depend on the cells around them
    extrapolates: bool = False
    no_fifth_order: ClassVar[str] = "does not support walls on faces"  # reason on a grid
    # stored quantity below which velocities, the other quantities over it, fade to zero; 0 for none
    fades: float = 0.0
    max_divergence: float = 0.0  # greatest divergence of a given velocity [1/s]

    def __init_subclass__(cls) -> None:
        BasinRows.physics[cls.__module__.rpartition(".")[0]] = cls

    def __init__(self, case, name: str) -> None:
        self.case, self.name, self.part, self.mesh = case, name, case.nodes[name], case.meshes[name]
        self.x, self.y = np.ascontiguousarray(self.mesh.centre.T)
        self.n = self.x.size
        self.memory = 0  # size of its tables and its state [bytes]
        self.is_grid = is_grid(self.mesh)
        self.scalars = list(case.scalars) if self.part.physics_type.carries else []
        # of cells; the first is the stored quantity
        self.quantities = tuple(self.part.physics_type.states)
        # for each moving wall: state, stretch of cells per travel [1/m], displacement of corners per travel
        self.stretches: list[tuple[int, np.ndarray, np.ndarray]] = []

    # defined by each physics --------------------------------------------------------------------------------

    def lower(self, draft, row) -> None:
        """Fill the columns of the row that only its type has, and reserve the work arrays of its kernels."""
        raise NotImplementedError

    def pieces(self, valves: bool) -> Iterator[RhsTerms]:
        """Yield the `RhsTerms` of the basin, in their order within a phase; valves : True if the network has valves."""
        raise NotImplementedError

    def scales(self) -> list[float]:
        """Size of a small deviation of each state quantity, in SI units."""
        return [1.0] * len(self.quantities)

    def start(self, attitude: np.ndarray | None = None) -> np.ndarray:
        """Deviations of cells at the start of a run from the state at rest : float64[quantities, n].

        attitude : rotation matrix of the body that carries the basin, None for that at the start
        """
        return np.zeros((len(self.quantities), self.n))

    def ranges(self) -> dict[str, tuple[float, float]]:
        """(least, greatest) value over cells at the start of each quantity that determines waves, by name [SI]."""
        return {}

    def max_rate(self, y: np.ndarray) -> tuple[float, float]:
        """(greatest rate of waves or flows at a state y of the model [1/s], fraction of it by motion along x).

        The fraction is 1 on meshes other than grids.
        """
        velocity, speed = self.speeds(self.deviations(y))
        if not self.is_grid:
            left, right = self.mesh.left, self.mesh.right[: self.mesh.inner]
            across = (
                np.abs(np.einsum("fd,fd->f", velocity[left, :2], self.mesh.normal)) + speed[left]
            )
            through = np.bincount(left, across * self.mesh.length, self.n)
            through += np.bincount(right, (across * self.mesh.length)[: right.size], self.n)
            return float((0.5 * through / self.mesh.area).max()), 1.0
        grid = self.mesh.grid
        kx, ky = np.tile(1.0 / np.diff(grid.x), grid.ny), np.repeat(1.0 / np.diff(grid.y), grid.nx)
        along, across = kx * (np.abs(velocity[:, 0]) + speed), ky * (np.abs(velocity[:, 1]) + speed)
        worst = int(np.argmax(along + across))
        rate = float(along[worst] + across[worst])
        return rate, float(along[worst]) / rate if rate > 0.0 else 1.0

    @property
    def courant_factor(self) -> float:
        return float(self.row["unsplit"]) or 1.0

    def speeds(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(velocities, wave speeds) in cells at deviations y : float64[n, 3], float64[n] [m/s]."""
        raise NotImplementedError

    @property
    def scheme(self) -> str:
        """Name of the scheme that the basin uses."""
        return SCHEMES[self.case.numerics.scheme].for_basin(self.has_fifth_order).name

    @property
    def has_fifth_order(self) -> bool:
        """True if schemes above second order apply to the basin."""
        return self.part.physics_type.has_fifth_order(self.part, self.is_grid)

    def lower_probe(self, row, field: str, cells: np.ndarray, weights: np.ndarray) -> None:
        """Fill the row of a probe of a velocity in cells; each type of basin adds its other quantities.

        field : name of the quantity; cells, weights : cells around the probe, and their weights in its value
        """
        row["side"], row["scale"] = VELOCITIES[field], 1.0

    soil: Any = None  # keys of the soil into which water infiltrates; None without infiltration
    # states of each cell that belong to the soil: infiltrated height, condensed time
    soil_states: int = 0
    rains: bool = False  # True if rain falls on the basin

    @property
    def source_names(self) -> list[str]:
        """Names of its rows in the ledger of rain and infiltration."""
        return ["rain"] * self.rains + ["infiltration"] * (self.soil is not None)

    @property
    def source_states(self) -> np.ndarray:
        """Indices in y of the heights of rain, and of the states of the soil."""
        rained = [int(self.row["rained"])] if self.rains else []
        return np.append(
            rained, int(self.row["infiltrated"]) + np.arange(self.n * self.soil_states)
        ).astype(int)

    def lower_sources(self, draft, row) -> None:
        """Fill the columns of rain and infiltration, and add their states."""

    def mass_in_soil(self, y: np.ndarray) -> float:
        """Mass of the infiltrated water at the states y of the model [kg]."""
        return 0.0

    def notices(self, y: np.ndarray) -> list[Notice]:
        """Notices on the deviations y of cells at the start of a run."""
        return []

    def chain_texts(self) -> list[str]:
        """Texts on its walls on faces and its sections, for the command `check`."""
        return []

    # ----------------------------------------------------------------------------------------------------------

    @property
    def reach(self) -> int:
        """Number of cells on either side of a cell that its rate reads."""
        return SCHEMES[self.scheme].reach.behind

    @property
    def is_fifth_order(self) -> bool:
        """True if its scheme has an order above 2."""
        return SCHEMES[self.scheme].order > 2

    @cached_property
    def points(self) -> MeshPoints:
        """`MeshPoints` of the mesh, which finds the cell at a given point."""
        from fvsolve.core.mesh.mesh import MeshPoints

        return MeshPoints(self.mesh)

    def formula(self, shape) -> np.ndarray:
        """Mean of a formula (None for zero) over each cell : float64[n]; by nine Gauss points on grids, else one."""
        return means(samples(shape, self.mesh))

    def reflections(self) -> np.ndarray:
        """Reflection coefficients of waves at boundary faces, in the order of the kernels : float64[outer].

        The array is empty if all boundaries are walls.
        """
        mesh, coefficients = self.mesh, np.ones(self.mesh.left.size)
        for name, patch in self.part.patches.items():
            if not patch.is_interior:
                coefficients[mesh.patch(name)] = self.reflection(patch)
        for name in self.linked:
            coefficients[mesh.patch(name)] = 0.0
        outer = coefficients[mesh.inner :]
        if (outer == 1.0).all():
            return np.zeros(0)
        return outer[self.ring()] if self.is_grid else outer

    def ring(self) -> np.ndarray:
        """Numbers of the boundary faces of a grid, from 0 for the first one, in the order west, east, south, north."""
        mesh, grid = self.mesh, self.mesh.grid
        normal, left = mesh.normal[mesh.inner :], mesh.left[mesh.inner :]
        row, column = np.divmod(left, grid.nx)
        west, east = normal[:, 0] < -0.5, normal[:, 0] > 0.5
        south, at = normal[:, 1] < -0.5, np.where(np.abs(normal[:, 0]) > 0.5, row, column)
        side = np.where(west, 0, np.where(east, 1, np.where(south, 2, 3)))
        return np.lexsort((at, side))

    def ring_numbers(self, patch: str) -> np.ndarray:
        """Numbers of the faces of a patch in the order of boundary faces of the kernels; -1 for an interior patch."""
        faces = self.mesh.faces(patch).index - self.mesh.inner
        if patch in self.mesh.interior:
            return np.full(faces.size, -1)
        return np.argsort(self.ring())[faces] if self.is_grid else faces

    def reflection(self, patch) -> float:
        """Reflection coefficient of waves at a patch: 0 if it is open, 1 for a wall, other values for impedances."""
        return 0.0 if patch.passes else 1.0

    def is_open(self, patch: str) -> bool:
        """True if fluid flows through a patch without a link."""
        stated = self.part.patches.get(patch)
        return stated is not None and self.reflection(stated) != 1.0

    @property
    def driven(self) -> list[str]:
        """Names of the patches with a closure, or with faces that links join."""
        return [*self.closed, *self.linked]

    @property
    def closed(self) -> list[str]:
        """Names of the patches with a closure."""
        return [name for name, patch in self.part.patches.items() if patch.closure]

    @cached_property
    def linked(self) -> list[str]:
        """Names of the patches whose faces pass the flow of links, see `case.basins.patches_with_faces`.

        Interior patches are left out.
        """
        return [
            name
            for name in self.mesh.patches
            if f"{self.name}.{name}" in self.case.patches_with_faces
        ]

    @property
    def opening(self) -> str | None:
        """Name of the first patch through which fluid flows without a link; None without such a patch."""
        return next((patch for patch in self.part.patches if self.is_open(patch)), None)

    def states_of(self, y: np.ndarray) -> np.ndarray:
        """States of the basin among the states y of the model : float64[quantities, n]."""
        at = int(self.row["y"])
        return y[at : at + len(self.quantities) * self.n].reshape(-1, self.n)

    def deviations(self, y: np.ndarray) -> np.ndarray:
        """Deviations of quantities of cells from rest at the states y of the model : float64[quantities, n]."""
        if not self.moves:
            return self.states_of(y)
        wide, rest = self.area_ratios(y), np.zeros((len(self.quantities), self.n))
        rest[0] = self.at_rest()
        return (self.states_of(y) - rest * (wide - 1.0)) / wide

    @property
    def units_of_maxima(self) -> dict[str, str]:
        """SI unit of each quantity of `maxima`, by name."""
        return {
            name: DIMENSIONS[dimension].si
            for name, dimension in self.part.physics_type.maxima.items()
        }

    @property
    def records_maxima(self) -> bool:
        """True if the greatest values of its cells are recorded."""
        return self.name in self.case.output.basins_with_maxima

    @cached_property
    def sections(self) -> dict[str, FaceChain]:
        """Faces of its sections, by name."""
        stated = self.case.output.sections.items()
        return {
            name: section.chain(self.mesh) for name, section in stated if section.basin == self.name
        }

    @property
    def walls(self) -> list[str]:
        """Names of the patches that are moving walls."""
        return [name for name, patch in self.part.patches.items() if patch.moves]

    @property
    def moves(self) -> bool:
        """True if the basin has moving walls."""
        return bool(self.walls)

    def area_ratios(self, y: np.ndarray) -> np.ndarray:
        """Present over undeformed area of each cell at the states y of the model : float64[n]."""
        return 1.0 + sum((y[at] * per for at, per, _ in self.stretches), np.zeros(self.n))

    def node_points(self) -> dict[str, np.ndarray]:
        middle, faces = self.mesh.middle, self.mesh.faces
        return {
            f"{self.name}.{patch}": middle[faces(patch).index].mean(axis=0)
            for patch in patch_names(self.mesh)
        }

    def vectors_at(
        self, fields: dict[str, np.ndarray], out: np.ndarray, layout
    ) -> dict[str, np.ndarray]:
        """Vectors in cells of a basin on a body, in axes of the world: "velocity" and "normal" -> float64[n, 3].

        "normal" is the unit normal of the basin. fields : result of `fields`
        """
        from fvsolve.features.basins.lower_motion import axes_in_world

        axes = axes_in_world(self, out, layout)[1]
        return {"velocity": fields["velocity"] @ axes.T, "normal": np.tile(axes[:, 2], (self.n, 1))}

    def points_at(self, y: np.ndarray, out: np.ndarray, layout) -> np.ndarray:
        """Positions of corners of cells at the states y of the model : float64[p, 3] [m].

        For a basin on a body they are in axes of the world.
        """
        x, z = np.ascontiguousarray(self.mesh.points.T)
        plan = self.mesh.points + sum(
            (y[at] * weights for at, _, weights in self.stretches), np.zeros((1, 2))
        )
        points = np.column_stack([plan, self.ground(x, z)])
        if self.part.on is None:
            return points
        from fvsolve.features.basins.lower_motion import axes_in_world

        origin, axes = axes_in_world(self, out, layout)
        return origin + points @ axes.T

    def at_rest(self) -> np.ndarray | float:
        """First state quantity at rest, as a value or a value for each cell: depth [m] or density [kg/m3]."""
        raise NotImplementedError

    def thrust_at_rest(self) -> np.ndarray:
        """Force at rest on a wall next to each cell, per metre of wall : float64[n] [N/m]."""
        raise NotImplementedError

    def lower_common(self, draft, row) -> None:
        """Fill the row of the basin in the table of basins, and add its states to the draft of the model.

        The columns that all types have are filled here, the others by `lower`.
        """
        numerics = self.case.numerics
        mesh = self.mesh
        before = draft.used_size()
        self.row, row["n"] = row, self.n
        row["kind"] = physics_code(type(self).__module__.rpartition(".")[0])
        row["deep"], row["given"] = self.deep, self.given
        row["scheme"] = family(self.scheme)
        row["limiter"] = self.limiter_code(numerics.limiter)
        row["steepest"] = self.steepest
        row["wide"] = LIMITERS[numerics.limiter].overshoot
        row["area"] = row["drawn"] = draft.to_plane(mesh.area)
        if self.is_grid:
            grid = mesh.grid
            row["nx"], row["ny"] = grid.nx, grid.ny
            row["spacing"] = draft.to_plane(
                np.concatenate([1.0 / np.diff(grid.x), 1.0 / np.diff(grid.y)])
            )
        else:
            floats, self.integers = lower_mesh(mesh, self.steepest)
            row["mesh"], row["faces"] = draft.to_plane(floats), mesh.left.size
            row["links"] = len(draft.integers)
            draft.integers += self.integers.tolist()
        if self.scheme != SCHEMES[numerics.scheme].for_basin(True).name:
            needs = self.no_fifth_order if self.is_grid else "needs a full rectangle as mesh"
            text = f"basin {self.name}: {numerics.scheme} {needs}; muscl is used here"
            draft.warnings.append(Notice("scheme", f"nodes.{self.name}", text, "scheme"))
        reflections = self.reflections()
        row["reflect"], row["outer_given"] = draft.to_plane(reflections), reflections.size
        row["outer"] = mesh.left.size - mesh.inner
        passes = any(self.reflection(patch) != 1.0 for patch in self.part.patches.values())
        row["through"] = draft.to_work(reflections.size) if passes else -1
        has_boundary_rates = reflections.size or self.moves or self.part.on or self.sections
        row["boundary_rates"] = draft.to_work(
            len(self.quantities) * self.n if has_boundary_rates else 0
        )
        row["carried"] = row["flows"] = -1
        if self.moves:
            from fvsolve.features.basins.lower_motion import lower_lines

            lower_lines(draft, self, row)
        row["body"] = row["frame"] = row["maxima"] = row["driven"] = row["marked"] = -1
        self.lower(draft, row)
        if self.part.on is not None:
            from fvsolve.features.basins.lower_motion import lower_frame

            lower_frame(draft, self, row)
        if self.scalars:
            self.lower_scalars(draft, row)
        row["y"] = draft.size
        for quantity, scale in zip(self.quantities, self.scales(), strict=True):
            draft.states(Numbered(f"{self.name}.{quantity}", self.n), scale)
        row["carried"] = draft.size if self.scalars else -1
        for name in self.scalars:
            draft.states(Numbered(f"{self.name}.{name}", self.n), self.scalar_scale(name))
        row["rain"], row["total_area"] = -1, mesh.area.sum()
        self.lower_sources(draft, row)
        self.memory = 8 * (draft.used_size() + draft.size - before)
        place = f"nodes.{self.name}"
        draft.warnings += [
            Notice("mesh", place, f"basin {self.name}: {note}", "mesh") for note in mesh.notes
        ]

    def limiter_code(self, limiter: str) -> int:
        """Code of a limiter for kernels. Raises FvsolveError on grids for one that is not symmetric."""
        own = LIMITERS[limiter].own
        # flows through walls would not be zero
        if self.is_grid and own is not None and not own.symmetric:
            text = f"numerics.limiter: {limiter} is not symmetric: {own.costs[-1]}"
            raise FvsolveError(
                f"{text}; expected a limiter with phi(r) / r = phi(1 / r) for basins on grids"
            )
        return code_of_limiter(limiter, __name__ if self.is_grid else "")

    def lower_scalars(self, draft, row) -> None:
        """Reserve arrays of scalars: flows, values beyond the boundary, work; warn if values may leave their bounds."""
        mesh, grid = self.mesh, self.mesh.grid
        row["outside"] = draft.to_work(len(self.scalars) * int(row["outer"]))
        if self.is_grid:
            flows = grid.ny * (grid.nx + 1) + (grid.ny + 1) * grid.nx
            sizes = [
                advection_work,
                diffusion_work,
                *([fifth_order_work] if self.is_fifth_order else []),
            ]
            work_size = self.n + max(size(grid.nx, grid.ny) for size in sizes)
        else:
            flows, work_size = mesh.left.size, self.n + advection_faces.work_size(self.integers)
        if row["flows"] < 0:
            row["flows"] = draft.to_work(flows)
        row["scalar_work"] = draft.to_work(work_size)
        violation = self.bounds_violation(row)
        if violation:
            numerics = self.case.numerics
            limited = f", {numerics.limiter}" if self.scheme == "muscl" else ""
            text = f"basin {self.name}: scalars may leave their bounds ({self.scheme}{limited}; {numerics.method}): "
            key, reason, value, limit = violation
            draft.warnings.append(
                Notice("bounds", f"nodes.{self.name}", text + reason, key, value, limit)
            )

    def bounds_violation(self, row) -> tuple[str, str, float | None, float | None] | None:
        """Reason why scalars may leave their bounds: (key of the case, text, value, limit); None if they cannot.

        The key is None if no key is the cause; value and limit are None if they are not numbers.
        """
        numerics, method = self.case.numerics, METHODS.get(self.case.numerics.method)
        if row["scheme"] == rec.LINEAR:
            return (
                "scheme",
                "upwind5 does not keep scalars within bounds; upwind, muscl and weno5 do",
                None,
                None,
            )
        if method is None or not method.explicit or numerics.courant is None:
            key = (
                "step"
                if numerics.step is not None
                else "rtol"
                if numerics.rtol is not None
                else "method"
            )
            return key, f"ssp-rk3 with courant = {COURANT:g} or less keeps the bounds", None, None
        diffusing = [name for name in self.scalars if self.case.scalars[name].diffusivity > 0.0]
        if diffusing and not self.is_grid:
            text = f"{listing(diffusing)} {'diffuse' if len(diffusing) > 1 else 'diffuses'} on a mesh that is "
            return (
                None,
                f"{text}not a full rectangle; a full rectangle keeps the bounds",
                None,
                None,
            )
        if self.max_divergence > ROUNDING * row["fastest"]:
            reason = f"the velocity has a divergence of up to {self.max_divergence:.3g} 1/s"
            text = f"{reason}, which concentrates or dilutes scalars; a velocity by a stream function has no divergence"
            return "velocity", text, self.max_divergence, 0.0
        radius = ssp_radius(method)
        if numerics.courant > radius:
            key, advice = "courant", f"Courant numbers up to {radius:g} keep the bounds"
            if not radius:
                key, advice = "method", "with this method no Courant number keeps the bounds"
            return (
                key,
                f"{advice}; ssp-rk3 keeps the bounds up to a Courant number of 1",
                numerics.courant,
                radius,
            )
        return None

    def scalar_scale(self, name: str) -> float:
        """Scale of the amount of a scalar per area: its greatest absolute value at the start, for the depth 1.

        For a scalar without a formula for this basin the ambient value counts too. The scale is 1 if all are 0.
        """
        given, scalar = self.given_value(name), self.case.scalars[name]
        values = np.abs([scalar.initial, scalar.ambient]) if given is None else np.abs(given)
        return float(values.max()) or 1.0

    def given_value(self, name: str) -> Any:
        """Value of a scalar at the start that the part states, in all cells or each : float64[n]; None without it."""
        given = self.part.scalars.get(name)
        return None if given is None else self.formula(given)

    def depth_of(self, y: np.ndarray) -> np.ndarray:
        """Depth of each cell over which amounts of scalars are distributed, at deviations y : float64[n]."""
        return np.ones(self.n)

    def bounds(self) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield `bound_rows` that keep depths of water at 0 or above, and limit velocities between steps.

        With bed friction, a velocity between two steps lies between those of the steps.
        """
        states, none = int(self.row["y"]) + np.arange(self.n), NO_STATE
        if self.deep:
            yield bound_rows(states, none, none, self.at_rest(), 0.0, -1.0, np.inf)
        if self.fades > 0.0 and self.row["friction"] != records.NO_DRAG:
            for k in range(1, len(self.quantities)):
                yield bound_rows(
                    states + k * self.n, states, none, self.at_rest(), 1.0, self.fades, -1.0
                )

    def start_scalars(self, y: np.ndarray) -> None:
        """Write the amounts of scalars at the start to the states y of the model, for the depths of cells in y."""
        for name, amounts in zip(self.scalars, self.amounts(y), strict=True):
            given = self.given_value(name)
            value = self.case.scalars[name].initial if given is None else given
            amounts[:] = value * self.depth_of(self.deviations(y))

    def amounts(self, y: np.ndarray) -> np.ndarray:
        """Amounts of scalars per area among the states y of the model : float64[scalars, n]."""
        at = int(self.row["carried"])
        return y[at : at + len(self.scalars) * self.n].reshape(-1, self.n)

    def values(self, y: np.ndarray) -> dict[str, np.ndarray]:
        """Values of scalars in cells at the states y of the model : name -> float64[n].

        Below the depth DRY they tend to 0.
        """
        depth = np.maximum(self.depth_of(self.deviations(y)), DRY) * (
            self.area_ratios(y) if self.moves else 1.0
        )
        return {
            name: amounts / depth
            for name, amounts in zip(self.scalars, self.amounts(y), strict=True)
        }

    def mass_per_depth(self) -> np.ndarray:
        """Mass of fluid per depth in each cell : float64[n] [kg/m]; times an amount per area, the mass of a scalar.

        For a basin with a given velocity, whose depth is 1, it is the mass of the cell [kg].
        """
        return np.zeros(self.n)

    def lower_patch(self, draft, patch: str, row) -> None:
        """Fill the row of a patch in the table of patches: its cells, faces, sizes and schedules of inflow values."""
        cells = boundary_cells(self.mesh, patch)
        row["first"], row["count"] = len(draft.integers), cells.size
        draft.integers += cells.tolist()
        faces, behind, _, normal = self.mesh.faces(patch)
        row["ring"], row["faces"] = len(draft.integers), faces.size
        draft.integers += [*self.ring_numbers(patch).tolist(), *behind.tolist()]
        length = self.mesh.length[faces]
        sizes = [self.mesh.area[cells].sum(), length.sum()]
        if self.deep and self.part.on is not None:
            from fvsolve.features.basins.lower_motion import position_in_frame

            sizes += position_in_frame(draft, self, patch)
        row["sizes"] = draft.to_plane(np.array(sizes))
        per_area = [length / self.mesh.area[behind]] * (2 if self.moves else 1)
        row["normals"] = draft.to_plane(np.array([*normal.T, *per_area]))
        stated = self.part.patches.get(patch)
        row["open"], row["moves"] = self.is_open(patch), patch in self.walls
        given = stated.scalars if stated is not None else {}
        row["values"] = len(draft.integers)
        draft.integers += [
            draft.schedules.add(given[name]) if name in given else -1 for name in self.scalars
        ]

"""What all physics of basins share: cells, boundaries and patches as rows of tables. Knows no law."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from fvsolve.basins import advection_faces
from fvsolve.basins.advection import THIN, advection_work
from fvsolve.basins.diffusion import diffusion_work
from fvsolve.basins.kinds import kind_of
from fvsolve.basins.lower_mesh import lower_mesh
from fvsolve.basins.observe import SPEED, U, V
from fvsolve.case.basins import behind
from fvsolve.case.cells import is_grid, means, samples
from fvsolve.case.sections import DEFAULT_COURANT as COURANT
from fvsolve.errors import Notice, listing
from fvsolve.kernels import records as rec
from fvsolve.model.schemes import CODES, family
from fvsolve.model.state_names import Numbered
from fvsolve.schemes import LIMITERS, SCHEMES
from fvsolve.steppers.analysis.monotone import ssp_radius
from fvsolve.steppers.methods import METHODS

if TYPE_CHECKING:
    from fvsolve.kernels.phases import Pieces
    from fvsolve.mesh.points import MeshPoints

ROUNDING = 1e-12  # of rates
VELOCITIES = {"u": U, "v": V, "speed": SPEED}


class BasinRows:
    """A basin of a model: its part, its mesh, and its row once it is lowered."""

    physics: ClassVar[dict[str, type[BasinRows]]] = {}  # by the package that declares it
    units: ClassVar[dict[str, str]] = {}  # of fields
    deep: ClassVar[bool] = False  # whether its first quantity is a depth, over that in `plan`, that holds scalars
    given: ClassVar[bool] = False  # whether flows through its faces are those of a given velocity
    far_ends: ClassVar[bool] = True  # whether waves leave it on a polynomial of five cells
    banded: ClassVar[bool] = False  # whether rows of a grid of its cells can be stepped apart
    gathers: float = 0.0  # greatest divergence of a given velocity [1/s]

    def __init_subclass__(cls) -> None:
        BasinRows.physics[cls.__module__.rpartition(".")[0]] = cls

    def __init__(self, case, name: str) -> None:
        self.case, self.name, self.part, self.mesh = case, name, case.nodes[name], case.meshes[name]
        self.x, self.y = np.ascontiguousarray(self.mesh.centre.T)
        self.n = self.x.size
        self.memory = 0  # its tables and its state [bytes]
        self.is_grid = is_grid(self.mesh)
        self.scalars = list(case.scalars) if self.part.own.carries else []
        self.quantities = tuple(self.part.own.states)  # of cells, as states have them; the first is what is stored
        # of walls that move: state, stretch of cells per travel [1/m], and of corners how far they go with it
        self.stretches: list[tuple[int, np.ndarray, np.ndarray]] = []

    # what a physics says ------------------------------------------------------------------------------------

    def lower(self, draft, row) -> None:
        """Fill what its law needs of the row, and reserve what its kernels work in."""
        raise NotImplementedError

    def pieces(self, valves: bool) -> Iterator[Pieces]:
        """Of what its right-hand side and readers consist, in order; valves : whether there are any in the network."""
        raise NotImplementedError

    def scales(self) -> list[float]:
        """What counts as a small deviation of each quantity."""
        return [1.0] * len(self.quantities)

    def start(self, attitude: np.ndarray | None = None) -> np.ndarray:
        """Deviations at the start : float64[quantities, n]; attitude : R of its body, where that is another."""
        return np.zeros((len(self.quantities), self.n))

    def fields(self, y: np.ndarray) -> dict[str, np.ndarray]:
        """What cells hold at deviations float64[quantities, n], SI."""
        return {}

    def ground(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Height of what lies below it at points [m]."""
        return np.full(x.shape, self.part.elevation or 0.0)

    def ranges(self) -> dict[str, tuple[float, float]]:
        """Least and greatest of what tells of its waves at the start, SI."""
        return {}

    def pace(self, y: np.ndarray) -> tuple[float, float]:
        """Greatest rate [1/s] of its waves, or of what it carries, at a model's state y, and the share of x in it."""
        velocity, speed = self.speeds(self.of(y))
        if not self.is_grid:
            own, other = self.mesh.left, self.mesh.right[: self.mesh.inner]
            across = np.abs(np.einsum("fd,fd->f", velocity[own, :2], self.mesh.normal)) + speed[own]
            through = np.bincount(own, across * self.mesh.length, self.n)
            through += np.bincount(other, (across * self.mesh.length)[: other.size], self.n)
            return float((0.5 * through / self.mesh.area).max()), 1.0
        grid = self.mesh.grid
        kx, ky = np.tile(1.0 / np.diff(grid.x), grid.ny), np.repeat(1.0 / np.diff(grid.y), grid.nx)
        along, across = kx * (np.abs(velocity[:, 0]) + speed), ky * (np.abs(velocity[:, 1]) + speed)
        worst = int(np.argmax(along + across))
        rate = float(along[worst] + across[worst])
        return rate, float(along[worst]) / rate if rate > 0.0 else 1.0

    def speeds(self, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Velocity float64[n, 3] and speed of waves float64[n] at deviations float64[quantities, n] [m/s]."""
        raise NotImplementedError

    @property
    def waving(self) -> bool:
        """Whether there are waves of its own, beside what is carried."""
        return bool(self.quantities)

    @property
    def even_paced(self) -> bool:
        """Whether waves run at one speed, whatever they do."""
        return False

    @property
    def scheme(self) -> str:
        """The scheme that its kernels take."""
        return SCHEMES[self.case.numerics.scheme].on(self.is_grid).name

    def lower_probe(self, row, field: str, cells: np.ndarray, weights: np.ndarray) -> None:
        """Fill what a probe of a field is, beside the cells that it reads; all but velocities are its physics' own."""
        row["side"], row["scale"] = VELOCITIES[field], 1.0

    def mass(self) -> tuple[float, np.ndarray]:
        """Mass of the start's profile [kg], and mass per deviation of the first quantity : float64[n]."""
        return 0.0, np.zeros(self.n)

    def weights(self, y: np.ndarray) -> np.ndarray:
        """Weights w of small deviations d from y that store w d^2 : float64[quantities, n]."""
        return np.tile(0.5 * self.mesh.area, (len(self.quantities), 1))

    def above(self, y: np.ndarray, datum: float) -> float:
        """Energy at deviations y over that at rest and at P = 0, a surface at the datum or on the bed [J]."""
        return 0.0

    def notices(self, y: np.ndarray) -> list[Notice]:
        """What there is to know of deviations at the start."""
        return []

    def watches(self, y: np.ndarray) -> list[Any]:
        """Watches of a run from deviations y: each can `look` at (t, state), has `kept` numbers, makes `notices`."""
        return []

    # ----------------------------------------------------------------------------------------------------------

    @property
    def reach(self) -> int:
        """Cells either way that the rates of one look at."""
        return SCHEMES[self.scheme].reach.behind

    @property
    def whole(self) -> str:
        """Why its rows cannot be shared out among threads, "" where they can."""
        if not self.is_grid:
            return "its mesh is no full rectangle"
        if self.moves:
            return "its walls move"
        if self.part.on is not None:
            return "it rides on a body"
        if self.scalars and self.fifth:
            return f"{self.scheme} carries scalars"
        if self.scalars and self.opening is not None:
            return f"its boundary {self.opening} is open and scalars pass it"
        if fading := [name for name in self.scalars if self.case.scalars[name].decay > 0.0]:
            return f"{listing(fading)} decays"
        return "" if self.banded else f"rows of {self.part.physics} are not shared out"

    @property
    def sums_rows(self) -> bool:
        """Whether who finds rates of its rows can form sums of stages beside them, for nothing comes to these later.

        But at cells that all look at: behind patches.
        """
        return False

    @property
    def fifth(self) -> bool:
        """Whether its scheme is of more than second order."""
        return SCHEMES[self.scheme].order > 2

    @cached_property
    def points(self) -> MeshPoints:
        """Finds points of its mesh, and the cells that are read there."""
        from fvsolve.mesh.points import MeshPoints

        return MeshPoints(self.mesh)

    def formula(self, shape) -> np.ndarray:
        """Means of a formula over cells, on grids by nine Gauss points, elsewhere at centres : float64[n]."""
        return means(samples(shape, self.mesh))

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

    def opens(self, patch: str) -> bool:
        """Whether something passes a patch that no link brings."""
        stated = self.part.patches.get(patch)
        return stated is not None and self.reflection(stated) != 1.0

    @property
    def opening(self) -> str | None:
        """A patch that something passes which no link brings, if there is one."""
        return next((patch for patch in self.part.patches if self.opens(patch)), None)

    def own(self, y: np.ndarray) -> np.ndarray:
        """Its part of the states of a model : float64[quantities, n]."""
        at = int(self.row["y"])
        return y[at : at + len(self.quantities) * self.n].reshape(-1, self.n)

    def of(self, y: np.ndarray) -> np.ndarray:
        """Its deviations in a state of a model : float64[quantities, n]."""
        if not self.moves:
            return self.own(y)
        wide, rest = self.stretched(y), np.zeros((len(self.quantities), self.n))
        rest[0] = self.at_rest()
        return (self.own(y) - rest * (wide - 1.0)) / wide

    @property
    def walls(self) -> list[str]:
        """Names of its patches that are walls that move."""
        return [patch for patch, one in self.part.patches.items() if one.moves]

    @property
    def moves(self) -> bool:
        """Whether it has any of these."""
        return bool(self.walls)

    def stretched(self, y: np.ndarray) -> np.ndarray:
        """Areas of cells over those as drawn, in a state of a model : float64[n]."""
        return 1.0 + sum((y[at] * per for at, per, _ in self.stretches), np.zeros(self.n))

    def vectors_at(self, fields: dict[str, np.ndarray], out: np.ndarray, layout) -> dict[str, np.ndarray]:
        """Velocities of cells of a basin on a body, and its normal, along axes of the world : float64[n, 3] each."""
        from fvsolve.basins.lower_frames import axes_in_world

        axes = axes_in_world(self, out, layout)[1]
        return {"velocity": fields["velocity"] @ axes.T, "normal": np.tile(axes[:, 2], (self.n, 1))}

    def points_at(self, y: np.ndarray, out: np.ndarray, layout) -> np.ndarray:
        """Corners of cells in a state of a model, of what rides on a body in the world : float64[p, 3] [m]."""
        x, z = np.ascontiguousarray(self.mesh.points.T)
        plan = self.mesh.points + sum((y[at] * goes for at, _, goes in self.stretches), np.zeros((1, 2)))
        points = np.column_stack([plan, self.ground(x, z)])
        if self.part.on is None:
            return points
        from fvsolve.basins.lower_frames import axes_in_world

        origin, axes = axes_in_world(self, out, layout)
        return origin + points @ axes.T

    def at_rest(self) -> np.ndarray | float:
        """Its first quantity at rest."""
        raise NotImplementedError

    def thrust_at_rest(self) -> np.ndarray:
        """Force at rest on a wall of one metre beside each cell : float64[n] [N/m]."""
        raise NotImplementedError

    def lower_common(self, draft, row) -> None:
        """Fill what all kinds need."""
        numerics, mesh, before = self.case.numerics, self.mesh, draft.room()
        self.row, row["n"] = row, self.n
        row["kind"], row["deep"], row["given"] = (
            kind_of(type(self).__module__.rpartition(".")[0]),
            self.deep,
            self.given,
        )
        row["scheme"] = family(self.scheme)
        row["limiter"], row["wide"] = CODES[numerics.limiter], LIMITERS[numerics.limiter].wide
        row["area"] = row["drawn"] = draft.to_plane(mesh.area)
        if self.is_grid:
            grid = mesh.grid
            row["nx"], row["ny"] = grid.nx, grid.ny
            row["spacing"] = draft.to_plane(np.concatenate([1.0 / np.diff(grid.x), 1.0 / np.diff(grid.y)]))
        else:
            if self.scheme != SCHEMES[numerics.scheme].on(True).name:
                text = f"basin {self.name}: {numerics.scheme} wants a rectangle without holes; muscl is taken there"
                draft.warnings.append(Notice("scheme", f"nodes.{self.name}", text, "scheme"))
            floats, self.integers = lower_mesh(mesh)
            row["mesh"], row["faces"] = draft.to_plane(floats), mesh.left.size
            row["links"] = len(draft.integers)
            draft.integers += self.integers.tolist()
        given = self.reflects()
        row["reflect"], row["outer_given"] = draft.to_plane(given), given.size
        row["outer"] = mesh.left.size - mesh.inner
        row["through"] = draft.to_work(given.size) if given.size else -1
        row["unused"] = draft.to_work(len(self.quantities) * self.n if given.size or self.moves or self.part.on else 0)
        row["carried"] = row["flows"] = -1
        if self.moves:
            from fvsolve.basins.lower_walls import lower_lines

            lower_lines(draft, self, row)
        row["body"] = row["frame"] = -1
        self.lower(draft, row)
        if self.part.on is not None:
            from fvsolve.basins.lower_frames import lower_frame

            lower_frame(draft, self, row)
        if self.scalars:
            self.lower_scalars(draft, row)
        row["y"] = draft.size
        for what, scale in zip(self.quantities, self.scales(), strict=True):
            draft.states(Numbered(f"{self.name}.{what}", self.n), scale)
        row["carried"] = draft.size if self.scalars else -1
        for name in self.scalars:
            draft.states(Numbered(f"{self.name}.{name}", self.n), self.scalar_scale(name))
        self.memory = 8 * (draft.room() + draft.size - before)
        place = f"nodes.{self.name}"
        draft.warnings += [Notice("mesh", place, f"basin {self.name}: {note}", "mesh") for note in mesh.notes]

    def lower_scalars(self, draft, row) -> None:
        """Reserve what scalars are carried by and in, and values beyond the boundary."""
        mesh, grid = self.mesh, self.mesh.grid
        row["outside"] = draft.to_work(len(self.scalars) * int(row["outer"]))
        if self.is_grid:
            flows = grid.ny * (grid.nx + 1) + (grid.ny + 1) * grid.nx
            toil = self.n + max(advection_work(row["scheme"], grid.nx, grid.ny), diffusion_work(grid.nx, grid.ny))
        else:
            flows, toil = mesh.left.size, self.n + advection_faces.work_size(self.integers)
        if row["flows"] < 0:
            row["flows"] = draft.to_work(flows)
        row["toil"] = draft.to_work(toil)
        may = self.may_leave(row)
        if may:
            numerics = self.case.numerics
            limited = f", {numerics.limiter}" if self.scheme == "muscl" else ""
            what = f"basin {self.name}: scalars may leave their bounds ({self.scheme}{limited}; {numerics.method}): "
            key, why, value, limit = may
            draft.warnings.append(Notice("bounds", f"nodes.{self.name}", what + why, key, value, limit))

    def may_leave(self, row) -> tuple[str, str, float | None, float | None] | None:
        """Why scalars may leave the bounds that the case states: (key, text, value, limit); None where they cannot."""
        numerics, method = self.case.numerics, METHODS.get(self.case.numerics.method)
        if row["scheme"] == rec.LINEAR:
            return "scheme", "upwind5 keeps none; upwind, muscl and weno5 do", None, None
        if method is None or not method.explicit or numerics.courant is None:
            key = "step" if numerics.step is not None else "rtol" if numerics.rtol is not None else "method"
            return key, f"they are kept with ssp-rk3 and courant = {COURANT:g} or less", None, None
        spreads = [name for name in self.scalars if self.case.scalars[name].diffusivity > 0.0]
        if spreads and not self.is_grid:
            return None, f"{listing(spreads)} diffuses between cells that lean; a rectangle keeps them", None, None
        if self.gathers > ROUNDING * row["fastest"]:
            why = (
                f"the velocity has a divergence of up to {self.gathers:.3g} 1/s, which gathers or thins what it carries"
            )
            return "velocity", f"{why}; a stream function has none", self.gathers, 0.0
        radius = ssp_radius(method)
        if numerics.courant > radius:
            instead = f"Courant numbers up to {radius:g} keep them" if radius else "no Courant number keeps them"
            key = "courant" if radius else "method"
            return key, f"{instead}, with ssp-rk3 up to 1", numerics.courant, radius
        return None

    def scalar_scale(self, name: str) -> float:
        """What counts as a small amount of a scalar per area."""
        given, scalar = self.part.scalars.get(name), self.case.scalars[name]
        values = np.abs([scalar.initial, scalar.ambient]) if given is None else np.abs(self.formula(given))
        return float(values.max()) or 1.0

    def depth_of(self, y: np.ndarray) -> np.ndarray:
        """Depth that amounts of scalars are spread over : float64[n]."""
        return np.ones(self.n)

    def start_scalars(self, y: np.ndarray) -> None:
        """Amounts at the start, into the states of a model."""
        for name, amounts in zip(self.scalars, self.amounts(y), strict=True):
            given = self.part.scalars.get(name)
            value = self.case.scalars[name].initial if given is None else self.formula(given)
            amounts[:] = value * self.depth_of(self.of(y))

    def amounts(self, y: np.ndarray) -> np.ndarray:
        """Amounts per area in the states of a model : float64[scalars, n]."""
        at = int(self.row["carried"])
        return y[at : at + len(self.scalars) * self.n].reshape(-1, self.n)

    def values(self, y: np.ndarray) -> dict[str, np.ndarray]:
        """Values of scalars in cells, by name."""
        depth = np.maximum(self.depth_of(self.of(y)), THIN) * (self.stretched(y) if self.moves else 1.0)
        return {name: one / depth for name, one in zip(self.scalars, self.amounts(y), strict=True)}

    def held(self) -> np.ndarray:
        """Mass that holds a scalar, per depth : float64[n] [kg/m]."""
        return np.zeros(self.n)

    def lower_patch(self, draft, patch: str, row) -> None:
        """Fill the row of a patch that links may join."""
        cells = behind(self.mesh, patch)
        row["first"], row["count"] = len(draft.integers), cells.size
        draft.integers += cells.tolist()
        own, outer = np.arange(self.mesh.left.size)[self.mesh.patch(patch)], self.mesh.inner
        numbers = np.argsort(self.ring())[own - outer] if self.is_grid else own - outer
        row["ring"], row["faces"], behind_faces = len(draft.integers), own.size, self.mesh.left[own]
        draft.integers += [*numbers.tolist(), *behind_faces.tolist()]
        length = self.mesh.length[own]
        sizes = [self.mesh.area[cells].sum(), length.sum()]
        if self.deep and self.part.on is not None:
            from fvsolve.basins.lower_frames import place_in_frame

            sizes += place_in_frame(draft, self, patch)
        row["sizes"] = draft.to_plane(np.array(sizes))
        per_area = [length / self.mesh.area[behind_faces]] * (2 if self.moves else 1)
        row["normals"] = draft.to_plane(np.array([*self.mesh.normal[own].T, *per_area]))
        stated = self.part.patches.get(patch)
        row["open"], row["moves"] = self.opens(patch), patch in self.walls
        given = stated.scalars if stated is not None else {}
        row["values"] = len(draft.integers)
        draft.integers += [draft.schedules.add(given[name]) if name in given else -1 for name in self.scalars]

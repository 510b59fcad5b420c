"""Rows of the tables of a model for scalars in a given velocity: expressions, stream functions, files."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.rhs_assembly import RhsTerms
from fvsolve.errors import CaseError, Fault, MeshError, did_you_mean, listing
from fvsolve.features.basins.lower_basin import BasinRows
from fvsolve.parts.csv_rows import CsvError, read_rows
from fvsolve.units import show

if TYPE_CHECKING:
    from fvsolve.core.mesh import Mesh

COLUMNS = (("x", "y", "u", "v"), ("x", "y", "psi"))  # of a file
DIMENSIONS = {"x": "length", "y": "length", "u": "velocity", "v": "velocity", "psi": "diffusivity"}
# bits of a stream function after rounding, so that sums of its differences are exact
EXACT_BITS = 50
# relative error of a stream function and of the positions of corners
ROUNDING = 64 * np.finfo(float).eps
# of the greatest velocity: smaller velocities across the outline are rounding, set to zero
ROUNDED_CROSSFLOW = 1e-9


class TransportRows(BasinRows):
    """Rows of the tables of a model for a basin with a given velocity; its only states are scalars, its depth is 1.

    A velocity that crosses the outline where there is no named patch raises CaseError in `lower`.
    """

    given = banded = True

    def pieces(self, valves: bool) -> Iterator[RhsTerms]:
        yield RhsTerms(
            package="fvsolve.features.basins", observe="basin_scalars: observe_given_flows"
        )

    @property
    def forms_stages(self) -> bool:
        spreads = any(self.case.scalars[name].diffusivity > 0.0 for name in self.scalars)
        return not (self.undivided_reason or self.is_fifth_order or spreads)

    def lower(self, draft, row) -> None:
        given, mesh = self.part.velocity, self.mesh
        flows = self.flows(draft)
        row["thickness"], row["density"] = self.part.thickness or 1.0, self.case.properties.density
        row["period"] = given.period or 0.0
        if self.is_grid:
            grid = mesh.grid
            flow_x, flow_y = grid_flows(mesh, flows)
            row["flows"] = draft.to_plane(np.concatenate([flow_x, flow_y]))
            kx, ky = 1.0 / np.diff(grid.x), 1.0 / np.diff(grid.y)
            along, across = abs(flow_x).reshape(grid.ny, -1), abs(flow_y).reshape(-1, grid.nx)
            through = np.maximum(along[:, 1:], along[:, :-1]) + np.maximum(across[1:], across[:-1])
            row["fastest"] = (kx * ky[:, None] * through).max()
            worst = np.unravel_index(np.argmax(kx * ky[:, None] * through), through.shape)
            self.share = float(
                np.maximum(along[:, 1:], along[:, :-1])[worst] / max(through[worst], 1e-300)
            )
        else:
            row["flows"], inner = draft.to_plane(flows), mesh.inner
            through = np.bincount(mesh.left, np.abs(flows), self.n)
            through += np.bincount(mesh.right[:inner], np.abs(flows[:inner]), self.n)
            row["fastest"], self.share = (0.5 * through / mesh.area).max(), 1.0
        net = np.bincount(mesh.left, flows, self.n)
        net -= np.bincount(mesh.right[: mesh.inner], flows[: mesh.inner], self.n)
        self.max_divergence = float(np.abs(net / mesh.area).max())
        self.passing = passing = [name for name in mesh.patches if flows[mesh.patch(name)].any()]
        if mesh.patches[-1] in passing:
            own = np.arange(flows.size)[mesh.patch(mesh.patches[-1])]
            speed = np.abs(flows[own]) / mesh.length[own]
            # report the outer outline, before the outlines of holes
            around = is_outer_loop(mesh)[own - mesh.inner]
            at = mesh.middle[
                own[np.argmax(np.where(around, speed, 0.0) if speed[around].any() else speed)]
            ]
            text = f"the flow crosses the outline at x = {at[0]:.6g} m, y = {at[1]:.6g} m"
            remedy = "where there is no named patch; expected a patch with a name there"
            draft.fault(f"nodes.{self.name}.velocity", f"{text}, {remedy}")
            draft.check()
        row["unsplit"] = self.unsplit(row, passing)
        if passing:
            inward = -flows[mesh.inner :]
            row["through"] = draft.to_plane(inward[self.ring()] if self.is_grid else inward)

    def unsplit(self, row, passing: list[str]) -> float:
        """Factor by which `fastest`, the greatest rate of flow through a cell [1/s], is multiplied to limit the step.

        Without divergence and diffusion, Euler steps of Courant number 1 by this rate keep scalars within their bounds,
        except with upwind5, which has no bounds.
        row : row of the table of basins; passing : names of the patches with flow through them
        """
        if row["scheme"] in (rec.UPWIND, rec.LINEAR):
            return 1.0
        return 3.0 if row["scheme"] == rec.MUSCL and self.is_grid and passing else 2.0

    def is_open(self, patch: str) -> bool:
        return patch in self.passing

    def flows(self, draft) -> np.ndarray:
        """Flow through every face of the mesh along its normal, per thickness : float64[f] [m2/s].

        It is that at full speed, without the factor of `period`. Raises CaseError for a wrong velocity.
        """
        given, mesh = self.part.velocity.given, self.mesh
        if self.part.velocity.form == "u, v":
            return velocity_flows(
                mesh, *(given[key].at(*np.ascontiguousarray(mesh.middle.T)) for key in "uv")
            )
        if self.part.velocity.form == "stream":
            given = {"stream": given["stream"].at(*np.ascontiguousarray(mesh.points.T))}
        try:
            return face_flows(mesh, given)
        except (ValueError, TypeError, CaseError) as error:
            draft.fault(f"nodes.{self.name}.velocity", str(error))
            draft.check()
            raise

    def max_rate(self, y: np.ndarray) -> tuple[float, float]:
        return float(self.row["fastest"]), self.share

    def mass_per_depth(self) -> np.ndarray:
        return self.row["density"] * self.row["thickness"] * self.mesh.area


def constant(x, y, u, v):
    """Stream function [m2/s] of the uniform velocity (u, v) [m/s]."""
    return u * y - v * x


def rotation(x, y, centre, angular_velocity):
    """Stream function [m2/s] of a solid-body rotation, anticlockwise about centre [m]; angular_velocity [rad/s]."""
    return -0.5 * angular_velocity * ((x - centre[0]) ** 2 + (y - centre[1]) ** 2)


def swirl(x, y, speed=1.0, origin=(0.0, 0.0), size=1.0):
    """LeVeque's swirl (1996): speed size / pi sin^2(pi x / size) sin^2(pi y / size) [m2/s], from `origin`."""
    x, y = np.pi * (x - origin[0]) / size, np.pi * (y - origin[1]) / size
    return speed * size / np.pi * np.sin(x) ** 2 * np.sin(y) ** 2


def shear(x, y, rate, y0=0.0, u=0.0):
    """Stream function [m2/s] of a shear flow along x, velocity u + rate (y - y0); rate [1/s], u [m/s], y0 [m]."""
    return u * y + 0.5 * rate * (y - y0) ** 2


def parabolic(x, y, speed, south, north):
    """Stream function [m2/s] of a parabolic flow along x between walls at y = south and north; speed : mean u."""
    s = (y - south) / (north - south)
    return speed * (north - south) * s * s * (3.0 - 2.0 * s)


def cellular(x, y, speed, width, height, origin=(0.0, 0.0)):
    """Stream function [m2/s] of vortices of `width` by `height` [m] with alternate rotation; speed : greatest u."""
    s = np.sin(np.pi * (x - origin[0]) / width) * np.sin(np.pi * (y - origin[1]) / height)
    return speed * height / np.pi * s


# Stream functions psi(x, y, parameters) [m2/s] with u = psi_y, v = -psi_x. To add an expression, add a function here.
EXPRESSIONS: dict[str, Callable[..., np.ndarray]] = {
    function.__name__: function
    for function in (constant, rotation, swirl, shear, parabolic, cellular)
}


def face_flows(mesh: Mesh, velocity: Mapping) -> np.ndarray:
    """Flow through every face per depth, along its normal : float64[f] [m2/s].

    velocity : {"expression": name, and its parameters}, {"stream": float64[p] stream function at the corners [m2/s]} or
    {"file": table file with columns x, y, u, v or x, y, psi, with units in the header or in SI, interpolated linearly,
    "sheet": its sheet, if it is a workbook}.
    All but the flows from u and v are exactly free of divergence in every cell. Raises ValueError or TypeError for a
    wrong expression or stream function, MeshError for a wrong file.
    """
    kinds = {"expression": _by_name, "stream": _by_corners, "file": _by_file}
    given = [kind for kind in kinds if kind in velocity]
    if len(given) != 1:
        raise ValueError(
            f"velocity has {listing(velocity) or 'nothing'}; expected one of {listing(kinds)}"
        )
    return kinds[given[0]](mesh, **velocity)


def grid_flows(mesh: Mesh, flows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(eastward, northward) flows through the faces of a rectangle without holes, row by row.

    eastward : float64[ny (nx + 1)]; northward : float64[(ny + 1) nx]
    flows : float64[f]  flows through the faces of the mesh along their normals
    Raises ValueError for any other mesh.
    """
    grid = mesh.grid
    if grid is None or (grid.index < 0).any():
        raise ValueError("the mesh is not a full rectangle; expected a rectangle without holes")
    j, i = np.divmod(mesh.left, grid.nx)
    flow_x, flow_y = np.zeros(grid.ny * (grid.nx + 1)), np.zeros((grid.ny + 1) * grid.nx)
    for to, part, first, step in (
        (flow_x, 0, j * (grid.nx + 1) + i, 1),
        (flow_y, 1, j * grid.nx + i, grid.nx),
    ):
        ahead, behind = mesh.normal[:, part] > 0.5, mesh.normal[:, part] < -0.5
        to[first[ahead] + step] = flows[ahead]
        to[first[behind]] = -flows[behind]
    return flow_x, flow_y


def _by_name(mesh: Mesh, expression: str, **parameters) -> np.ndarray:
    if expression not in EXPRESSIONS:
        close = did_you_mean(str(expression), EXPRESSIONS)
        raise ValueError(f'unknown velocity "{expression}"; expected {listing(EXPRESSIONS)}{close}')
    function = EXPRESSIONS[expression]
    known = dict(list(inspect.signature(function).parameters.items())[2:])
    for name in parameters:
        if name not in known:
            close = did_you_mean(name, known)
            raise ValueError(
                f'velocity "{expression}" has no parameter {name}; expected {listing(known)}{close}'
            )
    missing = [name for name, p in known.items() if p.default is p.empty and name not in parameters]
    if missing:
        raise ValueError(
            f'velocity "{expression}" needs values of more parameters: {listing(missing)}'
        )
    return _by_corners(mesh, function(mesh.points[:, 0], mesh.points[:, 1], **parameters))


def _by_corners(mesh: Mesh, stream: np.ndarray) -> np.ndarray:
    """Flows through faces as differences of a stream function, rounded so that the differences are exact : float64[f].

    stream : float64[p]  stream function at the corners [m2/s]
    Raises ValueError for another shape or a value that is not finite.
    """
    stream = np.asarray(stream, float)
    if stream.shape != (len(mesh.points),):
        text = f"expected a value for each of {len(mesh.points)} corners of cells"
        raise ValueError(f"stream has shape {stream.shape}; {text}")
    if not np.isfinite(stream).all():
        x, y = mesh.points[np.flatnonzero(~np.isfinite(stream))[0]]
        raise ValueError(f"the stream function is not finite at ({x:.6g}, {y:.6g}) m")
    unit = 2.0 ** (np.frexp(np.abs(stream).max())[1] - EXACT_BITS)
    psi = np.round(constant_along_walls(mesh, stream) / unit) * unit
    return psi[mesh.ends[:, 1]] - psi[mesh.ends[:, 0]]


def connected(points: int, start: np.ndarray, stop: np.ndarray) -> np.ndarray:
    """Number of the group of points that edges connect, for each point : int64[points].

    start, stop : points at the ends of the edges
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    return connected_components(
        coo_array((np.ones(start.size), (start, stop)), shape=(points, points))
    )[1]


def constant_along_walls(mesh: Mesh, stream: np.ndarray) -> np.ndarray:
    """Stream function, made constant along boundary parts where it varies by rounding errors only : float64[p]."""
    steps = np.abs(np.diff(stream[mesh.ends], axis=1)[:, 0])
    # effect of rounding errors of positions
    reach = (steps / mesh.length).max() * np.abs(mesh.points).max()
    start, stop = mesh.ends[mesh.inner :][
        steps[mesh.inner :] <= ROUNDING * (np.abs(stream).max() + reach)
    ].T
    _, first, stretch = np.unique(
        connected(stream.size, start, stop), return_index=True, return_inverse=True
    )
    return stream[first[stretch]]


def is_outer_loop(mesh: Mesh) -> np.ndarray:
    """True for boundary faces of the outer boundary, False for those around holes : bool[boundary faces]."""
    start, stop = mesh.ends[mesh.inner :].T
    loop = connected(len(mesh.points), start, stop)
    return loop[start] == loop[np.argmin(mesh.points[:, 0])]


def velocity_flows(mesh: Mesh, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Flows through faces from velocities u, v at their middles : float64[f] [m2/s].

    Flows through the boundary that are rounding errors are set to zero.
    """
    normal = u * mesh.normal[:, 0] + v * mesh.normal[:, 1]
    still = np.abs(normal) <= ROUNDED_CROSSFLOW * np.hypot(u, v).max()
    still[: mesh.inner] = False
    return np.where(still, 0.0, normal * mesh.length)


def _by_file(mesh: Mesh, file: str | Path, sheet: str | None = None) -> np.ndarray:
    columns = _columns(Path(file), sheet)
    places = np.stack([columns["x"], columns["y"]], axis=1)
    if "psi" in columns:
        return _by_corners(mesh, _interpolated(file, places, columns["psi"], mesh.points))
    velocity = np.stack([columns["u"], columns["v"]], axis=1)
    velocities = _interpolated(file, places, velocity, mesh.middle)
    return velocity_flows(mesh, *velocities.T)


def _columns(path: Path, sheet: str | None) -> dict[str, np.ndarray]:
    """Columns of a table file of velocities or of a stream function : name -> float64[rows], in SI units."""
    try:
        rows = read_rows(path, sheet)
        if set(rows.names) not in map(set, COLUMNS) or len(rows.names) not in map(len, COLUMNS):
            header = show(", ".join(rows.header))
            raise CsvError(
                path.name, f"its header is {header}; expected x, y, u, v or x, y, psi", 1
            )
        columns = {name: rows.numbers(k, DIMENSIONS[name]) for k, name in enumerate(rows.names)}
    except CsvError as error:
        raise MeshError([Fault("", error.message, error.line)], str(path)) from None
    except ValueError as error:
        raise MeshError([Fault("", str(error))], str(path)) from None
    if len(rows.lines) < 3:
        text = f"too few points ({len(rows.lines)}); expected at least three, around the mesh"
        raise MeshError([Fault("", text)], str(path))
    return columns


def _interpolated(
    file: str | Path, places: np.ndarray, values: np.ndarray, positions: np.ndarray
) -> np.ndarray:
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    try:
        result = LinearNDInterpolator(places, values)(positions)
    except QhullError as error:
        text = "the points lie on one line; expected points around the mesh"
        raise MeshError([Fault("", text)], str(file)) from error
    outside = np.isnan(result).reshape(len(positions), -1).any(axis=1)
    if outside.any():
        (x, y), (low, high) = positions[outside][0], (places.min(axis=0), places.max(axis=0))
        text = f"the points do not enclose {outside.sum()} of {len(positions)} positions of the mesh, the first "
        span = f"({low[0]:.6g}, {low[1]:.6g}) to ({high[0]:.6g}, {high[1]:.6g}) m"
        raise MeshError(
            [Fault("", f"{text}({x:.6g}, {y:.6g}) m; the points span {span}")], str(file)
        )
    return result

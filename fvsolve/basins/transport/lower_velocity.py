"""Flows through the faces of a mesh from given velocities: expressions, stream functions, files."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fvsolve.errors import Fault, MeshError, did_you_mean, listing
from fvsolve.parts.csv_rows import CsvError, read_rows

if TYPE_CHECKING:
    from fvsolve.mesh import Mesh

COLUMNS = (("x", "y", "u", "v"), ("x", "y", "psi"))  # of a file
DIMENSIONS = {"x": "length", "y": "length", "u": "velocity", "v": "velocity", "psi": "diffusivity"}
EXACT_BITS = 50  # bits of a stream function after rounding, so that sums of its differences are exact
ROUNDING = 64 * np.finfo(float).eps  # relative error of a stream function and of the positions of corners
ROUNDED_CROSSFLOW = (
    1e-9  # of the greatest velocity: smaller velocities across the outline are rounding, and set to zero
)


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
    function.__name__: function for function in (constant, rotation, swirl, shear, parabolic, cellular)
}


def face_flows(mesh: Mesh, velocity: Mapping) -> np.ndarray:
    """Flow through every face per depth, along its normal : float64[f] [m2/s].

    velocity : {"expression": name, and its parameters}, {"stream": float64[p] stream function at the corners [m2/s]} or
    {"file": CSV file with columns x, y, u, v or x, y, psi, with units in the header or in SI, interpolated linearly}.
    All but the flows from u and v are exactly free of divergence in every cell. Raises ValueError or TypeError for a
    wrong expression or stream function, MeshError for a wrong file.
    """
    kinds = {"expression": _by_name, "stream": _by_corners, "file": _by_file}
    given = [kind for kind in kinds if kind in velocity]
    if len(given) != 1:
        raise ValueError(f"velocity has {listing(velocity) or 'nothing'}; expected one of {listing(kinds)}")
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
    for to, part, first, step in ((flow_x, 0, j * (grid.nx + 1) + i, 1), (flow_y, 1, j * grid.nx + i, grid.nx)):
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
            raise ValueError(f'velocity "{expression}" has no parameter {name}; expected {listing(known)}{close}')
    missing = [name for name, p in known.items() if p.default is p.empty and name not in parameters]
    if missing:
        raise ValueError(f'velocity "{expression}" needs values of more parameters: {listing(missing)}')
    return _by_corners(mesh, function(mesh.points[:, 0], mesh.points[:, 1], **parameters))


def _by_corners(mesh: Mesh, stream: np.ndarray) -> np.ndarray:
    """Flows through faces as differences of a stream function, rounded so that the differences are exact : float64[f].

    stream : float64[p]  stream function at the corners [m2/s]
    Raises ValueError for another shape or a value that is not finite.
    """
    stream = np.asarray(stream, float)
    if stream.shape != (len(mesh.points),):
        raise ValueError(
            f"stream has shape {stream.shape}; expected a value for each of {len(mesh.points)} corners of cells"
        )
    if not np.isfinite(stream).all():
        x, y = mesh.points[np.flatnonzero(~np.isfinite(stream))[0]]
        raise ValueError(f"the stream function is not finite at ({x:.6g}, {y:.6g}) m")
    unit = 2.0 ** (np.frexp(np.abs(stream).max())[1] - EXACT_BITS)
    psi = np.round(constant_along_walls(mesh, stream) / unit) * unit
    return psi[mesh.ends[:, 1]] - psi[mesh.ends[:, 0]]


def constant_along_walls(mesh: Mesh, stream: np.ndarray) -> np.ndarray:
    """Stream function, made constant along boundary parts where it varies by rounding errors only : float64[p]."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    steps = np.abs(np.diff(stream[mesh.ends], axis=1)[:, 0])
    reach = (steps / mesh.length).max() * np.abs(mesh.points).max()  # effect of rounding errors of positions
    start, stop = mesh.ends[mesh.inner :][steps[mesh.inner :] <= ROUNDING * (np.abs(stream).max() + reach)].T
    graph = coo_array((np.ones(start.size), (start, stop)), shape=(stream.size, stream.size))
    _, first, stretch = np.unique(connected_components(graph)[1], return_index=True, return_inverse=True)
    return stream[first[stretch]]


def is_outer_loop(mesh: Mesh) -> np.ndarray:
    """True for boundary faces of the outer boundary, False for those around holes : bool[boundary faces]."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    start, stop = mesh.ends[mesh.inner :].T
    count = len(mesh.points)
    loop = connected_components(coo_array((np.ones(start.size), (start, stop)), shape=(count, count)))[1]
    return loop[start] == loop[np.argmin(mesh.points[:, 0])]


def velocity_flows(mesh: Mesh, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Flows through faces from velocities u, v at their middles : float64[f] [m2/s].

    Flows through the boundary that are rounding errors are set to zero.
    """
    normal = u * mesh.normal[:, 0] + v * mesh.normal[:, 1]
    still = np.abs(normal) <= ROUNDED_CROSSFLOW * np.hypot(u, v).max()
    still[: mesh.inner] = False
    return np.where(still, 0.0, normal * mesh.length)


def _by_file(mesh: Mesh, file: str | Path) -> np.ndarray:
    columns = _columns(Path(file))
    places = np.stack([columns["x"], columns["y"]], axis=1)
    if "psi" in columns:
        return _by_corners(mesh, _interpolated(file, places, columns["psi"], mesh.points))
    velocity = np.stack([columns["u"], columns["v"]], axis=1)
    velocities = _interpolated(file, places, velocity, mesh.middle)
    return velocity_flows(mesh, *velocities.T)


def _columns(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV file of velocities or of a stream function : name -> float64[rows], in SI units."""
    try:
        rows = read_rows(path)
        if set(rows.names) not in map(set, COLUMNS) or len(rows.names) not in map(len, COLUMNS):
            raise CsvError(path.name, f"its header is {', '.join(rows.header)}; expected x, y, u, v or x, y, psi", 1)
        columns = {name: rows.numbers(k, DIMENSIONS[name]) for k, name in enumerate(rows.names)}
    except CsvError as error:
        raise MeshError([Fault("", error.message, error.line)], str(path)) from None
    except ValueError as error:
        raise MeshError([Fault("", str(error))], str(path)) from None
    if len(rows.lines) < 3:
        text = f"too few points ({len(rows.lines)}); expected at least three, around the mesh"
        raise MeshError([Fault("", text)], str(path))
    return columns


def _interpolated(file: str | Path, places: np.ndarray, values: np.ndarray, positions: np.ndarray) -> np.ndarray:
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    try:
        result = LinearNDInterpolator(places, values)(positions)
    except QhullError as error:
        raise MeshError(
            [Fault("", "the points lie on one line; expected points around the mesh")], str(file)
        ) from error
    outside = np.isnan(result).reshape(len(positions), -1).any(axis=1)
    if outside.any():
        (x, y), (low, high) = positions[outside][0], (places.min(axis=0), places.max(axis=0))
        text = f"the points do not enclose {outside.sum()} of {len(positions)} positions of the mesh, the first "
        text += (
            f"({x:.6g}, {y:.6g}) m; the points span ({low[0]:.6g}, {low[1]:.6g}) to ({high[0]:.6g}, {high[1]:.6g}) m"
        )
        raise MeshError([Fault("", text)], str(file))
    return result

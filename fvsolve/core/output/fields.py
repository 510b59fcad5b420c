"""Fields of a run: the index fields.pvd and its .vtu files with the values of all cells at the output times.

Pipes are chains of line cells along the network layout, with the elevation upwards. Features may add lines that move.
Cell data are in SI, pressures are absolute, and every array carries its unit as the VTK key UNITS_LABEL.

Under MPI each rank writes a .vtu file of its rows of a basin, rank 0 also the .pvtu index. Rank 0 has the values of all
cells. The other ranks wait for a broadcast of a function to call and its arguments (`solve.parallel_bands`).
"""

import base64
import html
import re
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.core.assembly.features import frames_of
from fvsolve.errors import RunError
from fvsolve.file_replacement import write_file

FIELD_UNITS = {
    "pressure": "Pa",
    "head": "m",
    "velocity": "m/s",
    "flow": "m3/s",
    "min_pressure": "Pa",
    "max_pressure": "Pa",
}
UNIT_XML = '<InformationKey name="UNITS_LABEL" location="vtkDataArray">{}</InformationKey>\n'
VTK_TYPES = {"f": "Float", "i": "Int", "u": "UInt"}
CELL_TYPES = {"line": 3, "triangle": 5, "quad": 9}  # type -> its number in VTK
MIN_WINDOW = 9  # least power of 2 of the window of zlib [bytes]
ZLIB_LEVEL = 1  # higher levels take several times as long, for files that are little smaller
VTU_HEAD = """<?xml version="1.0"?>
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian" header_type="UInt64" \
compressor="vtkZLibDataCompressor">
<UnstructuredGrid>
{reference}<Piece NumberOfPoints="{points}" NumberOfCells="{cells}">
"""
VTU_TAIL = "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n"
FILE_ATTRIBUTE = re.compile('file="([^"]+)"')
TIME_ATTRIBUTE = re.compile('timestep="([-+.e0-9]+)"')
PVD_HEAD = """<?xml version="1.0"?>
<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">
<Collection>
"""
PVD_TAIL = "</Collection>\n</VTKFile>\n"


class FieldSeries:
    """Series of .vtu files with their index fields.pvd, which is complete after each frame (output time).

    pieces : None, or the `ParallelBasinWriter` of meshes whose rows are distributed over MPI ranks
    """

    def __init__(self, folder: Path, model):
        self.folder, self.model, self.pieces = folder, model, None
        self.frames = 0
        # file name of a part -> `grid_xml` of points that do not move
        self.fixed_grids: dict[str, str] = {}
        places = {basin.name: np.array(basin.part.position or (0.0, 0.0)) for basin in model.meshed}
        pipe_reference = ""
        if model.pipes:
            from fvsolve.core.output import network_layout

            plane = network_layout.plane_of(model.case)
            if plane.crs:
                pipe_reference = place_xml(plane.origin.tolist(), plane.crs)

            places = network_layout.plan_positions(
                model.case, {pipe.name: pipe.length for pipe in model.pipes}
            )
            self.points, self.lines = pipe_geometry(model, places)
            self.owner = points_on_bodies(model, self.points)
        moving = {basin.name: np.zeros(2) for basin in model.meshed if basin.part.on is not None}
        self.places = places | moving  # a basin on a body is drawn in world axes
        lines = [basin for basin in model.meshed if getattr(basin, "table", "") == "links"]
        if lines:
            from fvsolve.core.output.link_frames import link_frames

            self.places |= link_frames(model.case, lines)
        carried = {name: scalar.unit for name, scalar in model.case.scalars.items()}
        units = {
            basin.name: basin.units | basin.units_of_maxima | (carried if basin.scalars else {})
            for basin in model.meshed
        }
        self.meshes = {
            basin.name: (*basin_geometry(basin, self.places[basin.name]), units[basin.name])
            for basin in model.meshed
        }
        self.references = {basin.name: reference_xml(basin) for basin in model.meshed}
        self.references[""] = pipe_reference
        self.drawn = next(
            (own for feature in model.features if (own := feature.drawn(model)) is not None), None
        )
        self.pipes = [pipe.name for pipe in model.pipes]
        self.units = FIELD_UNITS | carried
        cells = [pipe.cells for pipe in model.pipes]
        self.pipe = np.repeat(np.arange(len(cells), dtype=np.int32), cells)

    def start(self) -> None:
        """Start an empty series."""
        (self.folder / "fields").mkdir(exist_ok=True)
        (self.folder / "fields.pvd").write_bytes((PVD_HEAD + PVD_TAIL).encode())

    def entries_until(self, frames: int, t: float) -> list[str]:
        """Lines of the index of the first `frames` frames, written up to a checkpoint at time `t` [s].

        Raises RunError if frames are missing, or later than the checkpoint.
        """
        index = self.folder / "fields.pvd"
        lines = index.read_text(encoding="utf-8").splitlines() if index.is_file() else []
        n = frames * (len(self.meshes) + (1 if self.pipes else 0) + (1 if self.drawn else 0))
        entries = [f"{line}\n" for line in lines if line.startswith("<DataSet")][:n]
        matches = [FILE_ATTRIBUTE.search(line) for line in entries]
        if len(entries) < n or not all(
            match and (self.folder / match[1]).is_file() for match in matches
        ):
            raise RunError(f"{index}: frames are missing; start the run again with --force")
        time = TIME_ATTRIBUTE.search(entries[-1]) if entries else None
        if entries and not (time and float(time[1]) <= t + 1e-9 * abs(t)):
            text = f"its frames do not fit the checkpoint ({frames} frames up to t = {t:.6g} s)"
            raise RunError(f"{index}: {text}; start the run again with --force")
        return entries

    def continue_from(self, frames: int, entries: list[str]) -> None:
        """Keep the first `frames` frames of the series and delete later frames, to continue from a checkpoint.

        entries : result of `entries_until`
        """
        (self.folder / "fields").mkdir(exist_ok=True)
        for path in (self.folder / "fields").glob("*.*vtu"):
            number = path.stem.rpartition("-")[2]
            if number.isdecimal() and int(number) >= frames:
                path.unlink()
        write_file(self.folder / "fields.pvd", PVD_HEAD + "".join(entries) + PVD_TAIL)
        self.frames = frames

    def write(self, t: float, frame: dict) -> None:
        """Write the frame at time `t` [s]; frame : result of `RunData.fields`."""
        for part, basin in enumerate(self.model.meshed, 1):
            self._write_basin(t, part, basin, frame)
        if self.drawn:
            file, (points, speed) = (
                f"fields/{self.drawn.name}-{self.frames:06d}.vtu",
                self.drawn.at(frame["out"]),
            )
            blocks, grid = {**self.drawn.blocks, "speed": [speed]}, [("line", self.drawn.lines)]
            write_frame(self.folder / file, grid_xml(points, grid), blocks, {"speed": "m/s"})
            self._add_to_collection(t, len(self.meshes) + 1, file)
        if self.pipes:
            file = f"fields/{self.frames:06d}.vtu"
            data = {
                name: [np.concatenate([frame[pipe][name] for pipe in self.pipes])]
                for name in self.units
            }
            data["pipe"] = [self.pipe]
            points = self.points_at(frame)
            grid = self.grid("", points, [("line", self.lines)], points is self.points)
            write_frame(self.folder / file, grid, data, self.units)
            self._add_to_collection(t, 0, file)
        self.frames += 1

    def _write_basin(self, t: float, part: int, basin, frame: dict) -> None:
        """Write the fields of a basin at time `t` [s]; part : its number in the index; frame : as for `write`."""
        points, cells, units = self.meshes[basin.name]
        file, values = f"fields/{basin.name}-{self.frames:06d}.vtu", frame[basin.name]
        if self.pieces is not None and basin.name in self.pieces.rows:
            file = f"fields/{basin.name}-{self.frames:06d}.pvtu"
            self.pieces.write(self.folder / file, basin, self.places[basin.name], values, units)
        else:
            if basin.part.on is not None:
                values = values | basin.vectors_at(values, frame["out"], self.model.layout)
            blocks = {key: split_blocks(value, cells) for key, value in values.items()}
            # moving meshes have points of their own at each time
            moves = basin.name in frame["points"]
            if moves:
                points = np.append(self.places[basin.name], 0.0) + frame["points"][basin.name]
            write_frame(
                self.folder / file, self.grid(basin.name, points, cells, not moves), blocks, units
            )
        self._add_to_collection(t, part, file)

    def grid(self, part: str, points: np.ndarray, cells: list, fixed: bool) -> str:
        """Result of `grid_xml`, kept under the name `part` if the points are fixed."""
        if not fixed:
            return grid_xml(points, cells, self.references.get(part, ""))
        if part not in self.fixed_grids:
            self.fixed_grids[part] = grid_xml(points, cells, self.references.get(part, ""))
        return self.fixed_grids[part]

    def points_at(self, frame: dict) -> np.ndarray:
        """Points of the pipes in world axes at the time of a frame : float64[n, 3] [m]; points on frames move."""
        if not (self.owner >= 0).any():
            return self.points
        from fvsolve.core.model.frame_points import world_points

        return world_points(self.model, frame["out"], self.owner, self.points)[0]

    def _add_to_collection(self, t: float, part: int, file: str) -> None:
        line = f'<DataSet timestep="{float(t)!r}" part="{part}" file="{file}"/>\n'
        # A single write over the closing tags: the file stays valid if the process is killed before or after it.
        with open(self.folder / "fields.pvd", "r+b", buffering=0) as file:
            file.seek(-len(PVD_TAIL), 2)
            file.write((line + PVD_TAIL).encode())


def write_frame(path: Path, grid: str, data: dict[str, list], units: dict[str, str]) -> None:
    """Write a .vtu file: unstructured grid in XML, arrays compressed by zlib, of which each carries its unit.

    grid : result of `grid_xml`; data : name -> list of arrays, one for each block of cells; units : name -> unit
    """
    arrays = (
        (name, np.concatenate([np.asarray(block) for block in blocks]))
        for name, blocks in data.items()
    )
    text = "".join(array_xml(name, values, units) for name, values in arrays)
    write_file(path, f"{grid}<CellData>\n{text}</CellData>\n{VTU_TAIL}")


def reference_xml(basin) -> str:
    """XML text of the key `origin` [m] and the number of the key `crs` of a basin; "" if it has neither."""
    part = basin.part
    if part.origin is None and part.crs is None:
        return ""
    return place_xml(part.origin or (0.0, 0.0), part.crs)


def place_xml(origin: Sequence[float], crs: str | None) -> str:
    """XML text of an easting and northing [m] and of the number of a reference system."""
    arrays: list[tuple[str, str, Sequence]] = [("Float64", "origin", origin)]
    arrays += [("Int32", "epsg", (int(crs.removeprefix("EPSG:")),))] if crs else []
    text = "".join(
        f'<DataArray type="{kind}" Name="{name}" NumberOfTuples="{len(values)}" format="ascii">'
        f"{' '.join(map(repr, values))}</DataArray>\n"
        for kind, name, values in arrays
    )
    return f"<FieldData>\n{text}</FieldData>\n"


def grid_xml(points: np.ndarray, cells: list, reference: str = "") -> str:
    """Begin of the text of a .vtu file, with points and cells.

    points : float64[p, 3]; cells : blocks (type of `CELL_TYPES`, int[cells, corners])
    reference : result of `reference_xml`
    """
    corners = [np.asarray(block, dtype=np.int64) for _, block in cells]
    ends = np.cumsum(
        np.concatenate([np.full(len(block), block.shape[1], dtype=np.int64) for block in corners])
    )
    types = np.concatenate(
        [np.full(len(block), CELL_TYPES[kind], dtype=np.int32) for kind, block in cells]
    )
    groups = {
        "Points": [("Points", np.asarray(points, dtype=float))],
        "Cells": [
            ("connectivity", np.concatenate([block.ravel() for block in corners])),
            ("offsets", ends),
            ("types", types),
        ],
    }
    text = VTU_HEAD.format(points=len(points), cells=len(types), reference=reference)
    for group, arrays in groups.items():
        text += f"<{group}>\n{''.join(array_xml(name, values, {}) for name, values in arrays)}</{group}>\n"
    return text


def array_xml(name: str, values: np.ndarray, units: dict[str, str]) -> str:
    """XML text of an array: the sizes and the bytes of a single block compressed by zlib, in base 64.

    values : float64[n], int32[n] or int64[n], or with a second axis for components
    """
    values = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("<"))
    block = compressed(values.tobytes())
    sizes = np.array(
        [1, values.nbytes, 0, len(block)] if values.nbytes else [0, 0, 0], dtype="<u8"
    ).tobytes()
    content = base64.b64encode(sizes) + base64.b64encode(block if values.nbytes else b"")
    kind = f"{VTK_TYPES[values.dtype.kind]}{8 * values.itemsize}"
    shape = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
    head = f'<DataArray type="{kind}" Name="{html.escape(name)}"{shape} format="binary">'
    return f"{head}{content.decode()}\n{unit_xml(units, name)}</DataArray>\n"


def compressed(data: bytes) -> bytes:
    """Data compressed by zlib, with buffers no larger than the data need: clearing those of 268 kB takes longer."""
    window = min(max(len(data).bit_length(), MIN_WINDOW), zlib.MAX_WBITS)
    stream = zlib.compressobj(
        ZLIB_LEVEL, zlib.DEFLATED, window, min(window - 6, zlib.DEF_MEM_LEVEL)
    )
    return stream.compress(data) + stream.flush()


def unit_xml(units: dict[str, str], name: str) -> str:
    """XML text of the unit of an array; "" if it has no unit."""
    return UNIT_XML.format(html.escape(units[name], quote=False)) if name in units else ""


def pipe_geometry(model, plan: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Points [m] and lines of all pipes : float64[n, 3], int[cells, 2].

    Pipes share the point of their common node; the point of a node at a mesh is the mean of its faces.
    plan : part -> plan position float64[2] [m]
    """
    from fvsolve.core.output import network_layout

    places = {name: plan[network_layout.place(name)] for name in model.node_names}
    for part in model.meshed:
        places |= {name: plan[part.name] + point for name, point in part.node_points().items()}
    bends = network_layout.link_bends(model.case.links)
    ends = list(dict.fromkeys(end for pipe in model.pipes for end in (pipe.from_, pipe.to)))
    index = {name: i for i, name in enumerate(ends)}
    points = [np.array([[*places[name], model.elevation[name]] for name in ends])]
    lines, count = [], len(ends)
    for pipe in model.pipes:
        fractions = np.asarray(pipe.edges[1:-1]) / pipe.length
        start, end = places[pipe.from_], places[pipe.to]
        low, high = model.elevation[pipe.from_], model.elevation[pipe.to]
        inner = network_layout.link_path(start, end, fractions, bends[pipe.name])
        z = low + fractions * (high - low)
        if pipe.profile is not None:
            z = pipe.profile.at(pipe.edges[1:-1])
            inner = inner if pipe.profile.plan is None else pipe.profile.plan_at(pipe.edges[1:-1])
        points.append(np.column_stack([inner, z]))
        chain = [index[pipe.from_], *range(count, count + pipe.cells - 1), index[pipe.to]]
        lines.append(np.column_stack([chain[:-1], chain[1:]]))
        count += pipe.cells - 1
    return np.concatenate(points), np.concatenate(lines)


def points_on_bodies(model, points: np.ndarray) -> np.ndarray:
    """Body of each point of `pipe_geometry` : int[n], -1 for the world.

    The coordinates of points on a body are replaced, in place, by coordinates in the axes of the body, along a straight
    pipe.
    """
    places = model.case.places
    ends = list(dict.fromkeys(end for pipe in model.pipes for end in (pipe.from_, pipe.to)))
    owner, at = np.full(len(points), -1), len(ends)

    def body(name: str) -> int:
        on = getattr(places.get(name), "on", None)
        return -1 if on is None else frames_of(model).index(on)

    for k, name in enumerate(ends):
        owner[k] = body(name)
        if owner[k] >= 0:
            points[k] = places[name].place
    for pipe in model.pipes:
        inner = slice(at, at + pipe.cells - 1)
        owner[inner], at = body(pipe.from_), inner.stop
        if body(pipe.from_) >= 0:
            first, last = np.array(places[pipe.from_].place), np.array(places[pipe.to].place)
            points[inner] = first + np.asarray(pipe.edges[1:-1])[:, None] / pipe.length * (
                last - first
            )
    return owner


def basin_geometry(basin, origin: Any) -> tuple[np.ndarray, list]:
    """Corners of the cells of a basin at bed level [m], float64[p, 3], and blocks of successive cells of equal type."""
    mesh = basin.mesh
    points = drawn_points(basin, origin, mesh.points)
    three = mesh.cells[:, 3] < 0
    ends = np.flatnonzero(np.diff(three)) + 1
    blocks = np.split(np.arange(len(three)), ends)
    named = {True: ("triangle", 3), False: ("quad", 4)}
    return points, [(named[three[b[0]]][0], mesh.cells[b, : named[three[b[0]]][1]]) for b in blocks]


def drawn_points(basin, origin: Any, points: np.ndarray) -> np.ndarray:
    """Points of a basin mesh at bed level : float64[p, 3] [m]; origin : shift in plan [m], or a `PlanFrame`"""
    x, y = np.ascontiguousarray(points.T)
    if hasattr(origin, "along"):  # along a link
        return np.column_stack([origin.points(x, y), basin.ground(x, y)])
    return np.column_stack([origin[0] + x, origin[1] + y, basin.ground(x, y)])


def split_blocks(values: np.ndarray, blocks: list) -> list[np.ndarray]:
    """Split an array of cell values into one array for each block of cells."""
    return np.split(values, np.cumsum([len(cells) for _, cells in blocks])[:-1])


def read_series(path: Path) -> list[tuple[float, Path]]:
    """Time [s] and file of every entry of a .pvd file; raises RunError if it cannot be read."""
    from xml.etree import ElementTree

    try:
        root = ElementTree.parse(path).getroot()
        return [
            (float(entry.attrib["timestep"]), path.parent / entry.attrib["file"])
            for entry in root.iter("DataSet")
        ]
    except (OSError, ElementTree.ParseError, KeyError, ValueError) as error:
        raise RunError(f"{path} cannot be read: {error}") from None


def read_pipe_lines(
    path: Path, quantity: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Read the pipes of a .vtu file: points [m], lines, values of a quantity in SI, number of the pipe of each line.

    Returns float64[p, 3], int[c, 2], float64[c] and int[c]. Raises RunError if the file cannot be read.
    """
    from meshio import vtu  # meshio.read would print and exit on a damaged file

    try:
        mesh = vtu.read(str(path))
        data = mesh.cell_data_dict
        return mesh.points, mesh.cells_dict["line"], data[quantity]["line"], data["pipe"]["line"]
    except Exception as error:  # meshio and its parsers raise many types on a damaged file
        text = f"{type(error).__name__}: {error}"
        raise RunError(f"{path} cannot be read ({text}); run again with --force") from None


class ParallelBasinWriter:
    """Writer of the fields of meshes whose rows are distributed over MPI ranks.

    comm : MPI communicator of all ranks
    rows : basin -> int64[ranks + 1]  first row of each rank, then the number of rows
    """

    def __init__(self, comm, rows: dict[str, np.ndarray]) -> None:
        self.comm, self.rows = comm, rows

    def write(
        self, path: Path, basin, origin: np.ndarray, values: dict[str, np.ndarray], units: dict
    ) -> None:
        """Write the fields of a basin at one time; raises OSError if a rank cannot write its file.

        origin : plan shift of the basin [m]; values : quantity -> values of all cells; units : quantity -> unit
        """
        comm, rows = self.comm, self.rows[basin.name]
        layouts = {key: (item.shape[1:], item.dtype.str) for key, item in values.items()}
        comm.bcast((write_piece_of_rank, (str(path), basin.name, rows, origin, layouts, units)))
        for k in range(1, comm.size):
            for item in values.values():
                comm.Send(np.ascontiguousarray(item[rank_cells(basin, rows, k)]), k)
        own = {key: item[rank_cells(basin, rows, 0)] for key, item in values.items()}
        faults = [
            item
            for item in comm.gather(write_piece(path, basin, origin, rows, 0, own, units))
            if item
        ]
        if faults:
            raise OSError(*faults[0])
        write_file(path, pvtu_text(path, comm.size, values, units))


def write_piece_of_rank(
    comm, model, path: str, name: str, rows, origin, layouts: dict, units: dict
) -> None:
    """Receive the values of the cells of this rank, write its file, and send an error, if any, to rank 0.

    layouts : quantity -> (shape of the value of a cell, dtype); other arguments as in `write_piece`
    """
    basin = next(item for item in model.meshed if item.name == name)
    n = rows[comm.rank + 1] - rows[comm.rank]
    values = {
        key: np.empty((n * basin.mesh.grid.nx, *shape), kind)
        for key, (shape, kind) in layouts.items()
    }
    for item in values.values():
        comm.Recv(item, 0)
    comm.gather(write_piece(Path(path), basin, origin, rows, comm.rank, values, units))


def rank_cells(basin, rows: np.ndarray, k: int) -> slice:
    """Range of the cells of rank k in a basin. rows : first row of each rank, then the number of rows"""
    wide = basin.mesh.grid.nx
    return slice(wide * int(rows[k]), wide * int(rows[k + 1]))


def write_piece(path: Path, basin, origin, rows, k: int, values: dict, units: dict) -> tuple:
    """Write the .vtu file of rank k; returns the arguments of an OSError if that fails, else ().

    path : .pvtu file; origin : plan shift of the basin [m]; rows : as in `rank_cells`; values : quantity -> values of
    the cells of the rank; units : quantity -> unit
    """
    corners = basin.mesh.cells[rank_cells(basin, rows, k)]
    first, last = int(corners.min()), int(corners.max())  # a piece has complete rows of points
    points = drawn_points(basin, origin, basin.mesh.points[first : last + 1])
    blocks = {key: [array] for key, array in values.items()}
    try:
        grid = grid_xml(points, [("quad", corners - first)], reference_xml(basin))
        write_frame(piece_path(path, k), grid, blocks, units)
    except OSError as error:
        return error.errno, error.strerror or str(error), str(error.filename or piece_path(path, k))
    return ()


def piece_path(path: Path, k: int) -> Path:
    """Path of the file of rank k: `pool.1-000012.vtu` for `pool-000012.pvtu`; no part can have a name with a dot."""
    name, _, frame = path.stem.rpartition("-")
    return path.with_name(f"{name}.{k}-{frame}.vtu")


def pvtu_text(path: Path, n: int, values: dict[str, np.ndarray], units: dict[str, str]) -> str:
    """Text of the .pvtu index of the files of n ranks."""
    arrays = [
        f'<PDataArray type="{VTK_TYPES[array.dtype.kind]}{8 * array.dtype.itemsize}" Name="{key}" '
        f'NumberOfComponents="{array[:1].size}">\n{unit_xml(units, key)}</PDataArray>'
        for key, array in values.items()
    ]
    pieces = [f'<Piece Source="{piece_path(path, k).name}"/>' for k in range(n)]
    points = (
        '<PPoints>\n<PDataArray type="Float64" Name="Points" NumberOfComponents="3"/>\n</PPoints>'
    )
    lines = [
        '<?xml version="1.0"?>',
        '<VTKFile type="PUnstructuredGrid" version="0.1" byte_order="LittleEndian">',
        '<PUnstructuredGrid GhostLevel="0">',
        points,
        "<PCellData>",
        *arrays,
        "</PCellData>",
        *pieces,
        "</PUnstructuredGrid>",
        "</VTKFile>",
    ]
    return "\n".join(lines) + "\n"

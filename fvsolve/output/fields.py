"""fields.pvd and its .vtu frames: what every cell is doing at a time. Knows VTK files; knows no physics.

Pipes are chains of line cells along the layout, elevation upwards; cell data are in SI, pressures absolute, and every
array carries its unit as VTK's own UNITS_LABEL.
"""

from __future__ import annotations

import html
import re
from pathlib import Path

import numpy as np

from fvsolve.case.basins import patch_names
from fvsolve.errors import RunError
from fvsolve.output import layout

UNITS = {
    "pressure": "Pa", "head": "m", "velocity": "m/s", "flow": "m3/s", "least_pressure": "Pa", "greatest_pressure": "Pa",
}  # fmt: skip
UNIT = '<InformationKey name="UNITS_LABEL" location="vtkDataArray">{}</InformationKey>\n'
ARRAY = b"</DataArray>"
FILE = re.compile('file="([^"]+)"')

HEAD = """<?xml version="1.0"?>
<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">
<Collection>
"""
TAIL = "</Collection>\n</VTKFile>\n"


class FieldSeries:
    """Writes one .vtu per frame; the .pvd beside them is whole after each.

    pieces : None, or `Shares` of the basins that ranks write together
    """

    def __init__(self, folder: Path, model):
        self.folder, self.model, self.pieces = folder, model, None
        self.frames = 0
        places = {basin.name: np.array(basin.part.position or (0.0, 0.0)) for basin in model.basins}
        self.places = places
        if model.pipes:
            self.places = places = layout.positions(model.case, {pipe.name: pipe.length for pipe in model.pipes})
            self.points, self.lines = geometry(model, places)
            self.owner = ride(model, self.points)
        riding = {basin.name: np.zeros(2) for basin in model.basins if basin.part.on is not None}
        self.places = places = {**places, **riding}  # in the world, as bodies are
        carried = {name: scalar.unit for name, scalar in model.case.scalars.items()}
        units = {basin.name: basin.units | (carried if basin.scalars else {}) for basin in model.basins}
        self.basins = {basin.name: (*shape(basin, places[basin.name]), units[basin.name]) for basin in model.basins}
        self.bodies = skeleton_of(model)
        self.pipes = [pipe.name for pipe in model.pipes]
        self.units = UNITS | carried
        cells = [pipe.cells for pipe in model.pipes]
        self.pipe = np.repeat(np.arange(len(cells), dtype=np.int32), cells)

    def start(self) -> None:
        """Begin an empty series."""
        (self.folder / "fields").mkdir(exist_ok=True)
        (self.folder / "fields.pvd").write_bytes((HEAD + TAIL).encode())

    def continue_from(self, frames: int) -> None:
        """Keep the first `frames` of a series, drop what came after its checkpoint."""
        listed = self.folder / "fields.pvd"
        lines = listed.read_text(encoding="utf-8").splitlines() if listed.is_file() else []
        many = frames * (len(self.basins) + (1 if self.pipes else 0) + (1 if self.bodies else 0))
        kept = [f"{line}\n" for line in lines if line.startswith("<DataSet")][:many]
        named = [FILE.search(line) for line in kept]
        if len(kept) < many or not all(one and (self.folder / one[1]).is_file() for one in named):
            raise RunError(f"{listed} lacks frames; start the run again with --force")
        (self.folder / "fields").mkdir(exist_ok=True)
        for path in (self.folder / "fields").glob("*.*vtu"):
            number = path.stem.rpartition("-")[2]
            if number.isdecimal() and int(number) >= frames:
                path.unlink()
        listed.write_bytes((HEAD + "".join(kept) + TAIL).encode())
        self.frames = frames

    def write(self, t: float, frame: dict) -> None:
        """Add the frame at time `t` [s]: pipe -> quantity -> float64[cells], SI."""
        name = f"fields/{self.frames:06d}.vtu"
        for part, (basin, (points, cells, units)) in enumerate(self.basins.items(), 1):
            file, whole = f"fields/{basin}-{self.frames:06d}.vtu", self.model.basins[part - 1]
            if self.pieces is not None and basin in self.pieces.rows:
                file = f"fields/{basin}-{self.frames:06d}.pvtu"
                self.pieces.write(self.folder / file, whole, self.places[basin], frame[basin], units)
                self._list(f'<DataSet timestep="{float(t)!r}" part="{part}" file="{file}"/>\n')
                continue
            values = frame[basin]
            if whole.part.on is not None:
                values = values | whole.vectors_at(values, frame["out"], self.model.layout)
            found = {key: parted(value, cells) for key, value in values.items()}
            if basin in frame["points"]:  # what moves
                points = np.append(self.places[basin], 0.0) + frame["points"][basin]
            write_frame(self.folder / file, points, cells, found, units)
            self._list(f'<DataSet timestep="{float(t)!r}" part="{part}" file="{file}"/>\n')
        if self.bodies:
            file, (points, speed) = f"fields/bodies-{self.frames:06d}.vtu", self.bodies.at(frame["out"])
            found = {"body": [self.bodies.whose], "speed": [speed]}
            write_frame(self.folder / file, points, [("line", self.bodies.lines)], found, {"speed": "m/s"})
            self._list(f'<DataSet timestep="{float(t)!r}" part="{len(self.basins) + 1}" file="{file}"/>\n')
        if not self.pipes:
            self.frames += 1
            return
        data = {name: [np.concatenate([frame[pipe][name] for pipe in self.pipes])] for name in self.units}
        data["pipe"] = [self.pipe]
        write_frame(self.folder / name, self.now(frame), [("line", self.lines)], data, self.units)
        self._list(f'<DataSet timestep="{float(t)!r}" part="0" file="{name}"/>\n')
        self.frames += 1

    def now(self, frame: dict) -> np.ndarray:
        """Points of pipes, those that ride where their bodies are."""
        if not (self.owner >= 0).any():
            return self.points
        from fvsolve.output.skeleton import moved

        return moved(self.model, frame["out"], self.owner, self.points)[0]

    def _list(self, line: str) -> None:
        # One write over the closing tags: killed before or after it, the file is whole.
        with open(self.folder / "fields.pvd", "r+b", buffering=0) as file:
            file.seek(-len(TAIL), 2)
            file.write((line + TAIL).encode())


def skeleton_of(model):
    """What is drawn of bodies, None of none."""
    if not model.body_names:
        return None
    from fvsolve.output.skeleton import Skeleton

    return Skeleton(model)


def write_frame(path: Path, points: np.ndarray, cells: list, data: dict[str, list], units: dict[str, str]) -> None:
    """Write a .vtu; `data` are arrays block by block. meshio knows no units, so they are put in behind it."""
    import meshio

    meshio.Mesh(points, cells, cell_data=data).write(path)
    text = path.read_bytes()
    for name in units:
        end = text.index(ARRAY, text.index(f' Name="{name}"'.encode()))
        text = text[:end] + unit_of(units, name).encode() + text[end:]
    path.write_bytes(text)


def unit_of(units: dict[str, str], name: str) -> str:
    """What an array says of its unit, nothing where it has none."""
    return UNIT.format(html.escape(units[name], quote=False)) if name in units else ""


def geometry(model, plan: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Points float64[n, 3] [m] and lines int[cells, 2]; pipes meet in the point of their node, and basins at patches.

    plan : parts -> float64[2] [m]
    """
    places = {name: plan[layout.place(name)] for name in model.node_names}
    for basin in model.basins:
        for patch in patch_names(basin.mesh):
            places[f"{basin.name}.{patch}"] = plan[basin.name] + basin.mesh.middle[basin.mesh.patch(patch)].mean(axis=0)
    bends = layout.bends(model.case.links)
    ends = list(dict.fromkeys(end for pipe in model.pipes for end in (pipe.from_, pipe.to)))
    index = {name: i for i, name in enumerate(ends)}
    points = [np.array([[*places[name], model.elevation[name]] for name in ends])]
    lines, count = [], len(ends)
    for pipe in model.pipes:
        fractions = np.asarray(pipe.edges[1:-1]) / pipe.length
        start, end = places[pipe.from_], places[pipe.to]
        low, high = model.elevation[pipe.from_], model.elevation[pipe.to]
        inner = layout.path(start, end, fractions, bends[pipe.name])
        z = low + fractions * (high - low)
        if pipe.profile is not None:
            z = pipe.profile.at(pipe.edges[1:-1])
            inner = inner if pipe.profile.plan is None else pipe.profile.seen(pipe.edges[1:-1])
        points.append(np.column_stack([inner, z]))
        chain = [index[pipe.from_], *range(count, count + pipe.cells - 1), index[pipe.to]]
        lines.append(np.column_stack([chain[:-1], chain[1:]]))
        count += pipe.cells - 1
    return np.concatenate(points), np.concatenate(lines)


def ride(model, points: np.ndarray) -> np.ndarray:
    """Body of each point of `geometry`, -1 for none : int[n]; what rides is put in axes of its body, straight."""
    places = model.case.places
    ends = list(dict.fromkeys(end for pipe in model.pipes for end in (pipe.from_, pipe.to)))
    owner, at = np.full(len(points), -1), len(ends)

    def body(name: str) -> int:
        on = getattr(places.get(name), "on", None)
        return -1 if on is None else model.body_names.index(on)

    for k, name in enumerate(ends):
        owner[k] = body(name)
        if owner[k] >= 0:
            points[k] = places[name].place
    for pipe in model.pipes:
        inner = slice(at, at + pipe.cells - 1)
        owner[inner], at = body(pipe.from_), inner.stop
        if body(pipe.from_) >= 0:
            first, last = np.array(places[pipe.from_].place), np.array(places[pipe.to].place)
            points[inner] = first + np.asarray(pipe.edges[1:-1])[:, None] / pipe.length * (last - first)
    return owner


def shape(basin, origin: np.ndarray) -> tuple[np.ndarray, list]:
    """Corners float64[p, 3] [m] of a basin's cells, on their bed, and blocks of cells of a kind, in their order."""
    mesh = basin.mesh
    points = placed(basin, origin, mesh.points)
    three = mesh.cells[:, 3] < 0
    ends = np.flatnonzero(np.diff(three)) + 1
    blocks = np.split(np.arange(len(three)), ends)
    named = {True: ("triangle", 3), False: ("quad", 4)}
    return points, [(named[three[b[0]]][0], mesh.cells[b, : named[three[b[0]]][1]]) for b in blocks]


def placed(basin, origin: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Points of a mesh where they are drawn : float64[p, 3] [m]."""
    x, y = np.ascontiguousarray(points.T)
    return np.column_stack([origin[0] + x, origin[1] + y, basin.ground(x, y)])


def parted(values: np.ndarray, blocks: list) -> list[np.ndarray]:
    """Values of cells, block by block."""
    return np.split(values, np.cumsum([len(cells) for _, cells in blocks])[:-1])


def read_series(path: Path) -> list[tuple[float, Path]]:
    """(time [s], file) of every frame of a .pvd."""
    from xml.etree import ElementTree

    try:
        root = ElementTree.parse(path).getroot()
        return [(float(one.attrib["timestep"]), path.parent / one.attrib["file"]) for one in root.iter("DataSet")]
    except (OSError, ElementTree.ParseError, KeyError, ValueError) as error:
        raise RunError(f"{path} cannot be read: {error}") from None


def read_pipes(path: Path, quantity: str) -> np.ndarray:
    """A quantity of all cells of pipes in a frame, SI : float64[cells]; RunError where it cannot be read."""
    return read_lines(path, quantity)[2]


def read_lines(path: Path, quantity: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(points float64[p, 3] [m], lines int[c, 2], a quantity float64[c] in SI, number of the pipe int[c]) of a frame.

    RunError where it cannot be read.
    """
    from meshio import vtu  # meshio.read prints and exits where it cannot

    try:
        mesh = vtu.read(str(path))
        data = mesh.cell_data_dict
        return mesh.points, mesh.cells_dict["line"], data[quantity]["line"], data["pipe"]["line"]
    except Exception as error:  # whatever it and its parsers make of a damaged file
        said = f"{type(error).__name__}: {error}"
        raise RunError(f"{path} cannot be read ({said}); run again with --force") from None

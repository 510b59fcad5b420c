"""Picture of a case before a run: scheme of symbols with sizes and levels, maps of basins, and long sections."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from fvsolve.core.output import network_layout
from fvsolve.core.output.fields import pipe_geometry
from fvsolve.core.output.unit_columns import column
from fvsolve.core.run.plot_scene import scene_of, unit_of
from fvsolve.errors import FvsolveError
from fvsolve.file_replacement import replacing
from fvsolve.report.draw.map_picture import map_figure
from fvsolve.report.draw.network_picture import NetworkPicture
from fvsolve.report.draw.plot import initial_section_figure
from fvsolve.report.long_section import SectionPath, paths_of
from fvsolve.report.maps.flood_map import plan_of
from fvsolve.report.tables import key_text

MAX_SECTIONS = 3  # greatest number of long sections in a picture
MAX_SIZES = 40  # greatest number of parts with sizes beside their names
SECTION_POINTS = 200  # of a pipe in a section
# keys whose values stand beside the name of a part, as far as it has them, in this order
SIZE_KEYS = ("level", "head", "pressure", "length", "diameter", "area", "volume", "flow", "demand")
MAX_KEYS = 2  # greatest number of such values


def write_case_picture(model: Any, path: Path) -> Path:
    """Draw a case as its model understands it into a .png file; returns its path.

    It contains the scheme of the network with sizes, levels and the pressures at the start; the map of each basin of
    water with its depths at the start; and the longest sections with the heads at the start.
    Raises FvsolveError if the file is no .png, or if there is nothing to draw.
    """
    from PIL import Image

    if path.suffix != ".png":
        raise FvsolveError(f"{path}: expected a file name that ends in .png")
    pictures = [*_schemes(model), *_maps(model), *_sections(model)]
    if not pictures:
        raise FvsolveError(
            f"{model.case.name}: there is nothing to draw before a run; the case has bodies alone"
        )
    width = max(picture.shape[1] for picture in pictures)
    sheet = np.full((sum(picture.shape[0] for picture in pictures), width, 3), 255, np.uint8)
    top = 0
    for picture in pictures:
        sheet[top : top + picture.shape[0], : picture.shape[1]] = picture
        top += picture.shape[0]
    try:
        with replacing(path) as fresh:
            Image.fromarray(sheet).save(fresh, format="png", optimize=True)
    except OSError as error:
        raise FvsolveError(f"{path}: the picture cannot be written: {error}") from None
    return path


def _pixels(figure: Any) -> np.ndarray:
    """Pixels of a figure : uint8[height, width, 3]."""
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[:, :, :3].copy()


def _schemes(model: Any) -> list[np.ndarray]:
    """Picture of the nodes, links and pipes with sizes; none for a case with basins or bodies, which have no scheme."""
    case = model.case
    if not case.links or any(name not in case.links for name in case.meshes):
        return []
    if any(node.kind == "body" for node in case.nodes.values()):
        return []
    scene = scene_of(case, case.title or case.name, "pressure", [], 0)
    if model.pipes:
        lengths = {pipe.name: pipe.length for pipe in model.pipes}
        plan = network_layout.plan_positions(case, lengths)
        points, lines = pipe_geometry(model, plan)
        counts = [pipe.cells for pipe in model.pipes]
        owner = np.repeat(np.arange(len(counts)), counts)
        values = np.concatenate([_pressures(model, pipe) for pipe in model.pipes])
        scene.pipes, scene.names = [(points, lines, values, owner)], list(lengths)
        scene.quantity = unit_of(case, "pressure")
        if scene.plan == "schematic":
            scene.plan = "laid out"
    scene.frames = [("case at the start", [])]
    if len(scene.parts) + len(scene.names) <= MAX_SIZES:
        parts = case.nodes | case.links
        for part in scene.parts:
            part.name = _with_sizes(part.name, parts[part.name], case)
        scene.names = [_with_sizes(name, case.links[name], case) for name in scene.names]
    picture = NetworkPicture(scene, film=False)
    picture.show(0)
    return [picture.sheet.picture()]


def _with_sizes(name: str, part: Any, case: Any) -> str:
    """Name of a part, and in a second line its main sizes."""
    table = part.table()
    texts = [
        key_text(type(part).values().get(key), table[key], case)
        for key in SIZE_KEYS
        if isinstance(table.get(key), (int, float)) and not isinstance(table[key], bool)
    ]
    return "\n".join([name, ", ".join(texts[:MAX_KEYS])]) if texts else name


def _heads(model: Any, pipe: Any) -> tuple[float, float]:
    """Heads at both ends of a pipe at the start [m]."""
    nodes = model.checks["nodes"]
    return tuple(float(nodes[end]["head"]) for end in (pipe.from_, pipe.to))


def _pressures(model: Any, pipe: Any) -> np.ndarray:
    """Pressures of the cells of a pipe at the start, from linear heads : float64[cells] [Pa]."""
    first, last = _heads(model, pipe)
    edges = np.asarray(pipe.edges)
    share = 0.5 * (edges[1:] + edges[:-1]) / pipe.length
    head = first + share * (last - first)
    low, high = model.elevation[pipe.from_], model.elevation[pipe.to]
    height = low + share * (high - low)
    if pipe.profile is not None:
        height = pipe.profile.at(share * pipe.length)
    fluid = model.case.properties
    return model.case.ambient_pressure + fluid.density * model.case.gravity * (head - height)


def _maps(model: Any) -> list[np.ndarray]:
    """Maps of the depths of basins of water at the start."""
    pictures = []
    for basin in model.meshed:
        if basin.name in model.case.links or "depth" not in basin.part.physics_type.fields:
            continue
        depth = basin.fields(basin.deviations(model.start))["depth"]
        plan = plan_of(model.case, basin.name, depth)
        pictures.append(_pixels(map_figure(plan, plan.layers[0])))
    return pictures


def _sections(model: Any) -> list[np.ndarray]:
    """Pictures of the longest sections: pipes, and heads at the start."""
    pipes = {pipe.name: pipe for pipe in model.pipes}
    if not pipes:
        return []
    heads = {name: _heads(model, pipe) for name, pipe in pipes.items()}
    case = model.case
    along, height = (column("", item, case) for item in ("length", "head"))
    pictures = []
    for way in paths_of(case, heads)[:MAX_SECTIONS]:
        lines = section_lines(model, way, pipes, heads)
        data = SimpleNamespace(
            chainage=along.from_si(lines["chainage"]),
            elevation=height.from_si(lines["elevation"]),
            head=height.from_si(lines["head"]),
            places=[(float(along.from_si(at)), _place_text(case, name)) for name, at in way.places],
        )
        title = f"{case.title or case.name}\n{way.name}: heads at the start"
        figure = initial_section_figure(data, along.unit, height.unit, title)
        pictures.append(_pixels(figure))
    return pictures


def _place_text(case: Any, place: str) -> str:
    """Name of a place of a section, with the kinds of the links other than pipes that end there."""
    links = [
        name
        for name, link in case.links.items()
        if link.kind != "pipe" and place in link.ports.values()
    ]
    return ", ".join([place, *links])


def section_lines(
    model: Any, way: SectionPath, pipes: dict[str, Any], heads: dict[str, tuple[float, float]]
) -> dict[str, np.ndarray]:
    """Chainage, elevation of the pipe and head at the start along a path : name -> float64[n] [m]."""
    found: dict[str, list[np.ndarray]] = {"chainage": [], "elevation": [], "head": []}
    for leg in way.legs:
        pipe = pipes[leg.pipe]
        distance = np.linspace(0.0, pipe.length, SECTION_POINTS)
        low, high = model.elevation[pipe.from_], model.elevation[pipe.to]
        height = low + distance / pipe.length * (high - low)
        if pipe.profile is not None:
            height = pipe.profile.at(distance)
        first, last = heads[leg.pipe]
        order = slice(None, None, -1 if leg.backwards else 1)
        found["chainage"].append(np.array([leg.chainage(float(at)) for at in distance])[order])
        found["elevation"].append(np.asarray(height, float)[order])
        found["head"].append((first + distance / pipe.length * (last - first))[order])
    return {name: np.concatenate(pieces) for name, pieces in found.items()}

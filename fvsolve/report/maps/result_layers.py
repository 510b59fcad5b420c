"""Results of a run as layers of a GeoPackage: nodes, links, pieces of pipes, gauges, sections, walls and patches."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fvsolve.core.output.network_layout import link_bends, plane_of
from fvsolve.core.output.node_places import NodePlaces, node_places
from fvsolve.errors import FvsolveError, RunError
from fvsolve.parts.raster_files import import_library
from fvsolve.report.long_section import envelope_column
from fvsolve.report.maps.flood_map import stopped_text
from fvsolve.report.maps.map_shapes import is_line, link_points, shapes_of
from fvsolve.report.maps.network_map import network_map

# columns of the envelope of a pipe -> its extreme over the pipe
ENVELOPE = {
    "max_pressure": np.max,
    "min_pressure": np.min,
    "max_head": np.max,
    "min_head": np.min,
}
KINDS = {"Point": 1, "MultiLineString": 5, "LineString": 2}  # codes of well-known binary


class LayerFeature(NamedTuple):
    """Feature of a layer.

    points : float64[n, 2] [m], rows of NaN between separate lines; values : name of a column -> number or text
    """

    points: np.ndarray
    values: dict[str, Any]


def write_layers(result: Any, path: Path) -> Path:
    """Write the layers of a run to a GeoPackage, in the reference system of its case; returns its path.

    result : `Result` with its directory. Raises FvsolveError without pyogrio, without a place of any part, or if the
    file cannot be written.
    """
    try:
        raw = import_library("pyogrio.raw", "a GeoPackage")
        errors = import_library("pyogrio.errors", "a GeoPackage")
    except ValueError as error:
        raise FvsolveError(str(error)) from None
    layers = {name: rows for name, rows in result_layers(result).items() if rows}
    if not layers:
        text = f"{result.directory}: no part of the case has a place"
        text = f"{text}; expected nodes with `position`, or a basin"
        raise RunError(text)
    crs = plane_of(result.case).crs
    about = f"{result.case.title}. {stopped_text(result)}".strip(". ")
    try:
        path.unlink(missing_ok=True)
        for name, rows in layers.items():
            _write_layer(raw, path, name, rows, crs, about)
    except (OSError, errors.DataSourceError, errors.DataLayerError) as error:
        text = f"{path}: cannot be written: {error}"
        raise FvsolveError(text) from None
    return path


def result_layers(result: Any) -> dict[str, list[LayerFeature]]:
    """Layers of a run : name -> rows, with places in the reference system of the case."""
    case = result.case
    extremes = extremes_by_part(result)
    layers: dict[str, list[LayerFeature]] = {"nodes": [], "links": []}
    drawn: set[tuple[str, str]] = set()
    basins = [name for name, node in case.nodes.items() if node.kind == "basin"]
    origin = plane_of(case).origin
    for basin in basins:
        own = np.array(case.nodes[basin].origin or (0.0, 0.0))
        places = node_places(case, basin)
        shift = own - np.array(case.nodes[basin].position or (0.0, 0.0))
        _add_parts(result, places, shift, extremes, layers, drawn)
        _add_shapes(result, basin, own, extremes, layers)
    if not basins:
        at = {
            name: np.array(node.position, float)
            for name, node in case.nodes.items()
            if node.position is not None
        }
        _add_parts(result, NodePlaces(at, set(), set()), origin, extremes, layers, drawn)
    layers["pipe_pieces"] = list(_pieces(result, origin))
    return layers


def _add_parts(
    result: Any,
    places: NodePlaces,
    shift: np.ndarray,
    extremes: dict[str, dict[str, Any]],
    layers: dict[str, list[LayerFeature]],
    drawn: set[tuple[str, str]],
) -> None:
    """Add the nodes and links with places that no earlier basin has; shift : from their places to the system [m]"""
    case = result.case
    for name, spot in places.at.items():
        if ("nodes", name) in drawn:
            continue
        drawn.add(("nodes", name))
        node = case.nodes[name]
        values = {"name": name, "type": node.kind, "elevation_m": case.elevations.get(name)}
        values["place"] = "assumed" if name in places.assumed else "stated"
        values |= extremes.get(name, {})
        layers["nodes"].append(LayerFeature(spot[None] + shift, values))
    bends = link_bends(case.links)
    for name, link in case.links.items():
        if ("links", name) in drawn or not is_line(case, link):
            continue
        points = link_points(case, places, name, bends[name])
        if points is None:
            continue
        drawn.add(("links", name))
        values = {"name": name, "type": link.kind, "from": link.from_, "to": link.to}
        for key in ("length", "diameter"):
            values[f"{key}_m"] = getattr(link, key, None)
        values |= envelope_extremes(result, name) | extremes.get(name, {})
        layers["links"].append(LayerFeature(points + shift, values))


def _add_shapes(
    result: Any,
    basin: str,
    origin: np.ndarray,
    extremes: dict[str, dict[str, Any]],
    layers: dict[str, list[LayerFeature]],
) -> None:
    """Add gauges, sections, walls, patches and structures of a basin; origin : of its coordinates [m]"""
    names = {
        "gauge": "gauges",
        "section": "sections",
        "wall": "walls",
        "patch": "patches",
        "structure": "structures",
    }
    for shape in shapes_of(result.case, basin):
        if shape.kind not in names or (shape.kind != "gauge" and len(shape.points) < 2):
            continue
        values = {"name": shape.name, "basin": basin, "about": shape.text}
        key = f"@{shape.name}" if shape.kind == "gauge" else shape.name
        rows = layers.setdefault(names[shape.kind], [])
        rows.append(LayerFeature(shape.points + origin, values | extremes.get(key, {})))


def _pieces(result: Any, origin: np.ndarray) -> Iterator[LayerFeature]:
    """Pieces of pipes with the layers of the plan of the network, where all positions are stated."""
    plan = network_map(result)
    if plan is None or not plan.stated:
        return
    for k, ends in enumerate(plan.ends):
        values = {"pipe": plan.names[plan.pipe[k]]}
        for layer in plan.layers:
            values[column_name(layer.name, layer.classes.unit)] = float(layer.values[k])
        yield LayerFeature(ends if plan.crs else ends + origin, values)


def extremes_by_part(result: Any) -> dict[str, dict[str, Any]]:
    """Extremes of the probes of a run : part, or @GAUGE -> column -> value in the unit of the run.

    Of several places along a part the least and the greatest counts.
    """
    found: dict[str, dict[str, Any]] = {}
    for probe, item in result.summary["extremes"].items():
        head, _, place = probe.partition("@")
        part, _, quantity = head.rpartition(".")
        part = part.removeprefix("nodes.").removeprefix("links.")
        if place in result.case.output.gauges:
            part = f"@{place}"
        own = found.setdefault(part, {})
        for key, pick in (("minimum", min), ("maximum", max)):
            value = item[key]
            if value is None:
                continue
            column = column_name(f"{key[:3]}_{quantity}", item["unit"])
            own[column] = pick(own.get(column, value), value)
    return found


def envelope_extremes(result: Any, pipe: str) -> dict[str, Any]:
    """Extremes of a pipe over all its cells and steps : column -> value in the unit of the run; {} without envelope."""
    if not result.envelope or pipe not in result.envelope:
        return {}
    arrays = result.envelope[pipe]
    return {
        column_name(key, envelope_column(result, key).unit): float(pick(arrays[key]))
        for key, pick in ENVELOPE.items()
    }


def column_name(name: str, unit: str) -> str:
    """Name of a column with its unit, in letters, digits and _, as databases take it."""
    sign = {"-": "", "%": "percent"}.get(unit, unit)
    return re.sub(r"[^A-Za-z0-9]+", "_", f"{name} {sign}").strip("_")


def _write_layer(
    raw: Any, path: Path, name: str, rows: list[LayerFeature], crs: str, about: str
) -> None:
    """Append a layer to a GeoPackage; about : sentence for its description"""
    is_point = all(len(row.points) == 1 for row in rows)
    kind = "Point" if is_point else "MultiLineString"
    names = list(dict.fromkeys(key for row in rows for key in row.values))
    columns = []
    for key in names:
        values = [row.values.get(key) for row in rows]
        if all(value is None or isinstance(value, (int, float)) for value in values):
            columns.append(
                np.array([np.nan if value is None else value for value in values], float)
            )
        else:
            columns.append(np.array([value and str(value) for value in values], object))
    raw.write(
        path,
        np.array([well_known_binary(kind, row.points) for row in rows], object),
        columns,
        names,
        layer=name,
        driver="GPKG",
        geometry_type=kind,
        crs=crs or None,
        append=path.exists(),
        layer_metadata={"DESCRIPTION": about},
    )


def well_known_binary(kind: str, points: np.ndarray) -> bytes:
    """Well-known binary of a point, or of lines with rows of NaN between them; points : float64[n, 2] [m]"""
    head = b"\x01" + np.array([KINDS[kind]], "<u4").tobytes()
    if kind == "Point":
        return head + np.array(points[0], "<f8").tobytes()
    gaps = np.flatnonzero(np.isnan(points[:, 0]))
    lines = [part[~np.isnan(part[:, 0])] for part in np.split(points, gaps)]
    lines = [line for line in lines if len(line) > 1]
    data = head + np.array([len(lines)], "<u4").tobytes()
    for line in lines:
        data += b"\x01" + np.array([KINDS["LineString"], len(line)], "<u4").tobytes()
        data += np.array(line, "<f8").tobytes()
    return data

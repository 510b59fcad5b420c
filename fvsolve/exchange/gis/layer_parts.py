"""Parts of a case from the features of GIS layers: nodes, links, walls, patches, gauges and sections."""

import math
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.case.reading import Raw, class_of_type, with_defaults
from fvsolve.errors import did_you_mean, listing
from fvsolve.exchange.gis.layer_keys import IN_BASINS, PARTS, SHAPE_HEIGHTS, GisLayer
from fvsolve.parts.basin import ORIGIN
from fvsolve.parts.csv_rows import find_file
from fvsolve.parts.raster import Raster
from fvsolve.parts.raster_files import import_library, read_pixels
from fvsolve.parts.value import ReadContext, ValueFault, faults_of
from fvsolve.parts.vector_files import (
    DEGREES,
    Features,
    Shape,
    crs_name,
    read_features,
    reprojected,
)
from fvsolve.units import show

# Layers are read in this order: links end at nodes that other layers bring.
ORDER = ("nodes", "patches", "walls", "gauges", "sections", "links")
PIXELS = 4.0  # default distance of points of profiles and crests [pixels]
MOST_FAULTS = 20  # of a layer that are listed
SAME_PLACE = 1e-6  # distance between two nodes at the same place [m]
ABSENT = object()  # value of a template whose attribute is empty
ATTRIBUTE = re.compile(r"\{([^{}]*)\}")
Faults = list[tuple[tuple[Any, ...], str]]


def add_layers(raw: Raw, model: Any) -> Faults:
    """Replace the layers of the table `[gis]` of a raw case by their parts; returns faults as (key path, text).

    model : class of the table
    """
    given = raw.table["gis"]
    if not isinstance(given, dict) or "layers" not in given:
        return []
    raw.table["gis"] = {key: value for key, value in given.items() if key != "layers"}
    try:
        table = model.model_validate(given, context=ReadContext(folder=raw.folder))
    except ValueError as error:
        return faults_of(error, "gis")
    builder = PartBuilder(raw, table)
    names = sorted(table.layers, key=lambda name: ORDER.index(table.layers[name].becomes))
    for name in names:
        place = ("gis", "layers", name)
        try:
            builder.add(name, table.layers[name])
        except ValueError as error:
            builder.faults += faults_of(error, *place)
    builder.state_system()
    return builder.faults


class LayerFault(ValueError):
    """Fault of a key of a layer."""

    def __init__(self, key: str, text: str) -> None:
        self.faults = [((key,), text)]
        super().__init__(text)


class PartBuilder:
    """Parts that the layers of a case bring, written into its raw tables.

    faults : (key path, text) found so far; crs : reference system of the case, "" as long as it is unknown
    """

    def __init__(self, raw: Raw, table: Any) -> None:
        self.raw = raw
        self.table = table
        self.faults: Faults = []
        self.setting = ReadContext(folder=raw.folder)
        nodes = raw.table.get("nodes")
        nodes = nodes if isinstance(nodes, dict) else {}
        self.basins = {
            name: node
            for name, node in nodes.items()
            if isinstance(node, dict) and node.get("type") == "basin"
        }
        stated = [str(node["crs"]) for node in self.basins.values() if node.get("crs")]
        self.crs = table.crs or next(iter(stated), "")
        for name, node in self.basins.items():
            if node.get("crs") and self.crs != node["crs"]:
                text = f"{show(node['crs'])} is not the system of the case, {self.crs}"
                self.faults.append((("nodes", name, "crs"), f"{text}; expected one system"))

    def state_system(self) -> None:
        """Write the reference system of the case into its table, and into basins without one."""
        if not self.crs:
            return
        self.raw.table["gis"]["crs"] = self.crs
        origin = self.origin().tolist()
        if any(origin):
            self.raw.table["gis"]["origin"] = origin
        for node in self.basins.values():
            node.setdefault("crs", self.crs)

    def origin(self, basin: str = "") -> np.ndarray:
        """Easting and northing of the point (0, 0) of a basin, or of the positions of nodes [m]."""
        if basin:
            given = self.basins[basin].get("origin", (0.0, 0.0))
            return np.array(ORIGIN.read(given, self.setting))
        if self.table.origin is not None:
            return np.array(self.table.origin)
        for node in self.basins.values():
            if "origin" in node:
                position = np.array(node.get("position", (0.0, 0.0)), float)
                return np.array(ORIGIN.read(node["origin"], self.setting)) - position
        return np.zeros(2)

    def add(self, name: str, layer: GisLayer) -> None:
        """Add the parts of a layer. Raises ValueError for faults of the whole layer."""
        features = self.read(layer)
        basin = self.basin(layer) if layer.becomes in IN_BASINS else ""
        features = moved(features, self.origin(basin))
        reader = FeatureReader(name, layer, features, self)
        target, key = self.target(layer, basin)
        for part, keys in reader.parts(basin):
            if part in target:
                text = f"{show(part)} is already in the case"
                text = f"{text}; expected a name of its own for each feature"
                raise LayerFault("name", text)
            target[part] = keys
            self.mark(name, (*key, part))

    def mark(self, layer: str, place: tuple[str, ...]) -> None:
        """State the line of a layer as that of a part, for messages."""
        line = self.raw.line(("gis", "layers", layer)) if self.raw.text else None
        if line is not None:
            self.raw.lines[place] = line

    def read(self, layer: GisLayer) -> Features:
        """Features of a layer in the reference system of the case, which the first layer may state."""
        try:
            features = read_features(
                find_file(layer.file, ReadContext(folder=self.raw.folder)), layer.layer
            )
        except ValueError as error:
            raise LayerFault("file", str(error)) from None
        try:
            features = reprojected(features, self.crs, layer.crs)
        except ValueError as error:
            raise LayerFault("crs" if layer.crs else "file", str(error)) from None
        stated = layer.crs or features.crs
        if not self.crs and stated:
            rasterio = import_library("rasterio", "a reference system")
            name = crs_name(rasterio.crs.CRS.from_user_input(stated))
            self.crs = name if name.startswith("EPSG:") else ""
        if not stated and self.crs and self.is_in_degrees(features):
            text = f"{features.name} states no reference system"
            text = f"{text}, and its numbers look like degrees"
            text = f'{text}; expected the key `crs`, such as crs = "EPSG:4326"'
            raise LayerFault("file", text)
        return features

    def is_in_degrees(self, features: Features) -> bool:
        """True if numbers can be degrees, while the origin of the case lies at greater numbers."""
        far = any((np.abs(self.origin(name)) > DEGREES).any() for name in ("", *self.basins))
        if not far:
            return False
        for shape in features.shapes:
            for piece in shape.pieces:
                if (np.abs(piece[:, :2]) > DEGREES).any():
                    return False
        return True

    def basin(self, layer: GisLayer) -> str:
        """Name of the basin of a layer. Raises LayerFault if it is unknown, or not stated among several."""
        names = [*self.basins]
        if not layer.basin and len(names) == 1:
            return names[0]
        if not layer.basin:
            text = f"is missing, and the case has {len(names)} basins"
            raise LayerFault(
                "basin", f"{text}; expected one of {listing(names)}" if names else text
            )
        if layer.basin not in names:
            near = did_you_mean(layer.basin, names) or f"; basins are {listing(names)}"
            text = f"no basin named {show(layer.basin)}{near}"
            raise LayerFault("basin", text)
        return layer.basin

    def target(self, layer: GisLayer, basin: str) -> tuple[dict[str, Any], tuple[str, ...]]:
        """Table of the raw case for the parts of a layer, and its key path."""
        kind = layer.becomes
        path = (kind,)
        if kind in ("walls", "patches"):
            path = ("nodes", basin, kind)
        elif kind in IN_BASINS:
            path = ("output", kind)
        table: Any = self.raw.table
        for key in path:
            table = table.setdefault(key, {})
            if not isinstance(table, dict):
                text = f"{'.'.join(path)} is not a table; expected a table"
                raise LayerFault("becomes", text)
        return table, path

    def heights(self, layer: GisLayer) -> Raster | None:
        """Raster of heights of a layer in the coordinates of its parts; None without."""
        if layer.heights in ("", SHAPE_HEIGHTS):
            return None
        try:
            path = find_file(layer.heights, ReadContext(folder=self.raw.folder))
            origin = self.origin(self.basin(layer) if layer.becomes in IN_BASINS else "")
            pixels = read_pixels(path).to_basin(path.name, tuple(origin), self.crs)
        except ValueError as error:
            raise LayerFault("heights", str(error)) from None
        return Raster(path.name, pixels)

    def positions(self) -> dict[str, np.ndarray]:
        """Positions of all nodes that state one [m]."""
        found = {}
        for name, node in self.raw.table.get("nodes", {}).items():
            position = node.get("position") if isinstance(node, dict) else None
            if position is not None and name not in self.basins:
                found[name] = np.array(position, float)
        return found


def moved(features: Features, origin: np.ndarray) -> Features:
    """Features in coordinates that begin at an origin [m]."""
    shift = np.array([*origin, 0.0])
    shapes = [
        Shape(shape.kind, [piece - shift for piece in shape.pieces]) for shape in features.shapes
    ]
    return features._replace(shapes=shapes)


class FeatureReader:
    """Parts of the features of a layer.

    builder : of the whole case; dem : raster of heights, or None
    """

    def __init__(
        self, name: str, layer: GisLayer, features: Features, builder: PartBuilder
    ) -> None:
        self.name = name
        self.layer = layer
        self.features = features
        self.builder = builder
        self.dem = builder.heights(layer)
        self.ends: dict[str, np.ndarray] = {}
        if layer.becomes == "links":
            self.ends = builder.positions()
        kinds = PARTS[layer.becomes]
        wrong = [k for k, shape in enumerate(features.shapes) if shape.kind not in kinds]
        if wrong:
            kind = features.shapes[wrong[0]].kind
            text = f"{features.place(wrong[0])} is a {kind}; {layer.becomes} are"
            text = f"{text} {' or '.join(kind + 's' for kind in kinds)}"
            raise LayerFault("becomes", text)

    def parts(self, basin: str) -> Iterator[tuple[str, dict[str, Any]]]:
        """Yield (name, keys) of each part. Raises ValueFault with the faults of all features."""
        names: dict[str, int] = {}
        faults: dict[tuple, None] = {}  # each text counts a single time
        for count, k in enumerate(self.chosen(), 1):
            try:
                yield from self.parts_of(k, count, names, basin)
            except LayerFault as error:
                faults |= dict.fromkeys(error.faults)
        if faults:
            shown = list(faults)[:MOST_FAULTS]
            if len(faults) > len(shown):
                key = shown[-1][0]
                shown.append((key, f"{len(faults) - len(shown)} further features have such faults"))
            raise ValueFault(shown)

    def parts_of(
        self, k: int, count: int, names: dict[str, int], basin: str
    ) -> list[tuple[str, dict[str, Any]]]:
        """Names and keys of the parts of a feature, whose name is added to `names`; count : of the features so far

        Raises LayerFault.
        """
        shape = self.features.shapes[k]
        around = {**shape_values(shape), **self.features.attributes[k]}
        name = self.part_name(k, around, count)
        if name in names:
            first = self.features.numbers[names[name]]
            second = self.features.numbers[k]
            text = f"features {first} and {second} of {self.features.name} are both named"
            text = f"{text} {show(name)}; expected a name for each"
            raise LayerFault("name", text)
        names[name] = k
        keys = self.filled(self.layer.templates, around, k)
        return list(getattr(self, self.layer.becomes)(name, shape, keys, basin, k))

    def chosen(self) -> list[int]:
        """Indices of the features that fulfil the conditions."""
        known = self.features.attributes[0]
        for name in self.layer.where:
            if name not in known:
                raise LayerFault("where", self.unknown(name, known))
        chosen = []
        for k, attributes in enumerate(self.features.attributes):
            where = self.layer.where.items()
            if all(attributes[name] in values for name, values in where):
                chosen.append(k)
        if not chosen:
            text = f"no feature of {self.features.name} fulfils it"
            text = f"{text}; expected values of the file"
            raise LayerFault("where", text)
        return chosen

    def unknown(self, name: str, known: Any) -> str:
        """Message about an attribute that the layer does not have."""
        near = did_you_mean(name, known) or f"; attributes are {listing([*known] or ['none'])}"
        return f"{self.features.name} has no attribute {show(name)}{near}"

    def part_name(self, k: int, around: dict[str, Any], count: int) -> str:
        """Name of the part of a feature, with letters, digits, _ and -; count : of the features so far"""
        if not self.layer.name:
            return f"{self.name}-{count}"
        value = self.fill(self.layer.name, around, "name")
        text = "" if value is ABSENT else re.sub(r"[^A-Za-z0-9_-]+", "_", str(value)).strip("_")
        if not text:
            place = f"{self.features.place(k)} has no {self.layer.name}"
            text = f"{place}; expected a name for each feature"
            raise LayerFault("name", text)
        return text

    def filled(self, given: dict[str, Any], around: dict[str, Any], k: int) -> dict[str, Any]:
        """Keys with the attributes of a feature; keys of empty attributes are left out."""
        values = {key: self.fill(value, around, "keys") for key, value in given.items()}
        return {key: value for key, value in values.items() if value is not ABSENT}

    def fill(self, given: Any, around: dict[str, Any], key: str) -> Any:
        """Value of a template; ABSENT if it needs an empty attribute. key : of the layer, for messages"""
        if isinstance(given, dict):
            values = {name: self.fill(value, around, key) for name, value in given.items()}
            return {name: value for name, value in values.items() if value is not ABSENT}
        if isinstance(given, list):
            items = [self.fill(value, around, key) for value in given]
            return ABSENT if any(item is ABSENT for item in items) else items
        if not isinstance(given, str):
            return given
        names = ATTRIBUTE.findall(given)
        for name in names:
            if name not in around:
                raise LayerFault(key, self.unknown(name, around))
        if any(around[name] in (None, "") for name in names):
            return ABSENT
        if names and given == f"{{{names[0]}}}":
            return around[names[0]]
        return ATTRIBUTE.sub(lambda match: number_text(around[match[1]]), given)

    # kinds of parts -----------------------------------------------------------------------------------------

    def nodes(self, name: str, shape: Shape, keys: dict, basin: str, k: int) -> Iterator:
        """Node at a point."""
        point = self.single(shape, k)[0]
        keys.setdefault("position", point[:2].tolist())
        if self.layer.heights and "elevation" in self.known_keys(keys):
            keys.setdefault("elevation", float(self.heights(point[None], k)[0]))
        yield name, keys

    def links(self, name: str, shape: Shape, keys: dict, basin: str, k: int) -> Iterator:
        """Link along a line, or between the ends that its keys state."""
        line = self.single(shape, k)
        if shape.kind == "point":
            yield name, keys
            return
        line = line.copy()
        if self.layer.heights:
            line = self.resampled(line)
            line[:, 2] = self.heights(line, k)
        for key, end in (("from", 0), ("to", -1)):
            if key not in keys:
                keys[key] = self.node_at(line[end], k, key)
        known = self.known_keys(keys)
        if "profile" in known and self.layer.heights and "profile" not in keys:
            keys["profile"] = self.profile(line, keys)
        elif "length" in known and not {"length", "profile"} & keys.keys():
            keys["length"] = line_length(line)
        yield name, keys

    def walls(self, name: str, shape: Shape, keys: dict, basin: str, k: int) -> Iterator:
        """Walls along a line: with heights a wall for each segment, with the mean height of its ends."""
        several = len(shape.pieces) > 1
        for number, piece in enumerate(shape.pieces, 1):
            own = f"{name}-{number}" if several else name
            if not self.layer.heights:
                yield own, {"line": piece[:, :2].tolist(), **keys}
                continue
            if "crest" in keys:
                raise LayerFault("keys", "crest is given, and `heights` too; keep one")
            line = self.resampled(piece)
            z = self.heights(line, k)
            for i in range(len(line) - 1):
                ends = line[i : i + 2, :2].tolist()
                crest = float(0.5 * (z[i] + z[i + 1]))
                yield f"{own}-{i + 1}", {"line": ends, "crest": crest, **keys}

    def patches(self, name: str, shape: Shape, keys: dict, basin: str, k: int) -> Iterator:
        """Interior patch in a polygon, or at a point."""
        line = self.single(shape, k)
        if shape.kind == "point":
            yield name, {"at": line[0, :2].tolist(), **keys}
            return
        yield name, {"polygon": line[:-1, :2].tolist(), **keys}  # the last point is the first

    def gauges(self, name: str, shape: Shape, keys: dict, basin: str, k: int) -> Iterator:
        """Gauge at a point of a basin."""
        yield name, {"basin": basin, "at": self.single(shape, k)[0, :2].tolist(), **keys}

    def sections(self, name: str, shape: Shape, keys: dict, basin: str, k: int) -> Iterator:
        """Section along a line of a basin."""
        yield name, {"basin": basin, "line": self.single(shape, k)[:, :2].tolist(), **keys}

    # values of shapes ---------------------------------------------------------------------------------------

    def single(self, shape: Shape, k: int) -> np.ndarray:
        """Points of a shape of a single piece : float64[n, 3]."""
        if len(shape.pieces) > 1:
            text = f"{self.features.place(k)} has {len(shape.pieces)} pieces or rings"
            text = f"{text}; expected a single one in each feature"
            raise LayerFault("file", text)
        return shape.pieces[0]

    def known_keys(self, keys: dict[str, Any]) -> set[str]:
        """Keys of the type of a part, without those that `[defaults]` states for it."""
        kind = class_of_type(keys.get("type"))
        if kind is None:
            return set()
        stated = with_defaults(self.builder.raw.table, dict(keys)).keys() - keys.keys()
        return set(kind.values()) - stated

    def resampled(self, line: np.ndarray) -> np.ndarray:
        """Points of a line with further ones, so that none are further apart than the spacing : float64[n, 3]."""
        spacing = self.layer.spacing
        if spacing is None and self.dem is not None:
            spacing = PIXELS * max(self.dem.pixels.dx, self.dem.pixels.dy)
        if spacing is None:
            return line
        points = [line[:1]]
        for first, last in zip(line[:-1], line[1:], strict=True):
            count = max(math.ceil(math.hypot(*(last - first)[:2]) / spacing * (1.0 - 1e-12)), 1)
            shares = np.arange(1, count + 1)[:, None] / count
            points.append(first + shares * (last - first))
        return np.concatenate(points)

    def heights(self, points: np.ndarray, k: int) -> np.ndarray:
        """Heights at points, of the raster or of the shape, plus the offset : float64[n] [m]."""
        if self.dem is None:
            z = points[:, 2]
            if not np.isfinite(z).all():
                text = f'{self.features.place(k)} has no z; expected another value than "shape"'
                raise LayerFault("heights", text)
            return z + self.layer.offset
        try:
            z = self.dem(points[:, 0], points[:, 1])
            i = self.dem.column(points[:, 0]).astype(int)
            j = self.dem.row(points[:, 1]).astype(int)
            values = self.dem.pixels.values
            lacks = np.isnan(
                values[np.minimum(j, len(values) - 1), np.minimum(i, len(values[0]) - 1)]
            )
            if lacks.any():
                x, y = points[np.argmax(lacks), :2]
                text = f"{self.dem.name} has no data at x = {x:.6g} m, y = {y:.6g} m"
                text = f"{text}; expected a raster with data there"
                raise ValueError(text)
        except ValueError as error:
            text = f"{self.features.place(k)}: {error}"
            raise LayerFault("heights", text) from None
        return z + self.layer.offset

    def node_at(self, point: np.ndarray, k: int, key: str) -> str:
        """Name of the node at an end of a link; a new junction if the layer names junctions."""
        if self.ends:
            names = [*self.ends]
            distance = np.hypot(*(np.array([*self.ends.values()]) - point[:2]).T)
            near = int(np.argmin(distance))
            if distance[near] <= self.layer.snap:
                alike = np.flatnonzero(distance <= distance[near] + SAME_PLACE)
                if alike.size > 1:  # such as inlet and outlet of a pump
                    text = f"{listing([names[i] for i in alike])} lie at the end `{key}` of"
                    text = f"{text} {self.features.place(k)}, at the same place"
                    text = f"{text}; expected the key `{key}` by an attribute"
                    raise LayerFault("keys", text)
                return names[near]
        if not self.layer.junctions:
            x, y = point[:2]
            text = f"no node lies within {self.layer.snap:g} m of the end `{key}` of"
            text = f"{text} {self.features.place(k)}, at x = {x:.10g} m, y = {y:.10g} m"
            if self.ends:
                text = f"{text}; the nearest is {names[near]} at {distance[near]:.4g} m"
            remedy = 'expected nodes there, `snap` above that, keys from and to, or junctions = "J"'
            raise LayerFault("snap", f"{text}; {remedy}")
        nodes = self.builder.raw.table.setdefault("nodes", {})
        number = 1
        while f"{self.layer.junctions}{number}" in nodes:
            number += 1
        name = f"{self.layer.junctions}{number}"
        nodes[name] = {"type": "junction", "position": point[:2].tolist()}
        if self.layer.heights:
            nodes[name]["elevation"] = float(point[2])
        self.builder.mark(self.name, ("nodes", name))
        self.ends[name] = point[:2]
        return name

    def profile(self, line: np.ndarray, keys: dict[str, Any]) -> dict[str, list[float]]:
        """Profile of a pipe in space, which begins and ends at the elevations of its nodes."""
        line = line.copy()
        nodes = self.builder.raw.table["nodes"]
        for key, end in (("from", 0), ("to", -1)):
            node = nodes.get(keys[key], {})
            if isinstance(node.get("elevation"), (int, float)):
                line[end, 2] = node["elevation"]
            if "position" in node:
                line[end, :2] = node["position"]
        return dict(zip("xyz", line.T.tolist(), strict=True))


def shape_values(shape: Shape) -> dict[str, Any]:
    """Values of a shape that templates may name: {x}, {y} and {z} of its first point, and {length} of a line."""
    x, y, z = shape.pieces[0][0].tolist()
    values = {"x": x, "y": y, "z": None if math.isnan(z) else z}
    if shape.kind == "line":
        values["length"] = sum(line_length(piece) for piece in shape.pieces)
    return values


def line_length(line: np.ndarray) -> float:
    """Length of a line in plan [m]."""
    return float(np.hypot(*np.diff(line[:, :2], axis=0).T).sum())


def number_text(value: Any) -> str:
    """Text of an attribute within a longer text."""
    return repr(value) if isinstance(value, float) else str(value)

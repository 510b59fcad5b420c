"""Files of shapes with attributes, such as GeoJSON, GeoPackage and shapefiles, through pyogrio (GDAL)."""

import math
import struct
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.raster_files import import_library
from fvsolve.units import show

# code of well-known binary (OGC 06-103r4) -> kind of shape
KINDS = {
    1: "point",
    2: "line",
    3: "polygon",
    4: "point",
    5: "line",
    6: "polygon",
}
MULTIPLE = (4, 5, 6)  # codes of collections of shapes of a kind
CODE_NAMES = {
    7: "a collection of different shapes",
    8: "a circular arc",
    9: "a curve",
    10: "a polygon with curved sides",
    11: "curves",
    12: "surfaces with curved sides",
    15: "a polyhedral surface",
    16: "a triangulated surface",
    17: "a triangle",
}
HAS_Z, HAS_M = 0x80000000, 0x40000000  # bits of the code in the extended form of PostGIS
MOST_SHAPES = 1_000_000
DEGREES = (180.0, 90.0)  # greatest longitude and latitude


class Shape(NamedTuple):
    """Shape of a feature.

    kind : "point", "line" or "polygon"
    pieces : float64[n, 3] each, x, y and z (NaN without height): points, lines, or all rings of polygons; a point is
    inside if it is inside of an odd number of rings
    """

    kind: str
    pieces: list[np.ndarray]

    @property
    def has_heights(self) -> bool:
        """True if each point has a height."""
        return all(np.isfinite(piece[:, 2]).all() for piece in self.pieces)


class Features(NamedTuple):
    """Shapes of a layer of a file with their attributes.

    name : of the file with its layer, for messages; crs : reference system as the file states it, or ""
    numbers : of the features in the file
    attributes : of each feature, name -> number, text or None
    """

    name: str
    crs: str
    numbers: list[int]
    shapes: list[Shape]
    attributes: list[dict[str, Any]]

    def place(self, k: int) -> str:
        """Name of the feature with index k for messages."""
        return f"{self.name}, feature {self.numbers[k]}"


def read_features(path: Path, layer: str = "") -> Features:
    """Features of a layer of a file; layer : its name, "" for the only one. The last files are kept.

    Raises ValueError for a file that is not readable, an unknown layer, and features without a shape or with curves.
    """
    try:
        stat = path.stat()
    except OSError as error:
        raise ValueError(f"{path.name}: {error.strerror}") from None
    return _read(path, stat.st_mtime_ns, stat.st_size, layer)


@lru_cache(maxsize=8)
def _read(path: Path, changed: int, size: int, layer: str) -> Features:
    """Features of a layer; changed, size : of the file, which differ for an edited file"""
    pyogrio = import_library("pyogrio", f"{path.name} is a file of shapes, which")
    raw = import_library("pyogrio.raw", f"{path.name} is a file of shapes, which")
    try:
        layers = {name: kind for name, kind in pyogrio.list_layers(path) if kind is not None}
    except pyogrio.errors.DataSourceError:
        text = f"{path.name} is not a file of shapes; expected GeoJSON, GeoPackage or a shapefile"
        raise ValueError(text) from None
    layer = chosen_layer(path, layers, layer)
    name = path.name if len(layers) == 1 else f"{path.name}, layer {show(layer)}"
    try:
        about, numbers, shapes, columns = raw.read(path, layer=layer, return_fids=True)
    except (pyogrio.errors.DataSourceError, ValueError, RuntimeError) as error:
        text = f"{name} cannot be read: {error}"
        raise ValueError(text) from None
    if not len(shapes):
        text = f"{name} has no features; expected a layer with features"
        raise ValueError(text)
    if len(shapes) > MOST_SHAPES:
        text = f"{name} has {len(shapes)} features; expected at most {MOST_SHAPES}"
        raise ValueError(text)
    numbers = [int(number) for number in numbers]
    found = []
    for number, shape in zip(numbers, shapes, strict=True):
        try:
            found.append(read_shape(shape))
        except ValueError as error:
            text = f"{name}, feature {number} {error}"
            raise ValueError(text) from None
    values = [[plain(value) for value in column] for column in columns]
    fields = [str(field) for field in about["fields"]]
    rows = [dict(zip(fields, row, strict=True)) for row in zip(*values, strict=True)]
    crs = str(about["crs"] or "")
    if not rows:  # without attributes
        rows = [{} for _ in found]
    return Features(name, crs, numbers, found, rows)


def chosen_layer(path: Path, layers: dict[str, str], layer: str) -> str:
    """Name of the layer of a file with shapes. Raises ValueError if it is unknown, or not stated among several."""
    if not layers:
        raise ValueError(
            f"{path.name} has no layer with shapes; expected points, lines or polygons"
        )
    if not layer and len(layers) == 1:
        return next(iter(layers))
    if not layer:
        text = f"{path.name} has {len(layers)} layers: {listing([*map(show, layers)])}"
        text = f"{text}; expected the key `layer`"
        raise ValueError(text)
    if layer not in layers:
        known = did_you_mean(layer, layers) or f"; layers are {listing([*map(show, layers)])}"
        text = f"{path.name} has no layer {show(layer)}{known}"
        raise ValueError(text)
    return layer


def plain(value: Any) -> Any:
    """Attribute as number, text or None."""
    if value is None or (isinstance(value, (float, np.floating)) and math.isnan(value)):
        return None
    if isinstance(value, np.generic):
        value = value.item() if value.dtype.kind in "bifu" else str(value)
    if isinstance(value, float) and value.is_integer() and abs(value) < 2**53:
        return int(value)  # a column of whole numbers with gaps
    return value if isinstance(value, (bool, int, float)) else str(value).strip()


def read_shape(data: bytes | None) -> Shape:
    """Shape in well-known binary. Raises ValueError for an empty shape, for curves and for mixed collections."""
    if not data:
        raise ValueError("has no shape; expected one, or the feature left out by `where`")
    kind, pieces, _ = _read_piece(data, 0)
    if not pieces or any(not np.isfinite(piece[:, :2]).all() for piece in pieces):
        raise ValueError("has an empty shape; expected one, or the feature left out by `where`")
    return Shape(kind, pieces)


def _read_piece(data: bytes, at: int) -> tuple[str, list[np.ndarray], int]:
    """(kind, pieces, place behind it) of the shape that begins at a place of well-known binary."""
    order = "<" if data[at] == 1 else ">"
    (code,) = struct.unpack_from(f"{order}I", data, at + 1)
    at += 5
    thousands, base = divmod(code & 0x0FFFFFFF, 1000)
    has_z = bool(code & HAS_Z) or thousands in (1, 3)
    has_m = bool(code & HAS_M) or thousands in (2, 3)
    if base not in KINDS:
        raise ValueError(
            f"is {CODE_NAMES.get(base, 'an unknown shape')}; expected points, straight lines and polygons of them"
        )
    pieces: list[np.ndarray] = []
    if base in MULTIPLE:
        (count,) = struct.unpack_from(f"{order}I", data, at)
        at += 4
        for _ in range(count):
            _, inner, at = _read_piece(data, at)
            pieces += inner
        return KINDS[base], pieces, at
    width = 2 + has_z + has_m
    rings = 1
    if base == 3:
        (rings,) = struct.unpack_from(f"{order}I", data, at)
        at += 4
    for _ in range(rings):
        count = 1
        if base != 1:
            (count,) = struct.unpack_from(f"{order}I", data, at)
            at += 4
        numbers = np.frombuffer(data, f"{order}f8", count * width, at).reshape(count, width)
        at += 8 * count * width
        points = np.full((count, 3), np.nan)
        points[:, : 2 + has_z] = numbers[:, : 2 + has_z]
        if count:
            pieces.append(points)
    return KINDS[base], pieces, at


def reprojected(features: Features, crs: str, stated: str = "") -> Features:
    """Features with coordinates in another reference system.

    crs : of the result, such as "EPSG:32633"; "" : the coordinates stay, which have to be lengths
    stated : reference system of the file, if the file states none or a wrong one
    Raises ValueError for coordinates in degrees or in feet without a target, and for degrees out of range.
    """
    source = stated or features.crs
    xy = np.concatenate([piece[:, :2] for shape in features.shapes for piece in shape.pieces])
    if not source:
        return features
    if source == crs:
        return features
    rasterio = import_library(
        "rasterio", f"a comparison of the reference system of {features.name}"
    )
    warp = import_library(
        "rasterio.warp", f"a comparison of the reference system of {features.name}"
    )
    try:
        own = rasterio.crs.CRS.from_user_input(source)
    except rasterio.errors.CRSError:
        text = f"{features.name} has an unknown reference system {show(source[:80])}"
        text = f'{text}; expected the key `crs`, such as crs = "EPSG:32633"'
        raise ValueError(text) from None
    beyond = (np.abs(xy) > DEGREES).any(axis=1)
    if own.is_geographic and beyond.any():
        x, y = xy[np.argmax(beyond)]
        text = f"{features.name} is in degrees ({crs_name(own)})"
        text = f"{text}, but has coordinates such as {x:.6g}, {y:.6g}"
        text = f"{text}; expected the key `crs` with its true system"
        raise ValueError(text)
    if not crs:
        if own.is_geographic or own.linear_units_factor[1] != 1.0:
            unit = "degrees" if own.is_geographic else own.linear_units_factor[0]
            text = f"{features.name} is in {unit} ({crs_name(own)}), and the case states no system"
            text = f'{text}; expected `crs` of the case in metres, such as "EPSG:32633"'
            raise ValueError(text)
        return features
    target = rasterio.crs.CRS.from_user_input(crs)
    if own == target:
        return features
    x, y = (np.array(values) for values in warp.transform(own, target, *xy.T))
    if not (np.isfinite(x) & np.isfinite(y)).all():
        text = f"{features.name} has points outside {crs}; expected another system"
        raise ValueError(text)
    shapes, at = [], 0
    for shape in features.shapes:
        pieces = []
        for piece in shape.pieces:
            rows = slice(at, at + len(piece))
            pieces.append(np.column_stack([x[rows], y[rows], piece[:, 2]]))
            at += len(piece)
        shapes.append(Shape(shape.kind, pieces))
    return features._replace(shapes=shapes, crs=crs)


def crs_name(crs: Any) -> str:
    """Code of a reference system of rasterio, or its name."""
    code = crs.to_epsg()
    return f"EPSG:{code}" if code else str(crs)[:60]

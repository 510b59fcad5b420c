"""Files of GIS layers for tests: features relative to an origin, in any format and reference system."""

from pathlib import Path

import numpy as np
import pytest

pyogrio = pytest.importorskip("pyogrio.raw")
rasterio = pytest.importorskip("rasterio")
pytest.importorskip("rasterio.warp")

EAST, NORTH = 400_000.0, 5_800_000.0  # of the origin in UTM zone 33
HOME = "EPSG:25833"


def well_known_binary(kind: str, points) -> bytes:
    """Little-endian binary of a point, line or polygon, with z where points have three numbers."""
    pieces = {"Point": [[points]], "LineString": [points], "Polygon": points}[kind]
    width = len(pieces[0][0])
    code = {"Point": 1, "LineString": 2, "Polygon": 3}[kind] + (1000 if width == 3 else 0)
    data = b"\x01" + np.array([code], "<u4").tobytes()
    if kind == "Polygon":
        data += np.array([len(pieces)], "<u4").tobytes()
    for piece in pieces:
        if kind != "Point":
            data += np.array([len(piece)], "<u4").tobytes()
        data += np.array(piece, "<f8").tobytes()
    return data


def in_system(points, crs: str, shift=(EAST, NORTH)):
    """Points [m] relative to the origin, in a reference system."""
    points = np.array(points, float)
    flat = points.reshape(-1, points.shape[-1]).copy()
    flat[:, :2] += shift
    x, y = rasterio.warp.transform(HOME, crs, *flat[:, :2].T) if crs != HOME else flat[:, :2].T
    flat[:, 0], flat[:, 1] = x, y
    return flat.reshape(points.shape)


def write_layer(path: Path, kind: str, features: list, crs: str = HOME, layer: str | None = None):
    """Write features (points, attributes) to a file, whose suffix states its format."""
    shapes, rows = zip(*features, strict=True)
    shapes = [in_system(shape, crs) for shape in shapes]
    geometry = np.array([well_known_binary(kind, shape.tolist()) for shape in shapes], object)
    names = list(rows[0])
    columns = [np.array([row[name] for row in rows]) for name in names]
    columns = [column.astype(object) if column.dtype.kind == "U" else column for column in columns]
    has_z = shapes[0].shape[-1] == 3
    kind = f"{kind} Z" if has_z else kind
    pyogrio.write(
        path,
        geometry,
        columns,
        names,
        geometry_type=kind,
        crs=crs,
        layer=layer,
        append=layer is not None and path.exists(),
    )
    return path

"""Raster files of heights in three formats, and basins on them."""

import numpy as np
import pytest
from scipy.io import netcdf_file

from reference.basins import model_of
from reference.scenes import scene

UTM = 32633
WKT = f'PROJCS["WGS 84 / UTM zone 33N",GEOGCS["WGS 84",AUTHORITY["EPSG","4326"]],AUTHORITY["EPSG","{UTM}"]]'


def heights(ny=12, nx=20, seed=1) -> np.ndarray:
    """Rough heights [m], rows from south to north."""
    return np.random.default_rng(seed).uniform(0.0, 3.0, (ny, nx))


def ascii_grid(path, values, size=0.5, corner=(0.0, 0.0), **changes):
    """Write an ESRI ASCII grid; changes : lines of its head, None to leave a line out."""
    head = {
        "ncols": values.shape[1],
        "nrows": values.shape[0],
        "xllcorner": corner[0],
        "yllcorner": corner[1],
        "cellsize": size,
        "NODATA_value": -9999,
    } | changes
    lines = [f"{key} {item}" for key, item in head.items() if item is not None]
    rows = np.where(np.isnan(values), -9999.0, values)[::-1].tolist()
    path.write_text("\n".join([*lines, *(" ".join(map(repr, row)) for row in rows)]) + "\n")
    return path


def netcdf(
    path, values, size=0.5, corner=(0.0, 0.0), south_first=True, unit="m", wkt=WKT, others=()
):
    """Write a NetCDF-3 file of heights on centres."""
    turn = slice(None, None, 1 if south_first else -1)
    with netcdf_file(path, "w") as file:
        for name, count, low, step in zip(
            "yx", values.shape, corner[::-1], (turn, slice(None)), strict=True
        ):
            file.createDimension(name, count)
            item = file.createVariable(name, "d", (name,))
            item[:] = (low + size * (np.arange(count) + 0.5))[step]
            item.units = unit
        file.createVariable("crs", "i", ()).crs_wkt = wkt
        for name in ("height", *others):
            item = file.createVariable(name, "d", ("y", "x"))
            item._FillValue, item.grid_mapping = -9999.0, "crs"
            item[:] = np.where(np.isnan(values), -9999.0, values)[turn]
    return path


def geotiff(path, values, size=0.5, corner=(0.0, 0.0), crs=f"EPSG:{UTM}", **changes):
    rasterio = pytest.importorskip("rasterio")
    to = rasterio.transform.from_origin(corner[0], corner[1] + size * len(values), size, size)
    given = {
        "driver": "GTiff",
        "height": values.shape[0],
        "width": values.shape[1],
        "count": 1,
        "dtype": "float64",
        "crs": crs,
        "transform": to,
        "nodata": -9999.0,
    } | changes
    with rasterio.open(path, "w", **given) as file:
        for band in range(1, given["count"] + 1):
            file.write(np.where(np.isnan(values), -9999.0, values)[::-1] * band, band)
    return path


def pond(bed, end=0.1, probes=(), **more) -> dict:
    """Case of a basin of 10 m by 6 m with a bed; keys that are None are left out."""
    own = {
        "type": "basin",
        "size": [10.0, 6.0],
        "cells": [10, 6],
        "level": 4.0,
        "elevation": 0.0,
        "bed": bed,
    } | more
    own = {key: item for key, item in own.items() if item is not None}
    return scene({"pond": own}, {}, end, {"scheme": "muscl"}, probes)


def bed_of(case) -> tuple[np.ndarray, np.ndarray]:
    basin = model_of(case).meshed[0]
    return basin.bed, basin.mesh.area

"""Faults of the grids of `[output]`, and their numbers of pixels."""

import math
from collections.abc import Iterator
from typing import Any

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.raster_files import check_count, import_library
from fvsolve.units import show

NEAR = 1e-9  # tolerance of a number of pixels, relative


def pixel_counts(mesh: Any, cell: float) -> tuple[int, int]:
    """Numbers of square pixels along x and y that cover a mesh; cell : side of a pixel [m]"""
    size = mesh.points.max(axis=0) - mesh.points.min(axis=0)
    return tuple(max(math.ceil(length / cell * (1.0 - NEAR)), 1) for length in size.tolist())


def grid_faults(spec: Any, pool: Any, frames: int) -> Iterator[tuple[tuple, str]]:
    """Faults (key path below the grid, message) of a grid of a valid basin.

    spec : table of the grid; pool : `BasinFields` of its basin; frames : number of frames of the run
    """
    recorded = pool.basin.physics_type.maxima
    known = [*recorded, *pool.fields]
    for k, name in enumerate(spec.fields):
        if name not in known:
            yield (
                ("fields", k),
                f"no field {show(name)}{did_you_mean(str(name), known) or f'; fields are {listing(known)}'}",
            )
    if not spec.fields:
        yield ("fields",), f"names no field; expected some of {listing(known)}"
    if frames == 0 and any(name in pool.fields and name not in recorded for name in spec.fields):
        yield (
            ("fields",),
            "are written from frames, but `output.fields` is 0; expected `fields = 1` or more",
        )
    if pool.basin.on is not None or any(patch.moves for patch in pool.basin.patches.values()):
        yield (
            ("basin",),
            f"{show(spec.basin)} has cells that move; expected a basin without moving walls, on no body",
        )
    try:
        nx, ny = pixel_counts(pool.mesh, spec.cell)
        check_count("the grid", nx, ny * (frames if spec.format == "netcdf" and frames else 1))
    except ValueError as error:
        yield ("cell",), str(error)
    if spec.format == "geotiff":
        yield from _geotiff_faults(pool.basin.crs)


def _geotiff_faults(crs: str | None) -> Iterator[tuple[tuple, str]]:
    """Yield a fault if rasterio is missing, or does not know a CRS."""
    try:
        rasterio = import_library("rasterio", "a GeoTIFF")
    except ValueError as error:
        yield ("format",), f'{error}, or expected `format = "netcdf"`'
        return
    try:
        rasterio.crs.CRS.from_user_input(crs or "EPSG:32633")
    except rasterio.errors.CRSError as error:
        yield ("basin",), f"has an unknown `crs`: {error}"

"""Rectangles of cells over rasters, and holes where rasters have no data."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.parts.formula import SpatialField
from fvsolve.parts.raster import Raster
from fvsolve.parts.raster_files import Pixels, check_count, read_pixels
from fvsolve.parts.raster_systems import stretch
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import ReadContext, ValueFault

NEAR = 1e-9  # tolerance of a number of cells, relative


def mesh_pixels(basin: Any, setting: ReadContext) -> tuple[Path, Pixels]:
    """(path, pixels in the coordinates of the basin) of the raster that the cells of a basin cover.

    Raises ValueFault for an unsuitable raster.
    """
    path = setting.files[basin.mesh.raster]
    try:
        pixels = read_pixels(path, basin.mesh.band, basin.mesh.variable).to_basin(
            path.name, basin.origin, basin.crs
        )
    except ValueError as error:
        raise ValueFault([(("mesh", "raster"), str(error))]) from None
    return path, pixels


def raster_extent(basin: Any, setting: ReadContext) -> tuple[tuple, tuple, tuple]:
    """(size, numbers of cells, corner) of the rectangle of whole cells over a raster [m]; raises ValueFault."""
    path, pixels = mesh_pixels(basin, setting)
    wide = [
        count * step
        for count, step in zip(pixels.values.shape[::-1], (pixels.dx, pixels.dy), strict=True)
    ]
    cells = tuple(math.floor(length / basin.mesh.cell * (1.0 + NEAR)) for length in wide)
    text = (
        f"{path.name} measures {wide[0]:g} m by {wide[1]:g} m; expected smaller cells{pixels.hint}"
    )
    faults = [(("mesh", "cell"), text)] if min(cells) < 1 else []
    try:
        check_count("the basin", *cells)
    except ValueError as error:
        faults = [(("mesh", "cell"), str(error))]
    if getattr(basin, "level", None) is not None and getattr(basin, "bed", None) is None:
        text = (
            "gives only the outline of the basin; give the same raster as `bed` too, or `bed = 0`"
        )
        faults.append((("mesh", "raster"), text))
    if faults:
        raise ValueFault(faults)
    return tuple(basin.mesh.cell * count for count in cells), cells, (pixels.x, pixels.y)


def rasters_with_holes(basin: Any, setting: ReadContext) -> list[Raster]:
    """Rasters of the mesh and the keys of a basin with `outside = "hole"`."""
    fields = [shape.rule for shape in fields_of(basin) if isinstance(shape.rule, Raster)]
    if basin.mesh is not None and basin.mesh.outside == "hole":
        path, pixels = mesh_pixels(basin, setting)
        fields.append(Raster(path.name, pixels, True))
    return [raster for raster in fields if raster.holes]


def terrace_notes(basin: Any, grid: Any) -> tuple[str, ...]:
    """Remark on a bed whose pixels are larger than the cells of a rectangle; () without one."""
    raster = getattr(getattr(basin, "bed", None), "rule", None)
    least = float(min(np.diff(grid.x).min(), np.diff(grid.y).min()))
    if not isinstance(raster, Raster) or least > (1.0 - 1e-6) * min(
        raster.pixels.dx, raster.pixels.dy
    ):
        return ()
    text = f"cells of {least:g} m are smaller than the pixels of {raster.name}, so the bed has terraces"
    return (
        f"{text}, on which thin films are too slow; expected cells at least as large as pixels",
    )


def stretch_notes(basin: Any, mesh: Any, setting: ReadContext) -> tuple[str, ...]:
    """Remark on a CRS whose lengths are not true, with their factor at the middle of the basin; () without one."""
    pixels = [field.rule.pixels for field in fields_of(basin) if isinstance(field.rule, Raster)]
    pixels += (
        [mesh_pixels(basin, setting)[1]] if basin.mesh is not None and basin.mesh.raster else []
    )
    north = (basin.origin or (0.0, 0.0))[1] + 0.5 * (
        mesh.points[:, 1].min() + mesh.points[:, 1].max()
    )
    crs = max(
        [basin.crs or "", *(own.crs for own in pixels)], key=lambda text: stretch(text, north)
    )
    if (factor := stretch(crs, north)) <= 1.0:
        return ()
    latitude = math.degrees(math.acos(1.0 / factor))
    text = f"{crs} stretches lengths by 1/cos(latitude): {factor:.4g} times the true ones at {latitude:.3g} degrees"
    return (f"{text}; expected another system in metres, for example UTM, by gdalwarp -t_srs",)


def fields_of(table: Table) -> Iterator[SpatialField]:
    """Yield the fields over the plane in a table and in the tables below it."""
    for key in type(table).model_fields:
        value = getattr(table, key, None)
        # a series of fields stands for the field of its least values
        for entry in (
            [*value.values()] if isinstance(value, dict) else [getattr(value, "least", value)]
        ):
            if isinstance(entry, SpatialField):
                yield entry
            elif isinstance(entry, Table):
                yield from fields_of(entry)

"""Rasters as fields over a plane: means of pixels over the cells of a mesh, and values at points."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from fvsolve import units
from fvsolve.errors import listing
from fvsolve.parts.csv_rows import copy_name, find_file
from fvsolve.parts.raster_files import Pixels, read_pixels
from fvsolve.parts.table_model import read_keys
from fvsolve.parts.value import (
    NEEDED,
    Choice,
    Quantity,
    Range,
    ReadContext,
    Text,
    Value,
    Whole,
    between,
)
from fvsolve.units import show

FULL = 1e-9  # lacking share of a cell below which it counts as covered
DIGITS = 9  # of positions in pixels: rounding makes them the same for all formats of a file
# Centres of nine equal triangles of a triangle, as shares of its corners
CENTRES = (
    np.array(
        [(3 * i + 1, 3 * j + 1, 7 - 3 * i - 3 * j) for i in range(3) for j in range(3 - i)]
        + [(3 * i + 2, 3 * j + 2, 5 - 3 * i - 3 * j) for i in range(2) for j in range(2 - i)]
    )
    / 9.0
)


@dataclass(frozen=True, eq=False)
class Raster:
    """Values of pixels of a file in the coordinates of a basin.

    name : of the file; pixels : its values in SI; holes : True if cells without data are left out
    classes : float64[ny, nx]  numbers of classes, if they stand for other values, else None
    """

    name: str
    pixels: Pixels
    holes: bool = False
    classes: np.ndarray | None = None
    last: list = field(default_factory=list, repr=False)  # mesh, and means over its cells

    @cached_property
    def filled(self) -> np.ndarray:
        """Values with a rim of one pixel : float64[ny + 2, nx + 2]; the nearest pixel with data fills others."""
        values, lacks = self.pixels.values, np.isnan(self.pixels.values)
        if lacks.any():
            from scipy.ndimage import distance_transform_edt

            values = values[
                tuple(distance_transform_edt(lacks, return_distances=False, return_indices=True))
            ]
        return np.pad(values, 1, mode="edge")

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Bilinear values between the centres of pixels. Raises ValueError for a point outside the raster."""
        row, column = self.row(y), self.column(x)
        outside = (
            np.maximum(
                np.abs(2.0 * row / self.pixels.values.shape[0] - 1.0),
                np.abs(2.0 * column / self.pixels.values.shape[1] - 1.0),
            )
            > 1.0 + FULL
        )
        if outside.any():
            k = int(np.argmax(outside))
            text = f"{self.name} does not cover x = {x[k]:.6g} m, y = {y[k]:.6g} m"
            raise ValueError(
                f"{text}; expected a raster over the whole basin, or another `origin`{self.pixels.hint}"
            )
        return self.bilinear(row, column)

    def bilinear(self, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Bilinear values at positions in pixels; those outside have the value of the nearest pixel."""
        (j, b), (i, a) = (
            (at, to - at)
            for to, n in zip((row, column), self.filled.shape, strict=True)
            for to in [np.clip(to + 0.5, 0.0, n - 1.0)]
            for at in [np.minimum(to.astype(int), n - 2)]
        )
        first = j * self.filled.shape[1] + i  # south-west of the four centres around a point
        southwest, southeast, northwest, northeast = (
            self.filled.ravel()[first + step]
            for step in (0, 1, self.filled.shape[1], self.filled.shape[1] + 1)
        )
        return (southwest * (1.0 - a) + southeast * a) * (1.0 - b) + (
            northwest * (1.0 - a) + northeast * a
        ) * b

    def column(self, x: Any) -> np.ndarray:
        """Position along x in pixels from the west edge."""
        return np.round((x - self.pixels.x) / self.pixels.dx, DIGITS)

    def row(self, y: Any) -> np.ndarray:
        """Position along y in pixels from the south edge."""
        return np.round((y - self.pixels.y) / self.pixels.dy, DIGITS)

    def over_rectangles(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Exact means over the cells between grid lines, and shares of their areas with data : two float64[ny, nx].

        x : float64[nx + 1], y : float64[ny + 1]  grid lines [m]; without data the mean has no meaning
        """
        values = self.pixels.values
        rows, columns = (
            shares(*pair) for pair in zip((self.row(y), self.column(x)), values.shape, strict=True)
        )

        def mean(pixels: np.ndarray) -> np.ndarray:
            return (columns @ (rows @ pixels).T).T

        lacks = np.isnan(values)
        if not lacks.any():
            data = np.outer(rows.sum(axis=1), columns.sum(axis=1))
            return np.clip(mean(values), values.min(), values.max()), data
        low, high = np.nanmin(values), np.nanmax(values)
        return np.clip(mean(np.where(lacks, 0.0, values)), low, high), mean(
            np.where(lacks, 0.0, 1.0)
        )

    def lacks(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """True for cells between grid lines with less data than area : bool[ny, nx]; x, y : grid lines [m]"""
        return self.over_rectangles(x, y)[1] < 1.0 - FULL

    def over_triangles(
        self, points: np.ndarray, cells: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Means over triangles and quadrilaterals, and shares with data : two float64[n].

        Each triangle, or half of a quadrilateral, has nine points with bilinear values.
        points : float64[p, 2], cells : int64[n, 4]  as of a mesh
        """
        mean, data, whole = (np.zeros(len(cells)) for _ in range(3))
        for corners in ((0, 1, 2), (0, 2, 3)):
            own = np.flatnonzero(cells[:, corners[-1]] >= 0)
            at = points[cells[own][:, corners]]  # float64[n, 3, 2]
            along, other = at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]
            area = 0.5 * (along[:, 0] * other[:, 1] - along[:, 1] * other[:, 0])
            x, y = np.einsum("pk,nkd->dnp", CENTRES, at)
            row, column = self.row(y), self.column(x)
            i, j = np.floor(column).astype(int), np.floor(row).astype(int)
            inside = (
                (i >= 0)
                & (j >= 0)
                & (i < self.pixels.values.shape[1])
                & (j < self.pixels.values.shape[0])
            )
            known = inside & np.isfinite(
                self.pixels.values[np.where(inside, j, 0), np.where(inside, i, 0)]
            )
            mean[own] += area * self.bilinear(row, column).mean(axis=1)
            data[own] += area * known.mean(axis=1)
            whole[own] += area
        return mean / whole, data / whole

    def over(self, mesh: Any) -> np.ndarray:
        """Means over the cells of a mesh : float64[n]. Raises ValueError if a cell lacks data."""
        if self.last and self.last[0] is mesh:
            return self.last[1]
        if mesh.grid is not None:
            solid = mesh.grid.index >= 0
            mean, data = (array[solid] for array in self.over_rectangles(mesh.grid.x, mesh.grid.y))
        else:
            mean, data = self.over_triangles(mesh.points, mesh.cells)
        if (data < 1.0 - FULL).any():
            raise ValueError(self.gap_text(mesh, np.flatnonzero(data < 1.0 - FULL)))
        self.last[:] = [mesh, mean]
        return mean

    def gap_text(self, mesh: Any, cells: np.ndarray) -> str:
        """Message about the cells of a mesh that lack data; cells : their numbers"""
        pixels, (low, high) = self.pixels, (mesh.points.min(axis=0), mesh.points.max(axis=0))
        ny, nx = pixels.values.shape
        east, north = pixels.x + nx * pixels.dx, pixels.y + ny * pixels.dy
        x, y = mesh.centre[cells[0]]
        first = f"{cells.size} of {len(mesh.cells)} cells, first at {x:.6g},{y:.6g} m"
        if (
            min(*self.column(low[:1]), *self.row(low[1:])) < 0.0
            or high[0] > east
            or high[1] > north
        ):
            text = f"{self.name} does not cover {first}: in the coordinates of the basin it reaches from "
            text += f"{pixels.x:g},{pixels.y:g} to {east:g},{north:g} m, the basin from {low[0]:g},{low[1]:g} to "
            text += f"{high[0]:g},{high[1]:g} m; expected a raster over the whole basin, or another `origin`"
            return text + pixels.hint
        if self.classes is not None and np.isnan(pixels.values[np.isfinite(self.classes)]).any():
            lost = np.unique(self.classes[np.isnan(pixels.values) & np.isfinite(self.classes)])
            number = f"{listing([f'{value:g}' for value in lost], 10)}"
            return f"{self.name}: `table` has no value of class {number}, under {first}; expected all classes"
        return f'{self.name} has no data under {first}; expected data, or `outside = "hole"`'


def shares(edges: np.ndarray, count: int) -> Any:
    """Sparse matrix of the shares of intervals that lie in each pixel : [intervals, count].

    edges : float64[intervals + 1]  increasing positions in pixels; count : number of pixels
    """
    from scipy.sparse import csr_array

    low, high = edges[:-1], edges[1:]
    first = np.clip(np.floor(low), 0, count).astype(int)
    sizes = np.maximum(np.clip(np.ceil(high), 0, count).astype(int) - first, 0)
    interval = np.repeat(np.arange(low.size), sizes)
    pixel = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes) + first[interval]
    part = np.minimum(high[interval], pixel + 1) - np.maximum(low[interval], pixel)
    return csr_array((part / (high - low)[interval], (interval, pixel)), shape=(low.size, count))


@dataclass(frozen=True)
class ClassValues(Value):
    """Value of a case file: a table of the classes of a raster, number of a class -> quantity."""

    value: Quantity

    def read(self, given: Any, setting: ReadContext) -> dict[float, float]:
        if not isinstance(given, dict) or not given:
            raise ValueError(
                f"{show(given)} is not a table of classes; expected for example {{ 1 = 0.03, 2 = 0.06 }}"
            )
        values = {}
        for key, item in given.items():
            try:
                number = float(key)
            except ValueError:
                text = f"{show(key)} is not the number of a class; expected for example 1 = 0.03"
                raise ValueError(text) from None
            values[number] = self.value.read(item, setting)
        return values


def raster_keys(value: Quantity | None = None) -> dict[str, tuple[Value, Any]]:
    """Keys of a table with a raster : key -> (declaration, default); value : of its classes, None without classes"""
    keys: dict[str, tuple[Value, Any]] = {
        "raster": (Text(), NEEDED),
        "band": (Whole(between(1, 1e6)), 1),
        "variable": (Text(), ""),
        "unit": (Text(), ""),
        "outside": (Choice("choice", ("hole",)), None),
    }
    return keys | ({"table": (ClassValues(value), None)} if value is not None else {})


def read_raster(
    given: dict[str, Any], dimension: str, range: Range, setting: ReadContext
) -> tuple[dict, Raster]:
    """(table for the resolved case, raster in the coordinates of the basin that is read) from a table of a case file.

    dimension, range : of the values. Raises ValueError, or ValueFault with all faults of the table.
    """
    keys = read_keys(given, raster_keys(Quantity(dimension, range)), setting)
    stated, name, pixels = open_raster(given, keys, setting)
    values = pixels.values
    classes = None
    unit = keys["unit"] or pixels.unit
    if keys["table"] is not None:
        classes, values = values, np.full_like(values, np.nan)
        for number, value in keys["table"].items():
            values[classes == number] = value
    elif unit and (keys["unit"] or dimension != "number"):
        values = units.find(unit, dimension).si(values)
    return stated, Raster(name, pixels._replace(values=values), keys["outside"] == "hole", classes)


def open_raster(
    given: dict[str, Any], keys: dict[str, Any], setting: ReadContext, series: bool = False
) -> tuple:
    """(table for the resolved case, name of the file, its `Pixels` in the coordinates of the basin that is read).

    given, keys : table of a case file as given and as read; series : True if the file may have several frames
    """
    path = find_file(keys["raster"], setting)
    pixels = read_pixels(path, keys["band"], keys["variable"], series).to_basin(
        path.name, *setting.frame
    )
    return {**given, "raster": copy_name(path, setting)}, path.name, pixels

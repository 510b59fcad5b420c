"""Values over a plane: a number, a formula of x and y, or interpolated points of a file; their means over cells."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from fvsolve.parts.arithmetic import Arithmetic
from fvsolve.parts.csv_rows import read_rows
from fvsolve.parts.time_series import copy_name, find_file
from fvsolve.parts.value import PROFILE, Quantity, Range, ReadContext, Value, ValueFault, anything
from fvsolve.units import show

BLOCK = 2**16  # points per evaluation: limits the memory of intermediate values
# Three Gauss points in each direction of a rectangle, at 0 and +-sqrt(3 / 5) of its half: centre, corners, sides.
GAUSS = (0, 0), (-1, -1), (1, 1), (-1, 1), (1, -1), (-1, 0), (1, 0), (0, -1), (0, 1)


@dataclass(frozen=True)
class SpatialField:
    """Value at every point of a plane, in SI.

    given : the value as in the case file; rule : function of arrays x and y [m]
    """

    given: Any
    rule: Any

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Values at points x, y [m] : float64[n]. Raises ValueError if a value is not finite."""
        values = np.empty(np.shape(x))
        for first in range(0, values.size, BLOCK):
            part = slice(first, first + BLOCK)
            values[part] = self.rule(x[part], y[part])
        if not np.isfinite(values).all():
            k = int(np.argmax(~np.isfinite(values)))
            place = f"x = {x[k]:.6g} m, y = {y[k]:.6g} m"
            raise ValueError(f"{show(self.given)} is not finite at {place}; expected finite values in the whole basin")
        return values

    def table(self) -> Any:
        """Value of the field as in a case file."""
        return self.given

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SpatialField) and self.given == other.given

    def __hash__(self) -> int:
        return hash(str(self.given))


def uniform(value: float) -> SpatialField:
    """Field with the same value at every point."""
    return SpatialField(value, lambda x, y: value)


@dataclass(frozen=True)
class SpatialFieldKey(Value):
    """Value of a case file for a field over a plane: a quantity, a formula of x and y in SI, or points of a file.

    A file has the columns x, y and the value.
    """

    schema: ClassVar[dict[str, Any]] = {"type": ["number", "string", "object"]}

    dimension: str
    about: str = ""
    range: Range = anything
    changes: str = PROFILE

    def read(self, given: Any, setting: ReadContext) -> SpatialField:
        if isinstance(given, SpatialField):
            return given
        if isinstance(given, dict):
            return self._samples(given, setting)
        if not isinstance(given, str):
            return uniform(Quantity(self.dimension, self.range).read(given, setting))
        try:
            return uniform(Quantity(self.dimension, self.range).read(number_or_text(given), setting))
        except ValueError as error:
            if given[:1].isdigit() and not any(sign in given for sign in "*/+-()^<>="):
                raise
            return SpatialField(given, Arithmetic(given, str(error)))

    def _samples(self, given: dict, setting: ReadContext) -> SpatialField:
        if set(given) != {"file"} or not isinstance(given["file"], str):
            text = f'{show(given)} is not a field; expected {{ file = "NAME.csv" }} with columns x, y and the value'
            raise ValueError(text)
        try:
            path = find_file(given["file"], setting)
            columns = read_points(path, self.dimension)
        except ValueError as error:
            raise ValueFault([(("file",), str(error))]) from None
        return SpatialField({"file": copy_name(path, setting)}, Samples(columns))

    @property
    def takes(self) -> str:
        return f"{Quantity(self.dimension, self.range).takes}; formula"


def read_points(path: Path, dimension: str) -> np.ndarray:
    """Points of a CSV file : float64[n, 3] with x [m], y [m] and the value [SI].

    Raises ValueError with the faulty line. dimension : dimension of the value
    """
    rows = read_rows(path)
    if len(rows.header) != 3:
        raise ValueError(f"{path.name} has {len(rows.header)} columns; expected x, y and the value")
    if len(rows.lines) < 3:
        raise ValueError(f"{path.name}: too few points ({len(rows.lines)}); expected at least three")
    return np.column_stack([rows.numbers(k, kind) for k, kind in enumerate(("length", "length", dimension))])


@dataclass(frozen=True, eq=False)
class Samples:
    """Linear interpolation between scattered points; outside their convex hull, the value of the nearest point.

    columns : float64[n, 3]  x [m], y [m] and value of the points
    """

    columns: np.ndarray

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

        places, values = self.columns[:, :2], self.columns[:, 2]
        inner = LinearNDInterpolator(places, values)(x, y)
        return np.where(np.isnan(inner), NearestNDInterpolator(places, values)(x, y), inner)


def number_or_text(text: str) -> Any:
    """Number, if the text is a number, otherwise the text unchanged."""
    try:
        return float(text)
    except ValueError:
        return text


def is_grid(mesh: Any) -> bool:
    """True if the mesh is a full rectangular grid of nx times ny cells."""
    return mesh.grid is not None and len(mesh.cells) == mesh.grid.nx * mesh.grid.ny


def samples(shape: SpatialField | None, mesh: Any) -> np.ndarray:
    """Values of a formula at points in the n cells of a mesh : float64[points, n]; zeros if `shape` is None.

    On full rectangular grids there are nine Gauss points per cell, in the order of `GAUSS`; on other meshes there is
    only the centre.
    """
    x, y = np.ascontiguousarray(mesh.centre.T)
    if not is_grid(mesh):
        places = np.array([x]), np.array([y])
    else:
        wide, high = np.tile(np.diff(mesh.grid.x), mesh.grid.ny), np.repeat(np.diff(mesh.grid.y), mesh.grid.nx)
        to = 0.5 * math.sqrt(0.6) * np.array(GAUSS)[:, :, None]
        places = x + to[:, 0] * wide, y + to[:, 1] * high
    if shape is None:
        return np.zeros(places[0].shape)
    return shape.at(*(coordinate.ravel() for coordinate in places)).reshape(places[0].shape)


def means(values: np.ndarray) -> np.ndarray:
    """Means over each cell of the values from `samples` : float64[n].

    If all values of a cell are equal, its mean is exactly this value. The order of the sums makes the result the same
    to the bit for mirrored and rotated cells.
    """
    if len(values) == 1:
        return values[0]
    corners = (values[1] + values[2]) + (values[3] + values[4])
    sides = (values[5] + values[6]) + (values[7] + values[8])
    mean = (25.0 * corners + (40.0 * sides + 64.0 * values[0])) / 324.0
    return np.where(np.ptp(values, axis=0) > 0.0, mean, values[0])

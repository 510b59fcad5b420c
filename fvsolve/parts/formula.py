"""A value over the plane: a number, a formula of x and y, or samples of a file. Knows no mesh."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.parts.arithmetic import Arithmetic
from fvsolve.parts.csv_rows import read_rows
from fvsolve.parts.series import copy_name, find_file
from fvsolve.parts.value import PROFILE, Misfit, Quantity, Range, Setting, Value, anything
from fvsolve.units import show

MANY = 2**16  # points at a time, so that what a formula is made of stays small


@dataclass(frozen=True)
class Formula:
    """A value at every point, SI: what the file says, and a function of coordinates [m]."""

    said: Any
    rule: Any

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Values at points : float64[n]; ValueError where one is none."""
        found = np.empty(np.shape(x))
        for first in range(0, found.size, MANY):
            part = slice(first, first + MANY)
            found[part] = self.rule(x[part], y[part])
        if not np.isfinite(found).all():
            k = int(np.argmax(~np.isfinite(found)))
            raise ValueError(f"{show(self.said)} is no number at x = {x[k]:.6g} m, y = {y[k]:.6g} m")
        return found

    def table(self) -> Any:
        """What the file would say."""
        return self.said

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Formula) and self.said == other.said

    def __hash__(self) -> int:
        return hash(str(self.said))


def even(value: float) -> Formula:
    """The same value everywhere."""
    return Formula(value, lambda x, y: value)


@dataclass(frozen=True)
class Shaped(Value):
    """A value over the plane: a quantity, a formula of x and y in SI, or { file } with columns x, y and the value."""

    dimension: str
    about: str = ""
    range: Range = anything
    changes: str = PROFILE

    def read(self, given: Any, setting: Setting) -> Formula:
        if isinstance(given, Formula):
            return given
        if isinstance(given, dict):
            return self._samples(given, setting)
        if not isinstance(given, str):
            return even(Quantity(self.dimension, self.range).read(given, setting))
        try:
            return even(Quantity(self.dimension, self.range).read(plain(given), setting))
        except ValueError as error:
            if given[:1].isdigit() and not any(sign in given for sign in "*/+-()^<>="):
                raise
            return Formula(given, Arithmetic(given, str(error)))

    def _samples(self, given: dict, setting: Setting) -> Formula:
        if set(given) != {"file"} or not isinstance(given["file"], str):
            raise ValueError(f'{show(given)}; wanted {{ file = "NAME.csv" }}, columns x, y and the value')
        try:
            path = find_file(given["file"], setting)
            columns = read_points(path, self.dimension)
        except ValueError as error:
            raise Misfit([(("file",), str(error))]) from None
        return Formula({"file": copy_name(path, setting)}, Samples(columns))

    @property
    def takes(self) -> str:
        return f"{Quantity(self.dimension, self.range).takes}; formula"

    def json(self) -> dict[str, Any]:
        return {"type": ["number", "string", "object"]}


def read_points(path: Path, dimension: str) -> np.ndarray:
    """Columns x [m], y [m] and the value [SI] : float64[n, 3]; ValueError names the line at fault."""
    rows = read_rows(path)
    if len(rows.header) != 3:
        raise ValueError(f"{path.name} has {len(rows.header)} columns; wanted x, y and the value")
    if len(rows.lines) < 3:
        raise ValueError(f"{path.name}: {len(rows.lines)} points; wanted three at least")
    return np.column_stack([rows.numbers(k, one) for k, one in enumerate(("length", "length", dimension))])


@dataclass(frozen=True, eq=False)
class Samples:
    """Linear between scattered points, the nearest one's value beyond them; columns : float64[n, 3]."""

    columns: np.ndarray

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

        places, values = self.columns[:, :2], self.columns[:, 2]
        found = LinearNDInterpolator(places, values)(x, y)
        return np.where(np.isnan(found), NearestNDInterpolator(places, values)(x, y), found)


def plain(text: str) -> Any:
    """A text that is a number alone, a formula too, as that number."""
    try:
        return float(text)
    except ValueError:
        return text

"""A value over the plane: a number, a formula of x and y, or samples of a file. Knows no mesh."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.csv_rows import read_rows
from fvsolve.parts.series import copy_name, find_file
from fvsolve.parts.value import Misfit, Quantity, Range, Setting, Value, anything
from fvsolve.units import show

FUNCTIONS = {
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "arctan2": np.arctan2, "exp": np.exp, "log": np.log, "sqrt": np.sqrt,
    "tanh": np.tanh, "abs": np.abs, "min": np.minimum, "max": np.maximum, "hypot": np.hypot, "where": np.where,
}  # fmt: skip
NAMES = ("x", "y", "pi")
ALLOWED = (
    ast.Expression, ast.BinOp, ast.UnaryOp, ast.Compare, ast.Call, ast.Name, ast.Load, ast.Constant, ast.operator,
    ast.unaryop, ast.cmpop,
)  # fmt: skip


@dataclass(frozen=True)
class Formula:
    """A value at every point, SI: what the file says, and a function of coordinates [m]."""

    said: Any
    rule: Any

    def at(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Values at points : float64[n]; ValueError where one is none."""
        with np.errstate(all="ignore"):
            found = np.array(np.broadcast_to(self.rule(x, y), np.shape(x)), dtype=float)
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
            if given[:1].isdigit() and not any(sign in given for sign in "*/+-()"):
                raise
            return parsed(given, str(error))

    def _samples(self, given: dict, setting: Setting) -> Formula:
        if set(given) != {"file"} or not isinstance(given["file"], str):
            raise ValueError(f'{show(given)}; wanted {{ file = "NAME.csv" }}, columns x, y and the value')
        try:
            path = find_file(given["file"], setting)
            columns = read_points(path, self.dimension)
        except ValueError as error:
            raise Misfit([(("file",), str(error))]) from None
        return Formula({"file": copy_name(path, setting)}, Samples(columns))

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


def open_bracket(text: str) -> str:
    """What is wrong with the brackets of a text, "" where nothing is."""
    depth = 0
    for sign in text:
        depth += (sign == "(") - (sign == ")")
        if depth < 0:
            return "a bracket is closed that was not opened"
    return "a bracket is left open" if depth else ""


def parsed(text: str, otherwise: str = "") -> Formula:
    """The formula of a text; ValueError where it says anything but arithmetic of x, y, pi and FUNCTIONS."""
    about = f"{show(text)} is no formula of x and y"
    try:
        tree = ast.parse(text.replace("^", "**"), mode="eval")
    except (SyntaxError, ValueError, MemoryError, RecursionError) as error:
        if any(sign in text for sign in "*+()"):  # no quantity
            raise ValueError(f"{about}: {open_bracket(text) or getattr(error, 'msg', error)}") from None
        raise ValueError(otherwise or about) from None
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            known = list(FUNCTIONS) if id(node) in called else [*NAMES]
            if node.id not in known:
                raise ValueError(f"{about}: {node.id} is unknown{did_you_mean(node.id, known)}; "
                                 f"known are {listing([*NAMES, *FUNCTIONS])}")  # fmt: skip
        number = isinstance(node, ast.Constant) and isinstance(node.value, (int, float)) and node.value is not True
        if not isinstance(node, ALLOWED) or (isinstance(node, ast.Constant) and not number):
            raise ValueError(f"{about}; wanted numbers, {listing([*NAMES, *FUNCTIONS])} and arithmetic")
        if isinstance(node, ast.Call) and (node.keywords or not isinstance(node.func, ast.Name)):
            raise ValueError(f"{about}; wanted a call such as sin(x)")
    code = compile(tree, "formula", "eval")

    def rule(x: np.ndarray, y: np.ndarray) -> Any:
        return eval(code, {"__builtins__": {}}, {**FUNCTIONS, "pi": np.pi, "x": x, "y": y})

    try:
        with np.errstate(all="ignore"):
            rule(np.array([0.3]), np.array([0.7]))
    except Exception as error:  # a call with too few arguments, a list as a number
        raise ValueError(f"{about}: {error}") from None
    return Formula(text, rule)

"""Values over a plane: a number, a formula of x and y, points of a file or a raster; their means over cells.

A formula is parsed into a list of steps that act on arrays of floats.
"""

import ast
import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial, reduce
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.csv_rows import CsvRows, read_table_file
from fvsolve.parts.value import PROFILE, Quantity, Range, ReadContext, Value, ValueFault, anything
from fvsolve.units import show

NAMES = ("x", "y", "pi")
TIME_NAMES = ("t", "pi")
CALL_FORMS = (  # allowed calls; "..." stands for any number of arguments
    "sin(a)",
    "cos(a)",
    "tan(a)",
    "arctan2(a, b)",
    "exp(a)",
    "log(a)",
    "sqrt(a)",
    "tanh(a)",
    "abs(a)",
    "min(a, b, ...)",
    "max(a, b, ...)",
    "hypot(a, b)",
    "where(condition, a, b)",
)
FUNCTIONS = {form[: form.index("(")]: form for form in CALL_FORMS}
SMOOTH_FUNCTIONS = tuple(name for name in FUNCTIONS if name not in ("abs", "min", "max", "where"))
OPERATORS = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
    ast.UAdd: np.positive,
    ast.USub: np.negative,
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}
OPERATOR_HINT = "operators are + - * / ^ < <= > >= == !="
UNKNOWN_OPERATORS = {  # operators of other languages -> (sign, equivalent here)
    ast.MatMult: ("@", ""),
    ast.Mod: ("%", ""),
    ast.FloorDiv: ("//", ""),
    ast.LShift: ("<<", ""),
    ast.RShift: (">>", ""),
    ast.Invert: ("~", "where(a, 0, 1)"),
    ast.Not: ("not", "where(a, 0, 1)"),
    ast.BitAnd: ("&", "(a)*(b)"),
    ast.And: ("and", "(a)*(b)"),
    ast.BitOr: ("|", "max(a, b)"),
    ast.Or: ("or", "max(a, b)"),
    ast.IfExp: ("if", "where(condition, a, b)"),
}
NUMBER = re.compile(r"(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
MAX_LENGTH = 4000  # characters
TOO_DEEP = "brackets or powers are nested too deep"
ERRORS = ("divides by zero", "is the logarithm of zero", "is not a number", "overflows")


class Step(NamedTuple):
    """Step in the evaluation of a formula with a stack of values.

    rule : a number or name, which is pushed on the stack (count 0), or a function of the last `count` values
    part : text of the step in the formula
    """

    rule: Callable | str | float
    count: int
    part: str


class Arithmetic:
    """Formula of x and y, called with arrays, or of other names, whose steps become a program (`formula_program`).

    Raises ValueError for an invalid text or a value that is not finite.

    All values are floats; comparisons give 1 or 0. Values that the function `where` does not select may be invalid.
    """

    def __init__(
        self,
        text: str,
        otherwise: str = "",
        names: tuple[str, ...] = NAMES,
        functions: tuple[str, ...] = tuple(FUNCTIONS),
    ) -> None:
        """Parse a formula.

        otherwise : error message for a text that is not a formula at all; names : its variables
        functions : names of functions that messages list
        """
        self.text, self.source, self.names, self.functions = (
            text,
            text.replace("^", "**").strip(),
            names,
            functions,
        )
        of = (
            " and ".join(name for name in names if name != "pi")
            if len(names) < 4
            else listing(names, 20)
        )
        about = f"{show(text)} is not a formula of {of}"
        if len(text) > MAX_LENGTH:
            text = f'{about}: it has {len(text)} characters; expected at most {MAX_LENGTH}, or {{ file = "NAME.csv" }}'
            raise ValueError(text)
        try:
            tree = ast.parse(self.source, mode="eval").body
        except (MemoryError, RecursionError):
            raise ValueError(f"{about}: {TOO_DEEP}") from None
        except (SyntaxError, ValueError) as error:
            if any(sign in text for sign in "*+()"):  # not a quantity
                raise ValueError(
                    f"{about}: {bracket_fault(text) or getattr(error, 'msg', error)}"
                ) from None
            raise ValueError(otherwise or about) from None
        try:
            self.steps = list(self.read(tree))
        except RecursionError:
            raise ValueError(f"{about}: {TOO_DEEP}") from None
        except ValueError as error:
            raise ValueError(f"{about}: {error}") from None

    def read(self, node: ast.expr) -> Iterator[Step]:
        """Yield the steps that compute a node of the syntax tree; the last step gives its value."""
        part = self.source_of(node)
        if isinstance(node, ast.Constant):
            yield Step(decimal_number(part), 0, part)
        elif isinstance(node, ast.Name):
            if node.id not in self.names:
                hint = f"; did you mean {FUNCTIONS[node.id]}?" if node.id in FUNCTIONS else ""
                known = [*self.names, *self.functions]
                raise ValueError(
                    f"{node.id} is unknown{hint or did_you_mean(node.id, known)}; known are "
                    f"{listing(known, 20)}"
                )
            yield Step(node.id, 0, part)
        elif isinstance(node, ast.UnaryOp):
            yield from self.read(node.operand)
            yield Step(operator_function(node.op), 1, part)
        elif isinstance(node, ast.BinOp):
            chain = []  # x + y + z is (x + y) + z: a loop, since recursion would limit its length
            while isinstance(node, ast.BinOp):
                chain.append(node)
                node = node.left
            yield from self.read(node)
            for item in reversed(chain):
                yield from self.read(item.right)
                yield Step(operator_function(item.op), 2, self.source_of(item))
        elif isinstance(node, ast.Compare):  # 0 < x < 1 is 1 if both hold
            sides = [node.left, *node.comparators]
            for item, sign, other in zip(sides, node.ops, sides[1:], strict=False):
                yield from self.read(item)
                yield from self.read(other)
                yield Step(operator_function(sign), 2, part)
            if len(node.ops) > 1:
                yield Step(np.multiply, len(node.ops), part)
        elif isinstance(node, ast.Call):
            yield from self.call(node, part)
        else:
            operator_function(getattr(node, "op", node))

    def call(self, node: ast.Call, part: str) -> Iterator[Step]:
        """Yield the steps that compute a function call; part : its text in the formula"""
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if name not in FUNCTIONS:
            text = self.source_of(node.func)
            near, known = did_you_mean(text, self.functions), listing(self.functions, 20)
            raise ValueError(f"{text} is unknown{near}; known are {known}")
        form, given = FUNCTIONS[name], len(node.args)
        count, endless = form.count(",") + 1 - ("..." in form), "..." in form
        if node.keywords or given < count or (given > count and not endless):
            counted = f"{given} argument{'' if given == 1 else 's'}"
            raise ValueError(
                f"{name} has {counted}; expected {form}"
                if not node.keywords
                else f"expected {form}"
            )
        for argument in node.args:
            yield from self.read(argument)
        yield Step(
            {"min": np.minimum, "max": np.maximum}.get(name) or getattr(np, name), given, part
        )

    def source_of(self, node: ast.AST) -> str:
        """Source text of a node of the syntax tree."""
        text = ast.get_source_segment(self.source, node) or ""
        return text.replace("**", "^") if "^" in self.text else text

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Values of the formula at points x, y [m] : float64[n]. Raises ValueError at the first invalid value."""
        result, wrong = self.evaluate({"x": np.asarray(x, float), "y": np.asarray(y, float)})
        if (wrong >= 0).any():
            k = int(np.argmax(wrong >= 0))
            at, reason = divmod(int(wrong[k]), len(ERRORS))
            part = self.steps[at].part
            where = f"{ERRORS[reason]} at x = {x[k]:.6g} m, y = {y[k]:.6g} m"
            raise ValueError(
                f"{show(self.text)} {where}"
                if part == self.text
                else f"{show(self.text)}: {part} {where}"
            )
        return np.array(result, dtype=float)

    def evaluate(self, known: dict[str, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """(values, error codes as of `apply_step`) : float64[n], int64[n]; known : name -> float64[n]"""
        stack: list[tuple] = []
        known = known | {"pi": np.pi}
        with np.errstate(all="ignore"):
            for at, step in enumerate(self.steps):
                if step.count == 0:
                    stack.append((known.get(step.rule, step.rule), -1))
                    continue
                values, wrongs = zip(*stack[-step.count :], strict=True)
                stack[-step.count :] = [apply_step(at, step.rule, values, wrongs)]
        shape = np.shape(next(iter(known.values())))
        return tuple(np.broadcast_to(array, shape) for array in stack[0])


def apply_step(
    at: int, rule: Callable, values: tuple, wrongs: tuple
) -> tuple[np.ndarray, np.ndarray]:
    """(values, error codes) of a function of arrays : float64[n], int64[n].

    at : index of the step; rule : function; values : its arguments; wrongs : error codes of the arguments
    An error code is -1 for a valid value, otherwise len(ERRORS) * index of the step + index in `ERRORS`.
    """
    if rule is np.where:
        condition, a, b = wrongs
        chosen = np.where(np.not_equal(values[0], 0.0), a, b)
        return np.where(np.not_equal(values[0], 0.0), *values[1:]), np.where(
            condition >= 0, condition, chosen
        )
    result = np.asarray(reduce(rule, values) if len(values) > 2 else rule(*values), dtype=float)
    reason = np.where(np.isnan(result), 2, 3)
    for kind, zero, argument in ((0, np.divide, 1), (0, np.power, 0), (1, np.log, 0)):
        reason = np.where(np.equal(values[argument], 0.0), kind, reason) if rule is zero else reason
    own = np.where(np.isfinite(result), -1, len(ERRORS) * at + reason)
    return result, reduce(lambda first, then: np.where(first >= 0, first, then), [*wrongs, own])


def operator_function(node: ast.AST) -> Callable:
    """NumPy function of an operator of the syntax tree. Raises ValueError for an operator that formulas do not have."""
    if type(node) in OPERATORS:
        return OPERATORS[type(node)]
    sign, instead = UNKNOWN_OPERATORS.get(type(node), ("", ""))
    if not sign:
        raise ValueError(
            f"expected numbers, {listing([*NAMES, *FUNCTIONS], 20)} and arithmetic; {OPERATOR_HINT}"
        )
    raise ValueError(
        f"unknown operator {sign}; " + (f"did you mean {instead}?" if instead else OPERATOR_HINT)
    )


def decimal_number(text: str) -> float:
    """Value of a decimal number. Raises ValueError for any other text, and for a number too large for a float."""
    if NUMBER.fullmatch(text) is None:
        raise ValueError(f"{text} is not a decimal number; expected for example 16, 0.5 or 1e-3")
    if not np.isfinite(float(text)):
        raise ValueError(f"{text if len(text) < 30 else 'a number'} is too large")
    return float(text)


def bracket_fault(text: str) -> str:
    """Text of the fault of the brackets in a formula; "" for valid brackets."""
    depth = 0
    for sign in text:
        depth += (sign == "(") - (sign == ")")
        if depth < 0:
            return "a closing bracket has no opening bracket"
    return "a bracket is not closed" if depth else ""


RASTER_SUFFIXES = (".asc", ".nc", ".tif", ".tiff")
# key of a table -> module and function that read such a field; few cases have some
FIELD_READERS = {
    "groups": ("fvsolve.parts.mesh_fields", "read_group_values"),
    "polygons": ("fvsolve.parts.polygon_values", "read_polygon_values"),
}
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
            raise ValueError(
                f"{show(self.given)} is not finite at {place}; expected finite values in the whole basin"
            )
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
    """Value of a case file for a field over a plane: a quantity, a formula of x and y in SI, a file or a raster.

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
            return uniform(
                Quantity(self.dimension, self.range).read(number_or_text(given), setting)
            )
        except ValueError as error:
            if given[:1].isdigit() and not any(sign in given for sign in "*/+-()^<>="):
                raise
            return SpatialField(given, Arithmetic(given, str(error)))

    def _samples(self, given: dict, setting: ReadContext) -> SpatialField:
        for key, (module, name) in FIELD_READERS.items():
            if key in given:
                read = getattr(import_module(module), name)
                return SpatialField(*read(given, Quantity(self.dimension, self.range), setting))
        if "raster" in given:
            try:
                from fvsolve.parts.raster import read_raster  # only fields of files need it

                return SpatialField(*read_raster(given, self.dimension, self.range, setting))
            except ValueFault:
                raise
            except ValueError as error:
                raise ValueFault([(("raster",), str(error))]) from None
        if "file" not in given:
            text = f'{show(given)} is not a field; expected {{ file = "NAME.csv" }} with columns x, y and the value'
            raise ValueError(f'{text}, {{ raster = "NAME.tif" }} or {{ polygons = "NAME.gpkg" }}')
        if isinstance(name := given["file"], str) and Path(name).suffix.lower() in RASTER_SUFFIXES:
            text = f"{show(name)} is a raster; expected {{ raster = {show(name)} }}"
            raise ValueFault([(("file",), text)])
        _, rows, stated = read_table_file(given, setting)
        try:
            columns = read_points(rows, self.dimension)
        except ValueError as error:
            raise ValueFault([(("file",), str(error))]) from None
        return SpatialField(stated, Samples(columns))

    @property
    def takes(self) -> str:
        return f"{Quantity(self.dimension, self.range).takes}; formula; raster"


@dataclass(frozen=True)
class NumberOrField(Value):
    """Value of a case file for a number, or a field over a plane: a formula of x and y, a file or a raster."""

    schema: ClassVar[dict[str, Any]] = {"type": ["number", "string", "object"]}

    number: Quantity
    about: str = ""
    changes: str = PROFILE

    def read(self, given: Any, setting: ReadContext) -> float | SpatialField:
        if isinstance(given, float):
            return self.number.read(given, setting)
        found = SpatialFieldKey(self.number.dimension, self.about, self.number.range).read(
            given, setting
        )
        return found.given if isinstance(found.given, float) else found

    @property
    def takes(self) -> str:
        return f"{self.number.takes}; formula; raster"


def read_points(rows: CsvRows, dimension: str) -> np.ndarray:
    """Points of a table file : float64[n, 3] with x [m], y [m] and the value [SI].

    Raises ValueError with the faulty line. dimension : dimension of the value
    """
    if len(rows.header) != 3:
        raise ValueError(f"{rows.file} has {len(rows.header)} columns; expected x, y and the value")
    if len(rows.lines) < 3:
        raise ValueError(
            f"{rows.file}: too few points ({len(rows.lines)}); expected at least three"
        )
    return np.column_stack(
        [rows.numbers(k, kind) for k, kind in enumerate(("length", "length", dimension))]
    )


@dataclass(frozen=True, eq=False)
class Samples:
    """Interpolation between points: bilinear if they form a rectangular grid, otherwise linear in triangles.

    Outside the grid, or outside the convex hull of the points, it is the value at the nearest place of the grid or at
    the nearest point.
    columns : float64[n, 3]  x [m], y [m] and value of the points
    """

    columns: np.ndarray

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self._interpolation(x, y)

    @cached_property
    def _interpolation(self) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
        """Function of arrays x and y, made once."""
        places, values = self.columns[:, :2], self.columns[:, 2]
        if lines := grid_lines(places):
            return partial(
                bilinear, *lines, values[np.lexsort(places.T)].reshape(lines[1].size, lines[0].size)
            )
        from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator

        inner, outer = LinearNDInterpolator(places, values), NearestNDInterpolator(places, values)

        def interpolate(x: np.ndarray, y: np.ndarray) -> np.ndarray:
            found = inner(x, y)
            return np.where(np.isnan(found), outer(x, y), found)

        return interpolate


def grid_lines(places: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Coordinates of the lines along x and y of a rectangular grid, each increasing; None for scattered points.

    places : float64[n, 2]  points, in any order
    """
    x, column = np.unique(places[:, 0], return_inverse=True)
    y, row = np.unique(places[:, 1], return_inverse=True)
    if min(x.size, y.size) < 2 or x.size * y.size != len(places):
        return None
    return (x, y) if np.unique(row * x.size + column).size == len(places) else None


def bilinear(
    lines_x: np.ndarray, lines_y: np.ndarray, values: np.ndarray, x: np.ndarray, y: np.ndarray
) -> np.ndarray:
    """Bilinear interpolation in a rectangular grid; points outside get the value at the nearest place of the grid.

    lines_x, lines_y : increasing coordinates of nx and ny lines; values : float64[ny, nx]; x, y : points
    """
    (i, a), (j, b) = (
        (at, (np.clip(q, lines[0], lines[-1]) - lines[at]) / (lines[at + 1] - lines[at]))
        for q, lines in ((x, lines_x), (y, lines_y))
        for at in [np.clip(np.searchsorted(lines, q, side="right") - 1, 0, lines.size - 2)]
    )
    below = values[j, i] * (1.0 - a) + values[j, i + 1] * a
    above = values[j + 1, i] * (1.0 - a) + values[j + 1, i + 1] * a
    return below * (1.0 - b) + above * b


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
    only the centre. The values of a raster, of groups and of nodes are means over the cells, at all points.
    """
    if shape is not None:
        if hasattr(shape.rule, "over"):  # of a raster, of groups or of nodes of the mesh
            mean = shape.rule.over(mesh)
            return np.broadcast_to(mean, (len(GAUSS) if is_grid(mesh) else 1, mean.size))
    x, y = np.ascontiguousarray(mesh.centre.T)
    if not is_grid(mesh):
        places = np.array([x]), np.array([y])
    else:
        wide = np.tile(np.diff(mesh.grid.x), mesh.grid.ny)
        high = np.repeat(np.diff(mesh.grid.y), mesh.grid.nx)
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

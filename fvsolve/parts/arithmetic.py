"""Formulas of x and y, parsed into a list of steps that act on arrays of floats."""

import ast
import re
from collections.abc import Callable, Iterator
from functools import reduce
from typing import NamedTuple

import numpy as np

from fvsolve.errors import did_you_mean, listing
from fvsolve.units import show

NAMES = ("x", "y", "pi")
CALL_FORMS = (  # allowed calls; "..." stands for any number of arguments
    "sin(a)", "cos(a)", "tan(a)", "arctan2(a, b)", "exp(a)", "log(a)", "sqrt(a)", "tanh(a)", "abs(a)",
    "min(a, b, ...)", "max(a, b, ...)", "hypot(a, b)", "where(condition, a, b)",
)  # fmt: skip
FUNCTIONS = {form[: form.index("(")]: form for form in CALL_FORMS}
OPERATORS = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
    ast.UAdd: np.positive, ast.USub: np.negative, ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater,
    ast.GtE: np.greater_equal, ast.Eq: np.equal, ast.NotEq: np.not_equal,
}  # fmt: skip
OPERATOR_HINT = "operators are + - * / ^ < <= > >= == !="
UNKNOWN_OPERATORS = {  # operators of other languages -> (sign, equivalent here)
    ast.MatMult: ("@", ""), ast.Mod: ("%", ""), ast.FloorDiv: ("//", ""), ast.LShift: ("<<", ""),
    ast.RShift: (">>", ""), ast.Invert: ("~", "where(a, 0, 1)"), ast.Not: ("not", "where(a, 0, 1)"),
    ast.BitAnd: ("&", "(a)*(b)"), ast.And: ("and", "(a)*(b)"), ast.BitOr: ("|", "max(a, b)"),
    ast.Or: ("or", "max(a, b)"), ast.IfExp: ("if", "where(condition, a, b)"),
}  # fmt: skip
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
    """Formula of x and y, called with arrays. Raises ValueError for an invalid text or a value that is not finite.

    All values are floats; comparisons give 1 or 0. Values that the function `where` does not select may be invalid.
    """

    def __init__(self, text: str, otherwise: str = "") -> None:
        """Parse a formula; otherwise : error message for a text that is not a formula at all."""
        self.text, self.source = text, text.replace("^", "**").strip()
        about = f"{show(text)} is not a formula of x and y"
        if len(text) > MAX_LENGTH:
            text = f'{about}: it has {len(text)} characters; expected at most {MAX_LENGTH}, or {{ file = "NAME.csv" }}'
            raise ValueError(text)
        try:
            tree = ast.parse(self.source, mode="eval").body
        except (MemoryError, RecursionError):
            raise ValueError(f"{about}: {TOO_DEEP}") from None
        except (SyntaxError, ValueError) as error:
            if any(sign in text for sign in "*+()"):  # not a quantity
                raise ValueError(f"{about}: {bracket_fault(text) or getattr(error, 'msg', error)}") from None
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
            if node.id not in NAMES:
                hint = f"; did you mean {FUNCTIONS[node.id]}?" if node.id in FUNCTIONS else ""
                hint = hint or did_you_mean(node.id, [*NAMES, *FUNCTIONS])
                raise ValueError(f"{node.id} is unknown{hint}; known are {listing([*NAMES, *FUNCTIONS], 20)}")
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
                yield Step(np.minimum, len(node.ops), part)
        elif isinstance(node, ast.Call):
            yield from self.call(node, part)
        else:
            operator_function(getattr(node, "op", node))

    def call(self, node: ast.Call, part: str) -> Iterator[Step]:
        """Yield the steps that compute a function call; part : its text in the formula"""
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if name not in FUNCTIONS:
            text = self.source_of(node.func)
            raise ValueError(f"{text} is unknown{did_you_mean(text, FUNCTIONS)}; known are {listing(FUNCTIONS, 20)}")
        form, given = FUNCTIONS[name], len(node.args)
        count, endless = form.count(",") + 1 - ("..." in form), "..." in form
        if node.keywords or given < count or (given > count and not endless):
            counted = f"{given} argument{'' if given == 1 else 's'}"
            raise ValueError(f"{name} has {counted}; expected {form}" if not node.keywords else f"expected {form}")
        for argument in node.args:
            yield from self.read(argument)
        yield Step({"min": np.minimum, "max": np.maximum}.get(name) or getattr(np, name), given, part)

    def source_of(self, node: ast.AST) -> str:
        """Source text of a node of the syntax tree."""
        text = ast.get_source_segment(self.source, node) or ""
        return text.replace("**", "^") if "^" in self.text else text

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Values of the formula at points x, y [m] : float64[n]. Raises ValueError at the first invalid value."""
        known, stack = {"x": np.asarray(x, float), "y": np.asarray(y, float), "pi": np.pi}, []
        with np.errstate(all="ignore"):
            for at, step in enumerate(self.steps):
                if step.count == 0:
                    stack.append((known.get(step.rule, step.rule), -1))
                    continue
                values, wrongs = zip(*stack[-step.count :], strict=True)
                stack[-step.count :] = [apply_step(at, step.rule, values, wrongs)]
        result, wrong = (np.broadcast_to(array, known["x"].shape) for array in stack[0])
        if (wrong >= 0).any():
            k = int(np.argmax(wrong >= 0))
            at, reason = divmod(int(wrong[k]), len(ERRORS))
            part = self.steps[at].part
            where = f"{ERRORS[reason]} at x = {x[k]:.6g} m, y = {y[k]:.6g} m"
            raise ValueError(
                f"{show(self.text)} {where}" if part == self.text else f"{show(self.text)}: {part} {where}"
            )
        return np.array(result, dtype=float)


def apply_step(at: int, rule: Callable, values: tuple, wrongs: tuple) -> tuple[np.ndarray, np.ndarray]:
    """(values, error codes) of a function of arrays : float64[n], int64[n].

    at : index of the step; rule : function; values : its arguments; wrongs : error codes of the arguments
    An error code is -1 for a valid value, otherwise len(ERRORS) * index of the step + index in `ERRORS`.
    """
    if rule is np.where:
        condition, a, b = wrongs
        chosen = np.where(np.not_equal(values[0], 0.0), a, b)
        return np.where(np.not_equal(values[0], 0.0), *values[1:]), np.where(condition >= 0, condition, chosen)
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
        raise ValueError(f"expected numbers, {listing([*NAMES, *FUNCTIONS], 20)} and arithmetic; {OPERATOR_HINT}")
    raise ValueError(f"unknown operator {sign}; " + (f"did you mean {instead}?" if instead else OPERATOR_HINT))


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

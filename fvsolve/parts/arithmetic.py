"""What a formula of x and y may say, read once into steps on arrays of floats. Knows no mesh and no units."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from functools import reduce
from typing import NamedTuple

import numpy as np

from fvsolve.errors import did_you_mean, listing
from fvsolve.units import show

NAMES = ("x", "y", "pi")
FORMS = (  # of calls; what is open at its end takes any number of arguments
    "sin(a)", "cos(a)", "tan(a)", "arctan2(a, b)", "exp(a)", "log(a)", "sqrt(a)", "tanh(a)", "abs(a)",
    "min(a, b, ...)", "max(a, b, ...)", "hypot(a, b)", "where(condition, a, b)",
)  # fmt: skip
FUNCTIONS = {form[: form.index("(")]: form for form in FORMS}
OPERATORS = {
    ast.Add: np.add, ast.Sub: np.subtract, ast.Mult: np.multiply, ast.Div: np.divide, ast.Pow: np.power,
    ast.UAdd: np.positive, ast.USub: np.negative, ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater,
    ast.GtE: np.greater_equal, ast.Eq: np.equal, ast.NotEq: np.not_equal,
}  # fmt: skip
WANTED = "operators are + - * / ^ < <= > >= == !="
REFUSED = {  # operators of other languages: how they are written, and what says the same
    ast.MatMult: ("@", ""), ast.Mod: ("%", ""), ast.FloorDiv: ("//", ""), ast.LShift: ("<<", ""),
    ast.RShift: (">>", ""), ast.Invert: ("~", "where(a, 0, 1)"), ast.Not: ("not", "where(a, 0, 1)"),
    ast.BitAnd: ("&", "(a)*(b)"), ast.And: ("and", "(a)*(b)"), ast.BitOr: ("|", "max(a, b)"),
    ast.Or: ("or", "max(a, b)"), ast.IfExp: ("if", "where(condition, a, b)"),
}  # fmt: skip
NUMBER = re.compile(r"(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
LONGEST = 4000  # characters
NESTED = "it has too many brackets or powers in one another"
WRONG = ("divides by zero", "is the logarithm of zero", "is no number", "overflows")


class Step(NamedTuple):
    """A name or number (count 0), or what is done with so many of the values before it, and what the text has there."""

    rule: Callable | str | float
    count: int
    part: str


class Arithmetic:
    """Values of a text at points; ValueError, when it is read or taken, says what is wrong with it.

    Everything is a float, what is compared 1 or 0. What a `where` does not choose may be anything.
    """

    def __init__(self, text: str, otherwise: str = "") -> None:
        """otherwise : what is said of a text that is no arithmetic at all."""
        self.text, self.source = text, text.replace("^", "**").strip()
        about = f"{show(text)} is no formula of x and y"
        if len(text) > LONGEST:
            raise ValueError(
                f'{about}: it has {len(text)} characters; wanted {LONGEST} at most, or {{ file = "NAME.csv" }}'
            )
        try:
            tree = ast.parse(self.source, mode="eval").body
        except (MemoryError, RecursionError):
            raise ValueError(f"{about}: {NESTED}") from None
        except (SyntaxError, ValueError) as error:
            if any(sign in text for sign in "*+()"):  # no quantity
                raise ValueError(f"{about}: {open_bracket(text) or getattr(error, 'msg', error)}") from None
            raise ValueError(otherwise or about) from None
        try:
            self.steps = list(self.read(tree))
        except RecursionError:
            raise ValueError(f"{about}: {NESTED}") from None
        except ValueError as error:
            raise ValueError(f"{about}: {error}") from None

    def read(self, node: ast.expr) -> Iterator[Step]:
        """The steps of a branch of the text, last what it comes to."""
        part = self.written(node)
        if isinstance(node, ast.Constant):
            yield Step(number(part), 0, part)
        elif isinstance(node, ast.Name):
            if node.id not in NAMES:
                hint = f"; did you mean {FUNCTIONS[node.id]}?" if node.id in FUNCTIONS else ""
                hint = hint or did_you_mean(node.id, [*NAMES, *FUNCTIONS])
                raise ValueError(f"{node.id} is unknown{hint}; known are {listing([*NAMES, *FUNCTIONS], 20)}")
            yield Step(node.id, 0, part)
        elif isinstance(node, ast.UnaryOp):
            yield from self.read(node.operand)
            yield Step(operator(node.op), 1, part)
        elif isinstance(node, ast.BinOp):
            chain = []  # x + y + z is (x + y) + z: as long as a text may be, and no deeper for that
            while isinstance(node, ast.BinOp):
                chain.append(node)
                node = node.left
            yield from self.read(node)
            for one in reversed(chain):
                yield from self.read(one.right)
                yield Step(operator(one.op), 2, self.written(one))
        elif isinstance(node, ast.Compare):  # 0 < x < 1 where both hold
            sides = [node.left, *node.comparators]
            for one, sign, other in zip(sides, node.ops, sides[1:], strict=False):
                yield from self.read(one)
                yield from self.read(other)
                yield Step(operator(sign), 2, part)
            if len(node.ops) > 1:
                yield Step(np.minimum, len(node.ops), part)
        elif isinstance(node, ast.Call):
            yield from self.call(node, part)
        else:
            operator(getattr(node, "op", node))

    def call(self, node: ast.Call, part: str) -> Iterator[Step]:
        """The steps of a call."""
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if name not in FUNCTIONS:
            said = self.written(node.func)
            raise ValueError(f"{said} is unknown{did_you_mean(said, FUNCTIONS)}; known are {listing(FUNCTIONS, 20)}")
        form, given = FUNCTIONS[name], len(node.args)
        wanted, endless = form.count(",") + 1 - ("..." in form), "..." in form
        if node.keywords or given < wanted or (given > wanted and not endless):
            counted = f"{given} argument{'' if given == 1 else 's'}"
            raise ValueError(f"{name} has {counted}; wanted {form}" if not node.keywords else f"wanted {form}")
        for one in node.args:
            yield from self.read(one)
        yield Step({"min": np.minimum, "max": np.maximum}.get(name) or getattr(np, name), given, part)

    def written(self, node: ast.AST) -> str:
        """How the text has a branch."""
        said = ast.get_source_segment(self.source, node) or ""
        return said.replace("**", "^") if "^" in self.text else said

    def __call__(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Values at points : float64[n]; ValueError names the first part that has none, and where."""
        known, stack = {"x": np.asarray(x, float), "y": np.asarray(y, float), "pi": np.pi}, []
        with np.errstate(all="ignore"):
            for at, step in enumerate(self.steps):
                if step.count == 0:
                    stack.append((known.get(step.rule, step.rule), -1))
                    continue
                values, wrongs = zip(*stack[-step.count :], strict=True)
                stack[-step.count :] = [applied(at, step.rule, values, wrongs)]
        found, wrong = (np.broadcast_to(one, known["x"].shape) for one in stack[0])
        if (wrong >= 0).any():
            k = int(np.argmax(wrong >= 0))
            at, why = divmod(int(wrong[k]), len(WRONG))
            part = self.steps[at].part
            where = f"{WRONG[why]} at x = {x[k]:.6g} m, y = {y[k]:.6g} m"
            raise ValueError(
                f"{show(self.text)} {where}" if part == self.text else f"{show(self.text)}: {part} {where}"
            )
        return np.array(found, dtype=float)


def applied(at: int, rule: Callable, values: tuple, wrongs: tuple) -> tuple[np.ndarray, np.ndarray]:
    """What a rule makes of values, and what is wrong with it: -1 for nothing, else step and reason in one number."""
    if rule is np.where:
        condition, a, b = wrongs
        chosen = np.where(np.not_equal(values[0], 0.0), a, b)
        return np.where(np.not_equal(values[0], 0.0), *values[1:]), np.where(condition >= 0, condition, chosen)
    found = np.asarray(reduce(rule, values) if len(values) > 2 else rule(*values), dtype=float)
    why = np.where(np.isnan(found), 2, 3)
    for kind, zero, which in ((0, np.divide, 1), (0, np.power, 0), (1, np.log, 0)):
        why = np.where(np.equal(values[which], 0.0), kind, why) if rule is zero else why
    own = np.where(np.isfinite(found), -1, len(WRONG) * at + why)
    return found, reduce(lambda first, then: np.where(first >= 0, first, then), [*wrongs, own])


def operator(node: ast.AST) -> Callable:
    """What an operator does; ValueError for one that formulas have not."""
    if type(node) in OPERATORS:
        return OPERATORS[type(node)]
    sign, instead = REFUSED.get(type(node), ("", ""))
    if not sign:
        raise ValueError(f"wanted numbers, {listing([*NAMES, *FUNCTIONS], 20)} and arithmetic; {WANTED}")
    raise ValueError(f"there is no {sign}; " + (f"did you mean {instead}?" if instead else WANTED))


def number(said: str) -> float:
    """A decimal number; ValueError for any other form, and for one that no float holds."""
    if NUMBER.fullmatch(said) is None:
        raise ValueError(f"{said} is no decimal number; wanted for example 16, 0.5 or 1e-3")
    if not np.isfinite(float(said)):
        raise ValueError(f"{said if len(said) < 30 else 'a number'} is too large")
    return float(said)


def open_bracket(text: str) -> str:
    """What is wrong with the brackets of a text, "" where nothing is."""
    depth = 0
    for sign in text:
        depth += (sign == "(") - (sign == ")")
        if depth < 0:
            return "a bracket is closed that was not opened"
    return "a bracket is left open" if depth else ""

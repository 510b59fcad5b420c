"""Formulas of x and y: values as in mathematics, and faults that name every unsupported form."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.refusals import refused
from reference.scenes import scene

from fvsolve.parts.formula import SpatialFieldKey
from fvsolve.parts.value import ReadContext

X, Y = np.array([0.0, 1.0, 3.5]), np.array([2.0, 1.0, -0.5])


def values(text: str) -> np.ndarray:
    return SpatialFieldKey("length").read(text, ReadContext()).at(X, Y)


def of_points(rule) -> list[float]:
    return [rule(x, y) for x, y in zip(X.tolist(), Y.tolist(), strict=True)]


RIGHT = {
    "max(0, 0.1*x, 0.4*y)": lambda x, y: max(0.0, 0.1 * x, 0.4 * y),
    "min(x, y, 0.3, 2*y)": lambda x, y: min(x, y, 0.3, 2.0 * y),
    "max(x, y)": max,
    "hypot(x, hypot(y, 2))": lambda x, y: math.sqrt(x * x + y * y + 4.0),
    "arctan2(y, x)": lambda x, y: math.atan2(y, x),
    "-x^2 + 2**-1 - .5e1*(+y)": lambda x, y: -(x**2) + 0.5 - 5.0 * y,
    "2^x^2": lambda x, y: 2.0 ** (x**2),
    "where(0 < x < 2, sin(x), cos(x)/2.)": lambda x, y: (
        math.sin(x) if 0 < x < 2 else math.cos(x) / 2
    ),
    "(x >= 1)*(y != 1) + (x == y)": lambda x, y: float(x >= 1 and y != 1) + float(x == y),
    "where(x > 0, log(x), -1) + where(y < 0, 0, sqrt(y))": lambda x, y: (
        (math.log(x) if x > 0 else -1.0) + (0.0 if y < 0 else math.sqrt(y))
    ),
    "abs(y) + tan(x) + exp(-x) + tanh(y) + pi": lambda x, y: (
        abs(y) + math.tan(x) + math.exp(-x) + math.tanh(y) + math.pi
    ),
}


@pytest.mark.parametrize("text", RIGHT)
def test_a_formula_has_its_mathematical_value(text):
    assert values(text) == approx(of_points(RIGHT[text]), rel=1e-14, abs=1e-15)


REFUSED = {
    "max(x)": r"max has 1 argument; expected max\(a, b, ...\)",
    "min()": r"min has 0 arguments; expected min\(a, b, ...\)",
    "max(x, out=y)": r"expected max\(a, b, ...\)",
    "hypot(x, y, y)": r"hypot has 3 arguments; expected hypot\(a, b\)",
    "sin(x, x)": r"sin has 2 arguments; expected sin\(a\)",
    "abs(x, y)": r"abs has 2 arguments; expected abs\(a\)",
    "where(x < 1, 2)": r"where has 2 arguments; expected where\(condition, a, b\)",
    "arctan2(y)": r"arctan2 has 1 argument; expected arctan2\(a, b\)",
    "sine(x)": 'sine is unknown; did you mean "sin"',
    "2*sin": r"did you mean sin\(a\)",
    "x@y": "unknown operator @; operators are",
    "~x": "unknown operator ~",
    "x << 2": "unknown operator <<",
    "1<<99999999999": "unknown operator <<",
    "x % 2": "unknown operator %",
    "(x > 1) & (y > 1)": r"unknown operator &; did you mean \(a\)\*\(b\)",
    "x > 1 and y > 1": r"unknown operator and; did you mean \(a\)\*\(b\)",
    "1 if x > 1 else 0": r"unknown operator if; did you mean where\(condition, a, b\)",
    "0x10*x": "0x10 is not a decimal number",
    "0b11 + x": "0b11 is not a decimal number",
    "1_0*x": "1_0 is not a decimal number",
    "1j*x": "1j is not a decimal number",
    "True*x": "True is not a decimal number",
    "1e999*x": "1e999 is too large",
    "x.real*2": "expected numbers",
    "[x][0]*2": "expected numbers",
    "(lambda: x)()": "is unknown; known are",
    "+".join(
        ["x"] * 100_000
    ): "is not a formula of x and y: it has 199999 characters; expected at most 4000",
    "+".join(["0.1*x"] * 3000): "it has 17999 characters; expected at most 4000",
    "(" * 500 + "x" + ")" * 500: "is not a formula",
    "x**" * 1300 + "1": "brackets or powers are nested too deep",
}


@pytest.mark.parametrize("text", REFUSED, ids=range(len(REFUSED)))
def test_unknown_functions_of_formulas_are_refused_with_the_nearest_form(text):
    with pytest.raises(ValueError, match=REFUSED[text]):
        values(text)


@pytest.mark.parametrize("text, rule", [
    ("+".join(["x"] * 1200), lambda x: 1200.0 * x), ("-".join(["x"] * 1200), lambda x: -1198.0 * x),
    ("1" + "*x/x" * 600, lambda x: np.ones_like(x)),
], ids=["sum", "difference", "product"])  # fmt: skip
def test_a_long_formula_is_read(text, rule):
    """A formula of 1200 terms is read, more than the 1000 calls within calls that Python allows."""
    x = np.array([1.0, 2.0, 0.5])
    assert SpatialFieldKey("length").read(text, ReadContext()).at(x, x) == approx(
        rule(x), rel=1e-13
    )


NOWHERE = {
    "9^9^9": '"9\\^9\\^9" overflows at x = 0 m, y = 2 m',
    "2**(2**40)": "overflows",
    "1/(x - 1)": r'"1/\(x - 1\)" divides by zero at x = 1 m, y = 1 m',
    "3 + (x - 1)^-2": r": \(x - 1\)\^-2 divides by zero at x = 1 m",
    "tanh(exp(300*x))": r": exp\(300\*x\) overflows at x = 3.5 m, y = -0.5 m",
    "min(1/x, 5)": ": 1/x divides by zero at x = 0 m",
    "0/x": "divides by zero",
    "log(x)": "is the logarithm of zero at x = 0 m",
    "1 + sqrt(y)": r": sqrt\(y\) is not a number at x = 3.5 m",
    "y^0.5": "is not a number at x = 3.5 m, y = -0.5 m",
    "where(x < 2, 1/y, log(y))": r": log\(y\) is not a number at x = 3.5 m",
}


@pytest.mark.parametrize("text", NOWHERE)
def test_overflow_division_by_zero_and_no_number_are_named_with_part_and_place(text):
    with pytest.raises(ValueError, match=NOWHERE[text]):
        values(text)


# every key that takes formulas, with a fault only at the points of this key: cells, corners or face middles
WAYS = {
    "bed": {"bed": "1/(x - 0.125)"},
    "start.level": {"start": {"level": "max(1, 2, 1/(x - 0.125))"}},
    "start.u": {"start": {"u": "1/(x - 0.125)"}},
    "scalars.dye": {"scalars": {"dye": "1/(x - 0.125)"}},
    "velocity": {"velocity": {"u": "1/(x - 0.25)"}},
    "velocity.stream": {"velocity": {"stream": "log(x)"}},
}


@pytest.mark.parametrize("way", WAYS)
def test_a_fault_of_any_formula_is_a_fault_of_the_case(way):
    given = {"physics": "transport"} if "velocity" in WAYS[way] else {"level": 1.0}
    pool = {"type": "basin", "size": [1.0, 1.0], "cells": [4, 4], **given, **WAYS[way]}
    case = scene({"pool": pool}, {}, 1.0, {"method": "ssp-rk2", "courant": 0.5}, [], 0.1) | {
        "scalars": {"dye": {}}
    }
    assert len(refused(case, f"nodes.pool.{way}.*zero at x = 0").faults) == 1

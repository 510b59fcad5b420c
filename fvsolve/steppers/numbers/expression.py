"""An exact number from text: `-1/2+sqrt(3)/6`, `(88-7sqrt(6))/360`, `0.161`, `2g-1`. Knows no method."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction

from fvsolve.steppers.numbers.algebraic import Field, square_root
from fvsolve.steppers.numbers.polynomial import Polynomial

TOKEN = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3}(?!\d))?|[A-Za-z_]\w*|[-+*/^()]")
POWER_MOST, ROOT_MOST = 64, 10**9


def value_of(text: str, names: Mapping | None = None):
    """The number that `text` says; ValueError that says what is wrong with it.

    + - * / ^, brackets, `sqrt(n)` of a whole number, `names`; `7sqrt(6)` and `3(g-1)` are products.
    """
    tokens = TOKEN.findall(text)
    if "".join(tokens) != re.sub(r"\s", "", text):
        raise ValueError(f'"{text}" is not a number')
    reader = _Parser(text, tokens, names or {})
    found = reader.sum()
    if reader.rest:
        raise ValueError(f'"{text}": "{reader.rest[-1]}" does not fit')
    return found


def root(name: str, polynomial: str, near: float):
    """The root next to `near` of a polynomial in x, as the number called `name`."""
    p = value_of(polynomial, {"x": Polynomial([0, 1])})
    if not isinstance(p, Polynomial) or p.degree < 2 or not all(isinstance(x, Fraction) for x in p.coefficients):
        raise ValueError(f'"{polynomial}" is no polynomial in x of degree 2 or more with fractions')
    return Field(name, p, near).theta


def digits(text: str) -> int:
    """Significant digits of the longest decimal in `text`; 0 where there is none."""
    found = re.findall(r"\d*\.\d*", text)
    return max((len(one.replace(".", "").lstrip("0")) for one in found), default=0)


class _Parser:
    """Recursive descent: sum, product, power, atom."""

    def __init__(self, text: str, tokens: list[str], names: Mapping):
        self.text, self.rest, self.names = text, tokens[::-1], names

    def next(self, *wanted: str) -> str | None:
        return self.rest.pop() if self.rest and self.rest[-1] in wanted else None

    def sum(self):
        minus = self.next("-", "+") == "-"
        total = -self.product() if minus else self.product()
        while operator := self.next("+", "-"):
            one = self.product()
            total = total + one if operator == "+" else total - one
        return total

    def product(self):
        total = self.power()
        while self.rest and (self.rest[-1] in ("*", "/", "(") or self.rest[-1].isidentifier()):
            operator = self.next("*", "/")
            one = self.power()
            try:
                total = total / one if operator == "/" else total * one
            except ZeroDivisionError:
                raise ValueError(f'"{self.text}" divides by zero') from None
        return total

    def power(self):
        base = self.atom()
        if not self.next("^"):
            return base
        power = self.rest.pop() if self.rest else ""
        if not power.isdigit() or int(power) > POWER_MOST:
            raise ValueError(f'"{self.text}": wanted a whole power from 0 to {POWER_MOST} after "^"')
        return base ** int(power)

    def atom(self):
        token = self.rest.pop() if self.rest else ""
        if token == "(":
            inside = self.sum()
            if not self.next(")"):
                raise ValueError(f'"{self.text}" lacks a ")"')
            return inside
        if token == "sqrt":
            n = self.atom() if self.rest and self.rest[-1] == "(" else None
            if not isinstance(n, Fraction) or n.denominator != 1 or not 0 <= n <= ROOT_MOST:
                raise ValueError(f'"{self.text}": wanted sqrt(n) of a whole number n up to {ROOT_MOST:.0e}')
            return square_root(int(n))
        if token and (token[0].isdigit() or token[0] == "."):
            return Fraction(token)
        if token in self.names:
            return self.names[token]
        known = ", ".join(["sqrt(n)", *self.names])
        fault = f'unknown symbol "{token}"; known are {known}' if token.isidentifier() else f'"{token}" does not fit'
        raise ValueError(f'"{self.text}": {fault}' if token else f'"{self.text}" ends too early')

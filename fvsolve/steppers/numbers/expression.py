"""Exact numbers from text: `-1/2+sqrt(3)/6`, `(88-7sqrt(6))/360`, `0.161`, `2g-1`."""

from __future__ import annotations

import re
from collections.abc import Mapping
from fractions import Fraction

from fvsolve.steppers.numbers.algebraic import Field, square_root
from fvsolve.steppers.numbers.polynomial import Polynomial

TOKEN = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3}(?!\d))?|[A-Za-z_]\w*|[-+*/^()]")
POWER_MOST, ROOT_MOST = 64, 10**9


def value_of(text: str, names: Mapping | None = None):
    """Evaluate the expression `text` exactly; raises ValueError with a message that states the fault.

    Syntax: + - * / ^, brackets, `sqrt(n)` of an integer, the names in the dict `names`; `7sqrt(6)` and `3(g-1)` are
    products.
    """
    tokens = TOKEN.findall(text)
    if "".join(tokens) != re.sub(r"\s", "", text):
        raise ValueError(f'"{text}" is not a number')
    reader = _Parser(text, tokens, names or {})
    result = reader.sum()
    if reader.rest:
        raise ValueError(f'"{text}": unexpected "{reader.rest[-1]}"')
    return result


def root(name: str, polynomial: str, near: float):
    """Root nearest to `near` of a polynomial in x, as an exact number that is printed as `name`.

    polynomial : text such as "x^3-3x^2+3x/2-1/6", of degree 2 or more
    Raises ValueError for another text, and if no single root is near `near`.
    """
    p = value_of(polynomial, {"x": Polynomial([0, 1])})
    if not isinstance(p, Polynomial) or p.degree < 2 or not all(isinstance(x, Fraction) for x in p.coefficients):
        raise ValueError(f'"{polynomial}" is not a polynomial in x of degree 2 or more with rational coefficients')
    return Field(name, p, near).theta


def digits(text: str) -> int:
    """Greatest number of significant digits of the decimals in `text`; 0 without decimals."""
    decimals = re.findall(r"\d*\.\d*", text)
    return max((len(decimal.replace(".", "").lstrip("0")) for decimal in decimals), default=0)


class _Parser:
    """Recursive-descent parser of sums, products, powers, and numbers, names or brackets."""

    def __init__(self, text: str, tokens: list[str], names: Mapping):
        self.text, self.rest, self.names = text, tokens[::-1], names

    def next(self, *expected: str) -> str | None:
        return self.rest.pop() if self.rest and self.rest[-1] in expected else None

    def sum(self):
        minus = self.next("-", "+") == "-"
        total = -self.product() if minus else self.product()
        while operator := self.next("+", "-"):
            term = self.product()
            total = total + term if operator == "+" else total - term
        return total

    def product(self):
        total = self.power()
        while self.rest and (self.rest[-1] in ("*", "/", "(") or self.rest[-1].isidentifier()):
            operator = self.next("*", "/")
            factor = self.power()
            try:
                total = total / factor if operator == "/" else total * factor
            except ZeroDivisionError:
                raise ValueError(f'"{self.text}" divides by zero') from None
        return total

    def power(self):
        base = self.atom()
        if not self.next("^"):
            return base
        power = self.rest.pop() if self.rest else ""
        if not power.isdigit() or int(power) > POWER_MOST:
            raise ValueError(f'"{self.text}": expected an integer power from 0 to {POWER_MOST} after "^"')
        return base ** int(power)

    def atom(self):
        token = self.rest.pop() if self.rest else ""
        if token == "(":
            inside = self.sum()
            if not self.next(")"):
                raise ValueError(f'"{self.text}": a closing ")" is missing')
            return inside
        if token == "sqrt":
            n = self.atom() if self.rest and self.rest[-1] == "(" else None
            if not isinstance(n, Fraction) or n.denominator != 1 or not 0 <= n <= ROOT_MOST:
                raise ValueError(f'"{self.text}": expected sqrt(n) of an integer n up to {ROOT_MOST:.0e}')
            return square_root(int(n))
        if token and (token[0].isdigit() or token[0] == "."):
            return Fraction(token)
        if token in self.names:
            return self.names[token]
        known = ", ".join(["sqrt(n)", *self.names])
        fault = f'unknown symbol "{token}"; known are {known}' if token.isidentifier() else f'unexpected "{token}"'
        raise ValueError(f'"{self.text}": {fault}' if token else f'"{self.text}" ends too early')

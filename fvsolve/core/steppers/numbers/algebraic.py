"""Exact numbers a + b theta + c theta^2 + ..., theta a real algebraic number, and their text, as `-1/2+sqrt(3)/6`."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from fractions import Fraction
from math import isqrt

from fvsolve.core.steppers.numbers.polynomial import Polynomial, count_roots, sign

MIXED_ROOTS = (
    "{} are used in one tableau; expected a single root, or decimals of "
    "20 digits or more in place of all roots"
)
BITS = 160  # precision of the first bracket of a square root: enough for most signs and every float


class Field:
    """Field of the rational numbers and a root theta of a polynomial.

    name : name of theta in texts; near : value near theta. Multiple roots of the polynomial are made single.
    Raises ValueError if no single root is near it.
    """

    def __init__(self, name: str, polynomial: Polynomial, near: float):
        self.name = name
        self.polynomial = (polynomial // polynomial.gcd(polynomial.derivative())).monic()
        self.low, self.high = _isolated(self.polynomial, Fraction(near), name)
        # theta^n in terms of lower powers
        self.tail = tuple(-x for x in self.polynomial.coefficients[:-1])

    @property
    def theta(self) -> Algebraic:
        return Algebraic(self, [Fraction(0), Fraction(1)])

    def refine(self, bits: int) -> None:
        """Refine the bounds of theta by bisection until they differ by 2^-bits at most."""
        low = self.low
        high = self.high
        p = self.polynomial
        rising = p(low) < 0
        while high - low > Fraction(1, 1 << bits):
            middle = (low + high) / 2
            if (p(middle) < 0) == rising:
                low = middle
            else:
                high = middle
        self.low, self.high = low, high


class SquareRoot(Field):
    """Field of the rational numbers and the square root of the integer d."""

    def __init__(self, d: int):
        self.name = f"sqrt({d})"
        self.d = d
        self.polynomial = Polynomial([-d, 0, 1])
        self.tail = (Fraction(d), Fraction(0))
        self.refine(BITS)

    def refine(self, bits: int) -> None:
        # The integer square root is exact, so that no bisection is needed.
        root = isqrt(self.d << (2 * bits))
        self.low, self.high = Fraction(root, 1 << bits), Fraction(root + 1, 1 << bits)


class Algebraic:
    """Element of a `Field`, given by the coefficients of powers of its root theta.

    Operations return a fraction if only the coefficient of theta^0 remains, and raise ValueError for different fields.
    """

    __slots__ = ("field", "parts")

    def __init__(self, field: Field, parts):
        self.field, self.parts = field, tuple(parts)

    def _other(self, other) -> tuple | None:
        if isinstance(other, Algebraic):
            if other.field is not self.field:
                raise ValueError(MIXED_ROOTS.format(f"{self.field.name} and {other.field.name}"))
            return other.parts
        return (Fraction(other),) if isinstance(other, (int, Fraction)) else None

    def __add__(self, other):
        parts = self._other(other)
        if parts is None:
            return NotImplemented
        long, short = (self.parts, parts) if len(self.parts) >= len(parts) else (parts, self.parts)
        return number(
            self.field,
            [x + y for x, y in zip(long, short, strict=False)] + list(long[len(short) :]),
        )

    __radd__ = __add__

    def __neg__(self):
        return Algebraic(self.field, [-x for x in self.parts])

    def __sub__(self, other):
        return self + -other

    def __rsub__(self, other):
        return -self + other

    def __mul__(self, other):
        parts = self._other(other)
        if parts is None:
            return NotImplemented
        if len(parts) == 1:
            return number(self.field, [x * parts[0] for x in self.parts])
        product = [Fraction(0)] * (len(self.parts) + len(parts) - 1)
        for i, x in enumerate(self.parts):
            for j, y in enumerate(parts):
                if x and y:
                    product[i + j] += x * y
        tail = self.field.tail
        # Powers of theta from its degree on are replaced by lower ones, which keeps the form unique.
        while len(product) > len(tail):
            top = product.pop()
            if top:
                for j, y in enumerate(tail, start=len(product) - len(tail)):
                    product[j] += top * y
        return number(self.field, product)

    __rmul__ = __mul__

    def __truediv__(self, other):
        if isinstance(other, Algebraic):
            return self * other.inverse()
        return (
            NotImplemented if not isinstance(other, (int, Fraction)) else self * Fraction(1, other)
        )

    def __rtruediv__(self, other):
        return self.inverse() * other

    def __pow__(self, power: int):
        result = Fraction(1)
        for _ in range(power):
            result = result * self
        return result

    def inverse(self):
        """Inverse of the number, by the extended Euclidean algorithm; raises ZeroDivisionError for zero."""
        if self.sign() == 0:
            raise ZeroDivisionError("division by zero")
        modulus, polynomial = self.field.polynomial, Polynomial(self.parts)
        modulus = modulus // modulus.gcd(polynomial)  # drop the factors that do not vanish at theta
        # Invariant: r1 is s1 times the number, modulo the polynomial of theta.
        r0 = modulus
        r1 = polynomial % modulus
        s0 = Polynomial([])
        s1 = Polynomial([1])
        while r1.degree > 0:
            quotient, rest = divmod(r0, r1)
            r0, r1, s0, s1 = r1, rest, s1, s0 - quotient * s1
        return number(self.field, (s1 / r1.coefficients[0]).coefficients)

    def bracket(self) -> tuple[Fraction, Fraction]:
        """(lower, upper) bound of the number, by interval arithmetic with the bounds of theta."""
        low = high = Fraction(0)
        for value in reversed(self.parts):
            # The signs are not known, so that any of the four products may be the least or the greatest.
            ends = [
                low * self.field.low,
                low * self.field.high,
                high * self.field.low,
                high * self.field.high,
            ]
            low, high = min(ends) + value, max(ends) + value
        return low, high

    def sign(self) -> int:
        """Exact sign of the number: -1, 0 or 1."""
        low, high = self.bracket()
        # Zero is decided exactly first, because no refinement would ever exclude it.
        if low <= 0 <= high and self._vanishes():
            return 0
        bits = BITS
        while low <= 0 <= high:
            bits *= 2
            self.field.refine(bits)
            low, high = self.bracket()
        return 1 if low > 0 else -1

    def _vanishes(self) -> bool:
        common = self.field.polynomial.gcd(Polynomial(self.parts))
        # The number is zero if theta is a root of the common factor, which then changes sign there.
        return common.degree > 0 and common(self.field.low) * common(self.field.high) <= 0

    def __eq__(self, other) -> bool:
        difference = self - other if self._other(other) is not None else None
        return difference is not None and sign(difference) == 0

    def __lt__(self, other) -> bool:
        return sign(self - other) < 0

    def __le__(self, other) -> bool:
        return sign(self - other) <= 0

    def __gt__(self, other) -> bool:
        return sign(self - other) > 0

    def __ge__(self, other) -> bool:
        return sign(self - other) >= 0

    def __abs__(self):
        return -self if self.sign() < 0 else self

    def __hash__(self) -> int:
        return hash((id(self.field), self.parts))

    def __float__(self) -> float:
        """Float nearest to the number."""
        low, high = self.bracket()
        bits = BITS
        # Both bounds must round to the same float.
        while float(low) != float(high):
            bits *= 2
            self.field.refine(bits)
            low, high = self.bracket()
        return float(low)

    def __str__(self) -> str:
        terms = []
        for power, value in enumerate(self.parts):
            symbol = "" if power == 0 else self.field.name + (f"^{power}" if power > 1 else "")
            if value:
                terms.append(_term(abs(value), symbol, "-" if value < 0 else "+" if terms else ""))
        return "".join(terms)

    __repr__ = __str__


def number(field: Field, parts):
    """Element of a field, sum of parts[k] theta^k; a fraction if all parts but the first are 0."""
    parts = list(parts)
    while len(parts) > 1 and not parts[-1]:
        parts.pop()
    return Algebraic(field, parts) if len(parts) > 1 else parts[0] if parts else Fraction(0)


@functools.cache
def square_root(n: int):
    """sqrt(n) of an integer n >= 0, as an integer times the root of a square-free integer."""
    outside = 1
    inside = n
    k = 2
    # Square factors leave the root, so that equal numbers have equal forms.
    while k * k <= inside:
        while inside % (k * k) == 0:
            outside, inside = outside * k, inside // (k * k)
        k += 1
    if inside <= 1:
        return Fraction(outside * inside)
    return number(_root_field(inside), [Fraction(0), Fraction(outside)])


@functools.cache
def _root_field(d: int) -> SquareRoot:
    return SquareRoot(d)


def _term(value: Fraction, symbol: str, sign: str) -> str:
    if not symbol:
        return f"{sign}{value}"
    front = "" if value.numerator == 1 else f"{value.numerator}*"
    back = "" if value.denominator == 1 else f"/{value.denominator}"
    return f"{sign}{front}{symbol}{back}"


def _isolated(p: Polynomial, near: Fraction, name: str) -> tuple[Fraction, Fraction]:
    """Interval around `near` that contains exactly one root of the polynomial p, where p changes its sign.

    Raises ValueError if no such interval is found; name : name of the root in the message
    """
    # From narrow to wide intervals, so that the nearest root is found.
    width = Fraction(1, 1 << 40)
    while width <= 1 << 20:
        low, high = near - width, near + width
        if p(low) * p(high) < 0 and count_roots(p, low, high) == 1:
            return low, high
        width *= 2
    raise ValueError(
        f"the polynomial of {name} has no single root near {float(near):.12g}; expected a value closer to a real root"
    )


TOKEN = re.compile(r"(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3}(?!\d))?|[A-Za-z_]\w*|[-+*/^()]")
POWER_MOST, ROOT_MOST = 64, 10**9
LETTERS_MOST, NESTED_MOST = 1000, 20  # greatest length of an expression, and depth of its brackets
# greatest size of a value, and degree of a polynomial, in an expression
BITS_MOST, DEGREE_MOST = 20_000, 64


def value_of(text: str, names: Mapping | None = None):
    """Evaluate the expression `text` exactly; raises ValueError with a message that states the fault.

    Syntax: + - * / ^, brackets, `sqrt(n)` of an integer, the names in the dict `names`; `7sqrt(6)` and `3(g-1)` are
    products.
    """
    if len(text) > LETTERS_MOST:
        raise ValueError(
            f'"{text[:20]}..." has {len(text)} characters; expected at most {LETTERS_MOST}'
        )
    tokens = TOKEN.findall(text)
    # The search for tokens skips other characters, so they are missing in the joined text.
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
    if (
        not isinstance(p, Polynomial)
        or p.degree < 2
        or not all(isinstance(x, Fraction) for x in p.coefficients)
    ):
        raise ValueError(
            f'"{polynomial}" is not a polynomial in x of degree 2 or more with rational coefficients'
        )
    return Field(name, p, near).theta


def digits(text: str) -> int:
    """Greatest number of significant digits of the decimals in `text`; 0 without decimals."""
    decimals = re.findall(r"\d*\.\d*", text)
    return max((len(decimal.replace(".", "").lstrip("0")) for decimal in decimals), default=0)


class _Parser:
    """Recursive-descent parser of sums, products, powers, and numbers, names or brackets."""

    def __init__(self, text: str, tokens: list[str], names: Mapping):
        self.text, self.rest, self.names, self.depth = text, tokens[::-1], names, 0

    def checked(self, value):
        """The value, if it is small enough for exact arithmetic; else raises ValueError."""
        parts = (
            value.coefficients
            if isinstance(value, Polynomial)
            else getattr(value, "parts", (value,))
        )
        size = max(
            (x.numerator.bit_length() + x.denominator.bit_length() for x in parts), default=0
        )
        if size > BITS_MOST or isinstance(value, Polynomial) and value.degree > DEGREE_MOST:
            raise ValueError(f'"{self.text}" is too large for exact arithmetic')
        return value

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
                total = self.checked(total / factor if operator == "/" else total * factor)
            except ZeroDivisionError:
                raise ValueError(f'"{self.text}" divides by zero') from None
        return total

    def power(self):
        base = self.atom()
        if not self.next("^"):
            return base
        power = self.rest.pop() if self.rest else ""
        if not power.isdigit() or int(power) > POWER_MOST:
            raise ValueError(
                f'"{self.text}": expected an integer power from 0 to {POWER_MOST} after "^"'
            )
        result = Fraction(1)
        for _ in range(int(power)):
            # Checked after every factor, before a number becomes too large to handle.
            result = self.checked(result * base)
        return result

    def atom(self):
        token = self.rest.pop() if self.rest else ""
        if token == "(":
            # Each bracket is a call of the parser; too many would exhaust the stack of Python.
            self.depth += 1
            if self.depth > NESTED_MOST:
                raise ValueError(
                    f'"{self.text}" has more than {NESTED_MOST} brackets within each other'
                )
            inside = self.sum()
            self.depth -= 1
            if not self.next(")"):
                raise ValueError(f'"{self.text}": a closing ")" is missing')
            return inside
        if token == "sqrt":
            n = self.atom() if self.rest and self.rest[-1] == "(" else None
            if not isinstance(n, Fraction) or n.denominator != 1 or not 0 <= n <= ROOT_MOST:
                raise ValueError(
                    f'"{self.text}": expected sqrt(n) of an integer n up to {ROOT_MOST:.0e}'
                )
            return square_root(int(n))
        if token and (token[0].isdigit() or token[0] == "."):
            return Fraction(token)
        if token in self.names:
            return self.names[token]
        known = ", ".join(["sqrt(n)", *self.names])
        fault = (
            f'unknown symbol "{token}"; known are {known}'
            if token.isidentifier()
            else f'unexpected "{token}"'
        )
        raise ValueError(f'"{self.text}": {fault}' if token else f'"{self.text}" ends too early')

"""A Butcher array as it stands in the book, with its name and source; all else follows from it. Knows no time loop."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import numpy as np

from fvsolve.doors import COUNT, ROW, TABLE, TEXT, door
from fvsolve.errors import FvsolveError, nearest
from fvsolve.steppers.analysis.trees import Conditions, stage_order
from fvsolve.steppers.collocation import collocation, extrapolated
from fvsolve.steppers.numbers.algebraic import MIXED, Algebraic
from fvsolve.steppers.numbers.expression import digits, root, value_of
from fvsolve.units import show

METHODS: dict[str, Method] = {}  # some under two names: `gauss-2` is `implicit-midpoint`
LARGEST = 10**30  # entry
OWN: set[str] = set()  # names of the package's own, which nobody may take
EXACT_DECIMALS = 6  # decimals no longer than this are meant as they stand


@dataclass(frozen=True)
class Array:
    """The exact numbers of a tableau: fractions, or algebraic numbers with one root."""

    a: tuple[tuple, ...]
    b: tuple
    c: tuple
    embedded: tuple  # empty where there is none
    start: object  # weight of f(t, y) in the embedded solution
    dense: tuple[tuple, ...]


@dataclass(frozen=True, eq=False)
class Method:
    """A Runge-Kutta method: k_i = f(y + h sum_j a_ij k_j, t + c_i h), y+ = y + h sum_i b_i k_i (14), (23).

    Everything but name, source and text is derived on first use:
    a : float64[s, s]; b, c : float64[s]; error : float64[s] or empty, weights of y+ less the embedded
    solution, start_error what that lacks: the weight of f(t, y) at the start; dense : float64[s, d] or empty,
    y(theta) = y + h sum_i k_i sum_j dense_ij theta^(j+1).
    """

    name: str
    source: str
    text: str = field(repr=False)
    numbers: Mapping[str, tuple[str, float]] = field(default_factory=dict, repr=False)
    given_dense: Sequence = field(default=(), repr=False)
    start_weight: str | None = field(default=None, repr=False)
    given_digits: int | None = field(default=None, repr=False)

    @functools.cached_property
    def exact(self) -> Array:
        """The array in exact numbers; raises FvsolveError that names every fault of the text."""
        return _exact(self)

    @functools.cached_property
    def digits(self) -> int | None:
        """Significant digits that the source gives, None where its numbers are exact."""
        found = self.given_digits or digits(self.text)
        return found if found > EXACT_DECIMALS else None

    @property
    def rounding(self) -> Fraction:
        """Relative error of a coefficient: 0 where they are exact."""
        return Fraction(5, 10**self.digits) if self.digits else Fraction(0)

    @functools.cached_property
    def a(self) -> np.ndarray:
        return _floats(self.exact.a)

    @functools.cached_property
    def b(self) -> np.ndarray:
        return _floats(self.exact.b)

    @functools.cached_property
    def c(self) -> np.ndarray:
        return _floats(self.exact.c)

    @functools.cached_property
    def error(self) -> np.ndarray:
        pairs = zip(self.exact.b, self.exact.embedded, strict=True) if self.adaptive else ()
        return _floats([x - y for x, y in pairs])

    @functools.cached_property
    def start_error(self) -> float:
        return 0.0 - float(self.exact.start)

    @functools.cached_property
    def dense(self) -> np.ndarray:
        return _floats(self.exact.dense) if self.exact.dense else np.zeros((0, 0))

    @property
    def stages(self) -> int:
        return len(self.exact.b)

    @property
    def adaptive(self) -> bool:
        """Whether it estimates its error."""
        return len(self.exact.embedded) > 0

    @functools.cached_property
    def order(self) -> int:
        return self._conditions.order(self.exact.b)

    @functools.cached_property
    def error_order(self) -> int:
        """Order of the embedded solution, 0 where there is none."""
        if not self.adaptive:
            return 0
        if self.exact.start == 0:
            return self._conditions.order(self.exact.embedded)
        a = [[Fraction(0)] * (self.stages + 1), *([Fraction(0), *row] for row in self.exact.a)]
        return Conditions(a, self.rounding).order([self.exact.start, *self.exact.embedded])

    @property
    def control_order(self) -> int:
        """The power of h that the error estimate goes with; without one that of the global error."""
        return min(self.order, self.error_order) + 1 if self.adaptive else self.order

    @functools.cached_property
    def stage_order(self) -> int:
        return stage_order(self.exact.a, self.exact.b, self.exact.c, self.rounding)

    @property
    def times(self) -> tuple[float, ...]:
        """Of its stages, in steps."""
        return tuple(map(float, self.exact.c))

    @functools.cached_property
    def explicit(self) -> bool:
        """Whether each stage needs only those before it."""
        return not np.any(np.triu(self.a))

    @functools.cached_property
    def diagonally_implicit(self) -> bool:
        """Whether the stages can be solved in turn, and at least one must be solved."""
        return not self.explicit and not np.any(np.triu(self.a, 1))

    @property
    def kind(self) -> str:
        """What a step solves: nothing (explicit), a stage at a time (diagonal), all of them at once (full)."""
        return "explicit" if self.explicit else "diagonal" if self.diagonally_implicit else "full"

    @functools.cached_property
    def stiffly_accurate(self) -> bool:
        """Whether the last stage is the new state."""
        return self.exact.a[-1] == self.exact.b

    @functools.cached_property
    def first_same_as_last(self) -> bool:
        """Whether the last rate of a step is the first one of the next."""
        return self.stiffly_accurate and self.exact.c[-1] == 1 and not np.any(self.a[0])

    @functools.cached_property
    def _conditions(self) -> Conditions:
        return Conditions(self.exact.a, self.rounding)


@door(name=TEXT, dense=ROW, start_weight=TEXT, numbers=TABLE, digits=COUNT, source=TEXT)
def tableau(
    name: str, text: str | Sequence, b: Sequence | None = None, c: Sequence | None = None, *, source: str = "user",
    dense: Sequence = (), start_weight: str | None = None, numbers: Mapping[str, tuple[str, float]] | None = None,
    digits: int | None = None,
) -> Method:  # fmt: skip
    """A method from its Butcher array, in text or as A, b, c; it is known by `name` everywhere from then on.

    A : [s, s], b : [s], or two rows, the second embedded; c : [s], the sums of rows of A where left out; integers,
    fractions and floating-point numbers, the last taken as rounded in their last digit.

    Rows `c | a1 a2 ...`, a ruled line, `| b1 b2 ...` and, with an embedded solution, a second such row. Entries
    have no blanks: `1/3`, `0.161`, `(88-7sqrt(6))/360`, or expressions in `numbers`, for example
    `{"g": ("x^3-3x^2+3x/2-1/6", 0.4358665215)}`: the root of that polynomial next to that number.
    Decimals of more than six digits are taken as rounded, other entries as exact unless `digits` says how many
    of them count. `start_weight` is the weight of f(t, y) in an embedded solution of quadrature type.
    Raises FvsolveError with all faults: rows that do not fit, that do not add up to c, entries that are no numbers.
    """
    if name in OWN or name == "auto" or not name.strip() or name != name.strip():
        raise FvsolveError(f'"{name}" is not free: it is empty or names a method of the package; choose another name')
    if b is not None:
        if isinstance(text, str):
            raise FvsolveError("b is given beside a text, which has it; wanted A, b, c in numbers, or the text alone")
        text = printed(text, b, c)
    elif not isinstance(text, str):
        raise FvsolveError(f'method "{name}": A alone is no method; give tableau(name, A, b) or tableau(name, A, b, c)')
    method = Method(name, source, text, numbers or {}, dense, start_weight, digits)
    method.exact  # noqa: B018  (raises)
    METHODS[name] = method
    return method


def method_of_file(path: Path) -> Method:
    """The method whose tableau a file holds as text, known by the name of the file, without its ending, from then on.

    Raises FvsolveError for a file that is no tableau, and where that name is another method's.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise FvsolveError(f"{path} cannot be read as a tableau: {error}") from None
    source, known = str(path.resolve()), METHODS.get(path.stem)
    if known is not None and path.stem not in OWN and known.source != source and known.text != text:
        raise FvsolveError(f'{path}: "{path.stem}" is another method already, from {known.source}; rename the file')
    try:
        return tableau(path.stem, text, source=source)
    except FvsolveError as error:
        raise FvsolveError(f"{path}: {error}") from None


def printed(a: Sequence, b: Sequence, c: Sequence | None = None) -> str:
    """The text of a Butcher array that is given as numbers; FvsolveError for shapes that are none."""
    a, b = np.atleast_2d(np.asarray(a, dtype=object)), np.atleast_2d(np.asarray(b, dtype=object))
    s = a.shape[0]
    if a.shape != (s, s) or b.ndim != 2 or b.shape[0] > 2 or b.shape[1] != s:
        raise FvsolveError(f"A is {a.shape}, b {b.shape}; wanted s x s and s, or two rows of s where one is embedded")
    if c is None:
        c = [sum(map(_number, row), Fraction(0)) for row in a]
    c = np.atleast_1d(np.asarray(c, dtype=object))
    if c.shape != (s,):
        raise FvsolveError(f"c is {c.shape}; wanted {s} numbers")
    rows = [f"{_entry(left)} | {' '.join(map(_entry, row))}" for left, row in zip(c, a, strict=True)]
    return "\n".join([*rows, "---", *(f"| {' '.join(map(_entry, row))}" for row in b)])


def _number(x) -> Fraction:
    return Fraction(x) if isinstance(x, (int, Fraction, np.integer)) else Fraction(repr(float(x)))


def _entry(x) -> str:
    if isinstance(x, (float, np.floating)):
        return f"{Decimal(repr(float(x))):f}"
    return str(_number(x))


def declare(
    name: str, text: str, source: str, dense: Sequence = (), start_weight: str | None = None,
    numbers: Mapping[str, tuple[str, float]] | None = None, digits: int | None = None, also: str | None = None,
) -> Method:  # fmt: skip
    """One of the package's own methods, which is read on first use; `also` is its name within a family."""
    method = METHODS[name] = Method(name, source, text, numbers or {}, dense, start_weight, digits)
    OWN.add(name)
    if also:
        METHODS[also] = method
        OWN.add(also)
    return method


def method_named(name: str | Method) -> Method:
    """The method of that name, or that one; raises FvsolveError that suggests the nearest."""
    if isinstance(name, Method):
        return name
    if not isinstance(name, str):
        raise FvsolveError(f"method = {show(name)}; wanted a name")
    if name in METHODS:
        return METHODS[name]
    near = nearest(name, METHODS)
    hint = f'; did you mean "{near}"?' if near else f"; methods are {', '.join(METHODS)}"
    raise FvsolveError(f'no method named "{name}"{hint}')


def _exact(method: Method) -> Array:
    faults: list[str] = []
    numbers = {}
    for name, (polynomial, near) in method.numbers.items():
        try:
            numbers[name] = root(name, polynomial, near)
        except ValueError as error:
            faults.append(f"{name}: {error}")
    if faults:
        raise FvsolveError(_said(method.name, faults))
    head, weights = _rows(method.text, numbers, faults)
    if not faults:
        faults += _mixed([*head, *weights]) or _faults(head, weights, method.rounding)
    if not faults and method.start_weight is not None and len(weights) == 2:
        faults.append("a second row of weights and start_weight both give the embedded solution; keep one")
    if faults:
        raise FvsolveError(_said(method.name, faults))
    s = len(head)
    c, b = tuple(row[0] for row in head), tuple(weights[0])
    a = tuple(tuple(row[1:] + [Fraction(0)] * (s - len(row) + 1)) for row in head)
    embedded, start = tuple(weights[1]) if len(weights) == 2 else (), Fraction(0)
    if method.start_weight is not None:
        start = value_of(method.start_weight, numbers)
        embedded = extrapolated(c, start)
    dense = tuple(tuple(value_of(str(x), numbers) for x in row) for row in method.given_dense)
    return Array(a, b, c, embedded, start, dense or collocation(a, b, c, method.rounding))


def _rows(text: str, numbers: Mapping, faults: list[str]) -> tuple[list, list]:
    """Rows [c, a1, ...] above the ruled line and rows [b1, ...] below it."""
    head, weights, below = [], [], False
    for line in text.strip().splitlines():
        line = line.strip()
        if set(line) <= set("-+ "):
            below = True
            continue
        left, bar, right = line.partition("|")
        if not bar:
            faults.append(f'"{line}" has no "|"')
        row = []
        for word in right.split() if below else [left.strip(), *right.split()]:
            try:
                row.append(value_of(word, numbers))
                if abs(row[-1]) > LARGEST:
                    raise ValueError(f'"{word}" is beyond {LARGEST:.0e}')
            except ValueError as error:
                faults.append(f'row "{line}": {error}')
        (weights if below else head).append(row)
    if not head or not below:
        faults.append("wanted rows, a ruled line and weights")
    return head, weights


def _mixed(rows: list) -> list[str]:
    fields = {x.field.name for row in rows for x in row if isinstance(x, Algebraic)}
    return [MIXED.format(" and ".join(sorted(fields)))] if len(fields) > 1 else []


def _faults(head: list, weights: list, rounding: Fraction) -> list[str]:
    """What does not fit or add up."""
    s, found = len(head), []

    def off(row, wanted) -> bool:
        total = sum(row, Fraction(0))
        return (
            abs(total - wanted) > 2 * rounding * sum((abs(x) for x in row), Fraction(1))
            if rounding
            else total != wanted
        )

    for i, (c, *row) in enumerate(head, start=1):
        if len(row) > s:
            found.append(f"row {i} has {len(row)} entries; wanted at most {s}")
        elif off(row, c):
            found.append(f"row {i} adds up to {_show(sum(row, Fraction(0)))}; wanted c = {_show(c)}")
    if not 1 <= len(weights) <= 2 or any(len(row) != s for row in weights):
        found.append(f"wanted one or two rows of {s} weights below the line")
    else:
        for row in weights:
            if off(row, 1):
                found.append(f"weights must add up to 1, these add up to {_show(sum(row, Fraction(0)))}")
    return found


def _show(value) -> str:
    text = str(value)
    return text if len(text) <= 24 else f"{float(value):.17g}"


def _said(name: str, faults: list[str]) -> str:
    return f"{name}: {faults[0]}" if len(faults) == 1 else "\n  ".join([f"{name}: {len(faults)} faults", *faults])


def _floats(rows) -> np.ndarray:
    return np.array(
        [[float(x) for x in row] if isinstance(row, tuple) else float(row) for row in rows], dtype=np.float64
    )

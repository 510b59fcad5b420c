"""A Butcher array as it stands in the book, with its name, order and source. Knows no time loop."""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction

import numpy as np

from fvsolve.errors import FvsolveError, nearest

METHODS: dict[str, Method] = {}


@dataclass(frozen=True, eq=False)
class Method:
    """A Runge-Kutta method: k_i = f(y + h sum_j a_ij k_j, t + c_i h), y+ = y + h sum_i b_i k_i (14).

    a : float64[s, s]; b, c : float64[s]; error : float64[s] or empty, weights of y+ less the embedded
    solution; dense : float64[s, d] or empty, y(theta) = y + h sum_i k_i sum_j dense_ij theta^(j+1).
    """

    name: str
    order: int
    source: str
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    error: np.ndarray
    error_order: int
    dense: np.ndarray
    exact: tuple = field(repr=False, default=())

    @property
    def stages(self) -> int:
        return len(self.b)

    start_error = 0.0

    @property
    def explicit(self):
        return not np.triu(self.a).any()

    @property
    def diagonally_implicit(self):
        return not self.explicit and not np.triu(self.a, 1).any()

    @property
    def pairs(self):
        a = self.a[1:, 1:] if not self.a[0].any() else self.a
        return int(np.sum(np.linalg.eigvals(a).imag > 1e-12))

    @property
    def adaptive(self) -> bool:
        return self.error.size > 0

    @property
    def first_same_as_last(self) -> bool:
        return bool(np.array_equal(self.a[-1], self.b)) and self.stages > 1 and self.c[-1] == 1.0


def tableau(name: str, text: str, order: int = 0, source: str = "user", dense=(), error_order: int = 0) -> Method:
    """A method from its Butcher array in text; it is known by `name` everywhere from then on.

    Rows `c | a1 a2 ...`, a ruled line, `| b1 b2 ...` and, with an embedded solution, a second such row.
    Raises FvsolveError where rows do not fit, do not add up to c, or are not explicit.
    """
    head, weights = _read(name, text)
    s = len(head)
    c = [row[0] for row in head]
    a = [row[1:] + [Fraction(0)] * (s - len(row) + 1) for row in head]
    for i, row in enumerate(a):
        if sum(row) != c[i]:
            raise FvsolveError(f"{name}: row {i + 1} adds up to {sum(row)}; wanted c = {c[i]}")
    if any(len(row) != s for row in weights) or not 1 <= len(weights) <= 2:
        raise FvsolveError(f"{name}: wanted one or two rows of {s} weights below the line")
    if any(sum(row) != 1 for row in weights):
        raise FvsolveError(f"{name}: weights must add up to 1")
    error = [x - y for x, y in zip(*weights, strict=True)] if len(weights) == 2 else []
    method = Method(
        name, order, source, _floats(a), _floats(weights[0]), _floats(c), _floats(error), error_order,
        _floats(dense) if len(dense) else np.zeros((0, 0)), (a, *weights),
    )  # fmt: skip
    METHODS[name] = method
    return method


def method_named(name: str) -> Method:
    """The method of that name; raises FvsolveError that suggests the nearest."""
    if name in METHODS:
        return METHODS[name]
    near = nearest(name, METHODS)
    hint = f'; did you mean "{near}"?' if near else f"; methods are {', '.join(METHODS)}"
    raise FvsolveError(f'no method named "{name}"{hint}')


def _read(name, text):
    head, weights, below = [], [], False
    for line in text.strip().splitlines():
        if set(line.strip()) <= set("-+ "):
            below = True
            continue
        left, bar, right = line.partition("|")
        if not bar:
            raise FvsolveError(f'{name}: "{line.strip()}" has no "|"')
        try:
            row = [Fraction(word) for word in right.split()]
            head_or_weights = weights if below else head
            head_or_weights.append(row if below else [Fraction(left.strip()), *row])
        except ValueError:
            raise FvsolveError(f'{name}: "{line.strip()}" is not a row of fractions') from None
    if not head or not below:
        raise FvsolveError(f"{name}: wanted rows, a ruled line and weights")
    return head, weights


def _floats(rows):
    return np.array([[float(Fraction(x)) for x in row] if isinstance(row, (list, tuple)) else float(Fraction(row))
                     for row in rows], dtype=np.float64)  # fmt: skip

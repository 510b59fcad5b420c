"""Order conditions by rooted trees (Butcher 1963). Knows exact numbers and arrays of them; knows no method by name."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from fractions import Fraction

Tree = tuple  # (nodes, which of them): a name that says the size first, so that trees are in order

BITS = 256  # kept of rounded coefficients on the way


@functools.cache
def trees(nodes: int) -> tuple[tuple[Tree, ...], ...]:
    """Rooted trees with so many nodes, each the names of its branches; tree (n, i) is trees(n)[i].

    There are 1, 1, 2, 4, 9, 20, 48, 115, 286, 719 of 1 to 10 nodes.
    """
    smaller = [(n, i) for n in range(1, nodes) for i in range(len(trees(n)))]
    found = []

    def split(rest: int, most: int, branches: tuple) -> None:
        if rest == 0:
            found.append(branches)
        for k in reversed(range(most)):
            if smaller[k][0] <= rest:
                split(rest - smaller[k][0], k + 1, (*branches, smaller[k]))

    split(nodes - 1, len(smaller), ())
    return tuple(found)


@functools.cache
def density(tree: Tree) -> int:
    """gamma of a tree: its nodes times the densities of its branches."""
    nodes, which = tree
    return nodes * math.prod(map(density, trees(nodes)[which]))


class Conditions:
    """sum_i b_i phi_i(tree) = 1 / gamma(tree) for one array A, and any weights b.

    rounding : relative error of each coefficient, 0 where they are exact.
    single : the array that a lone branch takes in place of A, for Rosenbrock methods alpha + Gamma in place of alpha
    (Hairer and Wanner 1996, theorem IV.7.3).
    """

    def __init__(self, a: Sequence[Sequence], rounding: Fraction = Fraction(0), single: Sequence[Sequence] = ()):
        self.rounding = rounding
        self.a = self._rows(a)
        self.single = self._rows(single) if len(single) else self.a
        self.known: dict[tuple[Tree, bool], list] = {}

    def residual(self, tree: Tree, b: Sequence):
        """What a condition lacks: an exact number, 0 where it holds to the precision of the coefficients."""
        left = sum((x * y for x, y in zip(b, self._phi(tree, False), strict=True) if x != 0), Fraction(0))
        found = left - Fraction(1, density(tree))
        if self.rounding and found != 0:
            size = sum(short(abs(x)) * y for x, y in zip(b, self._phi(tree, True), strict=True))
            if abs(found) <= 2 * tree[0] * self.rounding * size:
                return Fraction(0)
        return found

    def holds(self, nodes: int, b: Sequence) -> bool:
        """Whether all conditions of so many nodes hold."""
        return all(self.residual((nodes, i), b) == 0 for i in range(len(trees(nodes))))

    def order(self, b: Sequence) -> int:
        """The greatest p such that all conditions up to p nodes hold; at most twice the stages (Butcher 1964)."""
        p = 0
        while p < 2 * len(self.a) and self.holds(p + 1, b):
            p += 1
        return p

    def _rows(self, a: Sequence[Sequence]) -> list:
        return [[(j, short(x) if self.rounding else x) for j, x in enumerate(row) if x != 0] for row in a]

    def _phi(self, tree: Tree, absolute: bool) -> list:
        """Products over the branches of A phi(branch); of absolute values where their size is wanted."""
        if (tree, absolute) not in self.known:
            found = [Fraction(1)] * len(self.a)
            branches = trees(tree[0])[tree[1]]
            rows = self.single if len(branches) == 1 else self.a
            if absolute:
                rows = [[(j, abs(x)) for j, x in row] for row in rows]
            for branch in branches:
                inner = self._phi(branch, absolute)
                found = [
                    f * sum((x * inner[j] for j, x in row), Fraction(0)) if f != 0 else f
                    for f, row in zip(found, rows, strict=True)
                ]
            self.known[tree, absolute] = [short(x) for x in found] if self.rounding else found
        return self.known[tree, absolute]


def short(x) -> Fraction:
    """A fraction of few digits next to x, far closer than any published one."""
    if not isinstance(x, Fraction):
        x = sum(x.bracket()) / 2
    return Fraction(round(x * (1 << BITS)), 1 << BITS)


def stage_order(a: Sequence[Sequence], b: Sequence, c: Sequence, rounding: Fraction = Fraction(0)) -> int:
    """The greatest q with sum_j a_ij c_j^(k-1) = c_i^k / k and sum_j b_j c_j^(k-1) = 1 / k for all k <= q."""

    def equal(row, k: int, wanted) -> bool:
        terms = [x * y ** (k - 1) for x, y in zip(row, c, strict=True)]
        if not rounding:
            return sum(terms, Fraction(0)) == wanted
        size = sum(abs(float(x)) for x in terms) + abs(float(wanted))
        return abs(sum(terms, Fraction(0)) - wanted) <= 2 * (k + 1) * rounding * Fraction(size)

    q = 0
    while q < 2 * len(b):
        k = q + 1
        if not equal(b, k, Fraction(1, k)) or not all(equal(a[i], k, c[i] ** k / k) for i in range(len(c))):
            return q
        q = k
    return q

"""Order conditions of Runge-Kutta and Rosenbrock methods by rooted trees (Butcher 1963)."""

import functools
import math
from collections.abc import Sequence
from fractions import Fraction

# (number of nodes, index in trees(nodes)); the size comes first, so that trees sort by size
Tree = tuple

ORDER_MOST = 12  # greatest order that is tested: there are 4766 trees of 12 nodes, 12486 of 13
BITS = 256  # precision of rounded coefficients in intermediate results


@functools.cache
def trees(nodes: int) -> tuple[tuple[Tree, ...], ...]:
    """Rooted trees with `nodes` nodes, each as the tuple of its branches; a branch (n, i) is the tree trees(n)[i].

    There are 1, 1, 2, 4, 9, 20, 48, 115, 286, 719 trees of 1 to 10 nodes.
    """
    smaller = [(n, i) for n in range(1, nodes) for i in range(len(trees(n)))]
    partitions = []

    def split(rest: int, count: int, branches: tuple) -> None:
        if rest == 0:
            partitions.append(branches)
        # Branches in one order only, so that each tree is found once.
        for k in reversed(range(count)):
            if smaller[k][0] <= rest:
                split(rest - smaller[k][0], k + 1, (*branches, smaller[k]))

    split(nodes - 1, len(smaller), ())
    return tuple(partitions)


@functools.cache
def density(tree: Tree) -> int:
    """Density gamma of a tree: its number of nodes times the densities of its branches."""
    nodes, index = tree
    return nodes * math.prod(map(density, trees(nodes)[index]))


class Conditions:
    """Order conditions of a Butcher matrix A: sum_i b_i phi_i(tree) = 1 / gamma(tree), for any weights b.

    phi are the elementary weights and gamma the density of a tree.
    rounding : relative error of each coefficient, 0 for exact coefficients
    single : matrix that replaces A at tree nodes with a single branch: alpha + Gamma for Rosenbrock methods, with alpha
    as A (Hairer and Wanner 1996, theorem IV.7.3)
    """

    def __init__(
        self,
        a: Sequence[Sequence],
        rounding: Fraction = Fraction(0),
        single: Sequence[Sequence] = (),
    ):
        self.rounding = rounding
        self.a = self._rows(a)
        self.single = self._rows(single) if len(single) else self.a
        self.known: dict[tuple[Tree, bool], list] = {}

    def residual(self, tree: Tree, b: Sequence):
        """Residual of the condition of a tree for the weights b; 0 if it holds to the precision of the coefficients.

        If the uncertainty of the left side is not below 1 / gamma, the condition counts as not satisfied.
        """
        left = sum(
            (x * y for x, y in zip(b, self._phi(tree, False), strict=True) if x != 0), Fraction(0)
        )
        residual = left - Fraction(1, density(tree))
        if self.rounding and residual != 0:
            # The sum of sizes, without cancellation, bounds the effect of rounded coefficients.
            size = sum(short(abs(x)) * y for x, y in zip(b, self._phi(tree, True), strict=True))
            uncertainty = 2 * tree[0] * self.rounding * size
            if abs(residual) <= uncertainty < Fraction(1, density(tree)):
                return Fraction(0)
        return residual

    def differ(
        self, b: Sequence, other: Sequence, nodes: int, weights: Sequence[tuple[list, list]]
    ) -> bool:
        """True if sum_i b_i phi_i differs for the weights b and `other`, by more than the rounding of coefficients.

        weights : pairs (phi, bounds of its size) of elementary weights of trees with at most `nodes` nodes
        """
        differences = [x - y for x, y in zip(b, other, strict=True)]
        sizes = [short(abs(x)) + short(abs(y)) for x, y in zip(b, other, strict=True)]
        for phi, bound in weights:
            difference = sum((x * y for x, y in zip(differences, phi, strict=True)), Fraction(0))
            size = (
                sum((x * y for x, y in zip(sizes, bound, strict=True)), Fraction(0))
                if self.rounding
                else 0
            )
            if abs(difference) > 2 * nodes * self.rounding * size:
                return True
        return False

    def all_trees(self, nodes: int) -> list[tuple[list, list]]:
        """Pairs for `differ`, of all trees with `nodes` nodes."""
        return [
            tuple(self._phi((nodes, i), absolute) for absolute in (False, True))
            for i in range(len(trees(nodes)))
        ]

    def tall_trees(self) -> list[tuple[list, list]]:
        """Pairs for `differ`, of trees without branching points: all that act on y' = lambda y."""
        pairs = [([Fraction(1)] * len(self.a),) * 2]
        for _ in self.a[1:]:
            pairs.append(tuple(self._product(row, k) for k, row in enumerate(pairs[-1])))
        return pairs

    def bushy_trees(self) -> list[tuple[list, list]]:
        """Pairs for `differ`, of trees whose branches are single nodes: all that act on y' = f(t)."""
        times, bounds = (self._product([Fraction(1)] * len(self.a), k) for k in range(2))
        powers = range(len(self.a))
        return [([x**k for x in times], [x**k for x in bounds]) for k in powers]

    def _product(self, column: Sequence, absolute: int) -> list:
        """Product of the matrix with a column; absolute : 1 for the absolute values of the matrix"""
        rows = [[(j, abs(x) if absolute else x) for j, x in row] for row in self.single]
        return [sum((x * column[j] for j, x in row), Fraction(0)) for row in rows]

    def holds(self, nodes: int, b: Sequence) -> bool:
        """True if all conditions for trees of `nodes` nodes hold."""
        return all(self.residual((nodes, i), b) == 0 for i in range(len(trees(nodes))))

    def order(self, b: Sequence) -> int:
        """Order of a method with the weights b: greatest p such that all conditions up to p nodes hold, at most 12.

        The order is at most twice the number of stages (Butcher 1964).
        """
        p, limit = 0, min(2 * len(self.a), ORDER_MOST)
        while p < limit and self.holds(p + 1, b):
            p += 1
        return p

    def _rows(self, a: Sequence[Sequence]) -> list:
        return [
            [(j, short(x) if self.rounding else x) for j, x in enumerate(row) if x != 0]
            for row in a
        ]

    def _phi(self, tree: Tree, absolute: bool) -> list:
        """Elementary weights phi of a tree: product of A phi(branch) over its branches.

        absolute : True for the weights with absolute values of A, which bound their size
        """
        if (tree, absolute) not in self.known:
            product = [Fraction(1)] * len(self.a)
            branches = trees(tree[0])[tree[1]]
            rows = self.single if len(branches) == 1 else self.a
            if absolute:
                rows = [[(j, abs(x)) for j, x in row] for row in rows]
            for branch in branches:
                inner = self._phi(branch, absolute)
                product = [
                    f * sum((x * inner[j] for j, x in row), Fraction(0)) if f != 0 else f
                    for f, row in zip(product, rows, strict=True)
                ]
            self.known[tree, absolute] = [short(x) for x in product] if self.rounding else product
        return self.known[tree, absolute]


def short(x) -> Fraction:
    """Fraction within 2^-257 of the exact number x, or of the middle of its bounds if x is irrational.

    This is more accurate than any published coefficient.
    """
    if not isinstance(x, Fraction):
        x = sum(x.bracket()) / 2
    return Fraction(round(x * (1 << BITS)), 1 << BITS)


def stage_order(
    a: Sequence[Sequence], b: Sequence, c: Sequence, rounding: Fraction = Fraction(0)
) -> int:
    """Stage order of a Butcher array: order to which the stages and the new state integrate polynomials in time.

    It is the greatest q with sum_j a_ij c_j^(k-1) = c_i^k / k and sum_j b_j c_j^(k-1) = 1 / k for all k <= q.
    rounding : relative error of a coefficient
    """

    def equal(row, k: int, expected) -> bool:
        terms = [x * y ** (k - 1) for x, y in zip(row, c, strict=True)]
        if not rounding:
            return sum(terms, Fraction(0)) == expected
        size = sum(abs(float(x)) for x in terms) + abs(float(expected))
        return abs(sum(terms, Fraction(0)) - expected) <= 2 * (k + 1) * rounding * Fraction(size)

    q = 0
    while q < 2 * len(b):
        k = q + 1
        if not equal(b, k, Fraction(1, k)) or not all(
            equal(a[i], k, c[i] ** k / k) for i in range(len(c))
        ):
            return q
        q = k
    return q

"""Schemes and limiters as data: weights of cell averages in the value at a face.

A linear scheme is a single entry here: order, reach, ends and step limits are derived from its weights. A limited
scheme has a kernel too (`kernels.reconstruction`); in smooth solutions it equals a linear scheme.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

# cells that a linear scheme may use, relative to the cell upstream of the face
STENCIL = range(-2, 3)
LEAST_CELLS = 5  # number of cells that a pipe needs for a scheme with a stencil of five
Weights = tuple[Fraction, ...]


class Reach(NamedTuple):
    """Numbers of cells that a scheme reads, for a wave that runs forward.

    behind, ahead : cells before and after a cell, for the rate of this cell
    entering, leaving : cells at an end of a pipe that determine the polynomial which continues the wave beyond the end,
        for an end where the wave enters and for one where it leaves
    """

    behind: int
    ahead: int
    entering: int
    leaving: int


@dataclass(frozen=True)
class Scheme:
    """Reconstruction of the value at a face from averages of the cells around it.

    family : kernel that computes the scheme
    weights : of cells u-2 .. u+2 in the value at the face between u and u+1, for an upstream cell u; None for a limited
        scheme
    twin : linear scheme that a limited scheme equals in smooth solutions
    shorter : scheme for pipes of fewer than `LEAST_CELLS` cells; plane : scheme for basins on rectangles
    cavities : True if the scheme is suitable at the edge of a cavity; stencils of other schemes reach across it
    extra_cells : cells read at an end where a wave leaves, in addition to those of the polynomial there
    own_end_factors : factors, at least 1, on the rate of a pipe of 1, 2, 3, ... cells, because of its ends
    branches : (name, weights) of each linear scheme that a limited scheme equals for fixed switches; empty for muscl
    The rate is the number of cells that a wave crosses per second. A factor is at least 0.9 min(1, C) / c: C is the
    Courant limit of ssp-rk3 on a long pipe, c the lesser of its limits on the short pipe with two open ends, and with
    an open and a shut end (tests/step_limits/test_ends.py).
    """

    name: str
    family: str = "linear"
    weights: Weights | None = None
    twin: str = ""
    shorter: str = ""
    plane: str = "muscl"
    cavities: bool = False
    extra_cells: int = 0
    own_end_factors: tuple[float, ...] = ()
    # linear schemes for fixed switches; for muscl see its limiter
    branches: tuple[tuple[str, Weights], ...] = ()

    @property
    def limited(self) -> bool:
        """True if the weights of the scheme depend on the solution."""
        return self.weights is None

    @property
    def smooth(self) -> Scheme:
        """Linear scheme that this scheme equals in smooth solutions: itself, or its twin."""
        return SCHEMES[self.twin] if self.limited else self

    @cached_property
    def degree(self) -> int:
        """Highest degree of polynomials for which the scheme gives the exact value at a face from cell averages.

        For a limited scheme it is the degree of the linear scheme `smooth`.
        """
        degree = 0
        while self.exact(degree + 1):
            degree += 1
        return degree

    def exact(self, degree: int) -> bool:
        """True if the scheme `smooth` gives x^degree exactly at the face x = 1, from averages over cells [k, k + 1]."""
        power = degree + 1
        averages = (Fraction((k + 1) ** power - k**power, power) for k in STENCIL)
        return (
            sum(w * average for w, average in zip(self.smooth.weights, averages, strict=True)) == 1
        )

    @property
    def order(self) -> int:
        """Order of the error in the cell length, in smooth solutions."""
        return self.degree + 1

    @cached_property
    def reach(self) -> Reach:
        """Numbers of cells that the scheme reads, see `Reach`."""
        used = [k for k, w in zip(STENCIL, self.smooth.weights, strict=True) if w != 0]
        return Reach(1 - min(used), max(0, *used), self.degree, self.degree + 1 + self.extra_cells)

    @property
    def end_factors(self) -> tuple[float, ...]:
        """Factors on the rate of a pipe of 1, 2, 3, ... cells because of its ends, see `Scheme`.

        They are those of the linear scheme `smooth`.
        """
        return self.smooth.own_end_factors

    def for_basin(self, rectangle: bool) -> Scheme:
        """Scheme that basins use in place of this one; rectangle : True for a grid, False for an unstructured mesh."""
        scheme = SCHEMES[self.plane]
        return scheme if rectangle or scheme.degree <= 1 else SCHEMES["muscl"]


def fractions(denominator: int, *weights: int) -> Weights:
    """Weights as fractions, from integers over a common denominator."""
    return tuple(Fraction(w, denominator) for w in weights)


UPWIND3, UPWIND5 = fractions(6, 0, -1, 5, 2, 0), fractions(60, 2, -13, 47, 27, -3)
SCHEMES = {
    scheme.name: scheme
    for scheme in (
        Scheme("upwind", "upwind", fractions(1, 0, 0, 1, 0, 0), plane="upwind", cavities=True),
        Scheme("muscl", "muscl", twin="fromm", cavities=True, extra_cells=1),
        Scheme(
            "upwind5",
            weights=UPWIND5,
            shorter="upwind3",
            plane="upwind5",
            own_end_factors=(1.0, 1.46, 1.61, 1.22, 1.88, 1.46, 1.25, 1.08),
        ),
        Scheme(
            "weno5",
            "weno5",
            twin="upwind5",
            shorter="muscl",
            plane="weno5",
            branches=(
                ("upwind5", UPWIND5),
                ("stencil behind", fractions(6, 2, -7, 11, 0, 0)),
                ("upwind3", UPWIND3),
                ("stencil ahead", fractions(6, 0, 0, 2, 5, -1)),
            ),
        ),
        Scheme(
            "linear-upwind",
            weights=fractions(2, 0, -1, 3, 0, 0),
            own_end_factors=(1.0, 1.38, 1.21, 1.11, 1.07, 1.03, 1.01),
        ),
        Scheme(
            "fromm", weights=fractions(4, 0, -1, 4, 1, 0), own_end_factors=(1.0, 1.46, 1.19, 1.08)
        ),
        Scheme("central", weights=fractions(2, 0, 0, 1, 1, 0)),
        Scheme("upwind3", weights=UPWIND3, own_end_factors=(1.0, 1.46, 1.61, 1.22, 1.03)),
    )
}
LINEAR = dict(
    sorted(
        ((name, scheme) for name, scheme in SCHEMES.items() if not scheme.limited),
        key=lambda pair: pair[1].order,
    )
)
LIMITED = {name: scheme for name, scheme in SCHEMES.items() if scheme.limited}


def end_rate_factor(scheme: str, cells: int) -> float:
    """Factor on the rate (cells crossed per second) of a pipe with a number of cells, because of its ends.

    It is 1 for a long pipe.
    """
    factors = SCHEMES[scheme].end_factors
    return factors[cells - 1] if cells <= len(factors) else 1.0


class OwnLimiter(NamedTuple):
    """Function phi(r) of a user's limiter, and results of its tests, see `parts.own_limiters`.

    symmetric : True if phi(r) / r = phi(1 / r); digest : hash of the function
    departures : texts about where it leaves the region of Sweby (1984); costs : texts about a lost order or symmetry
    steepest : see `Limiter.steepest`
    """

    phi: Callable[[float], float]
    symmetric: bool
    digest: str
    departures: tuple[str, ...]
    costs: tuple[str, ...]
    steepest: Fraction


class Limiter(NamedTuple):
    """Limiter of slopes; the code of a built-in limiter in `kernels.reconstruction` is its position in `LIMITERS`.

    tangents : (a, b) for each branch in which the limited slope is not zero but a d + b e; d and e are the differences
    of values to the cells behind and ahead. The slope of van Leer's limiter is smooth: its branches are the tangents at
    d = e, at d = 0 and at e = 0
    overshoot : factor on the range of the neighbouring cells, which bounds the values at the sides of a cell of an
        unstructured mesh. It is 1 without overshoot; linear fields on distorted meshes need more than 1. Water
        has its own bound, see `surface_mesh.MOST_OVERSHOOT`.
    own : function of a user's limiter; its tangents are samples of its slope
    """

    tangents: tuple[tuple[Fraction, Fraction], ...]
    overshoot: float
    own: OwnLimiter | None = None

    @property
    def branches(self) -> dict[str, Weights]:
        """Weights of the linear schemes that muscl equals, one for each branch of the limiter : name -> weights.

        They include upwind, for a slope of zero. With van Leer's limiter muscl equals the others only at the points of
        `tangents`.
        The branches with twice the difference to a neighbour as slope are named "twice behind" and "twice ahead",
        other slopes a d + b e of users' limiters "a behind, b ahead".
        """
        names = {(DOUBLE, ZERO): "twice behind", (ZERO, DOUBLE): "twice ahead"}
        known, found = {scheme.weights: name for name, scheme in LINEAR.items()}, {}
        for a, b in [(ZERO, ZERO), *self.tangents]:
            weights = (ZERO, -a / 2, 1 + a / 2 - b / 2, b / 2, ZERO)
            name = names.get((a, b), f"{float(a):.3g} behind, {float(b):.3g} ahead")
            found[known.get(weights, name)] = weights
        return found

    @property
    def steepest(self) -> Fraction:
        """Greatest ratio of the limited slope to the smaller of the differences to the cells behind and ahead."""
        return self.own.steepest if self.own else max(max(pair) for pair in self.tangents)

    @property
    def monotone(self) -> bool:
        """True if the total variation cannot grow with short steps."""
        return not (self.own and self.own.departures)


UNITY = Fraction(1)
DOUBLE = Fraction(2)
HALF = Fraction(1, 2)
ZERO = Fraction(0)
# environment variable with the limiters of users, for other processes
LIMITERS_VARIABLE = "FVSOLVE_LIMITERS"
LIMITERS = {
    "minmod": Limiter(((UNITY, ZERO), (ZERO, UNITY)), 1.0),
    "van-leer": Limiter(((HALF, HALF), (DOUBLE, ZERO), (ZERO, DOUBLE)), 2.0),
    "monotonized-central": Limiter(((HALF, HALF), (DOUBLE, ZERO), (ZERO, DOUBLE)), 2.0),
}


def branches(scheme: str, limiter: str) -> dict[str, Weights]:
    """Weights of the linear schemes that a limited scheme equals, one for each of its branches : name -> weights.

    For muscl the branches are those of the limiter; a linear scheme has none.
    """
    return LIMITERS[limiter].branches if scheme == "muscl" else dict(SCHEMES[scheme].branches)

"""Schemes and limiters as data: what each makes of the averages of cells at a face. Knows numbers; computes no field.

A linear scheme is one entry here, and nothing else: order, reach, ends and limits are derived from its weights. What is
limited has a kernel besides (`kernels.reconstruction`, `kernels.limiters`), and is its twin where all is smooth.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

CELLS = range(-2, 3)  # that a linear scheme may weigh, from the one before the face
ROOM = 5  # cells below which a pipe has none for a scheme of five
Weights = tuple[Fraction, ...]


class Reach(NamedTuple):
    """How many cells a scheme looks at, for a wave that runs forward."""

    behind: int  # cells before a cell, in its rate
    ahead: int  # cells after it
    entering: int  # cells under the polynomial beyond an end, where the wave enters
    leaving: int  # and where it leaves


@dataclass(frozen=True)
class Scheme:
    """How the value at a face comes from averages of cells on the side that a wave comes from.

    family : the kernel; weights : of cells u-2 .. u+2 in the value at the face after u, where it is linear
    twin : the linear scheme that a limited one is where all is smooth; shorter : the one that pipes of fewer than
    `ROOM` cells take; plane : the one that carries basins on rectangles
    cavities : whether it bears the edge of a cavity, over which the others reach
    more : cells that it reads at an end where a wave leaves, beyond its polynomial
    quicker : how much quicker than its inside a pipe of 1, 2, 3, ... cells is, for its ends: 0.9, or 0.9 times the
    limit on a long pipe where that is less, over the Courant number at which ssp-rk3 grows in it between open and shut
    ends (tests/limits/test_ends.py), where that is more than one
    """

    name: str
    family: str = "linear"
    weights: Weights | None = None
    twin: str = ""
    shorter: str = ""
    plane: str = "muscl"
    cavities: bool = False
    more: int = 0
    own_quicker: tuple[float, ...] = ()
    branches: tuple[tuple[str, Weights], ...] = ()  # what it is where its switches stand still; muscl asks its limiter

    @property
    def limited(self) -> bool:
        """Whether its weights go with the solution."""
        return self.weights is None

    @property
    def smooth(self) -> Scheme:
        """The linear scheme that it is where all is smooth: itself, or its twin."""
        return SCHEMES[self.twin] if self.limited else self

    @cached_property
    def degree(self) -> int:
        """The degree of polynomials whose value at the face it gives exactly from their averages."""
        degree = 0
        while self.exact(degree + 1):
            degree += 1
        return degree

    def exact(self, degree: int) -> bool:
        """Whether it gives x^degree at x = 1 from averages over cells [k, k + 1]."""
        power = degree + 1
        averages = (Fraction((k + 1) ** power - k**power, power) for k in CELLS)
        return sum(w * average for w, average in zip(self.smooth.weights, averages, strict=True)) == 1

    @property
    def order(self) -> int:
        """Of its error in dx, where all is smooth."""
        return self.degree + 1

    @cached_property
    def reach(self) -> Reach:
        """What the rates of a pipe's cells look at."""
        used = [k for k, w in zip(CELLS, self.smooth.weights, strict=True) if w != 0]
        return Reach(1 - min(used), max(0, *used), self.degree, self.degree + 1 + self.more)

    @property
    def quicker(self) -> tuple[float, ...]:
        """As of its twin."""
        return self.smooth.own_quicker

    def on(self, rectangle: bool) -> Scheme:
        """The scheme that carries basins on a rectangle, or on a mesh of any cells."""
        one = SCHEMES[self.plane]
        return one if rectangle or one.degree <= 1 else SCHEMES["muscl"]


def weighed(denominator: int, *weights: int) -> Weights:
    """Weights as fractions."""
    return tuple(Fraction(w, denominator) for w in weights)


UPWIND3, UPWIND5 = weighed(6, 0, -1, 5, 2, 0), weighed(60, 2, -13, 47, 27, -3)
SCHEMES = {one.name: one for one in (
    Scheme("upwind", "upwind", weighed(1, 0, 0, 1, 0, 0), plane="upwind", cavities=True),
    Scheme("muscl", "muscl", twin="fromm", cavities=True, more=1),
    Scheme("upwind5", weights=UPWIND5, shorter="upwind3", plane="upwind5",
           own_quicker=(1.0, 1.46, 1.61, 1.22, 1.88, 1.46, 1.25, 1.08)),
    Scheme("weno5", "weno5", twin="upwind5", shorter="muscl", plane="weno5", branches=(
        ("upwind5", UPWIND5), ("stencil behind", weighed(6, 2, -7, 11, 0, 0)), ("upwind3", UPWIND3),
        ("stencil ahead", weighed(6, 0, 0, 2, 5, -1)))),
    Scheme("linear-upwind", weights=weighed(2, 0, -1, 3, 0, 0), own_quicker=(1.0, 1.38, 1.21, 1.11, 1.07, 1.03, 1.01)),
    Scheme("fromm", weights=weighed(4, 0, -1, 4, 1, 0), own_quicker=(1.0, 1.46, 1.19, 1.08)),
    Scheme("central", weights=weighed(2, 0, 0, 1, 1, 0)),
    Scheme("upwind3", weights=UPWIND3, own_quicker=(1.0, 1.46, 1.61, 1.22, 1.03)),
)}  # fmt: skip
LINEAR = dict(sorted(((name, one) for name, one in SCHEMES.items() if not one.limited), key=lambda pair: pair[1].order))
LIMITED = {name: one for name, one in SCHEMES.items() if one.limited}


def quicker(scheme: str, cells: int) -> float:
    """Factor on the rate of a pipe's cells that its ends ask for; 1 where the pipe is long."""
    factors = SCHEMES[scheme].quicker
    return factors[cells - 1] if cells <= len(factors) else 1.0


class Limiter(NamedTuple):
    """A function of `kernels.limiters`, which has the codes in this order.

    tangents : (by the difference behind, by the one ahead) of its slope, where it has some and its switches stand still
    wide : on meshes of any cells, where slopes are least squares, how far values at sides may go beyond those around:
    1 for not at all, or as linear fields want on shaken meshes
    """

    tangents: tuple[tuple[Fraction, Fraction], ...]
    wide: float

    @property
    def branches(self) -> dict[str, Weights]:
        """What muscl is where its switches stand still: linear schemes, or twice the slope behind or ahead."""
        half = [(Fraction(), Fraction()), *((a / 2, b / 2) for a, b in self.tangents)]
        found = [(NONE, -a, 1 + a - b, b, NONE) for a, b in half]
        known = {one.weights: name for name, one in LINEAR.items()}
        return {known.get(w, "twice behind" if w[1] else "twice ahead"): w for w in found}

    @property
    def steepest(self) -> Fraction:
        """Its greatest slope over the smaller difference."""
        return max(max(pair) for pair in self.tangents)


ONE, TWO, HALF, NONE = Fraction(1), Fraction(2), Fraction(1, 2), Fraction(0)
LIMITERS = {
    "minmod": Limiter(((ONE, NONE), (NONE, ONE)), 1.0),
    "van-leer": Limiter(((HALF, HALF), (TWO, NONE), (NONE, TWO)), 2.0),
    "monotonized-central": Limiter(((HALF, HALF), (TWO, NONE), (NONE, TWO)), 2.0),
}


def branches(scheme: str, limiter: str) -> dict[str, Weights]:
    """The linear schemes that a limited one is where its switches stand still, by name."""
    return LIMITERS[limiter].branches if scheme == "muscl" else dict(SCHEMES[scheme].branches)

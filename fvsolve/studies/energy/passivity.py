"""Which schemes and methods keep a passive network passive, and up to which step. Knows matrices; runs no case.

A step adds h^2 sum of m_ij <k_i, k_j> to what a ledger with the method's own weights has for the energy, with
M = B A + A^T B - b b^T (Burrage and Butcher 1979). Where M and b have nothing below zero, no passive network ever gives
more than it had, at any step; where M has, a flow into one chamber shows it. Without a flow from outside it is the
propagator R(h A) that must not stretch the energy: |R(-x)| <= 1 for a leaking chamber, |R(i y)| <= 1 for a column that
swings in a tank, and the norm of R(h A) for a closed pipe, where a scheme must not create energy itself.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from fvsolve.doors import CALL, NAMES, door
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.output.summary import plain
from fvsolve.schemes import SCHEMES
from fvsolve.steppers.automatic import AUTO, EXPLICIT, IMPLICIT, TIGHT, TIGHT_BELOW
from fvsolve.studies.outcome import names

CELLS = 20  # of the pipe
SLACK = 1e-10  # of a norm over one: rounding
LEAST, MOST = 0.01, 8.0  # Courant numbers that are looked at


@dataclass(frozen=True)
class MethodClaim:
    """What a method promises: any_network at any step; limits of h / tau on a leaking chamber, h omega on a resonator.

    chamber : least eigenvalue of M for stages at different times; below zero some flow into a chamber creates energy,
    h^2 times that over the squares of the flows in a step. None for a Rosenbrock method, whose ledger is no sum of
    stage powers.
    """

    method: str
    any_network: bool | None
    chamber: float | None
    leak: float
    resonator: float


@dataclass(frozen=True)
class SchemeClaim:
    """What a scheme does to the energy of a closed pipe, continuous in time.

    rate : greatest relative growth of the energy, in crossings of a cell; gain : greatest factor on the energy at any
    time, from the state that grows most; passive : neither grows. None for a limited scheme: it has no matrix.
    """

    scheme: str
    rate: float | None
    gain: float | None
    passive: bool | None


@dataclass(frozen=True)
class Pair:
    """Greatest Courant number up to which a pair lets no state of a closed pipe gain energy in a step; inf: any.

    0 where none does; None where the scheme has no matrix.
    """

    scheme: str
    method: str
    courant: float | None


@dataclass(frozen=True)
class Passivity:
    """The claims of methods and schemes, and of their pairs."""

    methods: list[MethodClaim]
    schemes: list[SchemeClaim]
    pairs: list[Pair]

    @property
    def breaking(self) -> list[tuple[str, str]]:
        """Pairs that break passivity at every step, or at some state whatever the step."""
        return [(one.scheme, one.method) for one in self.pairs if one.courant == 0.0]

    def plain(self) -> dict:
        """For JSON; None for a limit that is not there, and `any_step` beside a Courant number."""
        pairs = [vars(one) | {"any_step": one.courant == math.inf} for one in self.pairs]
        return plain({"cells": CELLS, "methods": self.methods, "schemes": self.schemes, "pairs": pairs})


@door(schemes=NAMES, methods=NAMES, progress=CALL)
def passivity(schemes=None, methods=None, progress=None) -> Passivity:
    """The claims of the named schemes and methods, else of all. Raises FvsolveError for unknown ones.

    progress(done, total, next) counts the names.
    """
    schemes = checked(schemes, list(SCHEMES), "scheme")
    methods = checked(methods, method_names(), "method")
    tell, total = progress or (lambda *_: None), len(schemes) + len(methods)
    of_schemes, of_methods, limits = [], [], {}
    for done, name in enumerate(schemes):
        tell(done, total, name)
        of_schemes.append(scheme_claim(name))
    for done, name in enumerate(methods):
        tell(len(schemes) + done, total, name)
        of_methods.append(method_claim(name))
        limits |= {(scheme, name): courant_limit(scheme, name) for scheme in schemes}
    pairs = [Pair(scheme, method, limits[scheme, method]) for scheme in schemes for method in methods]
    return Passivity(of_methods, of_schemes, pairs)


def checked(given, known: list[str], what: str) -> list[str]:
    """The names, one or several, all if there are none; FvsolveError where one is unknown."""
    given = names(given)
    for name in given or ():
        if name not in known:
            if name == AUTO:
                raise FvsolveError(
                    f'method "{AUTO}" is not a single method: it changes between {EXPLICIT} and {IMPLICIT}, '
                    f"below rtol {TIGHT_BELOW:g} {TIGHT}; give these"
                )
            raise FvsolveError(f'no {what} named "{name}"{did_you_mean(name, known)}; {what}s are {", ".join(known)}')
    return given or list(known)


def method_claim(name: str) -> MethodClaim:
    """What a tableau promises."""
    from fvsolve.steppers import analyse, method_named

    facts, method = analyse(name), method_named(name)
    if method.kind == "linear":
        return MethodClaim(name, None, None, facts.real_interval, facts.imaginary_interval)
    m, together = stage_matrix(method.a, method.b), same_time(method.c)
    lowest, size = np.linalg.eigvalsh(m)[0], np.abs(method.b).max()
    chamber = float(np.linalg.eigvalsh(together.T @ m @ together)[0])
    sound = bool(lowest >= -1e-12 * size and method.b.min() >= 0.0)
    chamber = 0.0 if abs(chamber) < 1e-12 * size else chamber
    return MethodClaim(name, sound, chamber, facts.real_interval, facts.imaginary_interval)


def stage_matrix(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """M = B A + A^T B - b b^T."""
    weighed = b[:, None] * a
    return weighed + weighed.T - np.outer(b, b)


def same_time(c: np.ndarray) -> np.ndarray:
    """float64[s, times]: 1 where a stage stands at a time; stages at one time see one flow."""
    times = sorted(set(np.round(c, 12)))
    return np.array([[float(abs(x - time) < 1e-9) for time in times] for x in c])


@functools.cache
def closed_pipe(scheme: str) -> tuple[np.ndarray, np.ndarray]:
    """(A, S) of a lossless pipe shut at both ends: dy/dt = A y per crossing of a cell, energy |S y|^2."""
    from fvsolve.studies.outcome import prepared

    model = prepared({
        "schema": 1, "fluid": {"name": "user", "density": 1000.0, "bulk_modulus": 2e9, "viscosity": 1e-3,
                               "vapor_pressure": 2000.0, "law": "linear"},
        "nodes": {"a": {"type": "junction"}, "b": {"type": "junction"}, "tap": {"type": "reservoir", "pressure": 1e6}},
        "links": {"pipe": {"type": "pipe", "from": "a", "to": "b", "length": 1000.0, "diameter": 0.3, "cells": CELLS,
                           "wave_speed": 1000.0, "friction": {"model": "none"}},
                  "shut": {"type": "valve", "from": "b", "to": "tap", "area": 1e-4, "opening": 0.0}},
        "numerics": {"end": 1.0, "initial": "rest", "scheme": scheme},
    })  # fmt: skip
    unit = 100.0 * np.eye(model.y_size)
    a = np.column_stack([model.rhs(0.0, one) / 100.0 for one in unit]) / model.wave_rates[0]
    return a, np.kron(np.eye(2), point_matrix(model.tables.settings[0], CELLS))


def point_matrix(settings, n: int) -> np.ndarray:
    """S with |S c|^2 the sum over cells of the averages of squares that the energy ledger takes, n dx = 1."""
    from fvsolve.kernels.energy import POINTS, SHARES, width_of

    width = int(width_of(settings, n))
    found = np.zeros((3 * n, n))
    for i in range(n):
        first = min(max(i - width // 2, 0), n - width)
        found[3 * i : 3 * i + 3, first : first + width] = np.sqrt(SHARES)[:, None] * POINTS[width, i - first, :, :width]
    return np.linalg.cholesky(found.T @ found).T


@functools.cache
def pipe_operator(scheme: str) -> np.ndarray:
    """A in coordinates whose length is the root of the energy."""
    a, s = closed_pipe(scheme)
    return np.linalg.solve(s.T, (s @ a).T).T


@functools.cache
def scheme_claim(scheme: str) -> SchemeClaim:
    """Growth of energy that the cells of a scheme alone allow."""
    if SCHEMES[scheme].limited:
        return SchemeClaim(scheme, None, None, None)
    b = pipe_operator(scheme)
    rate = float(np.linalg.eigvalsh(b + b.T)[-1])
    passive = rate <= SLACK
    return SchemeClaim(scheme, 0.0 if passive else rate, 1.0 if passive else greatest_gain(b), passive)


def greatest_gain(b: np.ndarray) -> float:
    """Greatest |exp(b t)|^2, t in crossings of a cell: finely at first, then for as long as it takes there and back."""
    from scipy.linalg import expm

    power, gain = np.eye(len(b)), 1.0
    for step, count in ((0.02, 200), (0.25, 16 * CELLS)):
        grow = expm(step * b)
        for _ in range(count):
            power = grow @ power
            gain = max(gain, float(np.linalg.norm(power, 2)) ** 2)
    return gain


@functools.cache
def courant_limit(scheme: str, method: str) -> float | None:
    """Greatest Courant number below which no smaller one lets a state of the closed pipe gain energy in a step."""
    from fvsolve.steppers import analyse

    claim = scheme_claim(scheme)
    if claim.passive is None:
        return None
    if not claim.passive:
        return 0.0
    facts = analyse(method)
    if facts.a_stable:  # von Neumann: R(hA) is a contraction wherever A is dissipative
        return math.inf
    tried = np.geomspace(LEAST, MOST, 120)
    bad = next((k for k, x in enumerate(tried) if not stretch(scheme, method, x) <= 1.0 + SLACK), None)
    if bad is None:
        return math.inf
    if bad == 0:
        return 0.0
    low, high = tried[bad - 1], tried[bad]
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stretch(scheme, method, middle) <= 1.0 + SLACK else (low, middle)
    return float(low)


def stretch(scheme: str, method: str, courant: float) -> float:
    """Norm of R(courant A): the greatest growth of the root of the energy in a step."""
    b = courant * pipe_operator(scheme)
    up, down = (of_matrix(coefficients, b) for coefficients in polynomials(method))
    return float(np.linalg.norm(np.linalg.solve(down, up), 2))


@functools.cache
def polynomials(method: str) -> tuple[list[float], list[float]]:
    """Coefficients of numerator and denominator of R, lowest power first, each to the nearest number."""
    from fvsolve.steppers import stability_function

    r = stability_function(method_of(method))
    return [float(x) for x in r.numerator.coefficients], [float(x) for x in r.denominator.coefficients]


def method_of(name: str):
    """The method of a name."""
    from fvsolve.steppers import method_named

    return method_named(name)


def of_matrix(coefficients: list[float], b: np.ndarray) -> np.ndarray:
    """A polynomial, lowest power first, of a matrix."""
    total = np.zeros_like(b)
    for x in reversed(coefficients):
        total = total @ b + x * np.eye(len(b))
    return total


def method_names() -> list[str]:
    """All methods."""
    from fvsolve.steppers import METHODS

    return list(METHODS)

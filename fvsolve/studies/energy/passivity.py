"""Passivity of schemes and methods: conditions and step limits under which a passive network stays passive.

The energy after a step exceeds that of a ledger with the weights of the method by h^2 times the sum of
m_ij <k_i, k_j>, with M = B A + A^T B - b b^T (Burrage and Butcher 1979). If M and the weights b are non-negative, no
passive network supplies more energy than it had, for any step. If M has a negative eigenvalue, a flow into a chamber
shows it. Without external flow the propagator R(h A) must not increase the energy: |R(-x)| <= 1 for a leaking chamber,
|R(i y)| <= 1 for a column oscillating in a tank, and norm R(h A) <= 1 for a closed pipe, if the scheme creates none.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass

import numpy as np

from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.output.summary_file import plain
from fvsolve.schemes import SCHEMES
from fvsolve.steppers.automatic import AUTO, EXPLICIT, IMPLICIT, TIGHT_BELOW, TIGHT_IMPLICIT
from fvsolve.studies.outcome import name_list
from fvsolve.validation import FUNCTION, NAMES, validated

CELLS = 20  # cells of the closed pipe
NORM_TOLERANCE = 1e-10  # excess of a norm over 1 that counts as rounding
LEAST, MOST = 0.01, 8.0  # range of Courant numbers


@dataclass(frozen=True)
class MethodClaim:
    """Passivity of a method.

    any_network : True if passive for any network and any step; leak : greatest h / tau for a leaking chamber;
    resonator : greatest h omega for a resonator
    chamber : least eigenvalue of M for stages at different times. If it is negative, some flow into a chamber creates
    energy, h^2 times its value over the sum of squared flows in a step.
    any_network and chamber are None for a Rosenbrock method, whose ledger is not a sum of stage powers.
    """

    method: str
    any_network: bool | None
    chamber: float | None
    leak: float
    resonator: float


@dataclass(frozen=True)
class SchemeClaim:
    """Effect of a scheme on the energy of a closed pipe, continuous in time.

    rate : greatest relative growth rate of the energy per travel time of a cell; gain : greatest ratio of the energy
    at any time to that at the start; passive : True if the energy never grows. All None for a limited scheme, which has
    no matrix.
    """

    scheme: str
    rate: float | None
    gain: float | None
    passive: bool | None


@dataclass(frozen=True)
class Pair:
    """Greatest Courant number up to which no state of a closed pipe gains energy in a step; inf: any, 0: none.

    None if the scheme has no matrix.
    """

    scheme: str
    method: str
    courant: float | None


@dataclass(frozen=True)
class Passivity:
    """Passivity of methods, schemes and their pairs."""

    methods: list[MethodClaim]
    schemes: list[SchemeClaim]
    pairs: list[Pair]

    @property
    def breaking(self) -> list[tuple[str, str]]:
        """Pairs that violate passivity for every step: (scheme, method)."""
        return [(pair.scheme, pair.method) for pair in self.pairs if pair.courant == 0.0]

    def plain(self) -> dict:
        """Plain values for JSON: infinite limits are None; `any_step` is True if a pair has no limit."""
        pairs = [vars(pair) | {"any_step": pair.courant == math.inf} for pair in self.pairs]
        return plain({"cells": CELLS, "methods": self.methods, "schemes": self.schemes, "pairs": pairs})


@validated(schemes=NAMES, methods=NAMES, progress=FUNCTION)
def passivity(schemes=None, methods=None, progress=None) -> Passivity:
    """Compute the passivity of schemes and methods (default all). Raises FvsolveError for unknown names.

    progress : called as progress(done, total, next) for each name
    """
    schemes = check_names(schemes, list(SCHEMES), "scheme")
    methods = check_names(methods, method_names(), "method")
    report, total = progress or (lambda *_: None), len(schemes) + len(methods)
    of_schemes, of_methods, limits = [], [], {}
    for done, name in enumerate(schemes):
        report(done, total, name)
        of_schemes.append(scheme_claim(name))
    for done, name in enumerate(methods):
        report(len(schemes) + done, total, name)
        of_methods.append(method_claim(name))
        limits |= {(scheme, name): courant_limit(scheme, name) for scheme in schemes}
    pairs = [Pair(scheme, method, limits[scheme, method]) for scheme in schemes for method in methods]
    return Passivity(of_methods, of_schemes, pairs)


def check_names(given, known: list[str], kind: str) -> list[str]:
    """List of names from a name or names, all known names for None. Raises FvsolveError for an unknown name."""
    given = name_list(given)
    for name in given or ():
        if name not in known:
            if name == AUTO:
                raise FvsolveError(
                    f'method "{AUTO}" is not a single method: it changes between {EXPLICIT} and {IMPLICIT}, '
                    f"below rtol {TIGHT_BELOW:g} {TIGHT_IMPLICIT}; name these methods instead"
                )
            raise FvsolveError(f'no {kind} named "{name}"{did_you_mean(name, known)}. Expected {", ".join(known)}')
    return given or list(known)


def method_claim(name: str) -> MethodClaim:
    """Passivity of a method from its tableau."""
    from fvsolve.steppers import analyse, method_named

    facts, method = analyse(name), method_named(name)
    if method.kind == "linear":
        return MethodClaim(name, None, None, facts.real_interval, facts.imaginary_interval)
    m, together = stage_matrix(method.a, method.b), stages_by_time(method.c)
    lowest, size = np.linalg.eigvalsh(m)[0], np.abs(method.b).max()
    chamber = float(np.linalg.eigvalsh(together.T @ m @ together)[0])
    any_network = bool(lowest >= -1e-12 * size and method.b.min() >= 0.0)
    chamber = 0.0 if abs(chamber) < 1e-12 * size else chamber
    return MethodClaim(name, any_network, chamber, facts.real_interval, facts.imaginary_interval)


def stage_matrix(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """M = B A + A^T B - b b^T."""
    weighted = b[:, None] * a
    return weighted + weighted.T - np.outer(b, b)


def stages_by_time(c: np.ndarray) -> np.ndarray:
    """float64[s, times]: 1 if a stage is at a time; stages at equal times have equal flows."""
    times = sorted(set(np.round(c, 12)))
    return np.array([[float(abs(x - time) < 1e-9) for time in times] for x in c])


@functools.cache
def closed_pipe(scheme: str) -> tuple[np.ndarray, np.ndarray]:
    """(A, S) of a lossless pipe closed at both ends: dy/dt = A y per travel time of a cell, energy |S y|^2."""
    from fvsolve.studies.outcome import study_model

    model = study_model({
        "schema": 1, "fluid": {"name": "user", "density": 1000.0, "bulk_modulus": 2e9, "viscosity": 1e-3,
                               "vapor_pressure": 2000.0, "law": "linear"},
        "nodes": {"a": {"type": "junction"}, "b": {"type": "junction"}, "tap": {"type": "reservoir", "pressure": 1e6}},
        "links": {"pipe": {"type": "pipe", "from": "a", "to": "b", "length": 1000.0, "diameter": 0.3, "cells": CELLS,
                           "wave_speed": 1000.0, "friction": {"model": "none"}},
                  "shut": {"type": "valve", "from": "b", "to": "tap", "area": 1e-4, "opening": 0.0}},
        "numerics": {"end": 1.0, "initial": "rest", "scheme": scheme},
    })  # fmt: skip
    unit = 100.0 * np.eye(model.y_size)
    a = np.column_stack([model.rhs(0.0, state) / 100.0 for state in unit]) / model.wave_rates[0]
    return a, np.kron(np.eye(2), energy_matrix(model.tables.settings[0], CELLS))


def energy_matrix(settings, n: int) -> np.ndarray:
    """S with |S c|^2 equal to the sum over cells of the mean squares in the energy ledger, for n dx = 1."""
    from fvsolve.kernels.linear_energy import GAUSS_WEIGHTS, POINTS, polynomial_width

    width = int(polynomial_width(settings, n))
    points = np.zeros((3 * n, n))
    for i in range(n):
        start = min(max(i - width // 2, 0), n - width)
        points[3 * i : 3 * i + 3, start : start + width] = (
            np.sqrt(GAUSS_WEIGHTS)[:, None] * POINTS[width, i - start, :, :width]
        )
    return np.linalg.cholesky(points.T @ points).T


@functools.cache
def pipe_operator(scheme: str) -> np.ndarray:
    """A in coordinates whose Euclidean norm is the square root of the energy."""
    a, s = closed_pipe(scheme)
    return np.linalg.solve(s.T, (s @ a).T).T


@functools.cache
def scheme_claim(scheme: str) -> SchemeClaim:
    """Energy growth of the semi-discrete scheme."""
    if SCHEMES[scheme].limited:
        return SchemeClaim(scheme, None, None, None)
    b = pipe_operator(scheme)
    rate = float(np.linalg.eigvalsh(b + b.T)[-1])
    passive = rate <= NORM_TOLERANCE
    return SchemeClaim(scheme, 0.0 if passive else rate, 1.0 if passive else greatest_gain(b), passive)


def greatest_gain(b: np.ndarray) -> float:
    """Greatest |exp(b t)|^2, t in travel times of a cell: first 4 in fine steps, then 4 times the cells of the pipe."""
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
    """Courant number up to which no state of the closed pipe gains energy in a step; see `Pair`."""
    from fvsolve.steppers import analyse

    claim = scheme_claim(scheme)
    if claim.passive is None:
        return None
    if not claim.passive:
        return 0.0
    facts = analyse(method)
    if facts.a_stable:  # von Neumann: R(hA) is a contraction wherever A is dissipative
        return math.inf
    samples = np.geomspace(LEAST, MOST, 120)
    failed = next((k for k, x in enumerate(samples) if not step_gain(scheme, method, x) <= 1.0 + NORM_TOLERANCE), None)
    if failed is None:
        return math.inf
    if failed == 0:
        return 0.0
    low, high = samples[failed - 1], samples[failed]
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if step_gain(scheme, method, middle) <= 1.0 + NORM_TOLERANCE else (low, middle)
    return float(low)


def step_gain(scheme: str, method: str, courant: float) -> float:
    """Norm of R(courant A): greatest growth factor of the square root of the energy in a step."""
    b = courant * pipe_operator(scheme)
    numerator, denominator = (matrix_polynomial(coefficients, b) for coefficients in polynomials(method))
    return float(np.linalg.norm(np.linalg.solve(denominator, numerator), 2))


@functools.cache
def polynomials(method: str) -> tuple[list[float], list[float]]:
    """Coefficients of numerator and denominator of R, lowest power first, rounded to floats."""
    from fvsolve.steppers import stability_function

    r = stability_function(method_of(method))
    return [float(x) for x in r.numerator.coefficients], [float(x) for x in r.denominator.coefficients]


def method_of(name: str):
    """Method with a name."""
    from fvsolve.steppers import method_named

    return method_named(name)


def matrix_polynomial(coefficients: list[float], b: np.ndarray) -> np.ndarray:
    """Polynomial of a matrix; coefficients lowest power first."""
    total = np.zeros_like(b)
    for x in reversed(coefficients):
        total = total @ b + x * np.eye(len(b))
    return total


def method_names() -> list[str]:
    """Names of all methods."""
    from fvsolve.steppers import METHODS

    return list(METHODS)

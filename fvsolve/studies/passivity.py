"""Passivity of schemes and methods: conditions and step limits under which a passive network stays passive.

A Runge-Kutta method has coefficients A, weights b (B = diag b) and stage slopes k_i; h is the step. A ledger adds the
powers at the stages with the weights b. For the energy |y|^2 of the states y, it exceeds the energy after a step by h^2
times the sum of m_ij <k_i, k_j>, with M = B A + A^T B - b b^T (Burrage and Butcher 1979). If M and b are non-negative,
no passive network supplies more energy than it had, for any step. If M has a negative eigenvalue after stages at equal
times are joined, some flow into a chamber creates energy.

Without external flow, the solution of dy/dt = J y is multiplied by R(h J) in a step, with the stability function R. The
energy must not grow: |R(-x)| <= 1 for a leaking chamber, |R(i y)| <= 1 for a column that oscillates in a tank, and norm
R(h J) <= 1 for a closed pipe, if the scheme creates no energy.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np

from fvsolve.argument_checks import FUNCTION, NAMES, validated
from fvsolve.core.output.result_table import PlainData
from fvsolve.core.schemes import SCHEMES
from fvsolve.core.step_limits.greatest_step import greatest_step
from fvsolve.core.steppers.automatic import AUTO, EXPLICIT, IMPLICIT, TIGHT_BELOW, TIGHT_IMPLICIT
from fvsolve.declarations import declared
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.studies.outcome import name_list

CELLS = 20  # cells of the closed pipe
NORM_TOLERANCE = 1e-10  # excess of a norm over 1 that counts as rounding
LEAST, MOST = 0.01, 8.0  # range of Courant numbers


@dataclass(frozen=True)
class MethodClaim:
    """Passivity of a method, with limits of the step h.

    any_network : True if the method is passive for any network and any step
    leak : greatest h / tau up to which the energy of a leaking chamber does not grow; tau is its time constant
    resonator : greatest h omega up to which the energy of an undamped resonator of angular frequency omega does not
    grow. Both are inf without a limit, 0 if the energy grows at any step.
    chamber : least eigenvalue of the matrix M of `stage_matrix`, with stages at equal times joined (`stages_by_time`).
    If it is negative, some flow into a chamber creates energy in a step, in proportion to its magnitude, h^2 and the
    squared flows.
    any_network and chamber are None for a Rosenbrock method, whose energy balance is not a sum of powers at stages.
    """

    method: str
    any_network: bool | None
    chamber: float | None
    leak: float
    resonator: float


@dataclass(frozen=True)
class SchemeClaim:
    """Effect of a scheme on the energy of a pipe closed at both ends, with exact integration in time.

    rate : greatest relative growth rate of the energy, per travel time of a wave through a cell [-]
    gain : greatest ratio of the energy at any sampled time to the energy at the start [-]
    passive : True if the energy never grows. All are None for a scheme with a limiter, which is not linear.
    """

    scheme: str
    rate: float | None
    gain: float | None
    passive: bool | None


@dataclass(frozen=True)
class Pair(PlainData):
    """Scheme and method, with the Courant number up to which no state of a closed pipe gains energy in a step.

    courant : inf if there is no limit, 0 if any step can create energy, None for a scheme with a limiter
    """

    scheme: str
    method: str
    courant: float | None

    also = ("any_step",)

    @property
    def any_step(self) -> bool:
        """True if there is no limit."""
        return self.courant == math.inf


@dataclass(frozen=True)
class Passivity(PlainData):
    """Results of `passivity`: one entry for each method, for each scheme, and for each pair of the two."""

    methods: list[MethodClaim]
    schemes: list[SchemeClaim]
    pairs: list[Pair]

    json = "cells methods schemes pairs"
    cells = CELLS

    @property
    def breaking(self) -> list[tuple[str, str]]:
        """Pairs (scheme, method) that can create energy in a step of any length."""
        return [(pair.scheme, pair.method) for pair in self.pairs if pair.courant == 0.0]


@declared("study")
@validated(schemes=NAMES, methods=NAMES, progress=FUNCTION)
def passivity(schemes=None, methods=None, progress=None) -> Passivity:
    """Compute the passivity of schemes, of methods and of their pairs. Raises FvsolveError for unknown names.

    schemes, methods : name or list of names (default all); progress : called as progress(done, total, next)
    """
    schemes = check_names(schemes, list(SCHEMES), "scheme")
    methods = check_names(methods, method_names(), "method")
    report, total = progress or (lambda *_: None), len(schemes) + len(methods)
    of_schemes = []
    of_methods = []
    limits = {}
    for done, name in enumerate(schemes):
        report(done, total, name)
        of_schemes.append(scheme_claim(name))
    for done, name in enumerate(methods):
        report(len(schemes) + done, total, name)
        of_methods.append(method_claim(name))
        limits |= {(scheme, name): courant_limit(scheme, name) for scheme in schemes}
    pairs = [
        Pair(scheme, method, limits[scheme, method]) for scheme in schemes for method in methods
    ]
    return Passivity(of_methods, of_schemes, pairs)


def check_names(given, known: list[str], kind: str) -> list[str]:
    """List of names from a name or a list of names; all `known` names for None.

    kind : "scheme" or "method", for the message. Raises FvsolveError for an unknown name.
    """
    given = name_list(given)
    for name in given or ():
        if name not in known:
            if name == AUTO:
                raise FvsolveError(
                    f'method "{AUTO}" is not a single method: it changes between {EXPLICIT} and {IMPLICIT} '
                    f"({TIGHT_IMPLICIT} below rtol {TIGHT_BELOW:g}); name these methods instead"
                )
            hint = did_you_mean(name, known) or f"; expected {', '.join(known)}"
            raise FvsolveError(f'no {kind} named "{name}"{hint}')
    return given or list(known)


def method_claim(name: str) -> MethodClaim:
    """Passivity of a method from its tableau."""
    from fvsolve.core.steppers import analyse, method_named

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
    """Matrix M = B A + A^T B - b b^T of a Runge-Kutta method, with coefficients A, weights b and B = diag b."""
    weighted = b[:, None] * a
    return weighted + weighted.T - np.outer(b, b)


def stages_by_time(c: np.ndarray) -> np.ndarray:
    """Matrix float64[stages, times]: 1 if a stage is at a time, else 0; c : times of stages as fractions of a step."""
    times = sorted(set(np.round(c, 12)))
    return np.array([[float(abs(x - time) < 1e-9) for time in times] for x in c])


@functools.cache
def closed_pipe(scheme: str) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (A, S) of a lossless pipe closed at both ends, with a scheme.

    States y are the waves in both directions in the cells. They change by dy/dt = A y, with time in travel times of a
    wave through a cell; the energy is |S y|^2 up to a factor.
    """
    from fvsolve.studies.outcome import study_model

    model = study_model(
        {
            "schema": 1,
            "fluid": {
                "name": "user",
                "density": 1000.0,
                "bulk_modulus": 2e9,
                "viscosity": 1e-3,
                "vapor_pressure": 2000.0,
                "law": "linear",
            },
            "nodes": {
                "a": {"type": "junction"},
                "b": {"type": "junction"},
                "tap": {"type": "reservoir", "pressure": 1e6},
            },
            "links": {
                "pipe": {
                    "type": "pipe",
                    "from": "a",
                    "to": "b",
                    "length": 1000.0,
                    "diameter": 0.3,
                    "cells": CELLS,
                    "wave_speed": 1000.0,
                    "friction": {"model": "none"},
                },
                "shut": {"type": "valve", "from": "b", "to": "tap", "area": 1e-4, "opening": 0.0},
            },
            "numerics": {"end": 1.0, "initial": "rest", "scheme": scheme},
        }
    )
    unit = 100.0 * np.eye(model.y_size)
    a = np.column_stack([model.rhs(0.0, state) / 100.0 for state in unit]) / model.wave_rates[0]
    return a, np.kron(np.eye(2), energy_matrix(model.tables.settings[0], CELLS))


def energy_matrix(settings, n: int) -> np.ndarray:
    """Matrix S with |S c|^2 equal to the sum of the mean squares of a quantity in n cells, as in the energy balance.

    c : averages of the quantity over the cells; settings : settings of a model, which contain the scheme
    """
    from fvsolve.core.kernels.pipe_energy import GAUSS_WEIGHTS, POINTS, polynomial_width

    width = int(polynomial_width(settings, n))
    points = np.zeros((3 * n, n))
    for i in range(n):
        start = min(max(i - width // 2, 0), n - width)
        weighted = np.sqrt(GAUSS_WEIGHTS)[:, None] * POINTS[width, i - start, :, :width]
        points[3 * i : 3 * i + 3, start : start + width] = weighted
    return np.linalg.cholesky(points.T @ points).T


@functools.cache
def pipe_operator(scheme: str) -> np.ndarray:
    """Matrix A of `closed_pipe` in coordinates S y, whose Euclidean norm is the square root of the energy."""
    a, s = closed_pipe(scheme)
    return np.linalg.solve(s.T, (s @ a).T).T


@functools.cache
def scheme_claim(scheme: str) -> SchemeClaim:
    """Energy growth in a closed pipe with a scheme, with exact integration in time."""
    if SCHEMES[scheme].limited:
        return SchemeClaim(scheme, None, None, None)
    b = pipe_operator(scheme)
    rate = float(np.linalg.eigvalsh(b + b.T)[-1])
    passive = rate <= NORM_TOLERANCE
    return SchemeClaim(
        scheme, 0.0 if passive else rate, 1.0 if passive else greatest_gain(b), passive
    )


def greatest_gain(b: np.ndarray) -> float:
    """Greatest energy gain |exp(b t)|^2 of a closed pipe at any sampled time t; b : matrix of `pipe_operator`.

    t is in travel times of a wave through a cell: up to 4 in steps of 0.02, then 80 more in steps of 0.25.
    """
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
    """Courant number up to which no state of the closed pipe gains energy in a step; inf, 0 and None as for `Pair`.

    If the scheme creates energy, the limit is 0; otherwise the limit of an A-stable method is inf. For other methods
    120 Courant numbers from LEAST (0.01) to MOST (8) are tested: the limit is inf if none of them creates energy, and 0
    if the least one does.
    """
    from fvsolve.core.steppers import analyse

    claim = scheme_claim(scheme)
    if claim.passive is None:
        return None
    if not claim.passive:
        return 0.0
    facts = analyse(method)
    if facts.a_stable:  # von Neumann: R(hA) is a contraction wherever A is dissipative
        return math.inf

    def gains(courant: float) -> bool:
        # greatest growth of the square root of the energy in a step: norm of R(courant A), R the stability function
        b = courant * pipe_operator(scheme)
        numerator, denominator = (
            matrix_polynomial(coefficients, b) for coefficients in polynomials(method)
        )
        return (
            not np.linalg.norm(np.linalg.solve(denominator, numerator), 2) <= 1.0 + NORM_TOLERANCE
        )

    return greatest_step(gains, np.geomspace(LEAST, MOST, 120), width=1e-9).step


@functools.cache
def polynomials(method: str) -> tuple[list[float], list[float]]:
    """Coefficients (of the numerator, of the denominator) of the stability function, lowest power first."""
    from fvsolve.core.steppers import method_named, stability_function

    r = stability_function(method_named(method))
    return [float(x) for x in r.numerator.coefficients], [
        float(x) for x in r.denominator.coefficients
    ]


def matrix_polynomial(coefficients: list[float], b: np.ndarray) -> np.ndarray:
    """Value of a polynomial of the matrix b; coefficients : lowest power first."""
    total = np.zeros_like(b)
    for x in reversed(coefficients):
        total = total @ b + x * np.eye(len(b))
    return total


def method_names() -> list[str]:
    """Names of all methods of time integration."""
    from fvsolve.core.steppers import METHODS

    return list(METHODS)

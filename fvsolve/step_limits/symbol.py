"""Symbol of a linear scheme: rate of a wave on a uniform periodic grid, in exact arithmetic.

u_t + a u_x = 0 in cells of width dx: du_j/dt = -(a / dx) (F_j - F_j-1), F_j = sum_k w_k u_j+k-2. A wave
u_j = exp(i j theta) grows by du/dt = (a / dx) z(theta) u. With t = sin^2(theta / 2) both Re z and |z|^2 are
polynomials in t, 0 (longest waves) <= t <= 1 (two cells a wave).
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from fvsolve.errors import FvsolveError, nearest
from fvsolve.schemes import LIMITED, LINEAR, Weights
from fvsolve.steppers.numbers.polynomial import Polynomial

WEIGHTS: dict[str, Weights] = {name: scheme.weights for name, scheme in LINEAR.items()}


def weights_of(scheme: str) -> Weights:
    """Weights of cells u-2 .. u+2 in the value at the face after u; raises FvsolveError for a nonlinear scheme."""
    if scheme in WEIGHTS:
        return WEIGHTS[scheme]
    linear = ", ".join(WEIGHTS)
    if scheme in LIMITED:
        raise FvsolveError(f'scheme "{scheme}" is not linear and has no exact limit; linear schemes are {linear}')
    near = nearest(scheme, [*WEIGHTS, *LIMITED])
    hint = f'did you mean "{near}"?' if near else f"linear schemes are {linear}"
    raise FvsolveError(f'no scheme named "{scheme}"; {hint}')


def symbol(weights: Sequence, theta) -> np.ndarray:
    """z(theta) in floating point; theta : phase per cell [rad], a number or an array."""
    theta = np.asarray(theta, dtype=float)
    return sum(float(a) * np.exp(1j * m * theta) for m, a in _waves(weights).items())


def real_part(weights: Sequence) -> Polynomial:
    """Re z as a polynomial in t."""
    return _cosines(_waves(weights))


def square(weights: Sequence) -> Polynomial:
    """|z|^2 as a polynomial in t."""
    waves, product = _waves(weights), {}
    for m, x in waves.items():
        for n, y in waves.items():
            product[m - n] = product.get(m - n, Fraction(0)) + x * y
    return _cosines(product)


def _waves(weights: Sequence) -> dict[int, Fraction]:
    """z = sum_m a_m exp(i m theta)."""
    amplitudes: dict[int, Fraction] = {}
    for k, w in enumerate(weights, start=-2):
        amplitudes[k] = amplitudes.get(k, Fraction(0)) - w
        amplitudes[k - 1] = amplitudes.get(k - 1, Fraction(0)) + w
    return amplitudes


def _cosines(waves: dict[int, Fraction]) -> Polynomial:
    """sum_m a_m cos(m theta), cos theta = 1 - 2 t, by T_m+1 = 2 (1 - 2 t) T_m - T_m-1."""
    cosine = Polynomial([1, -2])
    before, now, total = cosine, Polynomial([1]), Polynomial([])
    for m in range(max(abs(m) for m in waves) + 1):
        total = total + now * (waves.get(m, Fraction(0)) + (waves.get(-m, Fraction(0)) if m else 0))
        before, now = now, 2 * cosine * now - before
    return total

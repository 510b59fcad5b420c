"""Symbol of a linear scheme: rate of a wave on a uniform periodic grid, in exact arithmetic.

Advection u_t + a u_x = 0 of a quantity u at speed a, in cells of width dx, is computed as
du_j/dt = -(a / dx) (F_j - F_j-1). Face values are F_j = sum_k w_k u_j+k-2 with the weights w_0 .. w_4 of the scheme. A
wave u_j = exp(i j theta) changes by du/dt = (a / dx) z(theta) u; z is the symbol. Both Re z and |z|^2 are polynomials
in t = sin^2(theta / 2), from t = 0 (longest waves) to t = 1 (two cells a wave).
"""

from collections.abc import Sequence
from fractions import Fraction

import numpy as np

from fvsolve.core.schemes import LIMITED, LINEAR, Weights
from fvsolve.core.steppers.numbers.polynomial import Polynomial
from fvsolve.errors import FvsolveError, nearest

WEIGHTS: dict[str, Weights] = {name: scheme.weights for name, scheme in LINEAR.items()}


def weights_of(scheme: str) -> Weights:
    """Five weights of a linear scheme in the value at the outflow face of a cell.

    They belong to the cells from two upstream to two downstream of this cell. Raises FvsolveError for a nonlinear
    scheme and for an unknown name.
    """
    if scheme in WEIGHTS:
        return WEIGHTS[scheme]
    linear = ", ".join(WEIGHTS)
    if scheme in LIMITED:
        raise FvsolveError(
            f'scheme "{scheme}" is not linear and has no exact limit; linear schemes are {linear}'
        )
    near = nearest(scheme, [*WEIGHTS, *LIMITED])
    hint = f'did you mean "{near}"?' if near else f"linear schemes are {linear}"
    raise FvsolveError(f'no scheme named "{scheme}"; {hint}')


def symbol(weights: Sequence, theta) -> np.ndarray:
    """Symbol z(theta) of a scheme in floating point : complex array like theta.

    weights : weights of five cells in a face value; theta : phase of the wave per cell [rad], a number or an array
    """
    theta = np.asarray(theta, dtype=float)
    return sum(float(a) * np.exp(1j * m * theta) for m, a in _waves(weights).items())


def real_part(weights: Sequence) -> Polynomial:
    """Real part of the symbol z of a scheme, as a polynomial in t = sin^2(theta / 2)."""
    return _cosines(_waves(weights))


def square(weights: Sequence) -> Polynomial:
    """|z|^2 of the symbol z of a scheme, as a polynomial in t = sin^2(theta / 2)."""
    waves, product = _waves(weights), {}
    for m, x in waves.items():
        for n, y in waves.items():
            product[m - n] = product.get(m - n, Fraction(0)) + x * y
    return _cosines(product)


def _waves(weights: Sequence) -> dict[int, Fraction]:
    """Amplitudes of the symbol z = sum_m a_m exp(i m theta) of a scheme : {m: a_m}."""
    amplitudes: dict[int, Fraction] = {}
    for k, w in enumerate(weights, start=-2):
        amplitudes[k] = amplitudes.get(k, Fraction(0)) - w
        amplitudes[k - 1] = amplitudes.get(k - 1, Fraction(0)) + w
    return amplitudes


def _cosines(waves: dict[int, Fraction]) -> Polynomial:
    """Polynomial in t = sin^2(theta / 2) equal to sum_m a_m cos(m theta), with the amplitudes a_m in `waves`.

    The cosines follow from cos theta = 1 - 2 t by the recurrence T_m+1 = 2 (1 - 2 t) T_m - T_m-1.
    """
    cosine = Polynomial([1, -2])
    before = cosine
    now = Polynomial([1])
    total = Polynomial([])
    for m in range(max(abs(m) for m in waves) + 1):
        total = total + now * (waves.get(m, Fraction(0)) + (waves.get(-m, Fraction(0)) if m else 0))
        before, now = now, 2 * cosine * now - before
    return total

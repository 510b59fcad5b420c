"""Pressure at the end of a laminar or a creeping line after a stop, independent of fvsolve.exact.

The result is relative to Joukowsky's jump, for a flow from 1 to 0. Times are in travel times L / a.
Laminar flow: Zielke's sum over Bessel zeros and Euler summation. `number` is nu L / (a R^2). With s in this time and
u = s / number, the momentum balance is s M (1 + 8/u + 4 W(u)) = -p_x. W(u) is the sum of 1 / (u + j^2) over the zeros j
of J_2 (Zielke 1968).
Creeping wall: Laplace inversion with mpmath. The elements are pairs (G, tau) with G = c D rho a^2 J / e and tau in
travel times. The transform is tanh(s sqrt(C)) / (s sqrt(C)) with C = 1 + sum of G / (1 + tau s) (Covas et al. 2005).
"""

import functools

import mpmath
import numpy as np
from scipy.special import binom, jn_zeros

ZEROS = 1000


@functools.cache
def zeros() -> np.ndarray:
    return jn_zeros(2, ZEROS) ** 2


def inertia(u: np.ndarray) -> np.ndarray:
    """Factor 1 + 8/u + 4 W(u), with an integral for the sum over the zeros beyond the last, near (k + 3/4) pi."""
    root = np.sqrt(u)
    rest = np.arctan(root / ((ZEROS + 1.25) * np.pi)) / (np.pi * root)
    return 1.0 + 8.0 / u + 4.0 * ((1.0 / (u[..., None] + zeros())).sum(axis=-1) + rest)


def euler(transform, t: float, terms: int = 60) -> float:
    """f(t) from its transform by a Fourier series with Euler's binomial mean of the tail (Abate and Whitt 1995)."""
    a, more = 24.0, 14
    k = np.arange(terms + more + 1)
    s = (a + 2j * np.pi * k) / (2.0 * t)
    values = (-1.0) ** k * transform(s).real
    values[0] *= 0.5
    sums = np.cumsum(values)
    mean = np.sum(binom(more, np.arange(more + 1)) * 2.0**-more * sums[terms:])
    return float(np.exp(0.5 * a) / t * mean)


def laminar_jump(number: float, t: float) -> float:
    """Pressure at the end of a line whose flow stops at once at t = 0, away from the fronts at 2, 4, ... [-]."""
    total, k = 0.0, 0
    while 2.0 * k < t:
        late = t - 2.0 * k

        def passage(s, k=k):
            root = np.sqrt(inertia(s / number))
            share = 1.0 if k == 0 else 2.0 * (-1.0) ** k
            return share * root / s * np.exp(-2.0 * k * s * (root - 1.0))

        total += euler(passage, late)
        k += 1
    return total


def ninth(place: np.ndarray) -> np.ndarray:
    """Slope of the polynomial of degree nine from 0 to 1 with four zero derivatives at both ends."""
    return 630.0 * (place * (1.0 - place)) ** 4


def smooth(number: float, start: float, duration: float, t: float) -> float:
    """Pressure at the end of a line whose flow stops along the polynomial of `ninth`, as an integral over jumps [-]."""
    found, places, weights = 0.0, *np.polynomial.legendre.leggauss(36)
    fronts = [t - start - 2.0 * k for k in range(int(t / 2.0) + 1)]
    cuts = np.unique(
        np.clip([0.0, duration, *fronts, *[f - 0.02 * duration for f in fronts]], 0.0, duration)
    )
    for low, high in zip(cuts[:-1], cuts[1:], strict=True):
        v = 0.5 * (1.0 + places)  # denser nodes near `high`, where the age of a jump is small
        sigma, w = high - (high - low) * v**2, (high - low) * v * weights
        age = t - start - sigma
        here = age > 0.0
        found += sum(
            w_ * ninth(s_ / duration) / duration * laminar_jump(number, a_)
            for w_, s_, a_ in zip(w[here], sigma[here], age[here], strict=True)
        )
    return float(found)


def creep_jump(elements, t: float) -> float:
    """Pressure at the end of a line whose flow stops at once at t = 0, away from the fronts at 2, 4, ... [-]."""

    def passage(s, k):
        taken = sum((share / (1 + tau * s) for share, tau in elements), mpmath.mpf(0))
        root = mpmath.sqrt(1 + taken)
        return (1 if k == 0 else 2 * (-1) ** k) / (s * root) * mpmath.exp(-2 * k * s * (root - 1))

    late = [t - 2.0 * k for k in range(1 + int(t // 2))]
    return float(
        sum(
            mpmath.invertlaplace(lambda s, k=k: passage(s, k), one, method="dehoog")
            for k, one in enumerate(late)
            if one > 0.0
        )
    )

"""Pressure at the end of a line with a creeping wall after an instantaneous stop, by Laplace inversion with mpmath.

The result is relative to Joukowsky's jump and independent of fvsolve.exact. Times are in travel times L / a. The
elements are pairs (G, tau) with G = c D rho a^2 J / e and tau in travel times. The transform is
tanh(s sqrt(C)) / (s sqrt(C)) with C = 1 + sum of G / (1 + tau s) (Covas et al. 2005).
"""

from __future__ import annotations

import mpmath


def jump(elements, t: float) -> float:
    """Pressure at the end of a line whose flow stops at once at t = 0, away from the fronts at 2, 4, ... [-]."""

    def passage(s, k):
        taken = sum((share / (1 + tau * s) for share, tau in elements), mpmath.mpf(0))
        root = mpmath.sqrt(1 + taken)
        return (1 if k == 0 else 2 * (-1) ** k) / (s * root) * mpmath.exp(-2 * k * s * (root - 1))

    late = [t - 2.0 * k for k in range(1 + int(t // 2))]
    return float(sum(mpmath.invertlaplace(lambda s, k=k: passage(s, k), one, method="dehoog")
                     for k, one in enumerate(late) if one > 0.0))  # fmt: skip

"""A line whose wall creeps and whose flow stops at once, by another road than fvsolve.exact: mpmath inverts it whole.

Pressure at the shut end over that of Joukowsky; time in travel times L / a; elements (G, tau) of G = c D rho a^2 J / e
and tau to that time: the transform is tanh(s sqrt(C)) / (s sqrt(C)), C = 1 + sum of G / (1 + tau s), Covas et al. 2005.
"""

from __future__ import annotations

import mpmath


def jump(elements, t: float) -> float:
    """Pressure at the end of a line whose flow stops at once at t = 0, away from the fronts at 2, 4, ..."""

    def passage(s, k):
        taken = sum((share / (1 + tau * s) for share, tau in elements), mpmath.mpf(0))
        root = mpmath.sqrt(1 + taken)
        return (1 if k == 0 else 2 * (-1) ** k) / (s * root) * mpmath.exp(-2 * k * s * (root - 1))

    late = [t - 2.0 * k for k in range(1 + int(t // 2))]
    return float(sum(mpmath.invertlaplace(lambda s, k=k: passage(s, k), one, method="dehoog")
                     for k, one in enumerate(late) if one > 0.0))  # fmt: skip

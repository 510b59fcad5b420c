"""Courant limit of waves and of advection on a uniform grid in the plane (von Neumann).

Waves of pressure p and velocities u, v have the speed c; each direction is split into its characteristics. The symbol
of the scheme at the phase theta per cell is z(theta) = a + i b. The wave rate is c / dx + c / dy; its fractions in x
and y are w_x and w_y. For a wave with the phases (theta_x, theta_y) per cell, the rate of change of (p, u, v) is the
wave rate times M (p, u, v), with

    M = [ w_x a_x + w_y a_y   i w_x b_x   i w_y b_y ]
        [ i w_x b_x           w_x a_x     0         ]
        [ i w_y b_y           0           w_y a_y   ]

An advected quantity has the single eigenvalue w_x z(theta_x) + w_y z(theta_y) in place of M. Growth of a single wave
proves that a Courant number is unstable, so growth above the computed limit is proved. Below the limit, phases between
the tested phases are not covered.
"""

from __future__ import annotations

import functools

import numpy as np

from fvsolve.step_limits.symbol import symbol, weights_of
from fvsolve.steppers.analysis.stability_function import stability_function
from fvsolve.steppers.tableau import method_named

PHASES = 33  # number of phases from 0 to pi in x; with the same spacing from -pi to pi in y
GROWTH = 1e-9  # |R| - 1 above which a wave counts as growing
MOST, HALVINGS = 64.0, 40
FINE = 1001  # phases along a line
MARGIN = 1.01  # margin of the Courant number: a step stable with it needs no further check


@functools.lru_cache(maxsize=64)
def plane_limit(scheme: str, method: str, share: float, waves: bool = True) -> float:
    """Greatest Courant number, step times wave rate, up to which no wave grows; 0 if waves always grow.

    share : part of x in the wave rate c / dx + c / dy, with the wave speed c, between 0 and 1
    waves : True for waves of pressure and velocity, False for advection
    Raises FvsolveError for a nonlinear scheme.
    """
    z = plane_eigenvalues(scheme, share, waves)

    def holds(courant: float) -> bool:
        return not is_unstable(z, method, courant)

    low, high = 0.0, 1.0 / 64.0
    while high <= MOST and holds(high):
        low, high = high, 2.0 * high
    if low == 0.0:
        return 0.0
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


@functools.lru_cache(maxsize=1024)
def is_stable_with_margin(scheme: str, method: str, courant: float, share: float = 1.0, waves: bool = False) -> bool:
    """True if no tested wave grows at a Courant number, nor at a Courant number 1 % greater.

    Arguments are as for `plane_limit`; with share = 1 and no waves it is advection along a line.
    """
    if share == 1.0 and not waves:
        z = symbol(weights_of(scheme), np.linspace(0.0, np.pi, FINE))
    else:
        z = plane_eigenvalues(scheme, share, waves)
    return not is_unstable(z, method, courant) and not is_unstable(z, method, courant * MARGIN)


def is_unstable(z: np.ndarray, method: str, courant: float) -> bool:
    """True if a wave grows in a step at a Courant number; z : eigenvalues for a wave rate of 1."""
    return bool(np.abs(stability_function(method_named(method))(courant * z)).max() > 1.0 + GROWTH)


def plane_eigenvalues(scheme: str, share: float, waves: bool) -> np.ndarray:
    """Eigenvalues of the waves (or of advection) for all tested pairs of phases in x and y, for a wave rate of 1.

    scheme, share, waves : as for `plane_limit`
    Returns complex128[phases in y, phases in x], with a last axis of length 3 for waves.
    """
    weights = weights_of(scheme)
    x, y = np.meshgrid(np.linspace(0.0, np.pi, PHASES), np.linspace(-np.pi, np.pi, 2 * PHASES - 1))
    zx, zy = share * symbol(weights, x), (1.0 - share) * symbol(weights, y)
    if not waves:
        return zx + zy
    m = np.zeros((*zx.shape, 3, 3), dtype=complex)
    m[..., 0, 0], m[..., 1, 1], m[..., 2, 2] = zx.real + zy.real, zx.real, zy.real
    m[..., 0, 1] = m[..., 1, 0] = 1j * zx.imag
    m[..., 0, 2] = m[..., 2, 0] = 1j * zy.imag
    return np.linalg.eigvals(m)

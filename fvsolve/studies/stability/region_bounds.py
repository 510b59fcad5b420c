"""Bounds on the greatest stable step, from eigenvalues and from the field of values of the Jacobian."""

from __future__ import annotations

import numpy as np

from fvsolve.steppers import analyse
from fvsolve.steppers.tableau import Method
from fvsolve.studies.linear.eigenvalues import ZERO_TOLERANCE
from fvsolve.studies.stability.bisection import bisect_limit

MODULUS_MARGIN = 1e-9  # |R| may exceed 1 by this: round-off of eigenvalues
POINTS_PER_SIDE = 8  # points along each side of the polygon inscribed in a field of values
TANGENTS = 49  # tangents to a field of values in the upper half plane
MAX_STATES = 400  # greatest number of states for which a field of values is computed
MAX_HS = 1e5  # greatest h |s| of the search


def region_limit(method: Method, points: np.ndarray) -> float:
    """Greatest step h [s] for which all points s [1/s] times any shorter step are in the stability region.

    The result is 0 if there is no such step, inf if all steps are possible. Points within 1e-10 of the imaginary axis
    (round-off, relative to the greatest |s|) are moved onto it, and points within 1e-10 of 0 are left out. Points to
    the right of the axis allow no step.
    """
    size = np.max(np.abs(points), initial=0.0)
    points = points[np.abs(points) > ZERO_TOLERANCE * size]
    if size == 0.0 or not points.size:
        return np.inf
    on_axis = np.abs(points.real) <= ZERO_TOLERANCE * size
    facts = analyse(method)
    if np.any(points.real[~on_axis] > 0.0) or (np.any(on_axis) and facts.imaginary_interval == 0.0):
        return 0.0
    if facts.a_stable:
        return np.inf
    points = np.where(on_axis, 1j * points.imag, points)
    r = facts.stability_function

    def outside(h: float) -> bool:
        with np.errstate(all="ignore"):
            return not bool(np.all(np.abs(r(h * points)) <= 1.0 + MODULUS_MARGIN))

    return bisect_limit(outside, 0.05 / size, MAX_HS / size, rise=1.02, fine=1e-7).step


def field_of_values(e: np.ndarray) -> np.ndarray:
    """Points on a polygon inscribed in the field of values of the real matrix E : complex[m].

    The field of values is the set of all x* E x with |x| = 1. Its tangent at an angle touches it at x* E x, where x is
    the eigenvector of the greatest eigenvalue of the Hermitian part of exp(-i angle) E (Johnson 1978). The lower half
    mirrors the upper half.
    """
    from scipy.linalg import eigh

    n = e.shape[0]
    points = []
    for angle in np.linspace(0.0, np.pi, TANGENTS):
        rotated = np.exp(-1j * angle) * e
        x = eigh(0.5 * (rotated + rotated.conj().T), subset_by_index=[n - 1, n - 1], check_finite=False)[1][:, 0]
        points.append(np.vdot(x, e @ x))
    upper = np.array(points)
    corners = np.concatenate([upper, upper[::-1].conj()])
    share = np.arange(POINTS_PER_SIDE) / POINTS_PER_SIDE
    return np.concatenate([a + (b - a) * share for a, b in zip(corners, np.roll(corners, -1), strict=True)])


def numerical_abscissa(e: np.ndarray) -> float:
    """Greatest initial growth rate [1/s] of the norm of x under x' = E x: the greatest Re x* E x with |x| = 1."""
    from scipy.linalg import eigh

    n = e.shape[0]
    return float(eigh(0.5 * (e + e.T), eigvals_only=True, subset_by_index=[n - 1, n - 1], check_finite=False)[0])

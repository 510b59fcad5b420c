"""What eigenvalues and the field of values say of the greatest step (13). Knows matrices; knows no case."""

from __future__ import annotations

import numpy as np

from fvsolve.steppers import analyse
from fvsolve.steppers.tableau import Method
from fvsolve.studies.linear.spectrum import ZERO
from fvsolve.studies.stability.bracket import limit

ON = 1e-9  # |R| may exceed one by this much: round-off of the eigenvalues
SIDE = 8  # points along each side of the polygon inscribed in a field of values
ANGLES = 49  # of its tangents in the upper half plane
WIDE = 400  # states up to which a field of values is computed
FAR = 1e5  # of h |s|, up to which an end is looked for


def region_limit(method: Method, points: np.ndarray) -> float:
    """The greatest h with |R(h' s)| <= 1 for all the points s and all h' <= h; 0 where none, inf where all [s].

    Points that round-off leaves within 1e-10 of the imaginary axis lie on it; points right of it allow no step.
    """
    size = np.max(np.abs(points), initial=0.0)
    points = points[np.abs(points) > ZERO * size]
    if size == 0.0 or not points.size:
        return np.inf
    on_axis = np.abs(points.real) <= ZERO * size
    facts = analyse(method)
    if np.any(points.real[~on_axis] > 0.0) or (np.any(on_axis) and facts.imaginary_interval == 0.0):
        return 0.0
    if facts.a_stable:
        return np.inf
    points = np.where(on_axis, 1j * points.imag, points)
    r = facts.stability_function

    def outside(h: float) -> bool:
        with np.errstate(all="ignore"):
            return not bool(np.all(np.abs(r(h * points)) <= 1.0 + ON))

    return limit(outside, 0.05 / size, FAR / size, rise=1.02, fine=1e-7).step


def field_of_values(e: np.ndarray) -> np.ndarray:
    """Points of the boundary of {x* E x : |x| = 1} : complex[m], sides of an inscribed polygon included.

    Each angle's tangent touches at x* E x, x the top eigenvector of the Hermitian part of exp(i angle) E (Johnson
    1978); E is real, so the upper half is mirrored.
    """
    from scipy.linalg import eigh

    n = e.shape[0]
    found = []
    for angle in np.linspace(0.0, np.pi, ANGLES):
        turned = np.exp(-1j * angle) * e
        x = eigh(0.5 * (turned + turned.conj().T), subset_by_index=[n - 1, n - 1], check_finite=False)[1][:, 0]
        found.append(np.vdot(x, e @ x))
    upper = np.array(found)
    corners = np.concatenate([upper, upper[::-1].conj()])
    share = np.arange(SIDE) / SIDE
    return np.concatenate([a + (b - a) * share for a, b in zip(corners, np.roll(corners, -1), strict=True)])


def numerical_abscissa(e: np.ndarray) -> float:
    """The greatest Re x* E x: how fast energy can grow at first [1/s]."""
    from scipy.linalg import eigh

    n = e.shape[0]
    return float(eigh(0.5 * (e + e.T), eigvals_only=True, subset_by_index=[n - 1, n - 1], check_finite=False)[0])

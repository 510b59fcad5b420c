"""A method's Butcher array as the compiled steps read it: one flat array. Knows no time loop.

[A (s x s), b, c, error] and, for implicit methods, what their Newton iterations need (`newton.py`, `irk.py`).
An implicit method gets the derivative at the start of the step as a first stage of weight zero, where it has none.
"""

from __future__ import annotations

import functools

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.jit import njit
from fvsolve.steppers.tableau import Method
from fvsolve.steppers.transform import transformed


@functools.cache
def coefficients(method: Method, damped: bool = False) -> tuple[np.ndarray, np.ndarray, int]:
    """(flat coefficients, dense output : float64[s, d], stages s), the start as an explicit stage included.

    damped : for `semi_implicit`, which keeps rates at the start beside those of its first stage
    """
    if method.kind == "linear":
        return method.coefficients
    a, b, c, dense = method.a, method.b, method.c, method.dense
    error = method.error if method.adaptive else np.zeros(len(b))
    if a[0].any() or c[0] != 0.0 or damped:
        a = np.block([[0.0, np.zeros(len(b))], [np.zeros((len(b), 1)), a]])
        b, c, error = (np.concatenate(([x], part)) for x, part in ((0.0, b), (0.0, c), (method.start_error, error)))
        dense = np.vstack([np.zeros((1, dense.shape[1])), dense]) if dense.size else dense
    flat = [a.ravel(), b, c, error]
    if method.kind == "full":
        try:
            flat.append(transformed(a[1:, 1:], c[1:], a[1:, 0]))
        except (np.linalg.LinAlgError, ValueError):
            raise FvsolveError(f"{method.name} cannot be stepped: A, less an explicit first stage, has no inverse with "
                               "a basis of eigenvectors; diagonally implicit arrays need none") from None  # fmt: skip
    flat.append(bent(method))
    flat.append([flat[-1].size])
    return np.concatenate(flat), np.ascontiguousarray(dense), len(b)


def bent(method: Method) -> np.ndarray:
    """[weights of the stages in p'(0), psi] of a collocation polynomial p that ends in a stage; empty for others.

    p + h psi(theta) (f - p'(0)), psi = int prod (x - c_i) / prod (-c_i), has the slope f at the start, of which p says
    nothing, the same slopes at the stages, and, as psi(1) = 0 from two stages on, the same end: one order more.
    """
    c, dense = method.c, method.dense
    if method.kind != "full" or not dense.size or not method.stiffly_accurate or c[0] == 0.0:
        return np.zeros(0)
    psi = np.poly(c)[::-1] / np.prod(-c) / np.arange(1.0, c.size + 2.0)
    return np.concatenate([dense[:, 0], psi])


@njit(inline="always")
def bend_of(coefficients, s):
    """What `bent` gives."""
    last = coefficients.size - 1
    return coefficients[last - int(coefficients[last]) : last]


@njit(inline="always")
def row_of(coefficients, s, i):
    """Row i of A."""
    return coefficients[i * s : (i + 1) * s]


@njit(inline="always")
def weights_of(coefficients, s):
    """b."""
    return coefficients[s * s : s * s + s]


@njit(inline="always")
def nodes_of(coefficients, s):
    """c."""
    return coefficients[s * s + s : s * s + 2 * s]


@njit(inline="always")
def error_of(coefficients, s):
    """Weights of the error estimate; zeros where there is none."""
    return coefficients[s * s + 2 * s : s * s + 3 * s]

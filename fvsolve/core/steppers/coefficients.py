"""Butcher array of a method as one flat array that the compiled steps read.

The array holds A (s x s), b, c and the weights of the error estimate, for s stages. For fully implicit methods the data
of their Newton iterations follow (`transformed`), and last the result of `start_slope_correction` and its
length. If the first stage of an implicit method is not the rate f at the start of the step, this rate is an extra
first stage with weight zero.
"""

import functools

import numpy as np

from fvsolve.core.steppers.tableau import Method
from fvsolve.errors import FvsolveError
from fvsolve.jit import njit


@functools.cache
def coefficients(method: Method, damped: bool = False) -> tuple[np.ndarray, np.ndarray, int]:
    """(flat coefficients of a method, coefficients of its dense output : float64[s, d], number of stages s).

    The flat coefficients are listed at the top of this file, those of Rosenbrock methods in `Rosenbrock.coefficients`.
    The stages include the start of the step as an explicit stage where the method is implicit.
    damped : True for `erk.damped_attempt`, which stores the rates at the start in addition to those of its first stage.
    Raises FvsolveError if A of a fully implicit method is singular or has no basis of eigenvectors; an explicit first
    stage is left out of A.
    """
    if method.kind == "linear":
        return method.coefficients
    a = method.a
    b = method.b
    c = method.c
    dense = method.dense
    error = method.error if method.adaptive else np.zeros(len(b))
    # Steps begin with f at their start: other methods receive it as a further stage of weight 0.
    if a[0].any() or c[0] != 0.0 or damped:
        a = np.block([[0.0, np.zeros(len(b))], [np.zeros((len(b), 1)), a]])
        b, c, error = (
            np.concatenate(([x], part))
            for x, part in ((0.0, b), (0.0, c), (method.start_error, error))
        )
        dense = np.vstack([np.zeros((1, dense.shape[1])), dense]) if dense.size else dense
    flat = [a.ravel(), b, c, error]
    if method.kind == "full":
        try:
            flat.append(transformed(a[1:, 1:], c[1:], a[1:, 0]))
        except (np.linalg.LinAlgError, ValueError):
            raise FvsolveError(
                f"{method.name} cannot be used for steps: A without its explicit first stage is singular or has no "
                "basis of eigenvectors; expected an invertible, diagonalisable A, or a diagonally implicit array"
            ) from None
    flat.append(start_slope_correction(method))
    flat.append([flat[-1].size])
    return np.concatenate(flat), np.ascontiguousarray(dense), len(b)


def start_slope_correction(method: Method) -> np.ndarray:
    """Correction of the dense output of a collocation method whose last stage is the end of the step.

    The collocation polynomial p(theta) does not have the slope f of the solution at the start. The polynomial
    p + h psi(theta) (f - p'(0)) has this slope, with the nodes c_i and psi = integral from 0 to theta of
    prod (x - c_i) / prod (-c_i). It has the same slopes at the stages, and its order is one higher. For two or more
    Radau nodes it has the same end, as psi(1) = 0.
    Returns the weights of the stages in p'(0), then the coefficients of psi; an empty array for other methods.
    """
    c, dense = method.c, method.dense
    if method.kind != "full" or not dense.size or not method.stiffly_accurate or c[0] == 0.0:
        return np.zeros(0)
    psi = np.poly(c)[::-1] / np.prod(-c) / np.arange(1.0, c.size + 2.0)
    return np.concatenate([dense[:, 0], psi])


@njit(inline="always")
def start_slope_of(coefficients, s):
    """Read the result of `start_slope_correction` from the flat coefficients."""
    last = coefficients.size - 1
    return coefficients[last - int(coefficients[last]) : last]


@njit(inline="always")
def row_of(coefficients, s, i):
    """Row i of the matrix A of a method with s stages, in its flat coefficients."""
    return coefficients[i * s : (i + 1) * s]


@njit(inline="always")
def weights_of(coefficients, s):
    """Weights b of the stages of a method, in its flat coefficients."""
    return coefficients[s * s : s * s + s]


@njit(inline="always")
def nodes_of(coefficients, s):
    """Nodes c (times of the stages, in steps) of a method, in its flat coefficients."""
    return coefficients[s * s + s : s * s + 2 * s]


@njit(inline="always")
def error_of(coefficients, s):
    """Weights of the stages in the error estimate of a method, in its flat coefficients; zeros without an estimate."""
    return coefficients[s * s + 2 * s : s * s + 3 * s]


def transformed(a: np.ndarray, c: np.ndarray, a0: np.ndarray) -> np.ndarray:
    """Matrices T, T^-1, L, T L, P, C, T^-1 A^-1 a0, A^-1 a0 by rows in one flat array, for `irk`.

    a : float64[q, q]  coefficients A of the implicit stages; c : their times
    a0 : float64[q]  weights of the explicit first stage in these stages
    A^-1 = T L T^-1; a complex pair of eigenvalues is a block [[a, -b], [b, a]] of L with b > 0. C : see `lower`.
    P extrapolates the slopes of the last step to this step: the sum of P[j, d] x^(d+1) is the integral from 1 to 1 + x
    of the j-th Lagrange polynomial on c; zero if c has equal entries.
    Raises LinAlgError for a singular A, ValueError for an A without a basis of eigenvectors.
    """
    q = len(c)
    inverse = np.linalg.inv(a)
    values, vectors = np.linalg.eig(inverse)
    t, blocks = np.zeros((q, q)), np.zeros((q, q))
    real = np.abs(values.imag) <= 1e-12 * np.abs(values)
    at = 0
    # Real eigenvalues first: error estimates use the first block as a real shift.
    for i in [*np.flatnonzero(real), *np.flatnonzero(~real & (values.imag > 0))]:
        v = vectors[:, i] / np.abs(vectors[:, i]).max()
        if real[i]:
            t[:, at], blocks[at, at], at = v.real, values[i].real, at + 1
        else:  # A^-1 (u - i w) = (a + i b) (u - i w): in the basis u, w A^-1 is [[a, -b], [b, a]]
            t[:, at], t[:, at + 1] = v.real, -v.imag
            blocks[at : at + 2, at : at + 2] = [
                [values[i].real, -values[i].imag],
                [values[i].imag, values[i].real],
            ]
            at += 2
    # A basis that is nearly singular would amplify rounding.
    if at < q or np.linalg.cond(t) > 1e8:
        raise ValueError("no basis of eigenvectors")
    back, ahead = np.linalg.inv(t), np.zeros((q, q))
    # Equal nodes have no Lagrange polynomials; then the prediction is zero.
    if len(np.unique(c)) == q:
        lagrange = np.linalg.inv(np.vander(c - 1.0, increasing=True))  # in x, by columns
        ahead = (lagrange / (1.0 + np.arange(q))[:, None]).T
    parts = (t, back, blocks, t @ blocks, ahead, lower(a), back @ inverse @ a0, inverse @ a0)
    return np.concatenate([part.ravel() for part in parts])


def lower(a: np.ndarray) -> np.ndarray:
    """Lower triangular factor C of the matrix A = C U, with unit diagonal of U (Crout) : float64[q, q].

    It can be used only if its diagonal has no zero.
    """
    rest, c = a.copy(), np.zeros_like(a)
    for j in range(len(a)):
        c[j:, j] = rest[j:, j]
        if rest[j, j] != 0.0:
            rest -= np.outer(rest[:, j], rest[j]) / rest[j, j]
    return c

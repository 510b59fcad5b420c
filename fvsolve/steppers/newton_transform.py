"""Matrices for Newton iterations on the stages of a fully implicit method, computed from its Butcher array."""

from __future__ import annotations

import numpy as np


def transformed(a: np.ndarray, c: np.ndarray, a0: np.ndarray) -> np.ndarray:
    """Matrices T, T^-1, L, T L, P, C, T^-1 A^-1 a0, A^-1 a0 by rows in one flat array, for `irk` and `stage_sweeps`.

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
    for i in [*np.flatnonzero(real), *np.flatnonzero(~real & (values.imag > 0))]:
        v = vectors[:, i] / np.abs(vectors[:, i]).max()
        if real[i]:
            t[:, at], blocks[at, at], at = v.real, values[i].real, at + 1
        else:  # A^-1 (u - i w) = (a + i b) (u - i w): in the basis u, w A^-1 is [[a, -b], [b, a]]
            t[:, at], t[:, at + 1] = v.real, -v.imag
            blocks[at : at + 2, at : at + 2] = [[values[i].real, -values[i].imag], [values[i].imag, values[i].real]]
            at += 2
    if at < q or np.linalg.cond(t) > 1e8:
        raise ValueError("no basis of eigenvectors")
    back, ahead = np.linalg.inv(t), np.zeros((q, q))
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

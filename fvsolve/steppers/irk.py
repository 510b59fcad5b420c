"""One fully implicit Runge-Kutta step, all stages at once by simplified Newton. Knows arrays; controls nothing.

With Z the increments of the q stages and K = (h A)^-1 Z their slopes, Newton solves ((h A)^-1 x I - I x J) dZ = F - K.
A^-1 = T L T^-1 with L block upper triangular (Butcher 1976; Hairer and Wanner 1996, IV.8): a real shift for every
real eigenvalue, a complex one for every pair.
"""

from __future__ import annotations

import numpy as np

from fvsolve.jit import njit
from fvsolve.steppers.coefficients import error_of, nodes_of, row_of, weights_of
from fvsolve.steppers.newton import (
    CONVERGED,
    FAILED,
    HAS,
    JACOBIAN,
    KNOWN,
    MADE,
    MOST,
    SHIFT,
    begin,
    book_increment,
    increment_size,
    part,
    renew,
    store_of,
    verdict,
)
from fvsolve.steppers.orders import (
    CALLS,
    CONTROL,
    FACTORS,
    LAST,
    NEWTON,
    NEWTON_FAILED,
    SIZE,
    STEPS,
    TOLERANCE,
)
from fvsolve.steppers.step import combine, error_norm
from fvsolve.steppers.structure import SIZE as STATES
from fvsolve.steppers.structure import STARTS


def transformed(a: np.ndarray, c: np.ndarray) -> np.ndarray:
    """[T, T^-1, L, A^-1, P], each q x q and flat, for the implicit stages: A : float64[q, q], c : float64[q].

    Pairs in L stand as [[a, -b], [b, a]]. P[j, d] : the integral from 1 to 1 + x of the j-th Lagrange polynomial on c
    is the sum of P[j, d] x^(d+1): what the last step's slopes say of this step; zero where c repeats.
    """
    from scipy.linalg import schur

    q = len(c)
    inverse = np.linalg.inv(a)
    blocks, t = schur(inverse, output="real")
    for i in range(q - 1):
        if blocks[i + 1, i] != 0.0:
            ratio = np.sqrt(-blocks[i + 1, i] / blocks[i, i + 1])  # second vector of the pair, stretched
            blocks[i + 1, :], blocks[:, i + 1] = blocks[i + 1, :] / ratio, blocks[:, i + 1] * ratio
            t[:, i + 1] *= ratio
            if blocks[i + 1, i] < 0.0:
                blocks[i + 1, :], blocks[:, i + 1] = -blocks[i + 1, :], -blocks[:, i + 1]
                t[:, i + 1] *= -1.0
    ahead = np.zeros((q, q))
    if len(np.unique(c)) == q:
        shifted = np.linalg.inv(np.vander(c - 1.0, increasing=True))  # Lagrange polynomials in x, by columns
        ahead = (shifted / (1.0 + np.arange(q))[:, None]).T
    return np.concatenate([part.ravel() for part in (t, np.linalg.inv(t), blocks, inverse, ahead)])


def pairs_of(coefficients: np.ndarray, s: int) -> int:
    """Number of complex pairs among the eigenvalues of A^-1."""
    q = s - 1
    blocks = coefficients[s * s + 3 * s + 2 * q * q :][: q * q].reshape(q, q)
    return int(np.count_nonzero(np.tril(blocks, -1)))


@njit(inline="always")
def matrix(coefficients, s, which):
    """One of the matrices of `transformed`, flat."""
    q = s - 1
    at = s * s + 3 * s + which * q * q
    return coefficients[at : at + q * q]


@njit
def predict(coefficients, c, h, h_last, last, n, z):
    """z <- increments that the last step's slopes promise for the stages of a step of h."""
    q, p = c.size - 1, matrix(coefficients, c.size, 4)
    for i in range(q):
        x = c[i + 1] * h / h_last
        zi = z[i * n : i * n + n]
        for e in range(n):
            zi[e] = 0.0
        for j in range(q):
            w = 0.0
            for d in range(q - 1, -1, -1):
                w = (w + p[j * q + d]) * x
            kj = last[(j + 1) * n : (j + 2) * n]
            for e in range(n):
                zi[e] += h_last * w * kj[e]


@njit
def mix(m, q, factor, n, source, target):
    """target_i = factor sum of m_ij source_j, over stages; vectors of n behind one another."""
    for i in range(q):
        to = target[i * n : i * n + n]
        for e in range(n):
            to[e] = 0.0
        for j in range(q):
            w, of = factor * m[i * q + j], source[j * n : j * n + n]
            if w != 0.0:
                for e in range(n):
                    to[e] += w * of[e]


@njit
def factor_blocks(factor, factor_complex, shape, coefficients, s, h, jacobian, size, store, store_complex, memory):
    """Factors for every block of L / h, real ones and complex ones behind one another; False without a pivot."""
    q, blocks = s - 1, matrix(coefficients, s, 2)
    b, reals, pairs = 0, 0, 0
    while b < q:
        shift = blocks[b * q + b] / h
        memory[FACTORS] += 1.0
        if b + 1 < q and blocks[(b + 1) * q + b] != 0.0:
            at = store_complex[pairs * size : (pairs + 1) * size]
            if factor_complex(shape, jacobian, complex(shift, blocks[(b + 1) * q + b] / h), at) != 0:
                return False
            b, pairs = b + 2, pairs + 1
        else:
            if factor(shape, jacobian, shift, store[reals * size : (reals + 1) * size]) != 0:
                return False
            b, reals = b + 1, reals + 1
    return True


@njit
def solve_blocks(solve, solve_complex, shape, coefficients, s, h, n, size, store, store_complex, w, pair):
    """w <- (L / h x I - I x J)^-1 w, from the last block up."""
    q, blocks = s - 1, matrix(coefficients, s, 2)
    reals, pairs = 0, 0
    for b in range(q - 1):
        pairs += 1 if blocks[(b + 1) * q + b] != 0.0 else 0
    reals = q - 2 * pairs
    b = q - 1
    while b >= 0:
        wide = 2 if b > 0 and blocks[b * q + b - 1] != 0.0 else 1
        for i in range(b - wide + 1, b + 1):
            wi = w[i * n : i * n + n]
            for j in range(b + 1, q):
                link = blocks[i * q + j] / h
                if link != 0.0:
                    wj = w[j * n : j * n + n]
                    for e in range(n):
                        wi[e] -= link * wj[e]
        if wide == 2:
            pairs -= 1
            for e in range(n):
                pair[e] = complex(w[(b - 1) * n + e], w[b * n + e])
            solve_complex(shape, store_complex[pairs * size : (pairs + 1) * size], pair)
            for e in range(n):
                w[(b - 1) * n + e], w[b * n + e] = pair[e].real, pair[e].imag
        else:
            reals -= 1
            solve(shape, store[reals * size : (reals + 1) * size], w[b * n : b * n + n])
        b -= wide


@njit
def iterate(
    rhs, solve, solve_complex, handle, coefficients, shape, t, h, y, y_stage, k, supply, where, out, orders, memory,
    nnz, size, work, store, work_complex, z, w,
):  # fmt: skip
    """Newton on all stages; returns CONVERGED or FAILED. Slopes stay (h A)^-1 z: F + J dz of the last iteration."""
    s, n = k.shape
    q, c, weights, f = s - 1, nodes_of(coefficients, s), part(work, 1, n), part(work, 3, n)
    pair, before, why = work_complex[:n], 0.0, FAILED
    for turn in range(MOST):
        for i in range(q):
            for e in range(n):
                y_stage[e] = y[e] + z[i * n + e]
            rhs(t + c[i + 1] * h, y_stage, f, out, handle)
            for m in range(supply.shape[1]):
                supply[i + 1, m] = out[where + m]
            for e in range(n):
                f[e] -= k[i + 1, e]
            put(matrix(coefficients, s, 1), q, i, n, f, w)
        memory[CALLS] += q
        memory[NEWTON] += 1.0
        solve_blocks(solve, solve_complex, shape, coefficients, s, h, n, size, store, work_complex[n:], w, pair)
        dz = part(work, 6, q * n)
        mix(matrix(coefficients, s, 0), q, 1.0, n, w, dz)
        for i in range(q):
            for e in range(n):
                z[i * n + e] += dz[i * n + e]
        add_slopes(matrix(coefficients, s, 3), q, 1.0 / h, n, dz, k)
        length = increment_size(dz, weights, memory)
        done, why = verdict(turn, length, before, orders, work)
        before = length
        if done:
            break
    if why == CONVERGED:
        for i in range(q):
            book_increment(shape, nnz, dz[i * n : i * n + n], supply, i + 1, work)
    return why


@njit
def put(m, q, j, n, f, w):
    """w_i += m_ij f over stages i; the first column writes."""
    for i in range(q):
        to, c = w[i * n : i * n + n], m[i * q + j]
        if j == 0:
            for e in range(n):
                to[e] = c * f[e]
        else:
            for e in range(n):
                to[e] += c * f[e]


@njit
def add_slopes(m, q, factor, n, dz, k):
    """k_{i+1} += factor sum of m_ij dz_j."""
    for i in range(q):
        to = k[i + 1]
        for j in range(q):
            w, of = factor * m[i * q + j], dz[j * n : j * n + n]
            for e in range(n):
                to[e] += w * of[e]


@njit
def slopes(coefficients, s, h, n, z, k):
    """k <- (h A)^-1 (z - h a_0 k_0), a_0 the weights of an explicit first stage."""
    q, inverse = s - 1, matrix(coefficients, s, 3)
    for i in range(q):
        for e in range(n):
            k[i + 1, e] = 0.0
        start = 0.0
        for j in range(q):
            start += inverse[i * q + j] * row_of(coefficients, s, j + 1)[0]
        if start != 0.0:
            for e in range(n):
                k[i + 1, e] = -start * k[0, e]
    add_slopes(inverse, q, 1.0 / h, n, z, k)


@njit
def filtered_error(
    rhs, solve, handle, shape, coefficients, t, h, y, now, new, k, out, scale, orders, memory, size, work, store
):
    """The embedded solution's difference, smoothed by the first real factor; once more from there if it is great.

    e = (I - h g J)^-1 h (e_0 f(t, y) + sum of e_i k_i), 1 / g the real eigenvalue of A^-1 (Hairer and Wanner IV.8).
    """
    s, n = k.shape
    error, d, f = error_of(coefficients, s), part(work, 0, n), part(work, 3, n)
    q, blocks = s - 1, matrix(coefficients, s, 2)
    shift = 0.0
    for b in range(q):
        if (b == 0 or blocks[b * q + b - 1] == 0.0) and (b == q - 1 or blocks[(b + 1) * q + b] == 0.0):
            shift = blocks[b * q + b] / h
            break
    found = 0.0
    for turn in range(2):
        for e in range(n):
            total = error[0] * (f[e] if turn == 1 else k[0, e])
            for j in range(1, s):
                total += error[j] * k[j, e]
            d[e] = total * h * shift
        solve(shape, store[:size], d)
        total = 0.0
        for e in range(n):
            w = d[e] / (orders[SIZE] * (scale[e] + max(abs(y[now, e]), abs(y[new, e]))))
            total += w * w
        found = np.sqrt(total / n)
        if found < 1.0 or turn == 1:
            break
        for e in range(n):
            y[3, e] = y[now, e] + d[e]
        rhs(t, y[3], f, out, handle)
        memory[CALLS] += 1.0
    return found


@njit
def attempt(
    rhs, factor, solve, factor_complex, solve_complex, handle, coefficients, shape, t, h, y, now, new, k, supply,
    where, out, scale, orders, memory, work, work_complex,
):  # fmt: skip
    """y[new] and the stages k from y[now] and k[0] = f(t, y[now]); returns the error in units of the tolerance.

    Returns NEWTON_FAILED where a fresh Jacobian does not help.
    """
    s, n = k.shape
    nnz = shape[shape[STARTS] + shape[STATES]]
    c, q, shift = nodes_of(coefficients, s), s - 1, 1.0 / h
    begin(k, y[now], scale, orders, memory, nnz, work)
    store, size = store_of(work)
    z, w = part(work, 5, q * n), part(work, 8, q * n)
    last = work[JACOBIAN + nnz : JACOBIAN + nnz + s * n]
    while True:
        if work[HAS] == 0.0:
            renew(rhs, handle, shape, where, t, y[now], k, supply, scale, out, memory, nnz, work)
        why = FAILED
        if work[SHIFT] == shift or factor_blocks(
            factor, factor_complex, shape, coefficients, s, h, work[JACOBIAN : JACOBIAN + nnz], size, store,
            work_complex[n:], memory,
        ):  # fmt: skip
            work[SHIFT] = shift
            if work[KNOWN] == 1.0:
                predict(coefficients, c, h, memory[LAST], last, n, z)
            else:
                for e in range(q * n):
                    z[e] = 0.0
            slopes(coefficients, s, h, n, z, k)
            why = iterate(
                rhs, solve, solve_complex, handle, coefficients, shape, t, h, y[now], y[3], k, supply, where, out,
                orders, memory, nnz, size, work, store, work_complex, z, w,
            )  # fmt: skip
        if why == CONVERGED:
            break
        if work[MADE] == memory[STEPS] and work[HAS] == 1.0:
            return NEWTON_FAILED
        work[HAS] = 0.0
    combine(y[now], h, weights_of(coefficients, s), s, k, y[new])
    if orders[CONTROL] != TOLERANCE:
        return 0.0
    if error_of(coefficients, s)[0] != 0.0 and row_of(coefficients, s, 1)[0] == 0.0:
        return filtered_error(
            rhs, solve, handle, shape, coefficients, t, h, y, now, new, k, out, scale, orders, memory, size, work, store
        )
    return error_norm(h, error_of(coefficients, s), k, y[now], y[new], scale, orders[SIZE])

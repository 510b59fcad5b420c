"""How far powers of one step grow, and the greatest step at which they do not. Knows matrices; runs nothing.

growth = max over n <= N of ||R(h J)^n|| in the energy norm; a step fails where it exceeds 1e3.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fvsolve.steppers import stability_function
from fvsolve.steppers.tableau import Method
from fvsolve.studies.stability.bracket import Limit, halved, limit

THRESHOLD = 1e3
STEPS = 1000
DENSE = 500  # states up to which powers are squared; beyond, vectors are propagated
FAR = 1e4  # of h ||J||, up to which a step that does not fail is looked for
SOME = 11  # steps at which all powers are looked at, where few of them never fail


class Growth(NamedTuple):
    """The greatest norm found (inf: none that is finite), after how many steps, the start that grows so, its end.

    start, end : float64[n], unit vectors
    """

    size: float
    steps: int
    start: np.ndarray
    end: np.ndarray


def step_matrix(method: Method, e: np.ndarray) -> np.ndarray:
    """R(E) : float64[n, n] for E = h J : Horner for explicit methods, else the stages' linear system as it stands."""
    n = e.shape[0]
    if method.explicit:
        coefficients = [float(x) for x in stability_function(method).numerator.coefficients]
        found = coefficients[-1] * np.eye(n)
        for x in coefficients[-2::-1]:
            found = e @ found
            found[np.diag_indices(n)] += x
        return found
    a, b, s = method.a, method.b, method.stages
    if not np.any(np.triu(a, 1)):
        stages: list[np.ndarray] = []
        for i in range(s):
            right = e + e @ sum((a[i, j] * stages[j] for j in range(i) if a[i, j] != 0.0), np.zeros((n, n)))
            stages.append(np.linalg.solve(np.eye(n) - a[i, i] * e, right) if a[i, i] != 0.0 else right)
    else:
        whole = np.linalg.solve(np.eye(s * n) - np.kron(a, e), np.tile(e, (s, 1)))
        stages = [whole[i * n : (i + 1) * n] for i in range(s)]
    return np.eye(n) + sum(b[i] * stages[i] for i in range(s))


def norm_exceeds(m: np.ndarray, threshold: float) -> bool:
    """Whether ||M||_2 > threshold; cheap bounds first."""
    if not np.all(np.isfinite(m)):
        return True
    squares = np.einsum("ij,ij->j", m, m)
    if np.sum(squares) <= threshold**2:
        return False
    return bool(np.max(squares) > threshold**2) or float(np.linalg.norm(m, 2)) > threshold


ALL = 64  # powers up to this one and the last ones are all looked at, between them sixteen for each doubling
FEW = 64  # states up to which every power is


def looked_at(steps: int, few: bool = False) -> list[int]:
    """After how many steps growth is looked at: 1 .. 64, 16 .. 31 times each power of two, the last 64; rising.

    few : powers of two and `steps` alone
    """
    wanted = {1 << k for k in range(64)} | {steps}
    if not few:
        wanted |= {*range(2, ALL + 1), *range(steps - ALL + 1, steps)}
        wanted |= {j << k for k in range(2, 59) for j in range(16, 32)}
    return sorted(n for n in wanted if 1 <= n <= steps)


def powers(m: np.ndarray, steps: int, few: bool = False) -> Iterator[tuple[int, np.ndarray]]:
    """(n, M^n) for the n that are `looked_at`, of a small M all n; ends with the first that is not finite.

    Each from the one before, or from two lower ones.
    """
    found, last, power = {1: m}, 1, m
    yield 1, m
    every = m.shape[0] <= FEW and not few
    for n in range(2, steps + 1) if every else looked_at(steps, few)[1:]:
        high = 1 << (n.bit_length() - 1)
        high = n // 2 if high == n else high
        if every or n == last + 1:
            power = power @ m
        else:
            rest = n - high
            power = found[high] @ (found[rest] if rest in found else assembled(found, rest))
        last = n
        if n <= ALL or n & (n - 1) == 0:
            found[n] = power
        yield n, power
        if not np.all(np.isfinite(power)):
            return


def assembled(found: dict[int, np.ndarray], n: int) -> np.ndarray:
    """M^n from the powers of two that are there."""
    whole = None
    for k in range(n.bit_length()):
        if n >> k & 1:
            whole = found[1 << k] if whole is None else whole @ found[1 << k]
    return whole


def growth(m: np.ndarray, steps: int = STEPS) -> Growth:
    """The greatest ||M^n||_2 over the n <= steps of `powers`, and the start that grows so (unit length)."""
    size, at, kept = 1.0, 0, np.eye(m.shape[0])
    for n, power in powers(m, steps):
        if not np.all(np.isfinite(power)):
            size, at = np.inf, n
            break
        if np.linalg.norm(power) > size:
            here = float(np.linalg.norm(power, 2))
            if here > size:
                size, at, kept = here, n, power
    ends, _, starts = np.linalg.svd(kept)
    return Growth(size, at, starts[0], ends[:, 0])


class DenseGrowth:
    """Steps of one method on a small system; `e` is J in the energy norm."""

    def __init__(self, method: Method, e: np.ndarray, steps: int, threshold: float = THRESHOLD) -> None:
        self.method, self.e, self.steps, self.threshold = method, e, steps, threshold
        self.size = float(np.linalg.norm(e, 2))

    def fails(self, h: float, few: bool = False) -> bool:
        """Whether some power n <= steps of R(h J) exceeds the threshold; `few`: some of those of `powers` that are."""
        m = self.matrix(h)
        with np.errstate(over="ignore", invalid="ignore"):
            return any(norm_exceeds(power, self.threshold) for _, power in powers(m, self.steps, few))

    def limit(self) -> Limit:
        """The greatest step below which none fails: by few powers first, which it cannot exceed, then by all."""
        rough = limit(lambda h: self.fails(h, few=True), 0.1 / self.size, FAR / self.size)
        if rough.step == 0.0:
            return rough
        if np.isinf(rough.step):
            some = any(self.fails(h) for h in np.geomspace(0.1, FAR, SOME) / self.size)
            return limit(self.fails, 0.1 / self.size, FAR / self.size) if some else rough
        if not self.fails(rough.step):
            return rough
        low, high = 0.97 * rough.step, rough.step
        while self.fails(low):
            low, high = 0.9 * low, low
        return halved(self.fails, low, high)

    def failing_after(self, h: float) -> int:
        """After how many steps growth is first seen beyond the threshold; 0 where it is not."""
        with np.errstate(over="ignore", invalid="ignore"):
            found = (n for n, power in powers(self.matrix(h), self.steps) if norm_exceeds(power, self.threshold))
            return next(found, 0)

    def growth(self, h: float) -> Growth:
        """Greatest growth at a step; far beyond the threshold repeated squaring is round-off."""
        with np.errstate(over="ignore", invalid="ignore"):
            return growth(self.matrix(h), self.steps)

    def matrix(self, h: float) -> np.ndarray:
        """R(h J)."""
        with np.errstate(over="ignore", invalid="ignore"):
            return step_matrix(self.method, h * self.e)

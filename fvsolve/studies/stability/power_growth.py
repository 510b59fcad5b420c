"""Growth of powers of the matrix of a step, and the greatest step without growth above the threshold.

The growth is the greatest norm of R(h J)^n over n <= N steps, in the energy norm, with the step h, the Jacobian J and
the stability function R of the method. A step fails if the growth exceeds 1000.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fvsolve.steppers import stability_function
from fvsolve.steppers.tableau import Method
from fvsolve.studies.stability.bisection import StepLimit, bisect, bisect_limit

THRESHOLD = 1e3
STEPS = 1000
DENSE = 500  # greatest number of states for which powers are matrices; above, vectors are propagated
MAX_HJ = 1e4  # greatest h ||J|| of the search
CHECKED_STEPS = 11  # steps whose powers are all checked if a few powers show no failure


class Growth(NamedTuple):
    """Greatest growth found, `size` (inf: not finite), after `steps` steps.

    start, end : float64[n]  deviation with this growth at its start and at its end, scaled to norm 1
    """

    size: float
    steps: int
    start: np.ndarray
    end: np.ndarray


def step_matrix(method: Method, e: np.ndarray) -> np.ndarray:
    """Matrix of a step of a linear system : float64[n, n], R(E) with the stability function R and E = h J.

    e : float64[n, n]  step times Jacobian. It is computed by Horner's rule for explicit methods, and from the linear
    system of the stages for implicit methods.
    """
    n = e.shape[0]
    if method.explicit:
        coefficients = [float(x) for x in stability_function(method).numerator.coefficients]
        result = coefficients[-1] * np.eye(n)
        for x in coefficients[-2::-1]:
            result = e @ result
            result[np.diag_indices(n)] += x
        return result
    a, b, s = method.a, method.b, method.stages
    if not np.any(np.triu(a, 1)):
        stages: list[np.ndarray] = []
        for i in range(s):
            right = e + e @ sum((a[i, j] * stages[j] for j in range(i) if a[i, j] != 0.0), np.zeros((n, n)))
            stages.append(np.linalg.solve(np.eye(n) - a[i, i] * e, right) if a[i, i] != 0.0 else right)
    else:
        solved = np.linalg.solve(np.eye(s * n) - np.kron(a, e), np.tile(e, (s, 1)))
        stages = [solved[i * n : (i + 1) * n] for i in range(s)]
    return np.eye(n) + sum(b[i] * stages[i] for i in range(s))


def norm_exceeds(m: np.ndarray, threshold: float) -> bool:
    """True if the 2-norm of the matrix m exceeds the threshold or is not finite; cheap bounds are checked first."""
    if not np.all(np.isfinite(m)):
        return True
    squares = np.einsum("ij,ij->j", m, m)
    if np.sum(squares) <= threshold**2:
        return False
    return bool(np.max(squares) > threshold**2) or float(np.linalg.norm(m, 2)) > threshold


CONSECUTIVE_POWERS = 64  # number of first and of last powers that are all checked; between, sixteen for each doubling
ALL_POWERS_STATES = 64  # greatest number of states for which every power is checked


def checked_powers(steps: int, few: bool = False) -> list[int]:
    """Increasing numbers n of steps, up to `steps`, at which growth is checked.

    They are 1 to 64, 16 to 31 times powers of two, powers of two, and the last 64 numbers.
    few : True for powers of two and `steps` only
    """
    numbers = {1 << k for k in range(64)} | {steps}
    if not few:
        numbers |= {*range(2, CONSECUTIVE_POWERS + 1), *range(steps - CONSECUTIVE_POWERS + 1, steps)}
        numbers |= {j << k for k in range(2, 59) for j in range(16, 32)}
    return sorted(n for n in numbers if 1 <= n <= steps)


def matrix_powers(m: np.ndarray, steps: int, few: bool = False) -> Iterator[tuple[int, np.ndarray]]:
    """Yield pairs (n, m^n) of powers of a matrix m, for increasing n.

    n takes the values of `checked_powers`; for a matrix of up to 64 states, unless `few` is True, it takes all values
    up to `steps`. A power is the product of m and the power before, or of two lower powers. The first power that is not
    finite is the last pair.
    """
    known, last, power = {1: m}, 1, m
    yield 1, m
    all_powers = m.shape[0] <= ALL_POWERS_STATES and not few
    for n in range(2, steps + 1) if all_powers else checked_powers(steps, few)[1:]:
        high = 1 << (n.bit_length() - 1)
        high = n // 2 if high == n else high
        if all_powers or n == last + 1:
            power = power @ m
        else:
            rest = n - high
            power = known[high] @ (known[rest] if rest in known else assembled_power(known, rest))
        last = n
        if n <= CONSECUTIVE_POWERS or n & (n - 1) == 0:
            known[n] = power
        yield n, power
        if not np.all(np.isfinite(power)):
            return


def assembled_power(known: dict[int, np.ndarray], n: int) -> np.ndarray:
    """Power m^n of a matrix as a product of the powers m^(2^k) in `known`."""
    product = None
    for k in range(n.bit_length()):
        if n >> k & 1:
            product = known[1 << k] if product is None else product @ known[1 << k]
    return product


def power_growth(m: np.ndarray, steps: int = STEPS) -> Growth:
    """Greatest 2-norm of the powers m^n over the n <= steps of `matrix_powers`, with its deviation (see `Growth`)."""
    size, after, greatest = 1.0, 0, np.eye(m.shape[0])
    for n, power in matrix_powers(m, steps):
        if not np.all(np.isfinite(power)):
            size, after = np.inf, n
            break
        if np.linalg.norm(power) > size:
            norm = float(np.linalg.norm(power, 2))
            if norm > size:
                size, after, greatest = norm, n, power
    ends, _, starts = np.linalg.svd(greatest)
    return Growth(size, after, starts[0], ends[:, 0])


class DenseGrowth:
    """Growth over the steps of one method on a small system, from powers of the step matrix.

    e : float64[n, n]  Jacobian in coordinates of the energy norm [1/s]; size : its 2-norm
    """

    def __init__(self, method: Method, e: np.ndarray, steps: int, threshold: float = THRESHOLD) -> None:
        self.method, self.e, self.steps, self.threshold = method, e, steps, threshold
        self.size = float(np.linalg.norm(e, 2))

    def fails(self, h: float, few: bool = False) -> bool:
        """True if the norm of a power of the matrix of a step of h [s] exceeds the threshold within `steps` powers.

        few : True to check only powers of two and the last power
        """
        m = self.matrix(h)
        with np.errstate(over="ignore", invalid="ignore"):
            return any(norm_exceeds(power, self.threshold) for _, power in matrix_powers(m, self.steps, few))

    def limit(self) -> StepLimit:
        """Limit of the step: first from few powers, which give an upper bound, then from all checked powers."""
        rough = bisect_limit(lambda h: self.fails(h, few=True), 0.1 / self.size, MAX_HJ / self.size)
        if rough.step == 0.0:
            return rough
        if np.isinf(rough.step):
            fails_somewhere = any(self.fails(h) for h in np.geomspace(0.1, MAX_HJ, CHECKED_STEPS) / self.size)
            return bisect_limit(self.fails, 0.1 / self.size, MAX_HJ / self.size) if fails_somewhere else rough
        if not self.fails(rough.step):
            return rough
        low, high = 0.97 * rough.step, rough.step
        while self.fails(low):
            low, high = 0.9 * low, low
        return bisect(self.fails, low, high)

    def failing_after(self, h: float) -> int:
        """First number of steps of h [s] in `matrix_powers` after which growth exceeds the threshold; 0 for none."""
        with np.errstate(over="ignore", invalid="ignore"):
            failing = (
                n for n, power in matrix_powers(self.matrix(h), self.steps) if norm_exceeds(power, self.threshold)
            )
            return next(failing, 0)

    def growth(self, h: float) -> Growth:
        """Greatest growth with steps of h [s], and the deviation with this growth.

        Growth far above the threshold is inaccurate, because repeated squaring amplifies round-off.
        """
        with np.errstate(over="ignore", invalid="ignore"):
            return power_growth(self.matrix(h), self.steps)

    def matrix(self, h: float) -> np.ndarray:
        """Matrix of a step of h [s] : float64[n, n]."""
        with np.errstate(over="ignore", invalid="ignore"):
            return step_matrix(self.method, h * self.e)

"""Growth of small deviations over many steps of a linear system, and the least step that fails.

The growth is the greatest norm of R(h J)^n over n <= N steps, in the energy norm, with the step h, the Jacobian J and
the stability function R of the method. A step fails if the growth exceeds 1000.

Arguments of several functions : e, Jacobian in coordinates of the energy norm [1/s]; steps, number of steps over which
growth counts; threshold, growth above which a step fails; work, `WorkLimit` that a prediction spends; default: a new
limit
"""

import functools
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

from fvsolve.core.step_limits.greatest_step import StepLimit, limit_from, multiples, step_below
from fvsolve.core.steppers import stability_function
from fvsolve.core.steppers.tableau import Method
from fvsolve.studies.work_limit import CALL_TIME, DENSE_RATE, FEWER_CELLS, SPARSE_RATE, WorkLimit

POWER_OPERATIONS = 4.0  # over n^3, of a power of a matrix and the check of its norm
# of a power iteration for a norm; greatest norm over its result
NORM_TURNS, NORM_ACCURACY = 20, 1.0 + 1e-6


def prediction_limit(states: int, steps: int, remedy: str = FEWER_CELLS) -> WorkLimit:
    """Limit of the time of a prediction of growth for this number of states over this number of steps."""
    return WorkLimit(
        f"predictions for {states} states and {steps} steps", f"{remedy}, or use fewer --steps"
    )


# powers of the step matrix ----------------------------------------------------------------------------------------

THRESHOLD = 1e3
STEPS = 1000
# greatest number of states for which powers are matrices; above, vectors are propagated
DENSE = 500
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
    a = method.a
    b = method.b
    s = method.stages
    if not np.any(np.triu(a, 1)):
        stages: list[np.ndarray] = []
        for i in range(s):
            right = e + e @ sum(
                (a[i, j] * stages[j] for j in range(i) if a[i, j] != 0.0), np.zeros((n, n))
            )
            stages.append(
                np.linalg.solve(np.eye(n) - a[i, i] * e, right) if a[i, i] != 0.0 else right
            )
    else:
        # the stages of a state stay together: in the other order pivots grew to 1e76 for a lossless pipe of 250 cells
        solved = np.linalg.solve(np.eye(s * n) - np.kron(e, a), np.repeat(e, s, axis=0))
        stages = [solved[i::s] for i in range(s)]
    return np.eye(n) + sum(b[i] * stages[i] for i in range(s))


def step_operations(method: Method, n: int) -> float:
    """Number of floating-point operations of `step_matrix` for n states."""
    if method.explicit:
        return 2.0 * n**3 * method.stages
    if np.any(np.triu(method.a, 1)):
        return (
            2.0 * method.stages + 2.0 / 3.0 * method.stages**3
        ) * n**3 + 2.0 * method.stages**2 * n**3
    return (2.0 + 8.0 / 3.0) * n**3 * method.stages


def norm_exceeds(m: np.ndarray, threshold: float) -> bool:
    """True if the 2-norm of the matrix m exceeds the threshold or is not finite; cheap bounds are checked first.

    If these do not decide, t^2 - m^T m with the threshold t has a Cholesky factor only if the norm is less than t. This
    takes less time than a product of two matrices, and singular values that of twenty.
    """
    if not np.all(np.isfinite(m)):
        return True
    squares = np.einsum("ij,ij->j", m, m)
    if np.sum(squares) <= threshold**2:
        return False
    if np.max(squares) > threshold**2:
        return True
    try:
        np.linalg.cholesky(threshold**2 * np.eye(m.shape[1]) - m.T @ m)
    except np.linalg.LinAlgError:
        return True
    return False


def norm_near(m: np.ndarray, v: np.ndarray) -> tuple[float, np.ndarray]:
    """(2-norm of a matrix, to 1e-6; vector of norm 1 that it stretches most).

    v : first vector of a power iteration, such as that of a similar matrix. If the iteration has not found the greatest
    norm, singular values are computed.
    """
    for _ in range(NORM_TURNS):
        turned = m.T @ (m @ v)
        size = np.linalg.norm(turned)
        if not 0.0 < size < np.inf:
            break
        v = turned / size
    size = float(np.linalg.norm(m @ v))
    return float(np.linalg.norm(m, 2)) if norm_exceeds(m, NORM_ACCURACY * size) else size, v


# number of first and of last powers that are all checked; between, sixteen for each doubling
CONSECUTIVE_POWERS = 64
ALL_POWERS_STATES = 64  # greatest number of states for which every power is checked


def checked_powers(steps: int, few: bool = False) -> list[int]:
    """Increasing numbers n of steps, up to `steps`, at which growth is checked.

    They are 1 to 64, 16 to 31 times powers of two, powers of two, and the last 64 numbers.
    few : True for powers of two and `steps` only
    """
    numbers = {1 << k for k in range(64)} | {steps}
    if not few:
        numbers |= {
            *range(2, CONSECUTIVE_POWERS + 1),
            *range(steps - CONSECUTIVE_POWERS + 1, steps),
        }
        numbers |= {j << k for k in range(2, 59) for j in range(16, 32)}
    return sorted(n for n in numbers if 1 <= n <= steps)


def matrix_powers(m: np.ndarray, steps: int, few: bool = False) -> Iterator[tuple[int, np.ndarray]]:
    """Yield pairs (n, m^n) of powers of a matrix m, for increasing n.

    n takes the values of `checked_powers`; for a matrix of up to 64 states, unless `few` is True, it takes all values
    up to `steps`. A power is the product of m and the power before, or of two lower powers. The first power that is not
    finite is the last pair.
    """
    known = {1: m}
    last = 1
    power = m
    yield 1, m
    all_powers = m.shape[0] <= ALL_POWERS_STATES and not few
    for n in range(2, steps + 1) if all_powers else checked_powers(steps, few)[1:]:
        high = 1 << (n.bit_length() - 1)
        high = n // 2 if high == n else high
        if all_powers or n == last + 1:
            power = power @ m
        else:
            rest = n - high
            parts = (known[1 << k] for k in range(rest.bit_length()) if rest >> k & 1)
            power = known[high] @ (
                known[rest] if rest in known else functools.reduce(np.matmul, parts)
            )
        last = n
        if n <= CONSECUTIVE_POWERS or n & (n - 1) == 0:
            known[n] = power
        yield n, power
        if not np.all(np.isfinite(power)):
            return


def power_growth(m: np.ndarray, steps: int = STEPS) -> Growth:
    """Greatest 2-norm of the powers m^n over the n <= steps of `matrix_powers`, with its deviation (see `Growth`)."""
    size = 1.0
    after = 0
    greatest = np.eye(m.shape[0])
    v = np.random.default_rng(5).standard_normal(m.shape[0])
    for n, power in matrix_powers(m, steps):
        if not np.all(np.isfinite(power)):
            size, after = np.inf, n
            break
        if norm_exceeds(power, size):
            norm, v = norm_near(power, v)
            if norm > size:
                size = norm
                after = n
                greatest = power
    ends, _, starts = np.linalg.svd(greatest)
    return Growth(size, after, starts[0], ends[:, 0])


class DenseGrowth:
    """Growth over the steps of one method on a small system, from powers of the step matrix.

    e : float64[n, n]  Jacobian; size : its 2-norm. Methods raise TooLarge if the estimated time exceeds its limit.
    """

    def __init__(
        self,
        method: Method,
        e: np.ndarray,
        steps: int,
        threshold: float = THRESHOLD,
        work: WorkLimit | None = None,
    ) -> None:
        self.method, self.e, self.steps, self.threshold = method, e, steps, threshold
        self.size, self.work = (
            float(np.linalg.norm(e, 2)),
            work or prediction_limit(e.shape[0], steps),
        )

    def fails(self, h: float, few: bool = False) -> bool:
        """True if a power of the step matrix exceeds the threshold; few : only powers of two and the last power."""
        m, bound = self.matrix(h), 1.0
        with np.errstate(over="ignore", invalid="ignore"):
            for n, power in self.powers(m, few):
                if norm_exceeds(power, self.threshold):
                    return True
                if few or n > CONSECUTIVE_POWERS:
                    continue
                if n & (n - 1) == 0 and self.stays_below(power, n, bound):
                    return False
                bound = max(bound, float(np.linalg.norm(power)))
            return False

    def stays_below(self, power: np.ndarray, n: int, bound: float) -> bool:
        """True if no power up to the last exceeds the threshold, as ||m^(q n + r)|| <= ||m^n||^q ||m^r||.

        power : m^n; bound : of the norms of all lower powers
        """
        if bound > self.threshold:
            return False
        self.work.spend(POWER_OPERATIONS * len(power) ** 3 / DENSE_RATE)
        return not norm_exceeds(power, (self.threshold / bound) ** (n / self.steps))

    def powers(self, m: np.ndarray, few: bool = False) -> Iterator[tuple[int, np.ndarray]]:
        """Powers of `matrix_powers`, whose time is spent."""
        for n, power in matrix_powers(m, self.steps, few):
            self.work.spend(POWER_OPERATIONS * len(m) ** 3 / DENSE_RATE)
            yield n, power

    def limit(self) -> StepLimit:
        """Limit of the step: first from few powers, which give an upper bound, then from all checked powers."""
        rough = limit_from(lambda h: self.fails(h, few=True), 0.1 / self.size, MAX_HJ / self.size)
        if rough.step == 0.0:
            return rough
        if np.isinf(rough.step):
            fails_somewhere = any(
                self.fails(h) for h in np.geomspace(0.1, MAX_HJ, CHECKED_STEPS) / self.size
            )
            return (
                limit_from(self.fails, 0.1 / self.size, MAX_HJ / self.size)
                if fails_somewhere
                else rough
            )
        if not self.fails(rough.step):
            return rough
        return step_below(self.fails, rough.step, multiples(0.97 * rough.step, 0.9, 0.0))

    def failing_after(self, h: float) -> int:
        """First number of steps of h [s] in `matrix_powers` after which growth exceeds the threshold; 0 for none."""
        with np.errstate(over="ignore", invalid="ignore"):
            powers = self.powers(self.matrix(h))
            return next((n for n, power in powers if norm_exceeds(power, self.threshold)), 0)

    def growth(self, h: float) -> Growth:
        """Greatest growth with steps of h [s], and the deviation with this growth.

        Growth far above the threshold is inaccurate, because repeated squaring amplifies round-off.
        """
        count = len(checked_powers(self.steps))
        self.work.spend(2.0 * count * POWER_OPERATIONS * len(self.e) ** 3 / DENSE_RATE)
        with np.errstate(over="ignore", invalid="ignore"):
            return power_growth(self.matrix(h), self.steps)

    def matrix(self, h: float) -> np.ndarray:
        """Matrix of a step of h [s] : float64[n, n]."""
        self.work.spend(step_operations(self.method, len(self.e)) / DENSE_RATE)
        with np.errstate(over="ignore", invalid="ignore"):
            return step_matrix(self.method, h * self.e)


# vectors ----------------------------------------------------------------------------------------------------------

VECTORS, PASSES = 4, 4  # vectors in a block; passes forward and back
# greatest norm of a power over that of a random block, and over the root of the number of states
NORM_MARGIN = 2.0


class VectorGrowth:
    """Growth over many steps on a large system: a block of vectors is multiplied by the step matrix again and again.

    The matrix and its transpose are used in turn, as in a power iteration for the 2-norm. Start vectors are random with
    a fixed seed. The result is a lower bound of the greatest growth, close to it after four passes.
    e : sparse Jacobian; size : its 2-norm
    """

    def __init__(
        self,
        method: Method,
        e: Any,
        steps: int,
        threshold: float = THRESHOLD,
        work: WorkLimit | None = None,
    ) -> None:
        self.method, self.e, self.steps, self.threshold = method, e.tocsr(), steps, threshold
        self.work = work or prediction_limit(e.shape[0], steps)
        self.transpose = e.T.tocsr()
        v = np.random.default_rng(2).standard_normal(e.shape[0])
        for _ in range(50):  # power iteration for the 2-norm
            v = self.transpose @ (self.e @ (v / np.linalg.norm(v)))
        self.size = float(np.sqrt(np.linalg.norm(v)))
        self.start_block = np.random.default_rng(1).standard_normal((e.shape[0], VECTORS))

    def limit(self) -> StepLimit:
        """Limit of the step [s], below which no step is found to fail."""
        return limit_from(self.fails, 0.1 / self.size, MAX_HJ / self.size)

    def fails(self, h: float) -> bool:
        """True if growth above the threshold is found with steps of h [s]."""
        return self.failing_after(h) > 0

    def failing_after(self, h: float) -> int:
        """Number of steps of h [s] after which growth is found to exceed the threshold; 0 if it does not."""
        growth = self.growth(h, self.threshold)
        return growth.steps if growth.size > self.threshold else 0

    def growth(self, h: float, enough: float = np.inf) -> Growth:
        """Greatest growth found with steps of h [s], and the deviation with this growth.

        The search ends when the growth exceeds a finite `enough`, or is so far below it after a pass that the norm of
        no power can reach it. Raises TooLarge if the estimated time exceeds its limit.
        """
        (forth, time), (back, _) = (
            step_function(self.method, h, e, self.work) for e in (self.e, self.transpose)
        )
        v, unit = self.start_block, self.start_block[:, 0] / np.linalg.norm(self.start_block[:, 0])
        best = Growth(1.0, 0, unit, unit)
        for _ in range(PASSES):
            start = np.linalg.qr(v)[0]
            size, steps, block = self.propagate(forth, time, start, enough)
            if steps == 0 or not np.isfinite(size):
                return best if steps == 0 else best._replace(size=size, steps=steps)
            if size > best.size:
                ends, _, mixing = np.linalg.svd(block, full_matrices=False)
                best = Growth(size, steps, start @ mixing[0], ends[:, 0])
            if size > enough or size * NORM_MARGIN * np.sqrt(v.shape[0]) < enough < np.inf:
                return best
            v = block
            self.work.spend(steps * time)
            for _ in range(steps):
                v = back(v)
        return best

    def propagate(
        self, step: Callable, time: float, v: np.ndarray, enough: float
    ) -> tuple[float, int, np.ndarray]:
        """(greatest norm of a block v of vectors over the steps, number of steps when it is reached, block then).

        step, time : function that multiplies a block by the step matrix, and its time [s]
        enough : norm above which the steps end
        """
        size = 1.0
        steps = 0
        block = v
        done = 0
        with np.errstate(over="ignore", invalid="ignore"):
            for n in checked_powers(self.steps):
                self.work.spend((n - done) * time + CALL_TIME)
                for _ in range(n - done):
                    v = step(v)
                done = n
                if not np.all(np.isfinite(v)):
                    return np.inf, n, block
                norm = float(np.linalg.norm(v, 2))
                if norm > size:
                    size = norm
                    steps = n
                    block = v
                if norm > enough:
                    break
        return size, steps, block


def step_function(
    method: Method, h: float, e: Any, work: WorkLimit | None = None
) -> tuple[Callable[[np.ndarray], np.ndarray], float]:
    """(function that multiplies a block of vectors : float64[n, k] by the matrix of a step of h [s], its time [s]).

    e : sparse Jacobian. The time is an estimate for `VECTORS` vectors; work : spends that of factors
    """
    scaled = h * e
    n = e.shape[0]
    s = method.stages
    product_time = CALL_TIME + 2.0 * VECTORS * (e.nnz + n) / SPARSE_RATE
    if method.explicit:
        coefficients = [float(x) for x in stability_function(method).numerator.coefficients]

        def explicit(v: np.ndarray) -> np.ndarray:
            result = coefficients[-1] * v
            for x in coefficients[-2::-1]:
                result = scaled @ result + x * v
            return result

        return explicit, s * product_time
    from scipy.sparse import eye_array, kron
    from scipy.sparse.linalg import splu

    scaled = scaled.tocsc()
    # in the order of `step_matrix`
    factors = splu((eye_array(s * n) - kron(scaled, method.a)).tocsc())
    entries = factors.nnz
    if work is not None:
        # less than the sum of squares over the columns
        work.spend(entries**2 / (s * n) / SPARSE_RATE)

    def implicit(v: np.ndarray) -> np.ndarray:
        stages = factors.solve(np.repeat(scaled @ v, s, axis=0))
        return v + sum(method.b[i] * stages[i::s] for i in range(s))

    return implicit, product_time + 2.0 * VECTORS * entries / SPARSE_RATE


def growth_method(
    method: Method,
    e: Any,
    steps: int = STEPS,
    threshold: float = THRESHOLD,
    work: WorkLimit | None = None,
) -> Any:
    """Object that computes the growth of deviations: `DenseGrowth` for up to 500 states, `VectorGrowth` for more."""
    if e.shape[0] <= DENSE:
        return DenseGrowth(
            method, e if isinstance(e, np.ndarray) else e.toarray(), steps, threshold, work
        )
    from scipy.sparse import csr_array

    return VectorGrowth(method, csr_array(e), steps, threshold, work)


def predicted_limit(growth: Any) -> StepLimit:
    """Limit of the step of a linear system, below which no step is found to fail.

    growth : result of `growth_method`. The search goes from 0.1 / ||J||, or less if that fails, to 1e4 / ||J||, with
    the norm of the Jacobian J. The limit is inf if no step fails, and for J = 0.
    """
    return growth.limit() if growth.size else StepLimit(np.inf, np.inf)

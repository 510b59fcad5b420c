"""Growth of a block of vectors under repeated steps, for matrices too large to be squared."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.steppers import stability_function
from fvsolve.steppers.tableau import Method
from fvsolve.studies.stability.bisection import StepLimit, bisect_limit
from fvsolve.studies.stability.power_growth import MAX_HJ, THRESHOLD, Growth, checked_powers

TIME_LIMIT = 30.0  # time limit of a prediction [s]
VECTORS, PASSES = 4, 4  # vectors in a block; passes forward and back
# Greatest ratio of the norm of a power to the norm of a random block, over the root of the number of states.
NORM_MARGIN = 2.0


class VectorGrowth:
    """Growth over many steps on a large system: a block of vectors is multiplied by the step matrix again and again.

    The matrix and its transpose are used in turn, as in a power iteration for the 2-norm. Start vectors are random with
    a fixed seed. The result is a lower bound of the greatest growth, close to it after four passes.
    e : sparse Jacobian in coordinates of the energy norm [1/s]; size : its 2-norm
    latest : time of the monotonic clock [s] from which computations raise TooLarge; default: 30 s after the start
    """

    def __init__(
        self, method: Method, e: Any, steps: int, threshold: float = THRESHOLD, latest: float | None = None
    ) -> None:
        self.method, self.e, self.steps, self.threshold = method, e.tocsr(), steps, threshold
        self.latest = time.monotonic() + TIME_LIMIT if latest is None else latest
        self.transpose = e.T.tocsr()
        self.size = self.two_norm()
        self.start_block = np.random.default_rng(1).standard_normal((e.shape[0], VECTORS))

    def two_norm(self) -> float:
        """Estimate of the 2-norm of the Jacobian [1/s], by power iteration."""
        v = np.random.default_rng(2).standard_normal(self.e.shape[0])
        for _ in range(50):
            v = self.transpose @ (self.e @ (v / np.linalg.norm(v)))
        return float(np.sqrt(np.linalg.norm(v)))

    def limit(self) -> StepLimit:
        """Limit of the step [s], below which no step is found to fail."""
        return bisect_limit(self.fails, 0.1 / self.size, MAX_HJ / self.size)

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
        no power can reach it. Raises TooLarge at the time limit.
        """
        forth, back = step_function(self.method, h, self.e), step_function(self.method, h, self.transpose)
        v, unit = self.start_block, self.start_block[:, 0] / np.linalg.norm(self.start_block[:, 0])
        best = Growth(1.0, 0, unit, unit)
        for _ in range(PASSES):
            start = np.linalg.qr(v)[0]
            size, steps, block = self.propagate(forth, start, enough)
            if steps == 0 or not np.isfinite(size):
                return best if steps == 0 else best._replace(size=size, steps=steps)
            if size > best.size:
                ends, _, mixing = np.linalg.svd(block, full_matrices=False)
                best = Growth(size, steps, start @ mixing[0], ends[:, 0])
            if size > enough or size * NORM_MARGIN * np.sqrt(v.shape[0]) < enough < np.inf:
                return best
            v = block
            for _ in range(steps):
                v = back(v)
        return best

    def propagate(self, step: Callable, v: np.ndarray, enough: float) -> tuple[float, int, np.ndarray]:
        """(greatest norm of a block v of vectors over the steps, number of steps when it is reached, block then).

        step : function that multiplies a block by the step matrix; enough : norm above which the steps end
        """
        size, steps, block, done = 1.0, 0, v, 0
        with np.errstate(over="ignore", invalid="ignore"):
            for n in checked_powers(self.steps):
                if time.monotonic() > self.latest:
                    raise TooLarge(too_large(self.e.shape[0], self.steps))
                for _ in range(n - done):
                    v = step(v)
                done = n
                if not np.all(np.isfinite(v)):
                    return np.inf, n, block
                norm = float(np.linalg.norm(v, 2))
                if norm > size:
                    size, steps, block = norm, n, v
                if norm > enough:
                    break
        return size, steps, block


class TooLarge(FvsolveError):
    """Error: the prediction has taken longer than its time limit."""


def too_large(states: int, steps: int) -> str:
    """Text of the error `TooLarge`: number of states and steps, and remedies."""
    return (
        f"{states} states and {steps} steps take longer than {TIME_LIMIT:g} s to predict: give pipes or basins fewer "
        "cells, --set links.NAME.cells=100 or nodes.NAME.cells=[20,20] (or, for pipes that state no cells, a "
        "greater numerics.cell_time; the limit as a Courant number changes little), or use fewer --steps"
    )


def step_function(method: Method, h: float, e: Any) -> Callable[[np.ndarray], np.ndarray]:
    """Function that multiplies a block of vectors : float64[n, k] by the matrix of a step of h [s]; e : Jacobian."""
    if method.explicit:
        coefficients = [float(x) for x in stability_function(method).numerator.coefficients]
        scaled = h * e

        def explicit(v: np.ndarray) -> np.ndarray:
            result = coefficients[-1] * v
            for x in coefficients[-2::-1]:
                result = scaled @ result + x * v
            return result

        return explicit
    from scipy.sparse import eye_array, kron
    from scipy.sparse.linalg import splu

    n, s = e.shape[0], method.stages
    scaled = (h * e).tocsc()
    factors = splu((eye_array(s * n) - kron(method.a, scaled)).tocsc())

    def implicit(v: np.ndarray) -> np.ndarray:
        stages = factors.solve(np.tile(scaled @ v, (s, 1)))
        return v + sum(method.b[i] * stages[i * n : (i + 1) * n] for i in range(s))

    return implicit

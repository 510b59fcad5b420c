"""How far a block of vectors grows that is carried along, where squaring costs too much. Knows sparse matrices."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.steppers import stability_function
from fvsolve.steppers.tableau import Method
from fvsolve.studies.stability.bracket import Limit, limit
from fvsolve.studies.stability.growth import FAR, THRESHOLD, Growth, looked_at

LONGEST = 30.0  # that a prediction may take [s]
VECTORS, PASSES = 4, 4  # that are carried, and how often forth and back
SURELY = (
    2.0  # times the root of the states: of a block at random, how far the norm of a power may lie above what it shows
)


class Sparse:
    """The same on a large one: a block of vectors is carried forth by R and back by its transpose, from a fixed seed.

    What it finds is a lower bound of the norm, that four passes bring near.
    """

    def __init__(
        self, method: Method, e: Any, steps: int, threshold: float = THRESHOLD, latest: float | None = None
    ) -> None:
        self.method, self.e, self.steps, self.threshold = method, e.tocsr(), steps, threshold
        self.latest = time.monotonic() + LONGEST if latest is None else latest
        self.back = e.T.tocsr()
        self.size = self.two_norm()
        self.first = np.random.default_rng(1).standard_normal((e.shape[0], VECTORS))

    def two_norm(self) -> float:
        """||J||_2 by iteration."""
        v = np.random.default_rng(2).standard_normal(self.e.shape[0])
        for _ in range(50):
            v = self.back @ (self.e @ (v / np.linalg.norm(v)))
        return float(np.sqrt(np.linalg.norm(v)))

    def limit(self) -> Limit:
        """The greatest step below which none is found to fail."""
        return limit(self.fails, 0.1 / self.size, FAR / self.size)

    def fails(self, h: float) -> bool:
        """Whether growth beyond the threshold is found."""
        return self.failing_after(h) > 0

    def failing_after(self, h: float) -> int:
        """After how many steps growth is first seen beyond the threshold; 0 where it is not."""
        found = self.growth(h, self.threshold)
        return found.steps if found.size > self.threshold else 0

    def growth(self, h: float, enough: float = np.inf) -> Growth:
        """Greatest growth found at a step; stops where it is `enough`."""
        forth, back = stepping(self.method, h, self.e), stepping(self.method, h, self.back)
        v, none = self.first, self.first[:, 0] / np.linalg.norm(self.first[:, 0])
        best = Growth(1.0, 0, none, none)
        for _ in range(PASSES):
            start = np.linalg.qr(v)[0]
            size, at, last = self.carried(forth, start, enough)
            if at == 0 or not np.isfinite(size):
                return best if at == 0 else best._replace(size=size, steps=at)
            if size > best.size:
                ends, _, mix = np.linalg.svd(last, full_matrices=False)
                best = Growth(size, at, start @ mix[0], ends[:, 0])
            if size > enough or size * SURELY * np.sqrt(v.shape[0]) < enough < np.inf:
                return best
            v = last
            for _ in range(at):
                v = back(v)
        return best

    def carried(self, step: Callable, v: np.ndarray, enough: float) -> tuple[float, int, np.ndarray]:
        """(greatest norm of a block carried along, after how many steps, the block then); ends where it is enough."""
        size, at, kept, done = 1.0, 0, v, 0
        with np.errstate(over="ignore", invalid="ignore"):
            for n in looked_at(self.steps):
                if time.monotonic() > self.latest:
                    raise TooLarge(too_large(self.e.shape[0], self.steps))
                for _ in range(n - done):
                    v = step(v)
                done = n
                if not np.all(np.isfinite(v)):
                    return np.inf, n, kept
                here = float(np.linalg.norm(v, 2))
                if here > size:
                    size, at, kept = here, n, v
                if here > enough:
                    break
        return size, at, kept


class TooLarge(FvsolveError):
    """No answer in the time that is given to one."""


def too_large(states: int, steps: int) -> str:
    """What to say then."""
    return (f"{states} states and {steps} steps take longer than {LONGEST:g} s to predict: give pipes or basins fewer "
            "cells, --set links.NAME.cells=100 or nodes.NAME.cells=[20,20] (or numerics.cell_time, where pipes state "
            "none; the limit as a Courant number changes little), or fewer --steps")  # fmt: skip


def stepping(method: Method, h: float, e: Any) -> Callable[[np.ndarray], np.ndarray]:
    """v -> R(h J) v for blocks of vectors : float64[n, k]."""
    if method.explicit:
        coefficients = [float(x) for x in stability_function(method).numerator.coefficients]
        scaled = h * e

        def explicit(v: np.ndarray) -> np.ndarray:
            found = coefficients[-1] * v
            for x in coefficients[-2::-1]:
                found = scaled @ found + x * v
            return found

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

"""Where along a pipe a probe reads, and with which weights. Knows cells; knows no physics."""

from __future__ import annotations

import functools

import numpy as np

from fvsolve.schemes import SCHEMES

TIE = 1e-6  # of a cell, within which two sets of cells are as near


def along(draft, row, fraction: float, degree: int | None = None) -> None:
    """Where along its pipe a probe reads: an end, or cells by a polynomial, of the scheme's degree if left out."""
    if fraction in (0.0, 1.0):
        row["side"] = -1 if fraction == 0.0 else 1
        return
    n = int(draft.pipe_table[row["index"]]["cells"])
    degree = min(degree or max(SCHEMES[draft.case.numerics.scheme].degree, 1), n - 1)
    first, weights = around(fraction * n, degree, n)
    row["cell"], row["count"], row["weights"] = first, weights.size, len(draft.floats)
    draft.floats += weights.tolist()


@functools.lru_cache(maxsize=4096)
def around(x: float, degree: int, n: int) -> tuple[int, np.ndarray]:
    """First of the cells that are read x cells from `from`, and their weights.

    They are the nearest degree + 1; where two such sets are as near, as on a face for an even degree, it is the mean
    of both, so that a pipe drawn the other way reads the same.
    """
    middle = x - 0.5 * (degree + 1)
    firsts = sorted({int(np.clip(round(middle + side), 0, n - degree - 1)) for side in (-TIE, TIE)})
    weights = np.zeros(firsts[-1] - firsts[0] + degree + 1)
    for first in firsts:
        weights[first - firsts[0] :][: degree + 1] += reading_weights(x - first, degree) / len(firsts)
    return firsts[0], weights


def reading_weights(x: float, degree: int) -> np.ndarray:
    """Weights w with sum w_k (average over [k, k+1]) = value at x, exact for polynomials up to `degree`."""
    powers = np.arange(degree + 1)
    cells = np.arange(degree + 1)[:, None]
    averages = ((cells + 1.0) ** (powers + 1) - cells ** (powers + 1.0)) / (powers + 1)
    return np.linalg.solve(averages.T, float(x) ** powers)

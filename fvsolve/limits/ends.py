"""The Courant limit of a pipe of few cells, which its ends bring down. Knows schemes and their closures; no network.

One wave through n cells goes by dr/dt = A r + b in, out = v r, in units of cells a second: `in` is the datum at the end
where it enters, `out` what the polynomial gives where it leaves. What leaves comes back by the other wave, so that a
pipe whose ends reflect p and q of a pressure has the eigenvalues of A + s b v, s^2 = p q: 1 between two open or two
shut ends, -1 between an open and a shut one, 0 where nothing comes back.
"""

from __future__ import annotations

import functools

import numpy as np

from fvsolve.kernels.ends import END_ENTERING, END_LEAVING, END_VALUE, GHOSTS
from fvsolve.limits.plane import GROWTH
from fvsolve.limits.symbol import weights_of
from fvsolve.schemes import ROOM, SCHEMES
from fvsolve.steppers.analysis.stability_function import stability_function
from fvsolve.steppers.tableau import method_named

LONG = 40  # cells from which on the ends are too far apart to count
WORST = (0.0, 1.0, -1.0)  # of p q, what brings the limit down most
LOWEST, HIGHEST, RISE, HALVINGS = 1.0 / 64.0, 64.0, 1.02, 40  # of the Courant numbers that are tried


@functools.lru_cache(maxsize=1024)
def pipe_limit(scheme: str, method: str, cells: int, returned: tuple[float, ...] = WORST) -> float:
    """The greatest Courant number up to which no mode of a pipe of so many cells grows; 0 where there is none.

    returned : products p q of reflections, all of which must hold
    """

    def holds(courant: float) -> bool:
        return pipe_growth(scheme, method, cells, courant, returned) <= GROWTH

    low, high = 0.0, LOWEST
    while high <= HIGHEST and holds(high):
        low, high = high, RISE * high
    for _ in range(HALVINGS if low > 0.0 else 0):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


@functools.lru_cache(maxsize=4096)
def pipe_growth(scheme: str, method: str, cells: int, courant: float, returned: tuple[float, ...] = WORST) -> float:
    """By how much more than one the fastest mode is multiplied in a step; below zero where all decay."""
    r = stability_function(method_named(method))
    return float(np.abs(r(courant * pipe_modes(scheme, cells, returned))).max()) - 1.0


@functools.lru_cache(maxsize=1024)
def pipe_modes(scheme: str, cells: int, returned: tuple[float, ...] = WORST) -> np.ndarray:
    """Eigenvalues of a pipe, in travel times of a cell, for some products of its ends' reflections : complex[m]."""
    a, b, v = one_wave((SCHEMES[scheme].shorter or scheme) if cells < ROOM else scheme, cells)
    roots = [sign * np.sqrt(complex(product)) for product in returned for sign in (1.0, -1.0)]
    return np.concatenate([np.linalg.eigvals(a + s * np.outer(b, v)) for s in roots])


def one_wave(scheme: str, cells: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(A, b, v) of one wave through a pipe, as `kernels.pipes` and `kernels.ends` close it."""
    degree, weights = SCHEMES[scheme].degree, [float(w) for w in weights_of(scheme)]
    known = np.eye(cells + 1)  # rows: the datum, then the cells
    near, far = known, known[:0:-1]  # from the end where it enters, where it leaves
    into, out = min(degree, cells), min(degree, cells - 1)
    before = END_ENTERING[into, ::-1, : into + 1] @ near[: into + 1]
    beyond = END_LEAVING[out, :, : out + 1] @ far[: out + 1]
    cell = np.vstack([before, known[1:], beyond])
    inner = [sum(w * cell[GHOSTS + i + k] for k, w in enumerate(weights, start=-2)) for i in range(cells - 1)]
    last = END_VALUE[out, : out + 1] @ far[: out + 1]
    face = np.vstack([known[:1], *inner, last])
    rate = face[:-1] - face[1:]
    return rate[:, 1:], rate[:, 0], last[1:]

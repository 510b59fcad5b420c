"""Courant limit of a pipe of few cells, whose ends reduce the limit.

A wave with the values r in n cells follows dr/dt = A r + b r_in, r_out = v r, in units of cells a second. Here r_in is
the wave that enters at the upstream end, and r_out the wave that leaves at the downstream end, by extrapolation. The
leaving wave returns as the opposite wave. So a pipe with the pressure reflection factors p and q at its ends has the
eigenvalues of A + s b v with s^2 = p q: 1 between two open or two shut ends, -1 between an open and a shut end, 0
without reflection.
"""

from __future__ import annotations

import functools

import numpy as np

from fvsolve.kernels.ghost_cells import END_ENTERING, END_LEAVING, END_VALUE, GHOSTS
from fvsolve.schemes import LEAST_CELLS, SCHEMES
from fvsolve.step_limits.plane_limit import GROWTH
from fvsolve.step_limits.symbol import weights_of
from fvsolve.steppers.analysis.stability_function import stability_function
from fvsolve.steppers.tableau import method_named

LONG = 40  # number of cells from which the ends do not reduce the limit
WORST = (0.0, 1.0, -1.0)  # values of p q that reduce the limit most
LOWEST, HIGHEST, RISE, HALVINGS = 1.0 / 64.0, 64.0, 1.02, 40  # range of trial Courant numbers, ratio, bisections


@functools.lru_cache(maxsize=1024)
def pipe_limit(scheme: str, method: str, cells: int, returned: tuple[float, ...] = WORST) -> float:
    """Greatest Courant number up to which no mode of a pipe of `cells` cells grows; 0 if modes always grow.

    returned : products of the pressure reflection factors at both ends; the limit holds for all of these products
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
    """Greatest growth factor of a mode of a pipe of `cells` cells in a step, minus 1; negative if all modes decay.

    scheme, method : names; courant : Courant number
    returned : products of the pressure reflection factors at both ends
    """
    r = stability_function(method_named(method))
    return float(np.abs(r(courant * pipe_modes(scheme, cells, returned))).max()) - 1.0


@functools.lru_cache(maxsize=1024)
def pipe_modes(scheme: str, cells: int, returned: tuple[float, ...] = WORST) -> np.ndarray:
    """Eigenvalues of the waves in a pipe, divided by the cells that a wave crosses per second : complex[m].

    returned : products of the pressure reflection factors at both ends
    """
    a, b, v = wave_matrices((SCHEMES[scheme].shorter or scheme) if cells < LEAST_CELLS else scheme, cells)
    roots = [sign * np.sqrt(complex(product)) for product in returned for sign in (1.0, -1.0)]
    return np.concatenate([np.linalg.eigvals(a + s * np.outer(b, v)) for s in roots])


def wave_matrices(scheme: str, cells: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrices A, b, v of dr/dt = A r + b r_in, r_out = v r for a wave r through a pipe of `cells` cells.

    r_in is the wave that enters, r_out the wave that leaves, extrapolated as in `kernels.ghost_cells`. The unit of time
    is the travel time of a wave through a cell.
    """
    degree, weights = SCHEMES[scheme].degree, [float(w) for w in weights_of(scheme)]
    known = np.eye(cells + 1)  # rows: the datum, then the cells
    near, far = known, known[:0:-1]  # from the upstream end, from the downstream end
    into, out = min(degree, cells), min(degree, cells - 1)
    before = END_ENTERING[into, ::-1, : into + 1] @ near[: into + 1]
    beyond = END_LEAVING[out, :, : out + 1] @ far[: out + 1]
    cell = np.vstack([before, known[1:], beyond])
    inner = [sum(w * cell[GHOSTS + i + k] for k, w in enumerate(weights, start=-2)) for i in range(cells - 1)]
    last = END_VALUE[out, : out + 1] @ far[: out + 1]
    face = np.vstack([known[:1], *inner, last])
    rate = face[:-1] - face[1:]
    return rate[:, 1:], rate[:, 0], last[1:]

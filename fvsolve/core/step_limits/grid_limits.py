"""Courant limits of linear schemes on grids: waves and advection in the plane (von Neumann), pipes of few cells.

In the plane, waves of pressure p and velocities u, v have the speed c; each direction is split into its
characteristics. The symbol of the scheme at the phase theta per cell is z(theta) = a + i b. The wave rate is
c / dx + c / dy; its fractions in x and y are w_x and w_y. For a wave with the phases (theta_x, theta_y) per cell, the
rate of change of (p, u, v) is the wave rate times M (p, u, v), with

    M = [ w_x a_x + w_y a_y   i w_x b_x   i w_y b_y ]
        [ i w_x b_x           w_x a_x     0         ]
        [ i w_y b_y           0           w_y a_y   ]

An advected quantity has the single eigenvalue w_x z(theta_x) + w_y z(theta_y) in place of M. Growth of a single wave
proves that a Courant number is unstable, so growth above the computed limit is proved. Below the limit, phases between
the tested phases are not covered.

The ends of a pipe of few cells reduce its limit. A wave with the values r in n cells follows dr/dt = A r + b r_in,
r_out = v r, in units of cells a second. Here r_in is the wave that enters at the upstream end, and r_out the wave that
leaves at the downstream end, by extrapolation. The leaving wave returns as the opposite wave. So a pipe with the
pressure reflection factors p and q at its ends has the eigenvalues of A + s b v with s^2 = p q: 1 between two open or
two shut ends, -1 between an open and a shut end, 0 without reflection.
"""

import functools
from collections.abc import Callable

import numpy as np

from fvsolve.core.kernels.ghost_cells import END_ENTERING, END_LEAVING, END_VALUE, GHOSTS
from fvsolve.core.schemes import LEAST_CELLS, SCHEMES
from fvsolve.core.step_limits.greatest_step import greatest_step, multiples
from fvsolve.core.step_limits.symbol import symbol, weights_of
from fvsolve.core.steppers.analysis.stability_function import stability_function

PHASES = 33  # number of phases from 0 to pi in x; with the same spacing from -pi to pi in y
GROWTH = 1e-9  # |R| - 1 above which a wave counts as growing
# range of trial Courant numbers, number of bisections
LOWEST = 1.0 / 64.0
HIGHEST = 64.0
HALVINGS = 40
FINE = 1001  # phases along a line
MARGIN = 1.01  # margin of the Courant number: a step stable with it needs no further check
LONG = 40  # number of cells from which the ends of a pipe reduce the limit by less than 8 %
WORST = (0.0, 1.0, -1.0)  # products of reflection factors of both ends that reduce the limit most
RISE = 1.02  # ratio of trial Courant numbers for a pipe of few cells


def greatest_courant(fails: Callable[[float], bool], ratio: float) -> float:
    """Greatest trial Courant number up to which `fails` is False; 0 if the lowest one fails, inf if none does.

    fails : function of a Courant number; ratio : ratio of the trial numbers before bisection
    """
    return greatest_step(
        fails, multiples(LOWEST, ratio, HIGHEST), width=0.0, halvings=HALVINGS
    ).step


@functools.lru_cache(maxsize=64)
def plane_limit(scheme: str, method: str, share: float, waves: bool = True) -> float:
    """Greatest Courant number, step times wave rate, up to which no wave grows; 0 if waves always grow.

    share : part of x in the wave rate c / dx + c / dy, with the wave speed c, between 0 and 1
    waves : True for waves of pressure and velocity, False for advection
    Raises FvsolveError for a nonlinear scheme.
    """
    z = plane_eigenvalues(scheme, share, waves)
    return greatest_courant(lambda courant: is_unstable(z, method, courant), 2.0)


@functools.lru_cache(maxsize=1024)
def is_stable_with_margin(
    scheme: str, method: str, courant: float, share: float = 1.0, waves: bool = False
) -> bool:
    """True if no tested wave grows at a Courant number, nor at a Courant number 1 % greater.

    Arguments are as for `plane_limit`; with share = 1 and no waves it is advection along a line.
    """
    if share == 1.0 and not waves:
        z = symbol(weights_of(scheme), np.linspace(0.0, np.pi, FINE))
    else:
        z = plane_eigenvalues(scheme, share, waves)
    return not is_unstable(z, method, courant) and not is_unstable(z, method, courant * MARGIN)


def is_unstable(z: np.ndarray, method: str, courant: float) -> bool:
    """True if a wave grows in a step at a Courant number; z : eigenvalues for a wave rate of 1."""
    return bool(np.abs(stability_function(method)(courant * z)).max() > 1.0 + GROWTH)


def plane_eigenvalues(scheme: str, share: float, waves: bool) -> np.ndarray:
    """Eigenvalues of the waves (or of advection) for all tested pairs of phases in x and y, for a wave rate of 1.

    scheme, share, waves : as for `plane_limit`
    Returns complex128[phases in y, phases in x], with a last axis of length 3 for waves.
    """
    weights = weights_of(scheme)
    x, y = np.meshgrid(np.linspace(0.0, np.pi, PHASES), np.linspace(-np.pi, np.pi, 2 * PHASES - 1))
    zx, zy = share * symbol(weights, x), (1.0 - share) * symbol(weights, y)
    if not waves:
        return zx + zy
    m = np.zeros((*zx.shape, 3, 3), dtype=complex)
    m[..., 0, 0], m[..., 1, 1], m[..., 2, 2] = zx.real + zy.real, zx.real, zy.real
    m[..., 0, 1] = m[..., 1, 0] = 1j * zx.imag
    m[..., 0, 2] = m[..., 2, 0] = 1j * zy.imag
    return np.linalg.eigvals(m)


# pipes of few cells ----------


@functools.lru_cache(maxsize=1024)
def pipe_limit(scheme: str, method: str, cells: int, returned: tuple[float, ...] = WORST) -> float:
    """Greatest Courant number up to which no mode of a pipe of `cells` cells grows; 0 if modes always grow.

    returned : products of the pressure reflection factors at both ends; the limit holds for all of these products
    """
    return greatest_courant(
        lambda courant: pipe_growth(scheme, method, cells, courant, returned) > GROWTH, RISE
    )


@functools.lru_cache(maxsize=4096)
def pipe_growth(
    scheme: str, method: str, cells: int, courant: float, returned: tuple[float, ...] = WORST
) -> float:
    """Greatest growth factor of a mode of a pipe of `cells` cells in a step, minus 1; negative if all modes decay.

    scheme, method : names; courant : Courant number
    returned : products of the pressure reflection factors at both ends
    """
    r = stability_function(method)
    return float(np.abs(r(courant * pipe_modes(scheme, cells, returned))).max()) - 1.0


@functools.lru_cache(maxsize=1024)
def pipe_modes(scheme: str, cells: int, returned: tuple[float, ...] = WORST) -> np.ndarray:
    """Eigenvalues of the waves in a pipe, divided by the cells that a wave crosses per second : complex[m].

    returned : products of the pressure reflection factors at both ends
    """
    a, b, v = wave_matrices(
        (SCHEMES[scheme].shorter or scheme) if cells < LEAST_CELLS else scheme, cells
    )
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
    inner = [
        sum(w * cell[GHOSTS + i + k] for k, w in enumerate(weights, start=-2))
        for i in range(cells - 1)
    ]
    last = END_VALUE[out, : out + 1] @ far[: out + 1]
    face = np.vstack([known[:1], *inner, last])
    rate = face[:-1] - face[1:]
    return rate[:, 1:], rate[:, 0], last[1:]

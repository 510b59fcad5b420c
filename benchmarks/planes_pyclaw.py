"""Solvers and states of PyClaw on squares of cells, set up as in its examples."""

from __future__ import annotations

import contextlib
import logging
import tempfile
import warnings
from importlib import import_module

import numpy as np
from measure import peer_module

# its import opens a log in the folder
with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
    pyclaw = peer_module("clawpack.pyclaw", "clawpack")
    riemann = pyclaw and import_module("clawpack.riemann")
    if pyclaw:
        logging.disable(logging.INFO)

FIELDS = {"vc_advection_2D": 1}  # fields of a state; three for all others
GIVEN = {"vc_advection_2D": 2, "shallow_bathymetry_fwave_2D": 1, "sw_aug_2D": 1}  # auxiliary fields


def classic(flux: str, split: bool, limited: bool = True):
    """Solver Lax-Wendroff with limited waves, by directions in turn or with transverse waves."""
    solver = pyclaw.ClawSolver2D(getattr(riemann, flux))
    solver.limiters = pyclaw.limiters.tvd.MC if limited else 0
    solver.dimensional_split, solver.transverse_waves = split, 0 if split else 2
    solver.cfl_desired, solver.cfl_max = 0.9, 1.0
    return between_walls(solver, flux)


def sharp(flux: str):
    """Solver SharpClaw with its defaults, fifth-order WENO and SSP-RK(10, 4)."""
    return between_walls(pyclaw.SharpClawSolver2D(getattr(riemann, flux)), flux)


def between_walls(solver, flux: str):
    """Solver with walls on all sides, for advection with extrapolation."""
    solver.all_bcs = pyclaw.BC.wall if FIELDS.get(flux, 3) == 3 else pyclaw.BC.extrap
    solver.aux_bc_lower[:] = solver.aux_bc_upper[:] = [pyclaw.BC.extrap] * 2
    solver.max_steps = 10**9
    return solver


def solution(flux: str, cells: int, size: float, q: np.ndarray, aux=None, **given):
    """State on cells^2; q, aux : float64[fields, ny, nx], rows by y as in fvsolve."""
    domain = pyclaw.Domain([pyclaw.Dimension(0.0, size, cells, name=name) for name in "xy"])
    state = pyclaw.State(domain, FIELDS.get(flux, 3), GIVEN.get(flux, 0))
    state.q[...] = q.transpose(0, 2, 1)
    if aux is not None:
        state.aux[...] = aux.transpose(0, 2, 1)
    state.problem_data.update(given)
    return pyclaw.Solution(state, domain)


def stepping(solver, found, step: float):
    """Function advance(steps) with steps of constant length."""
    solver.dt_variable, solver.dt = False, step
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        solver.setup(found)
    return lambda steps: solver.evolve_to_time(found, found.t + steps * step)

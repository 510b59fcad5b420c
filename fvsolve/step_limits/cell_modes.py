"""Eigenvalues of cells at the start: friction, unsteady friction, wall creep, decay and diffusion of scalars.

Friction couples the two waves of a pipe. With the slope g [1/s] of the friction force over the mass flow, the rate q of
cells that a wave crosses [1/s], and the symbol z of the scheme, the eigenvalues are
s = q Re z - g / 2 +- sqrt(g^2 / 4 - (q Im z)^2).
"""

from __future__ import annotations

import functools

import numpy as np

from fvsolve.assembly.pipe_terms import elements
from fvsolve.kernels.steady_friction import drag_slope
from fvsolve.schemes import SCHEMES
from fvsolve.step_limits.symbol import symbol

PHASES = np.linspace(0.0, np.pi, 65)
LEAST_CELLS = 3  # least number of cells of a basin for diffusion modes
DIFFUSION = 1.0 - np.cos(PHASES)  # diffusion rate of a wave, relative to 2 D / dx^2

Modes = list[tuple[str, np.ndarray]]  # places and eigenvalues there [1/s]


def cell_modes(model) -> Modes:
    """All modes of cells: pairs of the name of the part and the eigenvalues there [1/s]."""
    return [*friction_modes(model), *memory_modes(model), *pipe_scalar_modes(model), *basin_scalar_modes(model)]


def friction_modes(model) -> Modes:
    """Modes of waves in pipes with friction, at the initial flow: pairs of pipe name and eigenvalues [1/s]."""
    scheme, modes = model.case.numerics.scheme, []
    weights = SCHEMES[scheme].smooth.weights
    symbols = {n: pipe_symbol(tuple(weights), n) for n in {mesh.cells for mesh in model.pipes}}
    for mesh, row, q in zip(model.pipes, model.tables.pipes, model.wave_rates, strict=True):
        g = friction_slope(row)
        if g > 0.0 and row["delay"] < 0:
            z = symbols[mesh.cells]  # waves between two ends are longer than two cells
            root = np.sqrt(0.25 * g * g - (q * z.imag) ** 2 + 0j)
            modes.append((mesh.name, np.concatenate([q * z.real - 0.5 * g + root, q * z.real - 0.5 * g - root])))
    return modes


@functools.lru_cache(maxsize=256)
def pipe_symbol(weights: tuple, n: int) -> np.ndarray:
    """Symbol of a scheme for 65 waves between the ends of a pipe of n cells : complex128[65].

    It is the complex growth rate of a wave, divided by the rate of cells that a wave crosses.
    weights : weights of cells in the value at a face
    """
    values = symbol(weights, PHASES * (1.0 - 0.5 / n))
    values.flags.writeable = False
    return values


def memory_modes(model) -> Modes:
    """Modes of unsteady friction and creeping walls: for each pipe an estimate of the eigenvalue of the fastest decay.

    It is minus the sum of the rate of the fastest relaxation term and the gains of all terms; for unsteady friction the
    sum includes the slope of the steady friction.
    Returns pairs of the name and the eigenvalue [1/s].
    """
    modes, floats = [], model.tables.floats
    for mesh, row in zip(model.pipes, model.tables.pipes, strict=True):
        if row["terms"] > 0:
            gain, rate = floats[row["term"] : row["term"] + 2 * row["terms"]].reshape(-1, 2).T
            modes.append((f"{mesh.name}.memory", np.array([-rate.max() - gain.sum() - friction_slope(row)])))
        if row["elements"] > 0:
            gain, rate = elements(floats, row).T
            modes.append((f"{mesh.name}.creep", np.array([-rate.max() - gain.sum()])))
    return modes


def friction_slope(row) -> float:
    """Derivative of the friction force per length with respect to mass flow [1/s], at the initial flow.

    row : row of the pipe in the table of pipes
    """
    return float(drag_slope(*(row[key] for key in ("friction", "loss", "rough", "roughness", "reynolds", "flow"))))


def pipe_scalar_modes(model) -> Modes:
    """Modes of transported scalars in pipes, at the initial flow: pairs of "pipe.scalar" and eigenvalues [1/s]."""
    modes, rho = [], model.case.properties.density
    for name, scalar in model.case.scalars.items():
        for mesh, row in zip(model.pipes, model.tables.pipes, strict=True):
            q = abs(float(row["flow"])) / (rho * row["area"] * row["dx"])
            s = -q * (1.0 - np.exp(-1j * PHASES)) - 2.0 * scalar.diffusivity / row["dx"] ** 2 * DIFFUSION - scalar.decay
            modes.append((f"{mesh.name}.{name}", s))
    return modes


def basin_scalar_modes(model) -> Modes:
    """Modes of scalars in basins, from decay and from diffusion of the shortest wave of the mesh.

    Returns pairs of "basin.scalar" and eigenvalue [1/s].
    """
    return [
        (f"{basin.name}.{name}", np.array([-scalar.decay - scalar.diffusivity * greatest_diffusion_rate(basin.mesh)]))
        for name, scalar in model.case.scalars.items()
        for basin in model.basins
        if scalar.decay > 0.0 or scalar.diffusivity > 0.0
    ]


def greatest_diffusion_rate(mesh) -> float:
    """Greatest decay rate by diffusion on a mesh, over the diffusivity [1/m2]; no flux passes the boundary.

    It is 0 for fewer than 3 cells.
    """
    from scipy.sparse import coo_array, diags_array
    from scipy.sparse.linalg import eigsh

    n, left, right = mesh.area.size, mesh.left[: mesh.inner], mesh.right[: mesh.inner]
    if n < LEAST_CELLS:
        return 0.0
    near = mesh.length[: mesh.inner] / np.linalg.norm(mesh.centre[right] - mesh.centre[left], axis=1)
    through = coo_array((near, (left, right)), shape=(n, n))
    sides = np.bincount(left, near, n) + np.bincount(right, near, n)
    root = diags_array(1.0 / np.sqrt(mesh.area))
    operator = root @ (diags_array(sides) - through - through.T) @ root
    start = np.random.default_rng(1).standard_normal(n)
    return float(eigsh(operator.tocsr(), k=1, which="LM", tol=1e-3, v0=start, return_eigenvectors=False)[0])

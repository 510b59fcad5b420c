"""Modes of scalars in cells: transport, diffusion and decay."""

import numpy as np

from fvsolve.core.step_limits.growing_modes import PHASES, Modes

DIFFUSION = 1.0 - np.cos(PHASES)  # diffusion rate of a wave, relative to 2 D / dx^2
LEAST_DIFFUSION_CELLS = 3  # least number of cells of a basin for diffusion modes


def pipe_scalar_modes(model) -> Modes:
    """Modes of transported scalars in pipes, at the initial flow: pairs of "pipe.scalar" and eigenvalues [1/s]."""
    modes, rho = [], model.case.properties.density
    for name, scalar in model.case.scalars.items():
        for mesh, row in zip(model.pipes, model.tables.pipes, strict=True):
            q = abs(float(row["flow"])) / (rho * row["area"] * row["dx"])
            s = (
                -q * (1.0 - np.exp(-1j * PHASES))
                - 2.0 * scalar.diffusivity / row["dx"] ** 2 * DIFFUSION
                - scalar.decay
            )
            modes.append((f"{mesh.name}.{name}", s / model.case.retardation(mesh.name, name)))
    return modes


def basin_scalar_modes(model) -> Modes:
    """Modes of scalars in basins, from decay and from diffusion of the shortest wave of the mesh.

    Returns pairs of "basin.scalar" and eigenvalue [1/s].
    """
    return [
        (
            f"{basin.name}.{name}",
            np.array([-scalar.decay - scalar.diffusivity * greatest_diffusion_rate(basin.mesh)]),
        )
        for name, scalar in model.case.scalars.items()
        for basin in model.meshed
        if scalar.decay > 0.0 or scalar.diffusivity > 0.0
    ]


def greatest_diffusion_rate(mesh) -> float:
    """Greatest decay rate by diffusion on a mesh, over the diffusivity [1/m2]; no flux passes the boundary.

    It is 0 for fewer than 3 cells.
    """
    from scipy.sparse import coo_array, diags_array
    from scipy.sparse.linalg import eigsh

    n = mesh.area.size
    left = mesh.left[: mesh.inner]
    right = mesh.right[: mesh.inner]
    if n < LEAST_DIFFUSION_CELLS:
        return 0.0
    near = mesh.length[: mesh.inner] / np.linalg.norm(
        mesh.centre[right] - mesh.centre[left], axis=1
    )
    through = coo_array((near, (left, right)), shape=(n, n))
    sides = np.bincount(left, near, n) + np.bincount(right, near, n)
    root = diags_array(1.0 / np.sqrt(mesh.area))
    operator = root @ (diags_array(sides) - through - through.T) @ root
    start = np.random.default_rng(1).standard_normal(n)
    return float(
        eigsh(operator.tocsr(), k=1, which="LM", tol=1e-3, v0=start, return_eigenvectors=False)[0]
    )

"""Rows of the tables of a model for scalars in a given velocity."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fvsolve.basins.lower_basin import BasinRows
from fvsolve.basins.transport.lower_velocity import face_flows, grid_flows, is_outer_loop, velocity_flows
from fvsolve.errors import CaseError
from fvsolve.kernels import dtypes as rec
from fvsolve.kernels.rhs_assembly import RhsTerms


class TransportRows(BasinRows):
    """Rows of the tables of a model for a basin with a given velocity; its only states are scalars, its depth is 1.

    A velocity that crosses the outline where there is no named patch raises CaseError in `lower`.
    """

    given = banded = True

    def pieces(self, valves: bool) -> Iterator[RhsTerms]:
        yield RhsTerms(package=__package__, observe="transport_probes: observe_given_flows")

    @property
    def forms_stages(self) -> bool:
        spreads = any(self.case.scalars[name].diffusivity > 0.0 for name in self.scalars)
        return not (self.undivided_reason or self.is_fifth_order or spreads)

    def lower(self, draft, row) -> None:
        given, mesh = self.part.velocity, self.mesh
        flows = self.flows(draft)
        row["thickness"], row["density"] = self.part.thickness or 1.0, self.case.properties.density
        row["period"] = given.period or 0.0
        if self.is_grid:
            grid = mesh.grid
            flow_x, flow_y = grid_flows(mesh, flows)
            row["flows"] = draft.to_plane(np.concatenate([flow_x, flow_y]))
            kx, ky = 1.0 / np.diff(grid.x), 1.0 / np.diff(grid.y)
            along, across = abs(flow_x).reshape(grid.ny, -1), abs(flow_y).reshape(-1, grid.nx)
            through = np.maximum(along[:, 1:], along[:, :-1]) + np.maximum(across[1:], across[:-1])
            row["fastest"] = (kx * ky[:, None] * through).max()
            worst = np.unravel_index(np.argmax(kx * ky[:, None] * through), through.shape)
            self.share = float(np.maximum(along[:, 1:], along[:, :-1])[worst] / max(through[worst], 1e-300))
        else:
            row["flows"], inner = draft.to_plane(flows), mesh.inner
            through = np.bincount(mesh.left, np.abs(flows), self.n)
            through += np.bincount(mesh.right[:inner], np.abs(flows[:inner]), self.n)
            row["fastest"], self.share = (0.5 * through / mesh.area).max(), 1.0
        net = np.bincount(mesh.left, flows, self.n)
        net -= np.bincount(mesh.right[: mesh.inner], flows[: mesh.inner], self.n)
        self.max_divergence = float(np.abs(net / mesh.area).max())
        self.passing = passing = [name for name in mesh.patches if flows[mesh.patch(name)].any()]
        if mesh.patches[-1] in passing:
            own = np.arange(flows.size)[mesh.patch(mesh.patches[-1])]
            speed = np.abs(flows[own]) / mesh.length[own]
            around = is_outer_loop(mesh)[own - mesh.inner]  # report the outer outline, before the outlines of holes
            at = mesh.middle[own[np.argmax(np.where(around, speed, 0.0) if speed[around].any() else speed)]]
            text = (
                f"the flow crosses the outline at x = {at[0]:.6g} m, y = {at[1]:.6g} m, where there is no named patch"
            )
            draft.fault(f"nodes.{self.name}.velocity", f"{text}. Expected a patch with a name there")
            draft.check()
        row["unsplit"] = self.unsplit(row, passing)
        if passing:
            inward = -flows[mesh.inner :]
            row["through"] = draft.to_plane(inward[self.ring()] if self.is_grid else inward)

    def unsplit(self, row, passing: list[str]) -> float:
        """Factor by which `fastest`, the greatest rate of flow through a cell [1/s], is multiplied to limit the step.

        Without divergence and diffusion, Euler steps of Courant number 1 by this rate keep scalars within their bounds,
        except with upwind5, which has no bounds.
        row : row of the table of basins; passing : names of the patches with flow through them
        """
        if row["scheme"] in (rec.UPWIND, rec.LINEAR):
            return 1.0
        return 3.0 if row["scheme"] == rec.MUSCL and self.is_grid and passing else 2.0

    def is_open(self, patch: str) -> bool:
        return patch in self.passing

    def flows(self, draft) -> np.ndarray:
        """Flow through every face of the mesh along its normal, per thickness : float64[f] [m2/s].

        It is that at full speed, without the factor of `period`. Raises CaseError for a wrong velocity.
        """
        given, mesh = self.part.velocity.given, self.mesh
        if self.part.velocity.form == "u, v":
            return velocity_flows(mesh, *(given[key].at(*np.ascontiguousarray(mesh.middle.T)) for key in "uv"))
        if self.part.velocity.form == "stream":
            given = {"stream": given["stream"].at(*np.ascontiguousarray(mesh.points.T))}
        try:
            return face_flows(mesh, given)
        except (ValueError, TypeError, CaseError) as error:
            draft.fault(f"nodes.{self.name}.velocity", str(error))
            draft.check()
            raise

    def max_rate(self, y: np.ndarray) -> tuple[float, float]:
        return float(self.row["fastest"]), self.share

    def mass_per_depth(self) -> np.ndarray:
        return self.row["density"] * self.row["thickness"] * self.mesh.area

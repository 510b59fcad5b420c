"""Pipes in the tables of a model."""

import math

import numpy as np

from fvsolve.core.assembly.lowering import Lowering
from fvsolve.core.assembly.model_draft import PipeMesh
from fvsolve.core.assembly.pipe_terms import add_creep, reserve_terms
from fvsolve.core.assembly.scheme_codes import lower_position
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.schemes import end_rate_factor


class PipeRows(Lowering, kind="pipe"):
    """Conversion to table rows of pipes: cells with a forward and a backward wave, or a delay line."""

    table = "pipe"

    def fill(self, draft, name, link, rows) -> None:
        (row,), n, area = rows, link.cells, math.pi / 4.0 * link.diameter**2
        speed = draft.case.wave_speed(name)
        draft.ends(link, row)
        row["cells"], row["dx"], row["speed"] = n, link.length / n, speed
        row["rate_factor"] = end_rate_factor(draft.case.numerics.scheme, n)
        row["area"], row["diameter"], row["admittance"] = area, link.diameter, area / speed
        row["end_admittance"] = row["admittance"]
        row["cell"], draft.cells = draft.cells, draft.cells + n
        z = draft.node_table["elevation"][[row["from_node"], row["to_node"]]]
        row["rise"] = row["heat"] = row["present"] = -1
        if link.profile is None:
            row["slope"] = (z[1] - z[0]) / link.length
        row["noise"] = (1e-9 * draft.fluid.density * area * speed) ** 2
        row["compliance"] = draft.hydraulics.compliance(name, speed, draft.fault)
        draft.hydraulics.friction(name, link, row, draft.fault)
        if link.friction.model == "unsteady":
            reserve_terms(draft, row)
        if not any(feature.fill_pipe(draft, name, link, row) for feature in draft.features):
            names = [f"{name}.{wave}[{i}]" for wave in ("forward", "backward") for i in range(n)]
            row["y"] = draft.states(names, 0.5e5 * row["admittance"])
            add_creep(draft, name, link, row)
        x = (np.arange(n) + 0.5) * (link.length / n)
        elevation = z[0] + row["slope"] * x if link.profile is None else link.profile.at(x)
        draft.meshes.append(
            PipeMesh(
                name,
                link.from_,
                link.to,
                link.length,
                link.diameter,
                n,
                speed,
                x,
                np.linspace(0.0, link.length, n + 1),
                elevation,
                link.profile,
                (float(z[0]), float(z[1])),
            )
        )

    def force(self, draft, name, row) -> None:
        """Fill the row of a probe for the force on a pipe; report a fault for a delay line or a pipe on a body."""
        row["kind"] = rec.PIPE_FORCE
        pipe = draft.pipe_table[row["index"]]
        if pipe["cells"] == 0:
            draft.fault(
                f"links.{name}", 'a delay line has no force probe; set pipe_model = "finite-volume"'
            )
        elif pipe["forcing"] >= 0:
            draft.fault(
                f"links.{name}",
                "a pipe on a body has no force probe; use the forces of the joints of the body",
            )

    def probe(self, draft, name, probe, row) -> None:
        row["index"] = draft.pipe_names.index(name)
        if probe.quantity == "force":
            return self.force(draft, name, row)
        row["kind"] = rec.PIPE_FLOW if probe.quantity in ("flow", "velocity") else rec.PIPE_PRESSURE
        if draft.pipe_table[row["index"]]["cells"] == 0 and probe.fraction not in (0.0, 1.0):
            row["weights"] = len(draft.floats)
            draft.floats.append(probe.fraction)
        else:
            lower_position(draft, row, probe.fraction, 1 if probe.straight else None)
        if probe.straight and probe.quantity == "pressure" and not draft.case.law.cavitates:
            row["mark"] = row["index"]

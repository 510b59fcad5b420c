"""Conduits and their ends in the tables of a model."""

import math

import numpy as np

from fvsolve.core.assembly.lowering import Lowering, Restriction
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.structures import FACE_SHARE

from . import law
from .law_section import section_of


class ConduitRows(Lowering, kind="conduit"):
    """Probes of conduits; their cells are those of a basin, their ends are restrictions."""

    def probe(self, draft, name, probe, row) -> None:
        """Fill the row of a probe: the flow at an end, or values between the centres of cells, beside them constant."""
        carries = probe.quantity in draft.case.scalars
        if probe.quantity == "flow" and probe.fraction in (0.0, 1.0, None):
            end = "to" if probe.fraction == 1.0 else "from"
            row["kind"], row["index"] = (
                rec.VALVE_FLOW,
                draft.valve_names.index(f"{name}.{end}.face"),
            )
            row["side"] = -1 if end == "to" else 0
            return
        ((k, basin),) = ((k, basin) for k, basin in enumerate(draft.meshed) if basin.name == name)
        at = min(max((probe.fraction or 0.0) * basin.n - 0.5, 0.0), basin.n - 1.0)
        first = min(int(at), max(basin.n - 2, 0))
        cells, weights = [first, min(first + 1, basin.n - 1)], [1.0 - (at - first), at - first]
        row["kind"], row["index"], row["count"] = (
            rec.CELL_SCALAR if carries else rec.CELL_FIELD,
            k,
            2,
        )
        row["cell"], row["weights"] = len(draft.integers), len(draft.floats)
        draft.integers += cells
        draft.floats += weights
        if not carries:
            basin.lower_probe(row, probe.quantity, np.array(cells), np.array(weights))


class ConduitEndRows(Restriction, kind="conduit-end"):
    """Conversion to table rows of the ends of conduits: restrictions with their own law."""

    law = law

    def restriction(self, draft, name, link, row) -> None:
        conduit, gravity = draft.case.links[link.conduit], draft.case.gravity
        size = (
            draft.fluid.density
            * 0.25
            * math.pi
            * conduit.diameter**2
            * math.sqrt(gravity * conduit.diameter)
        )
        row["conductance"] = size**2 / (draft.fluid.density * gravity * conduit.diameter)
        row["chained"] = 1  # the links at the node limit its rate
        # unlike that of valves without a shaft: the velocity in the cells may change alone
        row["drive"] = 1.0

    def numbers(self, draft, name, link) -> list[float]:
        conduit = draft.case.links[link.conduit]
        section = section_of(
            draft.case.gravity, conduit.diameter, conduit.celerity(draft.case.gravity)
        )
        return [*section, 0.0, 0.0]  # the last two are written when the end is lowered

    def follow(self, start, k: int) -> None:
        """Leave the drop as it is: it is the height of the node over the water, and critical outflow has many drops."""

    def stepper(self, start, k: int, g: float, density_ratio: float):
        """Function as in `Restriction.stepper`, for water at rest."""
        link = start.case.conduits[start.draft.valve_names[k]]
        basin = next(basin for basin in start.draft.meshed if basin.name == link.conduit)
        (h, e), rho = basin.end_at_rest(link.patch), start.draft.fluid.density
        lowest = max(basin.bed[0 if link.patch == "from" else -1] - basin.part.level, 0.0)

        def step(flow, drop):
            z = lowest + float(drop) / (rho * start.case.gravity)
            inside, firm = law.end_state(basin.section, h, e, 0.0), FACE_SHARE * rec.FIRM_SLOPE
            a, s = law.level_step(basin.section, z, float(flow) / rho, inside, firm)
            return rho * a, s / start.case.gravity

        return step

"""Quasi-steady pipes in the tables of a model."""

import math

from scipy.optimize import brentq

from fvsolve.core.assembly.lowering import LAMINAR_REYNOLDS, Restriction
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.steady_friction import drag

from . import law

MOST_FLOW = 1e6  # beyond any flow of a pipe: one without losses has no flow at a drop [kg/s]
TINY_DROP = 1e-3  # of a pipe with hardly any loss [Pa]


class QuasiSteadyPipeRows(Restriction, kind="quasi-steady-pipe"):
    """Conversion to table rows of quasi-steady pipes: restrictions by the friction law of the pipe."""

    law = law

    def restriction(self, draft, name, link, row) -> None:
        """Set the conductance M^2 over the drop at 1 m/s, by which scales of flows are computed."""
        *friction, per, _ = self.coefficients(draft, name, link, lambda *_: None)
        flow = draft.fluid.density * math.pi / 4.0 * link.diameter**2
        row["chained"] = 1
        row["conductance"] = flow * flow / max(per * drag(*friction, flow), TINY_DROP)

    def numbers(self, draft, name, link) -> list[float]:
        return self.coefficients(draft, name, link, draft.fault)

    def coefficients(self, draft, name, link, fault) -> list[float]:
        """Numbers of a pipe, see `law`; fault : function (place, text) for a missing viscosity"""
        area, friction = math.pi / 4.0 * link.diameter**2, dict.fromkeys(law.DRAG, 0.0)
        draft.hydraulics.friction(name, link, friction, fault)
        # water's: it only bounds the slope at no flow
        viscosity = draft.fluid.viscosity or 1e-6 * draft.fluid.density
        least = LAMINAR_REYNOLDS * math.pi / 4.0 * link.diameter * viscosity
        return [*(float(friction[key]) for key in law.DRAG), link.length / area, least]

    smooths = True

    def smooth(self, draft, row, drop: float) -> None:
        """Raise the flow below which the losses are an odd cubic to the flow at this drop [Pa]."""
        at = int(row["data"])
        *friction, per, least = draft.floats[at : at + law.LEAST + 1]
        kind = int(friction[law.KIND])
        if kind == rec.FRICTION_ROUGH:  # linear where it is laminar
            return

        def rest(flow):
            return per * drag(kind, *friction[1:], flow) - drop

        most = least
        while rest(most) < 0.0 and most < MOST_FLOW:
            most *= 2.0
        if most > least and most < MOST_FLOW:
            draft.floats[at + law.LEAST] = brentq(rest, least, most)

    def probe(self, draft, name, probe, row) -> None:
        super().probe(draft, name, probe, row)
        link, x, row["weights"] = draft.case.links[name], probe.fraction, len(draft.floats)
        if probe.quantity in ("flow", "velocity"):
            draft.floats.append(math.pi / 4.0 * link.diameter**2)
            return
        row["kind"], row["index"], row["cell"] = (
            rec.PRESSURE_BETWEEN,
            *(draft.node_index[end] for end in (link.from_, link.to)),
        )
        low, high = draft.node_table["elevation"][[row["index"], row["cell"]]]
        axis = float(draft.case.axis_elevation(name, x))
        below = low + x * (high - low) - axis  # the line between both ends
        draft.floats += [x, axis, float(draft.fluid.density * draft.case.gravity * below)]

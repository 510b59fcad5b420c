"""Links by a curve of losses in the tables of a model."""

import numpy as np

from fvsolve.core.assembly.lowering import Restriction

from . import law

LEAST_FLOW = 1e-6  # flow up to which a loss at no flow grows from 0, over the second flow
# rise of the loss over a section, over the loss, per flow over the last flow of the section
LEAST_SLOPE = 1e-7
# difference from the loss of the curve at the start that counts as none, over the loss
SMALL_LOSS = 1e-6


class LossCurveRows(Restriction, kind="loss-curve"):
    """Conversion to table rows of links by a curve of losses: restrictions with a law of their own."""

    law = law

    def restriction(self, draft, name, link, row) -> None:
        """Set the conductance M^2 over the drop at the last point, by which scales of flows are computed."""
        flow, loss = self.curve(draft, link)
        ends = (draft.case.places[end] for end in (link.from_, link.to))
        # the links there limit the rate of its flow
        row["chained"] = any(node.kind == "junction" for node in ends)
        row["conductance"] = flow[-1] * flow[-1] / loss[-1]

    def numbers(self, draft, name, link) -> list[float]:
        flow, loss = self.curve(draft, link)
        return [float(len(flow)), *flow, *loss]

    def curve(self, draft, link) -> tuple[list[float], list[float]]:
        """Mass flows [kg/s] and losses [Pa] of the points at the reference density; both rise strictly from 0.

        A loss at no flow moves to a small flow, and a constant loss gets a small slope.
        """
        density, points = draft.fluid.density, link.loss
        weight = density * draft.case.gravity if points.quantity == "head" else 1.0
        flow, loss = [density * q for q in points.flow], [weight * size for size in points.value]
        if flow[0] == 0.0 and loss[0] > 0.0:
            flow[0] = LEAST_FLOW * flow[1]
        if flow[0] > 0.0:
            flow, loss = [0.0, *flow], [0.0, *loss]
        for k in range(1, len(flow)):
            scale = loss[k] or loss[-1]
            least = LEAST_SLOPE * scale * (flow[k] - flow[k - 1]) / flow[k]
            loss[k] = max(loss[k], loss[k - 1] + least)
        return flow, loss

    def follow(self, start, k: int) -> None:
        """Set the steady drop of the link to the loss of its flow, under the density law `linear`.

        If the drop found in the steady problem does not agree, the link counts as not open.
        """
        row, (drop, ratio) = start.valves[k], start.valve_drive(k)
        if row["open"] <= 0.0:
            return
        at, flow = int(row["data"]), float(row["flow"]) / ratio
        floats, count = start.draft.tables.floats, int(start.draft.tables.floats[at + law.COUNT])
        flows, losses = np.split(np.asarray(floats[at + law.FLOWS : at + law.FLOWS + 2 * count]), 2)
        last = (losses[-1] - losses[-2]) / (flows[-1] - flows[-2])
        size = abs(flow)
        lost = ratio * np.copysign(
            np.interp(size, flows, losses) + last * max(size - flows[-1], 0.0), flow
        )
        if abs(lost - drop) > SMALL_LOSS * (SMALL_LOSS * losses[-1] + abs(lost)):
            row["open"] = 0.0
        elif start.case.law.linear:
            row["drop"] = lost

"""Torques on shafts and bodies in the tables of a model."""

from __future__ import annotations

import numpy as np

from fvsolve.assembly.inputs import TORQUE, Input
from fvsolve.assembly.lowering import Lowering, lowering_of
from fvsolve.assembly.mechanics import PushLowering, join_ports
from fvsolve.kernels import dtypes as rec
from fvsolve.parts.force.lower import brace_of
from fvsolve.parts.pump.law import OWN_NUMBERS
from fvsolve.parts.pump.lower_drive import torques_on


class TorqueRows(Lowering, kind="torque"):
    """Conversion of torques on shafts; they have no rows, because the pump or turbine contains their parameters."""

    def of(self, part):
        return self if part.axis is None else BODY_TORQUES

    def inputs(self, model, name, part):
        turned = part.to.removesuffix(".shaft")
        row = lowering_of(type(model.case.links[turned])).row_of(model, turned)
        place = [torque is part for torque in torques_on(model.case, turned)].index(True)
        return {"torque": Input(TORQUE, int(model.tables.floats[row["data"] + OWN_NUMBERS + 2 * place]))}


class BodyTorqueRows(PushLowering):
    """Conversion to table rows of torques about an axis of a body, which follow a schedule."""

    ledger_name = "supplied"
    table, rank = "brace", 3

    def fill(self, draft, name, link, rows) -> None:
        (row,) = rows
        axis = rec.ABOUT, link.axis / np.linalg.norm(link.axis)
        _, row["speed"] = join_ports(draft, row, ("from_mass", "to_mass"), (link.from_, link.to), *axis)
        row["schedule"] = draft.schedules.add(link.torque)

    def inputs(self, model, name, part):
        return {"torque": Input(TORQUE, brace_of(model, name)["schedule"].item())}


BODY_TORQUES = BodyTorqueRows()

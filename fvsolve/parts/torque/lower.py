"""Torques on shafts of pumps in the tables of a model: their schedules stand among the numbers of the pump."""

from __future__ import annotations

from fvsolve.model.inputs import TORQUE, Input
from fvsolve.model.lowering import Lowering, lowering_of
from fvsolve.parts.pump.law import OWN_NUMBERS
from fvsolve.parts.pump.lower import torques_on


class TorqueRows(Lowering, kind="torque"):
    """What its pump adds up."""

    def inputs(self, model, name, part):
        pump = part.to.removesuffix(".shaft")
        row = lowering_of(type(model.case.links[pump])).row_of(model, pump)
        place = [one is part for one in torques_on(model.case, pump)].index(True)
        return {"torque": Input(TORQUE, int(model.tables.floats[row["data"] + OWN_NUMBERS + 2 * place]))}

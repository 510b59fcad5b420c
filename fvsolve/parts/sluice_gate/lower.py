"""Sluice gates in the tables of a model."""

from fvsolve.assembly.lowering import GATE_OPENING
from fvsolve.parts.weir.lower import StructureRows, weir_size
from fvsolve.parts.weir.part import COEFFICIENTS

from . import law


class SluiceGateRows(StructureRows, kind="sluice-gate"):
    """Conversion to table rows of sluice gates."""

    law, setting, setting_input, bottom_key = law, "opening", GATE_OPENING, "sill"

    def bottoms(self, part) -> tuple[float, float]:
        return part.sill, part.sill

    def size(self, draft, part) -> float:
        return weir_size(draft, part.width, COEFFICIENTS[part.weir_kind])

    def numbers(self, draft, name, part) -> list[float]:
        self.schedule(draft, name, part)
        return [part.width, part.sill, part.contraction, self.size(draft, part), draft.case.gravity]

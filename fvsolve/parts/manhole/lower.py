"""Manholes in the tables of a model."""

import math

from fvsolve.parts.weir.lower import StructureRows, weir_size

from . import law


class ManholeRows(StructureRows, kind="manhole"):
    """Conversion to table rows of manholes."""

    law = law

    def bottoms(self, part) -> tuple[float, float]:
        return part.crest, part.crest

    def size(self, draft, part) -> float:
        return part.orifice_coefficient * part.area * math.sqrt(2.0 * draft.case.gravity)

    def numbers(self, draft, name, part) -> list[float]:
        drop = weir_size(draft, part.perimeter, part.weir_coefficient)
        # the street is at the end `to` if only that end is a patch of a basin
        from_basin, to_basin = (
            draft.case.places[end].kind.startswith("patch") for end in (part.from_, part.to)
        )
        return [part.crest, drop, self.size(draft, part), float(from_basin or not to_basin)]

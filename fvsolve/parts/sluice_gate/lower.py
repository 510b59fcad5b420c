"""Sluice gates in the tables of a model."""

from fvsolve.core.assembly.lowering import GATE_OPENING
from fvsolve.errors import Notice
from fvsolve.parts.weir.lower import StructureRows, weir_size
from fvsolve.parts.weir.part import COEFFICIENTS

from . import law

# opening over the depth at the start above which a gate is hardly meant to touch the water
FAR_ABOVE = 3.0


class SluiceGateRows(StructureRows, kind="sluice-gate"):
    """Conversion to table rows of sluice gates."""

    law = law
    setting = "opening"
    setting_input = GATE_OPENING
    bottom_key = "sill"

    def bottoms(self, part) -> tuple[float, float]:
        return part.sill, part.sill

    def begin(self, start, part, row):
        """Add a notice also to a gate that the water never touches, see `highest_level`."""
        depth, known = self.highest_level(start, part, row)
        depth, opening = depth - part.sill, part.opening
        least = opening.value.min() if opening.kind not in ("control", "formula") else 0.0
        if depth > 0.0 and least > depth * (1.0 if known else FAR_ABOVE):
            name, amount = start.draft.valve_names[row["valve"]], start.case.amount
            text = (
                f"{name}: the opening of {amount(float(least), 'length')} above the sill is above the water there, "
                f"{amount(depth, 'length')} deep {'at most' if known else 'at the start'}, so that the gate is a "
                "weir; `opening` counts from the sill"
            )
            start.draft.warnings.append(
                Notice("range", f"links.{name}", text, "opening", float(least), depth)
            )
        return super().begin(start, part, row)

    @staticmethod
    def highest_level(start, part, row) -> tuple[float, bool]:
        """(Higher level at the ends [m], True if that of all times): of reservoirs at all times, else at the start."""
        ends = [start.case.nodes.get(end) for end in (part.from_, part.to)]
        if all(getattr(node, "head", None) is not None for node in ends):
            return max(float(node.head.value.max()) for node in ends), True
        valve = start.valves[row["valve"]]
        ambient = start.law.potential_of(start.case.ambient_pressure, 0.0)
        potential = max(
            float(start.answer.potential[valve[end]]) for end in ("from_node", "to_node")
        )
        return (potential - ambient) / start.weight, False

    def size(self, draft, part) -> float:
        return weir_size(draft, part.width, COEFFICIENTS[part.weir_kind])

    def numbers(self, draft, name, part) -> list[float]:
        self.schedule(draft, name, part)
        return [part.width, part.sill, part.contraction, self.size(draft, part), draft.case.gravity]

"""Solenoids in the tables of a model, and in the network of their circuit and armature."""

from math import asinh, pi, sinh, sqrt

from fvsolve.core.assembly.features import coordinate_of
from fvsolve.core.assembly.lowering import Device
from fvsolve.parts import law_elements as codes
from fvsolve.parts.network_elements import FLOW, Element, node_or_reference
from fvsolve.parts.solenoid import law

MU_0 = 4e-7 * pi  # permeability of the vacuum, to 1e-9 [H/m]
SMALL_FLUX_DENSITY = 0.1  # sets the size of a small flux [T]


class SolenoidRows(Device, kind="solenoid"):
    """Conversion of solenoids to a state, and to sources of current and force that follow it."""

    law = law
    table = ""
    states = ("flux_linkage",)
    quantities = ("current", "flux", "force")
    events = ("passes its closed position", "passes its closed position")
    remedy = "keep a gap between end stop and `closed_position`"

    def network_elements(self, case, name, part):
        place = f"links.{name}"
        p, n = (node_or_reference(case, part.ports[port]) for port in "pn")
        armature = part.ports["armature"]
        found = [
            Element(
                FLOW,
                place,
                place,
                (p, n),
                state=f"{name}.flux",
                initial=part.initial_flux,
                state_of=("device", name),
                unit=1.0 / part.turns,
                reads=(codes.DEVICE_INPUT, (name, "current", 1.0)),
            )
        ]
        if case.nodes[armature].kind == "mass":
            reads = codes.DEVICE_INPUT, (name, "force", 1.0)
            found.append(Element(FLOW, f"{place}.force", place, (None, armature), reads=reads))
        return found, []

    def numbers(self, draft, name, part) -> list[float]:
        saturation = 0.0 if part.saturation_flux is None else part.saturation_flux**-2
        per_gap = 1.0 / (MU_0 * part.pole_area)
        return [
            part.turns,
            part.core_reluctance,
            saturation,
            per_gap,
            part.closed_position,
            0.0,
            0.0,
            0.0,
        ]

    def scales(self, draft, name, part) -> list[float]:
        return [SMALL_FLUX_DENSITY * part.pole_area * part.turns]

    def begin(self, start, part, row) -> list[str]:
        armature = coordinate_of(start.draft, part.ports["armature"])
        numbers = start.draft.tables.floats
        row["travel"] = armature.y
        numbers[row["data"] + law.POSITION], numbers[row["data"] + law.SPEED] = (
            armature.position,
            armature.velocity,
        )
        start.draft.start_flags[int(row["event"])] = self.distance(start, part) >= 0.0
        return []

    def distance(self, start, part) -> float:
        """Distance from the armature to its closed position at the start [m]."""
        return float(
            part.closed_position - coordinate_of(start.draft, part.ports["armature"]).position
        )

    def source_at_start(self, start, part, row, quantity: str, flow: float) -> float:
        numbers = start.draft.tables.floats
        at = int(row["data"])
        distance = self.distance(start, part)
        side = 1.0 if distance >= 0.0 else -1.0
        flux = part.initial_flux
        if flux is None:  # from (slope + cubic Phi^2) Phi = turns times current
            slope = numbers[at + law.CORE] + numbers[at + law.PER_GAP] * side * distance
            cubic = numbers[at + law.CORE] * numbers[at + law.SATURATION]
            flux = numbers[at + law.TURNS] * flow / slope
            if cubic > 0.0:
                size = sqrt(slope / (3.0 * cubic))
                flux = 2.0 * size * sinh(asinh(1.5 * flux / size) / 3.0)
        numbers[at + law.FLUX] = flux
        compute = getattr(law.quantity_of, "py_func", law.quantity_of)
        return float(compute(self.quantities.index(quantity), numbers, at, flux, distance, side))

    def energy_rows(self, model, part, row, y, out):
        """Row of the energy matrix L for the flux at constant position: energy slope d^2 / (2 turns^2).

        d is the deviation of the flux linkage, slope the derivative of reluctance times flux by the flux [1/H].
        """
        numbers, at = model.tables.floats, int(row["data"])
        flux = numbers[at + law.FLUX] + y[row["y"]] / part.turns
        moved = y[row["travel"]] if row["travel"] >= 0 else 0.0
        gap = abs(part.closed_position - numbers[at + law.POSITION] - moved)
        slope = part.core_reluctance * (1.0 + 3.0 * numbers[at + law.SATURATION] * flux**2)
        slope += numbers[at + law.PER_GAP] * gap
        return [{int(row["y"]): float(sqrt(0.5 * slope) / part.turns)}]

    def above(self, model, part, row) -> float:
        numbers, at = model.tables.floats, int(row["data"])
        distance = part.closed_position - float(numbers[at + law.POSITION])
        compute = getattr(law.quantity_of, "py_func", law.quantity_of)
        side = 1.0 if distance >= 0.0 else -1.0
        return float(compute(law.ENERGY, numbers, at, numbers[at + law.FLUX], distance, side))

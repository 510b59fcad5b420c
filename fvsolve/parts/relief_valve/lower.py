"""Relief valves in the tables of a model, without or with disc dynamics."""

from fvsolve.assembly.device_lowering import Device
from fvsolve.errors import Notice
from fvsolve.parts.disc.law import RELIEF
from fvsolve.parts.disc.lower import LiftedValve
from fvsolve.parts.relief_valve import law


class ReliefDisc(LiftedValve, kind=""):
    """Conversion to table rows of relief valves with disc dynamics."""

    mode = RELIEF

    def lifting_pressure(self, start, k):
        i, part = int(start.valves[k]["from_node"]), self.part(start, k)
        return start.law.pressure_of(start.answer.potential[i], float(start.nodes["elevation"][i])) - part.set_pressure

    def row(self, start, k: int):
        i, part = int(start.valves[k]["from_node"]), self.part(start, k)
        z = float(start.nodes["elevation"][i])

        def newton(flow, drop, potential):
            x = (start.law.pressure_of(potential, z) - part.set_pressure) / part.overpressure
            target, slope, rise = self.flow_at(start, k, drop, x)
            rise /= part.overpressure
            size = max(slope + rise, 1e-12 * start.flow_scale)
            return 1.0 / size, slope / size, (target - flow) / size, rise / size

        return newton

    def add_start_notices(self, start, name, x):
        if x > 0.0:
            text = f"{name}: the relief valve is open at the start, lift {x:.3g} of 1"
            start.draft.warnings.append(Notice("start", f"links.{name}", text, "lift", float(x)))


class ReliefSwing(ReliefDisc, kind=""):
    """Conversion to table rows of relief valves with an oscillating disc (mass, spring, damper)."""

    states = ("opening", "speed")


class ReliefLag(ReliefDisc, kind=""):
    """Conversion to table rows of relief valves whose disc has a first-order lag."""

    states = ("opening",)


class Relief(ReliefDisc, kind="relief-valve"):
    """Conversion to table rows of relief valves whose lift follows the pressure at once."""

    law, controlling_event = law, -1
    events = ("is shut", "opens", "is fully open", "leaves full opening")

    def of(self, part) -> Device:
        return self if not part.has_dynamics else ReliefLag() if part.natural_frequency is None else ReliefSwing()

    def numbers(self, draft, name, part) -> list[float]:
        return [0.0, part.overpressure, 0.0]

    def store_lift(self, start, row, x, target):
        start.draft.tables.floats[row["data"]] = target

"""Check valves in the tables of a scene."""

from __future__ import annotations

from fvsolve.errors import Notice
from fvsolve.model.device import Device
from fvsolve.parts.check_valve import law
from fvsolve.parts.disc.law import CHECK
from fvsolve.parts.disc.lower import Lifting

SMALL_FLOW = 1e-9  # share of the flows of a scene below which a reversed one is rounding


class CheckDisc(Lifting, kind=""):
    """A check valve whose disc takes its time."""

    mode = CHECK

    def felt(self, start, k):
        before, behind = start.across(k)
        return (before - behind) * start.ratio.get(k, 1.0) - self.part(start, k).cracking_pressure

    def row(self, start, k: int):
        part, ratio = self.part(start, k), start.ratio.get(k, 1.0)

        def newton(flow, drop, potential):
            asked, slope, rise = self.flow_at(
                start, k, drop, (drop * ratio - part.cracking_pressure) / part.overpressure
            )
            slope += rise * ratio / part.overpressure
            size = max(slope, 1e-12 * start.flow_scale)
            return 1.0 / size, slope / size, (asked - flow) / size, 0.0

        return newton

    def tell(self, start, name, x):
        """A disc beside other valves does not lead the column that they hold together."""
        valve, nodes = start.valves[start.draft.valve_names.index(name)], start.nodes
        if any(
            nodes["gates"][valve[end]] >= 0 and nodes["gate_count"][valve[end]] > 1 for end in ("from_node", "to_node")
        ):
            text = (f"{name}: its disc and other valves hold a rigid column: its lift and flow are not to be trusted "
                    "from where it leaves its seat; make the column a pipe, or put a chamber between them")  # fmt: skip
            start.draft.warnings.append(Notice("range", f"links.{name}", text))

    def next(self, x, back, now):
        return "shut" if back and now != "shut" else super().next(x, back, now)


class CheckSwing(CheckDisc, kind=""):
    """The same with inertia."""

    states = ("opening", "speed")


class CheckLag(CheckDisc, kind=""):
    """The same without."""

    states = ("opening",)


class CheckValveRows(Device, kind="check-valve"):
    """Open or shut; its steady state is that in which no open one flows back and no shut one is pushed open."""

    law, sudden = law, True
    quantities = ("opening",)
    events = ("shuts", "opens")

    def of(self, part) -> Device:
        return self if not part.moves else CheckLag() if part.natural_frequency is None else CheckSwing()

    def numbers(self, draft, name, part) -> list[float]:
        return [part.cracking_pressure]

    def revise(self, start, part, row) -> bool:
        k = int(row["valve"])
        if k in start.shut:
            before, behind = start.across(k)
            opens = before - behind > part.cracking_pressure + 1e-6
            start.shut -= {k} if opens else set()
            return opens
        shuts = start.valve_flows()[k] < -SMALL_FLOW * start.flow_scale
        start.shut |= {k} if shuts else set()
        return shuts

"""Check valves in the tables of a model, and their states at the start."""

import numpy as np

from fvsolve.assembly.device_lowering import Device
from fvsolve.errors import Notice
from fvsolve.parts.check_valve import law, law_slam
from fvsolve.parts.disc.law import CHECK
from fvsolve.parts.disc.lower import LiftedValve

DIFFERENCE_TIME = 1e-6  # interval of the difference quotient for the deceleration of the flow [s]
SMALL_FLOW = 1e-9  # share of the flow scale below which a reversed flow is rounding


class CheckDisc(LiftedValve, kind=""):
    """Conversion to table rows of check valves whose disc moves with a delay."""

    mode = CHECK

    def lifting_pressure(self, start, k):
        before, behind = start.across(k)
        return (before - behind) * start.ratio.get(k, 1.0) - self.part(start, k).cracking_pressure

    def row(self, start, k: int):
        part, ratio = self.part(start, k), start.ratio.get(k, 1.0)

        def newton(flow, drop, potential):
            target, slope, rise = self.flow_at(
                start, k, drop, (drop * ratio - part.cracking_pressure) / part.overpressure
            )
            slope += rise * ratio / part.overpressure
            size = max(slope, 1e-12 * start.flow_scale)
            return 1.0 / size, slope / size, (target - flow) / size, 0.0

        return newton

    def add_start_notices(self, start, name, x):
        """Add a notice if the disc and other valves join the same rigid column, which the disc then cannot control."""
        valve, nodes = start.valves[start.draft.valve_names.index(name)], start.nodes
        if any(
            nodes["gates"][valve[end]] >= 0 and nodes["gate_count"][valve[end]] > 1 for end in ("from_node", "to_node")
        ):
            text = (f"{name}: its disc and other valves join the same rigid column: its lift and flow are not reliable "
                    "once it leaves its seat; make the column a pipe, or put a chamber between them")  # fmt: skip
            start.draft.warnings.append(Notice("range", f"links.{name}", text))

    def next_mode(self, x, back, now):
        return "shut" if back and now != "shut" else super().next_mode(x, back, now)


class InertialCheckDisc(CheckDisc, kind=""):
    """Conversion to table rows of check valves whose disc has inertia."""

    states = ("opening", "speed")


class LaggedCheckDisc(CheckDisc, kind=""):
    """Conversion to table rows of check valves whose disc has a first-order lag, without inertia."""

    states = ("opening",)


class CheckValveRows(Device, kind="check-valve"):
    """Conversion to table rows of check valves that are either open or shut.

    In the steady state no open valve has reverse flow, and no shut valve has a drop that opens it.
    """

    law, events_only = law, True
    quantities = ("opening",)
    events = ("shuts", "opens")

    def of(self, part) -> Device:
        if part.deceleration is not None:
            return SlamCurveRows()
        return (
            self
            if not part.has_dynamics
            else LaggedCheckDisc()
            if part.natural_frequency is None
            else InertialCheckDisc()
        )

    def numbers(self, draft, name, part) -> list[float]:
        return [part.cracking_pressure]

    def revise_state(self, start, part, row) -> bool:
        k = int(row["valve"])
        if k in start.shut:
            before, behind = start.across(k)
            opens = before - behind > part.cracking_pressure + 1e-6
            start.shut -= {k} if opens else set()
            return opens
        shuts = start.valve_flows()[k] < -SMALL_FLOW * start.flow_scale
        start.shut |= {k} if shuts else set()
        return shuts


class SlamCurveRows(CheckValveRows, kind=""):
    """Conversion to table rows of check valves that shut at the reverse velocity of their manufacturer's curve."""

    law = law_slam
    states = ("slam_velocity", "deceleration")
    events = ("flow reverses", "shuts", "flow is forward again", "flow reverses faster than its curve covers")
    remedy = "give the curve of the check valve a greater reverse_velocity"

    def numbers(self, draft, name, part) -> list[float]:
        return [part.cracking_pressure, draft.fluid.density * part.bore_area, part.deceleration.rate[-1]]

    def scales(self, draft, name, part) -> list[float]:
        return [1.0, 1.0]

    def apply_event(self, run_data, row, t, y, scale) -> None:
        o, at, curve = row["y"], row["event"], run_data.model.case.conduits[self.name(run_data, row)].deceleration
        if run_data.armed[at + law_slam.REVERSED] == 0.0:
            y[o] = y[o + 1] = 0.0
        elif y[o] == 0.0:
            y[o + 1] = self.deceleration(run_data, row, t, y)
            y[o] = max(float(np.interp(y[o + 1], curve.rate, curve.reverse_velocity)), law_slam.SMALLEST)

    def name(self, run_data, row) -> str:
        return run_data.model.valve_names[row["valve"]]

    def deceleration(self, run_data, row, t: float, y) -> float:
        """Deceleration [m/s2] of the flow in the bore at a state, by a backward difference in time; at least 0."""
        model, k = run_data.model, int(run_data.model.layout["valve"] + row["valve"])
        dydt, now, before = np.zeros(y.size), model.new_out(), model.new_out()
        model.functions.rhs(t, y, dydt, now, run_data.handle)
        model.functions.rhs(t - DIFFERENCE_TIME, y - DIFFERENCE_TIME * dydt, np.zeros(y.size), before, run_data.handle)
        full = model.tables.floats[row["data"] + law_slam.UNIT_FLOW]
        return max(float(before[k] - now[k]) / (DIFFERENCE_TIME * full), 0.0)

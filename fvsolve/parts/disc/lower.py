"""Valves with a disc that pressure lifts, in the tables of a model, and their states at the steady start."""

import math

from fvsolve.assembly.device_lowering import Device, opening_of
from fvsolve.kernels.restrictions import LEAST, flow_at_drop, flow_slope, transition_of
from fvsolve.parts.disc import law
from fvsolve.steady import Edge

LIFTING, OPEN = "lifting", "open"  # modes of a valve; shut valves are in `start.shut`
SEAT_DEPTH = 1e-12  # lift below the seat of a disc that has slammed, so that rounding does not open it
SMALL_LIFT = 1e-9  # lift that counts as rounding
# control of a column (the last two) is not reported
STOP_EVENTS = ("is fully open", "leaves full opening", "is shut", "leaves its seat", "", "")


class LiftedValve(Device, kind=""):
    """Conversion to table rows of valves that a pressure lifts; they are shut, fully open, or partly lifted.

    A disc with a delay has its lift as a state.
    """

    law, controlling_event = law, 4
    quantities = ("opening",)
    events = STOP_EVENTS
    remedy = "give the disc a greater overpressure"

    def numbers(self, draft, name, part) -> list[float]:
        """Parameters of the disc in the order of `law`: lift, target, lifting pressure at the start, then its keys."""
        frequency = part.natural_frequency or 0.0
        return [0.0, 0.0, 0.0, part.overpressure, part.time_constant or 0.0, 2.0 * math.pi * frequency,
                part.damping_ratio or 0.0]  # fmt: skip

    def scales(self, draft, name, part) -> list[float]:
        return [0.1, 0.1 * 2.0 * math.pi * (part.natural_frequency or 1.0)][: len(self.states)]

    def apply_event(self, run_data, row, t, y, scale) -> None:
        tables = run_data.model.tables
        stop, seat = (run_data.armed[row["event"] + k] > 0.0 for k in (0, 2))
        if self.states and seat and law.disc_lift(y, tables, row) > 0.0:  # the disc has slammed
            y[row["y"]] = -tables.floats[row["data"] + law.LIFT] - SEAT_DEPTH
        if row["states"] == 2 and (stop or seat):
            y[row["y"] + 1] = 0.0

    def part(self, start, k: int):
        return start.draft.devices[start.valves[k]["device"]][1]

    def lifting_pressure(self, start, k: int) -> float:
        """Lifting pressure of valve k minus its opening pressure [Pa], in the present iteration of the steady start."""
        raise NotImplementedError

    def edge(self, start, k):
        if start.rest:
            start.shut.add(k)
        if k in start.shut or start.valve_modes.setdefault(k, LIFTING) == OPEN:
            return None
        i, j = (int(start.valves[k][end]) for end in ("from_node", "to_node"))
        return Edge(i, j, self.row(start, k), 0.0, sensed_node=i)

    def follow(self, start, k) -> None:
        """Do nothing: the function `begin` sets the drop of valve k."""

    def flow_at(self, start, k: int, drop: float, lift: float) -> tuple[float, float, float]:
        """(mass flow [kg/s], its derivative by the drop [kg/s/Pa], its derivative by the lift [kg/s]) of valve k.

        drop : drop across the valve [Pa]; lift : lift of the disc [-], a negative lift counts as 0
        """
        g = float(start.valves[k]["conductance"]) * start.factor.get(k, 1.0)
        transition = transition_of(start.valves[k], g)
        full, x = flow_at_drop(g, transition, drop), max(lift, 0.0)
        steep = flow_slope(g, transition, drop) if transition > 0.0 else 0.5 * g / max(abs(full), LEAST * math.sqrt(g))
        return x * full, x * steep, max(full, 0.0)

    def revise_state(self, start, part, row) -> bool:
        k = int(row["valve"])
        if start.rest:
            return False
        before = "shut" if k in start.shut else start.valve_modes[k]
        x, flow = self.lifting_pressure(start, k) / part.overpressure, float(start.valve_flows()[k])
        after = self.next_mode(x, flow < -SMALL_LIFT * start.flow_scale, before)
        start.shut = start.shut | {k} if after == "shut" else start.shut - {k}
        start.valve_modes[k] = LIFTING if after == "shut" else after
        return after != before

    def next_mode(self, x: float, back: bool, now: str) -> str:
        """Mode of a valve in the next iteration of the steady start: "shut", LIFTING or OPEN.

        x : lift that follows from the pressures, not limited to 0 to 1
        back : True if the flow is reversed; now : present mode
        """
        if now == "shut":
            return LIFTING if x > SMALL_LIFT else now
        if x < -SMALL_LIFT:
            return "shut"
        return OPEN if now == LIFTING and x > 1.0 else LIFTING if now == OPEN and x < 1.0 - SMALL_LIFT else now

    def begin(self, start, part, row) -> list[str]:
        k = int(row["valve"])
        valve, name = start.valves[k], start.draft.valve_names[k]
        lifts = k not in start.shut and start.valve_modes[k] == LIFTING
        x = 0.0 if k in start.shut else opening_of(start, k) if lifts else 1.0
        self.store_lift(start, row, x, x if lifts else self.lifting_pressure(start, k) / part.overpressure)
        valve["open"] = valve["conductance"] * x * x if self.states or x == 0.0 else valve["conductance"]
        if self.states and x > 0.0 and valve["transition"] == 0.0:
            valve["drop"] = abs(valve["flow"]) * valve["flow"] / valve["open"]
        start.draft.tables.floats[row["data"] + 2] = start.valve_law(k)[1]
        self.add_start_notices(start, name, x)
        target = self.lifting_pressure(start, k) / part.overpressure
        return (
            [f"{name}: the valve is shut at the start, although the pressure there would open the valve"]
            if start.rest and target > SMALL_LIFT
            else []
        )

    def store_lift(self, start, row, x: float, target: float) -> None:
        """Store the lift x and the target lift at the start in the parameters of the disc.

        row : row of the disc in the table of devices
        """
        start.draft.tables.floats[row["data"] : row["data"] + 2] = x, target

    def add_start_notices(self, start, name: str, x: float) -> None:
        """Add notices about a valve to the draft of the model, if its kind has any; x : lift at the start"""

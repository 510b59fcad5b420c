"""Self-acting valves in the tables of a model, and their states at the steady start."""

import math
from typing import ClassVar, NamedTuple

import numpy as np

from fvsolve.core.assembly.lowering import FLOW, SET_PRESSURE, Device, Input, opening_of
from fvsolve.core.kernels.dtypes import NOT_HELD
from fvsolve.core.kernels.restrictions import LEAST, flow_at_drop, flow_slope, transition_of
from fvsolve.core.steady import Edge
from fvsolve.errors import Notice
from fvsolve.parts.self_acting import (
    law_at_once,
    law_check_valve,
    law_disc,
    law_regulating,
    law_relief_valve,
    law_slam,
)
from fvsolve.parts.self_acting.law_disc import CHECK, RELIEF
from fvsolve.parts.tolerances import is_head_above

LIFTING, OPEN = "lifting", "open"  # modes of a valve; shut valves are in `start.shut`
# lift below the seat of a disc that has slammed, so that rounding does not open it
SEAT_DEPTH = 1e-12
SMALL_LIFT = 1e-9  # lift that counts as rounding
# control of a column (the last two) is not reported
STOP_EVENTS = ("is fully open", "leaves full opening", "is shut", "leaves its seat", "", "")


class LiftedValve(Device, kind=""):
    """Conversion to table rows of valves that a pressure lifts; they are shut, fully open, or partly lifted.

    A disc with a delay has its lift as a state.
    """

    law, controlling_event = law_disc, 4
    quantities = ("opening",)
    events = STOP_EVENTS
    remedy = "give the disc a greater overpressure"

    def moved_as(self, part) -> Device:
        """Conversion with the states of the disc of a part: it follows with a first-order lag, or it has inertia."""
        return self.varied(
            states=("opening",) if part.natural_frequency is None else ("opening", "speed")
        )

    def numbers(self, draft, name, part) -> list[float]:
        """Parameters of the disc in the order of `law_disc`: three values at the start, then its keys."""
        frequency = part.natural_frequency or 0.0
        return [
            0.0,
            0.0,
            0.0,
            part.overpressure,
            part.time_constant or 0.0,
            2.0 * math.pi * frequency,
            part.damping_ratio or 0.0,
        ]

    def scales(self, draft, name, part) -> list[float]:
        return [0.1, 0.1 * 2.0 * math.pi * (part.natural_frequency or 1.0)][: len(self.states)]

    def apply_event(self, run_data, row, t, y, scale) -> None:
        tables = run_data.model.tables
        stop, seat = (run_data.armed[row["event"] + k] > 0.0 for k in (0, 2))
        # the disc has slammed
        if self.states and seat and law_disc.disc_lift(y, tables, row) > 0.0:
            y[row["y"]] = -tables.floats[row["data"] + law_disc.LIFT] - SEAT_DEPTH
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
        return Edge(
            i,
            j,
            self.row(start, k),
            0.0,
            sensed_nodes=tuple(node for node, _ in self.sensed_at(start, k)),
        )

    def sensed_at(self, start, k: int) -> list[tuple[int, float]]:
        """Nodes whose pressure lifts valve k, each with its weight in the lifting pressure."""
        return [(int(start.valves[k]["from_node"]), 1.0)]

    def follow(self, start, k) -> None:
        """Do nothing: the function `begin` sets the drop of valve k."""

    def flow_at(self, start, k: int, drop: float, lift: float) -> tuple[float, float, float]:
        """(mass flow [kg/s], its derivative by the drop [kg/s/Pa], its derivative by the lift [kg/s]) of valve k.

        drop : drop across the valve [Pa]; lift : lift of the disc [-], a negative lift counts as 0
        """
        g = float(start.valves[k]["conductance"]) * start.factor.get(k, 1.0)
        transition = transition_of(start.valves[k], g)
        full, x = flow_at_drop(g, transition, drop), max(lift, 0.0)
        steep = (
            flow_slope(g, transition, drop)
            if transition > 0.0
            else 0.5 * g / max(abs(full), LEAST * math.sqrt(g))
        )
        return x * full, x * steep, max(full, 0.0)

    def revise_state(self, start, part, row) -> bool:
        k = int(row["valve"])
        if start.rest:
            return False
        before = "shut" if k in start.shut else start.valve_modes[k]
        x, flow = self.lifting_pressure(start, k) / part.overpressure, float(start.valve_flows()[k])
        after = self.next_mode(x, self.is_reversed(start, k, flow), before)
        start.shut = start.shut | {k} if after == "shut" else start.shut - {k}
        start.valve_modes[k] = LIFTING if after == "shut" else after
        return after != before

    def is_reversed(self, start, k: int, flow: float) -> bool:
        """True if the flow of valve k [kg/s] is reversed in the present iteration of the steady start."""
        return flow < -SMALL_LIFT * start.flow_scale

    def next_mode(self, x: float, back: bool, now: str) -> str:
        """Mode of a valve in the next iteration of the steady start: "shut", LIFTING or OPEN.

        x : lift that follows from the pressures, not limited to 0 to 1
        back : True if the flow is reversed; now : present mode
        """
        if now == "shut":
            return LIFTING if x > SMALL_LIFT else now
        if x < -SMALL_LIFT:
            return "shut"
        return (
            OPEN
            if now == LIFTING and x > 1.0
            else LIFTING
            if now == OPEN and x < 1.0 - SMALL_LIFT
            else now
        )

    def begin(self, start, part, row) -> list[str]:
        k = int(row["valve"])
        valve, name = start.valves[k], start.draft.valve_names[k]
        lifts = k not in start.shut and start.valve_modes[k] == LIFTING
        if k in start.shut:
            x = 0.0
        elif not lifts:
            x = 1.0
        elif start.valve_flows()[k] <= 0.0:
            # the flow determines no lift, the lifting pressure does
            x = min(
                max(self.lifting_pressure(start, k) / self.part(start, k).overpressure, 0.0), 1.0
            )
        else:
            x = opening_of(start, k)
        self.store_lift(
            start, row, x, x if lifts else self.lifting_pressure(start, k) / part.overpressure
        )
        valve["open"] = (
            valve["conductance"] * x * x if self.states or x == 0.0 else valve["conductance"]
        )
        if self.states and x > 0.0 and valve["transition"] == 0.0:
            valve["drop"] = abs(valve["flow"]) * valve["flow"] / valve["open"]
        start.draft.tables.floats[row["data"] + 2] = start.valve_law(k)[1]
        self.add_start_notices(start, name, x)
        target = self.lifting_pressure(start, k) / part.overpressure
        text = f"{name}: the valve is shut at the start, although the pressure there would open the valve"
        return [text] if start.rest and target > SMALL_LIFT else []

    def store_lift(self, start, row, x: float, target: float) -> None:
        """Store the lift x and the target lift at the start in the parameters of the disc.

        row : row of the disc in the table of devices
        """
        start.draft.tables.floats[row["data"] : row["data"] + 2] = x, target

    def add_start_notices(self, start, name: str, x: float) -> None:
        """Add notices about a valve to the draft of the model, if its kind has any; x : lift at the start"""


DIFFERENCE_TIME = 1e-6  # interval of the difference quotient for the deceleration of the flow [s]


class CheckDisc(LiftedValve, kind=""):
    """Conversion to table rows of check valves whose disc moves with a delay."""

    mode = CHECK

    def lifting_pressure(self, start, k):
        before, behind = start.across(k)
        return (before - behind) * start.ratio.get(k, 1.0) - self.part(start, k).cracking_pressure

    def row(self, start, k: int):
        part, ratio = self.part(start, k), start.ratio.get(k, 1.0)

        def newton(flow, drop, *_):
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
            nodes["gates"][valve[end]] >= 0 and nodes["gate_count"][valve[end]] > 1
            for end in ("from_node", "to_node")
        ):
            text = (
                f"{name}: its disc and other valves join the same rigid column: its lift and flow are not reliable "
                "once it leaves its seat; make the column a pipe, or put a chamber between them"
            )
            start.draft.warnings.append(Notice("range", f"links.{name}", text))

    def next_mode(self, x, back, now):
        return "shut" if back and now != "shut" else super().next_mode(x, back, now)


class CheckValveRows(Device, kind="check-valve"):
    """Conversion to table rows of check valves that are either open or shut.

    In the steady state no open valve has reverse flow, and no shut valve has a drop that opens it.
    """

    law, events_only = law_check_valve, True
    quantities = ("opening",)
    events = ("shuts", "opens")

    def of(self, part) -> Device:
        if part.deceleration is not None:
            return SlamCurveRows()
        if not part.has_dynamics:
            return self
        return CheckDisc().moved_as(part)

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

    def shut_reason(self, start, k):
        return "passes no reversed flow"

    def flags_at_start(self, start, part, row) -> dict[int, bool]:
        return {int(row["event"]): int(row["valve"]) in start.shut}


class SlamCurveRows(CheckValveRows, kind=""):
    """Conversion to table rows of check valves that shut at the reverse velocity of their manufacturer's curve."""

    law = law_slam
    states = ("slam_velocity", "deceleration")
    events = (
        "flow reverses",
        "shuts",
        "flow is forward again",
        "flow reverses faster than its curve covers",
    )
    remedy = "give the curve of the check valve a greater reverse_velocity"

    def numbers(self, draft, name, part) -> list[float]:
        return [
            part.cracking_pressure,
            draft.fluid.density * part.bore_area,
            part.deceleration.rate[-1],
        ]

    def scales(self, draft, name, part) -> list[float]:
        return [1.0, 1.0]

    def flags_at_start(self, start, part, row) -> dict[int, bool]:
        return {}

    def apply_event(self, run_data, row, t, y, scale) -> None:
        o = row["y"]
        at = row["event"]
        curve = run_data.model.case.conduits[self.name(run_data, row)].deceleration
        if run_data.armed[at + law_slam.REVERSED] == 0.0:
            y[o] = y[o + 1] = 0.0
        elif y[o] == 0.0:
            y[o + 1] = self.deceleration(run_data, row, t, y)
            y[o] = max(
                float(np.interp(y[o + 1], curve.rate, curve.reverse_velocity)), law_slam.SMALLEST
            )

    def name(self, run_data, row) -> str:
        return run_data.model.valve_names[row["valve"]]

    def deceleration(self, run_data, row, t: float, y) -> float:
        """Deceleration [m/s2] of the flow in the bore at a state, by a backward difference in time; at least 0."""
        model, k = run_data.model, int(run_data.model.layout["valve"] + row["valve"])
        dydt = np.zeros(y.size)
        now = model.new_out()
        before = model.new_out()
        model.functions.rhs(t, y, dydt, now, run_data.handle)
        model.functions.rhs(
            t - DIFFERENCE_TIME,
            y - DIFFERENCE_TIME * dydt,
            np.zeros(y.size),
            before,
            run_data.handle,
        )
        full = model.tables.floats[row["data"] + law_slam.UNIT_FLOW]
        return max(float(before[k] - now[k]) / (DIFFERENCE_TIME * full), 0.0)


class ReliefDisc(LiftedValve, kind=""):
    """Conversion to table rows of relief valves with disc dynamics."""

    mode = RELIEF

    def opening_pressure(self, start, part) -> float:
        """Lifting pressure at which the valve begins to open [Pa]."""
        return part.set_pressure

    def lifting_pressure(self, start, k):
        return self.lifted_by(
            start, k, *(start.answer.potential[i] for i, _ in self.sensed_at(start, k))
        )

    def lifted_by(self, start, k: int, *potentials: float) -> float:
        """Lifting pressure of valve k minus its opening pressure [Pa], at given potentials of the sensed nodes [Pa]."""
        places = zip(self.sensed_at(start, k), potentials, strict=True)
        pressure = sum(
            weight * start.law.pressure_of(potential, float(start.nodes["elevation"][i]))
            for (i, weight), potential in places
        )
        return pressure - self.opening_pressure(start, self.part(start, k))

    def row(self, start, k: int):
        span = self.part(start, k).overpressure
        weights = [weight for _, weight in self.sensed_at(start, k)]

        def newton(flow, drop, *potentials):
            target, slope, rise = self.flow_at(
                start, k, drop, self.lifted_by(start, k, *potentials) / span
            )
            rise /= span
            size = max(slope + rise, 1e-12 * start.flow_scale)
            return (
                1.0 / size,
                slope / size,
                (target - flow) / size,
                *(weight * rise / size for weight in weights),
            )

        return newton

    def add_start_notices(self, start, name, x):
        if x > 0.0:
            kind = start.draft.case.conduits[name].kind.removesuffix("-valve")
            text = f"{name}: the {kind} valve is open at the start, lift {x:.3g} of 1"
            start.draft.warnings.append(Notice("start", f"links.{name}", text, "lift", float(x)))


class Relief(ReliefDisc, kind="relief-valve"):
    """Conversion to table rows of relief valves whose lift follows the pressure at once."""

    law, controlling_event = law_relief_valve, -1
    events = ("is shut", "opens", "is fully open", "leaves full opening")

    def of(self, part) -> Device:
        return ReliefDisc().moved_as(part) if part.has_dynamics else self

    def numbers(self, draft, name, part) -> list[float]:
        return [0.0, part.overpressure, 0.0]

    def store_lift(self, start, row, x, target):
        start.draft.tables.floats[row["data"]] = target


SMALL_FLOW = 1e-9  # flow regarded as rounding, over the flow scale of the model
SMALL_PRESSURE = 1e-3  # pressure regarded as rounding [Pa]
# mode of a regulating valve; OPEN and a valve in `start.shut` are open and closed in EPANET
ACTIVE = "active"


class SteadyValve(NamedTuple):
    """State of a control valve in an iteration of the steady start.

    start : steady problem; k : row of the valve; p_from, p_to : potentials at its ends [Pa]; flow : mass flow [kg/s]
    target : set value as a potential [Pa], or as a mass flow [kg/s]; loss : drop at full opening at this flow [Pa]
    """

    start: object
    k: int
    p_from: float
    p_to: float
    target: float
    flow: float
    loss: float

    @property
    def reversed(self) -> bool:
        return self.flow < 0.0


class Regulator(Device, kind=""):
    """Conversion to table rows of control valves; their opening is a state.

    In the steady state a valve is active (it keeps the sensed quantity at its set value), open or shut.
    """

    law, controlling_event = law_regulating, 6
    states = ("opening",)
    quantities = ("opening",)
    events = (
        "shuts against reversed flow",
        "opens again",
        "is fully open",
        "leaves full opening",
        "is shut",
        "leaves its seat",
        "",
        "",
    )
    remedy = "give the regulating valve a longer time_constant"
    # key of the set value, end at which it is sensed, verb for messages
    key, end, verb = "set_pressure", "", ""
    # conversion of valves with the time constant 0
    at_once: ClassVar[type["Regulator"] | None] = None

    def of(self, part) -> Device:
        return self if part.time_constant > 0.0 or self.at_once is None else self.at_once()

    def numbers(self, draft, name, part) -> list[float]:
        scale = 1.0 if self.end else draft.fluid.density
        schedule = getattr(part, self.key)
        row = draft.device_table[draft.device_names.index(name)]
        row["schedule"] = draft.schedules.add(schedule, scale)
        if self.end:
            self.check_set_pressure(draft, name, part)
        band = part.band if self.end else schedule.first * scale
        return [0.0, 0.0, 0.0, band, part.time_constant]

    def check_set_pressure(self, draft, name, part) -> None:
        """Report a fault if no source of the case can supply the set pressure of a valve."""
        nodes, case = draft.case.nodes.values(), draft.case
        pumped = any(link.kind == "pump" for link in case.links.values())
        if pumped or any(node.kind not in ("reservoir", "tank", "junction") for node in nodes):
            return  # pressure comes from elsewhere too
        weight = draft.fluid.density * case.gravity
        place = getattr(part, "to" if self.end == "to" else "from_")
        best, source = max(head_of(case, weight, other) for other in case.nodes)
        least = float(np.min(part.set_pressure.value))
        head = (least - case.ambient_pressure) / weight + (case.elevation(place) or 0.0)
        if is_head_above(head, best):
            amount = case.amount
            text = (
                f"{amount(least, 'pressure', 6)} at {place} is a head of {amount(head, 'head')}, above every "
                f"source: {source} has {amount(best, 'head')}"
            )
            draft.fault(
                f"links.{name}.set_pressure",
                f"{text}; the valve would never {self.verb}; expected a lower pressure",
            )

    def inputs(self, model, name, part):
        schedule = int(self.row_of(model, name)["schedule"])
        if self.end:
            return {self.key: Input(SET_PRESSURE, schedule)}
        return {self.key: Input(FLOW, schedule, model.case.properties.density)}

    def scales(self, draft, name, part) -> list[float]:
        return [0.1]

    def set_value(self, start, k: int) -> float:
        """Set value of valve k at the start: pressure [Pa] or mass flow [kg/s]."""
        row = start.draft.device_table[start.valves[k]["device"]]
        return start.schedule_value(row["schedule"])

    def target(self, start, k: int) -> float:
        """Set value of valve k at the start, as a potential [Pa] for a set pressure, or as a mass flow [kg/s]."""
        if not self.end:
            return self.set_value(start, k)
        return start.law.potential_of(
            self.set_value(start, k), float(start.nodes["elevation"][self.regulated_node(start, k)])
        )

    def regulated_node(self, start, k: int) -> int:
        return int(start.valves[k][f"{self.end}_node"])

    def is_controllable(self, start, k: int) -> bool:
        """True if valve k can change the quantity that it senses: the flow, or a pressure that is not fixed."""
        return not self.end or bool(np.isnan(start.fixed_potentials[self.regulated_node(start, k)]))

    def steady_mode(self, start, k: int) -> str:
        return start.valve_modes.setdefault(k, ACTIVE if self.is_controllable(start, k) else OPEN)

    def release(self, start, k: int) -> None:
        """Open valve k in the present iteration of the steady start; a reversed flow shuts it in the next one."""
        start.valve_modes[k] = OPEN

    def edge(self, start, k):
        if k in start.shut or self.steady_mode(start, k) == OPEN:
            return None
        i, j = (int(start.valves[k][end]) for end in ("from_node", "to_node"))
        goal = self.target(start, k)
        if not self.end:
            return Edge(
                i,
                j,
                None if start.rest else lambda flow, drop: (1.0, 0.0, goal - flow),
                drop=lambda flow: 0.0,
            )
        if start.rest:
            return Edge(
                i,
                j,
                None,
                0.0,
                drop=lambda flow: 0.0,
                held_potential=(self.regulated_node(start, k), goal),
            )
        return Edge(
            i,
            j,
            lambda flow, drop: (0.0, 0.0, 0.0),
            0.0,
            held_potential=(self.regulated_node(start, k), goal),
        )

    def revise_state(self, start, part, row) -> bool:
        k = int(row["valve"])
        flow = float(start.valve_flows()[k])
        p_from, p_to = start.across(k)
        loss = flow * abs(flow) / (float(start.valves[k]["conductance"]) * start.factor.get(k, 1.0))
        here = SteadyValve(start, k, p_from, p_to, self.target(start, k), flow, loss)
        before = "shut" if k in start.shut else self.steady_mode(start, k)
        after = self.next_mode(here, before)
        if after == ACTIVE and (k in start.uncontrolled or not self.is_controllable(start, k)):
            after = "shut"
        start.shut = start.shut | {k} if after == "shut" else start.shut - {k}
        start.valve_modes[k] = (
            OPEN if after == OPEN else ACTIVE if after == ACTIVE else start.valve_modes[k]
        )
        return after != before

    def next_mode(self, here: SteadyValve, now: str) -> str:
        """Mode in the next iteration of the steady start, "shut", ACTIVE or OPEN, by the rules of EPANET.

        here : state of the valve; now : present mode
        """
        raise NotImplementedError

    def begin(self, start, part, row) -> list[str]:
        k = int(row["valve"])
        valve = start.valves[k]
        floats = start.draft.tables.floats
        at = int(row["data"])
        shut, active = k in start.shut, self.steady_mode(start, k) == ACTIVE
        error = self.error(start, k)
        if active and not shut:
            if abs(error) > start.set_point_tolerance(self.end):
                self.refuse(start, k)
            error = 0.0
        x = opening_of(start, k) if active and not shut else 1.0 if error > 0.0 or not shut else 0.0
        floats[at], floats[at + 1], floats[at + 2] = x, error, self.set_value(start, k)
        valve["open"] = 0.0 if shut else valve["conductance"] * x * x
        if valve["open"] > 0.0 and valve["transition"] == 0.0:
            valve["drop"] = abs(valve["flow"]) * valve["flow"] / valve["open"]
        return []

    def error(self, start, k: int) -> float:
        """Control error of valve k at the start [Pa] or [kg/s], positive if the valve must open."""
        given = self.set_value(start, k)
        if not self.end:
            return given - float(start.valves[k]["flow"])
        pressure = float(start.nodes["pressure"][self.regulated_node(start, k)])
        return given - pressure if self.end == "to" else pressure - given

    def refuse(self, start, k: int) -> None:
        """Report a fault: no opening of valve k keeps the sensed quantity at its set value."""
        name = start.draft.valve_names[k]
        start.draft.fault(
            f"links.{name}.{self.key}",
            f"no steady state: no opening of the valve gives {self.key}, for "
            "example because a given demand alone determines the flow through the valve; change "
            f'{self.key} or the demand, or use initial = "rest"',
        )


class PressureReducingRows(Regulator, kind="pressure-reducing"):
    """Conversion to table rows of pressure-reducing valves, which limit the pressure at `to`.

    In the steady state a valve is open if this pressure is too low even at full opening, and shut if other sources keep
    it higher.
    """

    mode = law_regulating.REDUCING
    end = "to"
    verb = "reduce the pressure"

    def next_mode(self, here, now):
        low, high = here.target - SMALL_PRESSURE, here.target + SMALL_PRESSURE
        if now == "shut" and here.p_to < low:
            return (
                ACTIVE
                if here.p_from >= high
                else OPEN
                if here.p_from > here.p_to + SMALL_PRESSURE
                else now
            )
        if now != "shut" and here.reversed:
            return "shut"
        if now == ACTIVE:
            return OPEN if here.p_from - here.loss < low or here.p_to < low else now
        return ACTIVE if now == OPEN and here.p_to > high else now


class PressureSustainingRows(Regulator, kind="pressure-sustaining"):
    """Conversion to table rows of pressure-sustaining valves, which keep up the pressure at `from`.

    In the steady state a valve is open if this pressure is too high even at full opening, and shut if it is lower than
    the set value.
    """

    mode = law_regulating.SUSTAINING
    end = "from"
    verb = "open"

    def shut_reason(self, start, k):
        node = list(start.case.places)[self.regulated_node(start, k)]
        return f"cannot sustain {start.case.amount(self.set_value(start, k), 'pressure')} at {node}"

    def next_mode(self, here, now):
        low, high = here.target - SMALL_PRESSURE, here.target + SMALL_PRESSURE
        if now == "shut" and here.p_from > here.p_to + SMALL_PRESSURE:
            return OPEN if here.p_to > high else ACTIVE if here.p_from >= high else now
        if now != "shut" and here.reversed:
            return "shut"
        if now == ACTIVE:
            return OPEN if here.p_to + here.loss > high or here.p_from > high else now
        return ACTIVE if now == OPEN and here.p_from < low else now


class FlowControlRows(Regulator, kind="flow-control"):
    """Conversion to table rows of flow-control valves, which limit the flow.

    In the steady state a valve is open if its flow at full opening is below the set value.
    """

    mode, key = law_regulating.FLOW_CONTROL, "set_flow"

    def next_mode(self, here, now):
        if now == ACTIVE:
            drop, small = here.p_from - here.p_to, SMALL_FLOW * here.start.flow_scale
            return (
                OPEN
                if drop < here.loss - SMALL_PRESSURE or here.flow < here.target - small
                else now
            )
        if now == "shut":  # it holds nothing back but what is beyond its set flow
            return OPEN
        return ACTIVE if here.flow > here.target + SMALL_FLOW * here.start.flow_scale else now


class AtOnce:
    """Changes to the conversion of a control valve with the time constant 0: it has no state."""

    law = law_at_once
    events_only = True
    controlling_event = -1
    states = ()
    at_once = None
    events = ("shuts against reversed flow", "opens again", "is fully open", "leaves full opening")
    remedy = "give the regulating valve a time_constant"

    def held_end(self, part) -> str:
        return self.end

    def scales(self, draft, name, part) -> list[float]:
        return []

    def begin(self, start, part, row) -> list[str]:
        k, draft = int(row["valve"]), start.draft
        valve = start.valves[k]
        at = int(row["data"])
        shut = k in start.shut
        active, error = not shut and self.steady_mode(start, k) == ACTIVE, self.error(start, k)
        if active and abs(error) > start.set_point_tolerance(self.end):
            self.refuse(start, k)
        error, opening = (0.0, opening_of(start, k)) if active else (error, float(not shut))
        draft.tables.floats[at : at + 3] = opening, error, self.set_value(start, k)
        valve["open"] = 0.0 if shut else valve["conductance"]
        valve["drive"] = NOT_HELD if not active else 0.0 if self.end else self.set_value(start, k)
        if not shut and not active and valve["transition"] == 0.0:
            valve["drop"] = abs(valve["flow"]) * valve["flow"] / valve["open"]
        return []

    def flags_at_start(self, start, part, row) -> dict[int, bool]:
        k, at = int(row["valve"]), int(row["event"])
        return {
            at + law_at_once.SHUT: k in start.shut,
            at + law_at_once.FULL: k not in start.shut and self.steady_mode(start, k) == OPEN,
        }


class ReducingAtOnce(AtOnce, PressureReducingRows, kind=""):
    """Conversion to table rows of pressure-reducing valves that act at once."""


class SustainingAtOnce(AtOnce, PressureSustainingRows, kind=""):
    """Conversion to table rows of pressure-sustaining valves that act at once."""


class FlowControlAtOnce(AtOnce, FlowControlRows, kind=""):
    """Conversion to table rows of flow-control valves that act at once."""


PressureReducingRows.at_once = ReducingAtOnce
PressureSustainingRows.at_once = SustainingAtOnce
FlowControlRows.at_once = FlowControlAtOnce


def head_of(case, weight: float, name: str) -> tuple[float, str]:
    """(greatest head that the node `name` can supply [m], name); weight : rho g [N/m3]

    The head of a junction is infinite if it has an inflow, otherwise minus infinity.
    """
    node, z = case.nodes[name], case.elevation(name) or 0.0
    if node.kind == "tank":
        return z + max(node.level, node.height or 0.0), name
    if node.kind == "junction":
        return (math.inf if np.min(node.demand.value) < 0.0 else -math.inf), name
    if node.head is not None:
        return float(np.max(node.head.value)), name
    return (float(np.max(node.pressure.value)) - case.ambient_pressure) / weight + z, name

"""Control valves in the tables of a model, and their states at the steady start."""

import math
from typing import NamedTuple

import numpy as np

from fvsolve.assembly.device_lowering import Device, opening_of
from fvsolve.assembly.inputs import FLOW, SET_PRESSURE, Input
from fvsolve.parts.regulating import law
from fvsolve.steady import Edge

SMALL_FLOW = 1e-9  # flow regarded as rounding, over the flow scale of the model
SMALL_PRESSURE = 1e-3  # pressure regarded as rounding [Pa]
OPEN, ACTIVE = "open", "active"  # as EPANET calls them; in `start.shut`, closed


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

    law, controlling_event = law, 6
    states = ("opening",)
    quantities = ("opening",)
    events = ("shuts against reversed flow", "opens again", "is fully open", "leaves full opening", "is shut",
              "leaves its seat", "", "")  # fmt: skip
    remedy = "give the regulating valve a longer time_constant"
    key, end, verb = "set_pressure", "", ""  # key of the set value, end at which it is sensed, verb for messages

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
        if any(node.kind not in ("reservoir", "tank", "junction") for node in nodes) or "pump" in kinds_of(case):
            return  # pressure comes from elsewhere too
        weight, place = draft.fluid.density * case.gravity, getattr(part, "to" if self.end == "to" else "from_")
        best, source = max(head_of(case, weight, other) for other in case.nodes)
        least = float(np.min(part.set_pressure.value))
        head = (least - case.ambient_pressure) / weight + (case.elevation(place) or 0.0)
        if head > best:
            amount = case.amount
            text = (f"{amount(least, 'pressure', 6)} at {place} is a head of {amount(head, 'head')}, above every "
                    f"source: {source} has {amount(best, 'head')}")  # fmt: skip
            draft.fault(
                f"links.{name}.set_pressure", f"{text}; the valve would never {self.verb}; expected a lower pressure"
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
        return start.law.potential_of(self.set_value(start, k), float(start.nodes["elevation"][self.sensed(start, k)]))

    def sensed(self, start, k: int) -> int:
        return int(start.valves[k][f"{self.end}_node"])

    def is_controllable(self, start, k: int) -> bool:
        """True if valve k can change the quantity that it senses: the flow, or a pressure that is not fixed."""
        return not self.end or bool(np.isnan(start.fixed_potentials[self.sensed(start, k)]))

    def steady_mode(self, start, k: int) -> str:
        return start.valve_modes.setdefault(k, ACTIVE if self.is_controllable(start, k) else OPEN)

    def edge(self, start, k):
        if k in start.shut or self.steady_mode(start, k) == OPEN:
            return None
        i, j = (int(start.valves[k][end]) for end in ("from_node", "to_node"))
        goal = self.target(start, k)
        if not self.end:
            return Edge(i, j, None if start.rest else lambda flow, drop: (1.0, 0.0, goal - flow), drop=lambda flow: 0.0)
        if start.rest:
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0, held_potential=(self.sensed(start, k), goal))
        return Edge(i, j, lambda flow, drop: (0.0, 0.0, 0.0), 0.0, held_potential=(self.sensed(start, k), goal))

    def revise_state(self, start, part, row) -> bool:
        k = int(row["valve"])
        flow = float(start.valve_flows()[k])
        p_from, p_to = start.across(k)
        loss = flow * abs(flow) / (float(start.valves[k]["conductance"]) * start.factor.get(k, 1.0))
        here = SteadyValve(start, k, p_from, p_to, self.target(start, k), flow, loss)
        before = "shut" if k in start.shut else self.steady_mode(start, k)
        after = self.next_mode(here, before)
        if after == ACTIVE and not self.is_controllable(start, k):
            after = "shut"
        start.shut = start.shut | {k} if after == "shut" else start.shut - {k}
        start.valve_modes[k] = OPEN if after == OPEN else ACTIVE if after == ACTIVE else start.valve_modes[k]
        return after != before

    def next_mode(self, here: SteadyValve, now: str) -> str:
        """Mode in the next iteration of the steady start, "shut", ACTIVE or OPEN, by the rules of EPANET.

        here : state of the valve; now : present mode
        """
        raise NotImplementedError

    def begin(self, start, part, row) -> list[str]:
        k = int(row["valve"])
        valve, floats, at = start.valves[k], start.draft.tables.floats, int(row["data"])
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
        pressure = float(start.nodes["pressure"][self.sensed(start, k)])
        return given - pressure if self.end == "to" else pressure - given

    def refuse(self, start, k: int) -> None:
        """Report a fault: no opening of valve k keeps the sensed quantity at its set value."""
        name = start.draft.valve_names[k]
        start.draft.fault(f"links.{name}.{self.key}", f"no steady state: no opening of the valve gives {self.key}, for "
                          "example because a given demand alone determines the flow through the valve; change "
                          f'{self.key} or the demand, or use initial = "rest"')  # fmt: skip


class PressureReducingRows(Regulator, kind="pressure-reducing"):
    """Conversion to table rows of pressure-reducing valves, which limit the pressure at `to`.

    In the steady state a valve is open if this pressure is too low even at full opening, and shut if other sources keep
    it higher.
    """

    mode, end, verb = law.REDUCING, "to", "reduce the pressure"

    def next_mode(self, here, now):
        low, high = here.target - SMALL_PRESSURE, here.target + SMALL_PRESSURE
        if now == "shut" and here.p_to < low:
            return ACTIVE if here.p_from >= high else OPEN if here.p_from > here.p_to + SMALL_PRESSURE else now
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

    mode, end, verb = law.SUSTAINING, "from", "open"

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

    mode, key = law.FLOW_CONTROL, "set_flow"

    def next_mode(self, here, now):
        if now == ACTIVE:
            drop, small = here.p_from - here.p_to, SMALL_FLOW * here.start.flow_scale
            return OPEN if drop < here.loss - SMALL_PRESSURE or here.flow < here.target - small else now
        if now == "shut":  # it holds nothing back but what is beyond its set flow
            return OPEN
        return ACTIVE if here.flow > here.target + SMALL_FLOW * here.start.flow_scale else now


def kinds_of(case) -> set[str]:
    """Types of the links in a case."""
    return {link.kind for link in case.links.values()}


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

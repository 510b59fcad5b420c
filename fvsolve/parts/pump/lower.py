"""Pumps in the tables of a scene, and how they start. Knows one pump at a time; the curve's numbers are its own."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.errors import Notice
from fvsolve.kernels.schedules import value_until
from fvsolve.model.device import Device
from fvsolve.model.inputs import SPEED, Input
from fvsolve.parts import Schedule
from fvsolve.parts.pump import law
from fvsolve.parts.pump import law_curve as curves
from fvsolve.parts.pump.lower_curve import curve_numbers, rated_point
from fvsolve.parts.pump.lower_join import joined_table, specific_speed
from fvsolve.parts.pump.lower_notes import drawn_backwards, estimated, quick
from fvsolve.parts.pump.lower_shaft import inertia, shaft_points
from fvsolve.steady import Edge

SMALL_FLOW = 1e-9  # share of the flows of a scene below which a reversed one is rounding
SMALL_SPEED = 0.01  # what counts as a small change of relative speed
FEW, MANY = 20.0, 320.0  # specific speeds that the tables are near
SNAP = 1e-12  # share of the torques on a shaft below which their sum is rounding


class PumpRows(Device, kind="pump"):
    """A restriction that follows its curve; its steady state is that in which no flow passes its check valve back."""

    law = law
    quantities = ("head", "speed", "torque", "power")
    events = ("check valve shuts", "check valve opens")
    remedy = "give it a check-valve with a time_constant behind it, in place of its own"

    def inputs(self, model, name, part):
        return {"speed": Input(SPEED, int(self.row_of(model, name)["schedule"]))}

    def states_of(self, draft, name, part) -> tuple[str, ...]:
        return ("speed",) if part.trip is not None or torques_on(draft.case, name) else ()

    def scales(self, draft, name, part) -> list[float]:
        return [SMALL_SPEED for _ in self.states_of(draft, name, part)]

    def restriction(self, draft, name, link, row) -> None:
        weight = draft.fluid.density * draft.case.gravity
        flow, head = rated_point(link, weight)
        row["data"] = len(draft.floats)
        draft.floats += curve_numbers(link, weight)
        row["conductance"] = (draft.fluid.density * flow) ** 2 / (weight * head)

    def numbers(self, draft, name, part) -> list[float]:
        rated, torques = part.rated_speed or 1.0, torques_on(draft.case, name)
        mode = law.TURNED if torques else law.HELD_SPEED if part.trip is None else law.TRIPPING
        draft.device_table["schedule"][draft.device_names.index(name)] = draft.schedules.add(part.speed)
        given = [x for torque in torques for x in (draft.schedules.add(torque.torque), 0.0)]
        weight = draft.fluid.density * draft.case.gravity
        own = shaft_points(part, weight)
        numbers = {
            law.MODE: mode, law.CHECK: part.check_valve, law.TRIP: self.trip(draft, name, part),
            law.INERTIA: (inertia(part, weight) or np.inf) * rated, law.RATED: rated, law.COUNT_OR_TORQUE: own[0],
            law.GIVEN: len(torques), law.KNOWN: self.resists(part),
        }  # fmt: skip
        return [float(numbers.get(k, 0.0)) for k in range(law.OWN_NUMBERS)] + given + own[1:]

    def trip(self, draft, name, part) -> int:
        """The schedule that is 0 before and 1 after the trip; its speed has a kink there and no jump."""
        if part.trip is None:
            return -1
        kinks, start = dict(draft.schedules.breaks), draft.case.numerics.start
        if part.trip < start:
            draft.fault(f"links.{name}.trip", f"{part.trip:g} s lies before the start at {start:g} s")
        made = draft.schedules.add(Schedule("step", (part.trip - 1.0 - abs(part.trip), part.trip), (0.0, 1.0)))
        draft.schedules.breaks[part.trip] = kinks.get(part.trip, False)
        return made

    def resists(self, part) -> bool:
        return not part.inertia is part.trip is part.efficiency is part.shaft_power is part.suter is None

    def squares(self, model, part, row, y, out) -> list[dict[int, float]]:
        if row["y"] < 0:
            return []
        return [{int(row["y"]): part.rated_speed * math.sqrt(0.5 * inertia(part, weight_of(model)))}]

    def above(self, model, part, row) -> float:
        speed = float(model.tables.valves[row["valve"]]["drive"])
        return 0.5 * inertia(part, weight_of(model)) * (part.rated_speed * speed) ** 2 if row["y"] >= 0 else 0.0

    def passing(self, model, name, part, time) -> Notice:
        """What is to be known of a pump that left its curve, and may have."""
        when = model.case.amount(time, "time", 6)
        rated = rated_point(part, weight_of(model))
        if (table := joined_table(part, *rated)) is None:
            text = (f"{name}: it runs down, from {when} on beyond its curve's last flow, where its head is "
                    "that of a parabola; with rated_speed a Suter table would tell it")  # fmt: skip
            return Notice("range", f"links.{name}", text, "curve")
        speed = specific_speed(part, *rated)
        near = table.words if FEW <= speed <= MANY else f"{table.words}, the nearest"
        text = (f"{name}: it leaves its curve at {when}; outside of it head and torque are those of the Suter "
                f"table {near}, joined to it, by its specific speed of {speed:.4g} (rpm, m3/s, m); "
                "of a pump of several stages or inlets suter says it better")  # fmt: skip
        return Notice("range", f"links.{name}", text, "outside", speed)

    def speed_at(self, start, k: int) -> float:
        """Relative speed at the start."""
        row = start.draft.device_table[start.valves[k]["device"]]
        return start.given(row["schedule"])

    def edge(self, start, k: int):
        row = start.valves[k]
        i, j = int(row["from_node"]), int(row["to_node"])
        row["drive"] = speed = self.speed_at(start, k)
        row["open"] = 0.0 if k in start.shut else row["conductance"]
        if k in start.shut:
            return Edge(i, j, None, 0.0, shut=True)
        if start.rest:
            row["open"] = 0.0
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0)
        floats, at, g = start.draft.tables.floats, int(row["data"]), float(row["conductance"])
        rho, gravity = start.density_at(i), start.case.gravity
        ratio = rho / start.draft.fluid.density

        def newton(flow, present):
            a, s = curves.curve_step(floats, at, speed, rho, rho * gravity, g, float(flow), float(present * ratio))
            return 1.0 / s, ratio, a / s

        first = rho * floats[at + curves.SCALE] * speed
        return Edge(i, j, newton, float(first), drives=True)

    def follow(self, start, k) -> None:
        """Nothing: `begin` sees to it."""

    def lift(self, start, row, flow: float) -> float:
        """What a pump adds at a mass flow [Pa]."""
        floats, rho = start.draft.tables.floats, start.density_at(int(row["from_node"]))
        at, speed = int(row["data"]), float(row["drive"])
        return float(rho * start.case.gravity * curves.curve_head(floats, at, speed, float(flow) / rho)[0])

    def revise(self, start, part, row) -> bool:
        k = int(row["valve"])
        if not part.check_valve or start.rest:
            return False
        if k in start.shut:
            high, low = start.across(k)
            opens = bool(high + self.lift(start, start.valves[k], 0.0) > low + 1e-6)
            start.shut -= {k} if opens else set()
            return opens
        shuts = bool(start.valve_flows()[k] < -SMALL_FLOW * start.flow_scale)
        start.shut |= {k} if shuts else set()
        return shuts

    def begin(self, start, part, row) -> list[str]:
        k, draft = int(row["valve"]), start.draft
        valve, name, moving = start.valves[k], draft.valve_names[k], []
        ratio = start.density_at(int(valve["from_node"])) / draft.fluid.density
        if valve["open"] > 0.0:
            drop = -self.lift(start, valve, float(valve["flow"]))
            near = 1e-6 * (abs(drop) + abs(self.lift(start, valve, 0.0))) + 1e-3
            if abs(drop - valve["drop"] * ratio) > near:
                valve["open"] = 0.0
            elif draft.case.law.linear:
                valve["drop"] = drop
        if valve["open"] == 0.0 and k not in start.shut:
            moving.append(f"pump {name}: turns at {valve['drive']:.4g} of its speed without the flow for it")
        draft.warnings += [
            *drawn_backwards(start, name, part, valve), *quick(draft, name, part), *estimated(draft, name, part),
        ]  # fmt: skip
        return moving + self.let_go(start, part, row, valve)

    def let_go(self, start, part, row, valve) -> list[str]:
        """The speed from which a shaft runs free, and what does not hold it; returns what moves, in words."""
        draft, floats, at = start.draft, start.draft.tables.floats, int(row["data"])
        name = draft.valve_names[row["valve"]]
        if floats[at + law.MODE] == law.TRIPPING:
            trip = float(part.trip)
            given = draft.tables.schedules, draft.tables.pieces
            floats[at + law.HELD] = value_until(*given, int(row["schedule"]), trip, trip)
        if floats[at + law.MODE] != law.TURNED:
            return []
        rho = start.density_at(int(valve["from_node"]))
        speed, flow, dense = float(valve["drive"]), float(valve["flow"]) / rho, rho / draft.fluid.density
        taken = law.fluid_torque(floats, at, int(valve["data"]), speed, flow, dense)
        first, total = at + law.OWN_NUMBERS, 0.0
        for k in range(int(floats[at + law.GIVEN])):
            value = start.given(floats[first + 2 * k])
            floats[first + 2 * k + 1], total = value, total + value
        left = total - taken if abs(total - taken) > SNAP * (abs(total) + abs(taken)) else 0.0
        floats[at + law.HELD], floats[at + law.TORQUE], floats[at + law.OFFSET] = speed, taken, left
        rise = left / part.inertia
        return [f"pump {name}: its shaft speeds up by {rise:.4g} rad/s2"] if left != 0.0 else []


def weight_of(model) -> float:
    """rho g of a model's fluid [N/m3]."""
    settings = model.tables.settings[0]
    return float(settings["rho"] * settings["gravity"])


def torques_on(case, name: str) -> list:
    """Torques given to the shaft of a pump."""
    return [link for link in case.links.values() if link.kind == "torque" and link.to == f"{name}.shaft"]

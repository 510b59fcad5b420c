"""Turbines in the tables of a model, and their initial steady state."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from fvsolve.assembly.device_lowering import Device
from fvsolve.assembly.inputs import ANGULAR_SPEED, Input, opening_input
from fvsolve.errors import Notice
from fvsolve.kernels import dtypes as rec
from fvsolve.parts.pump.law import INERTIA, RATED
from fvsolve.parts.pump.lower_drive import ShaftLowering, numbers_of
from fvsolve.parts.pump.lower_notes import unusual_inertia
from fvsolve.parts.turbine import law
from fvsolve.parts.turbine import law_chart as charts
from fvsolve.parts.turbine.lower_chart import chart_numbers
from fvsolve.steady import Edge

FLOW_TOLERANCE = 1e-6  # pressure difference regarded as zero, over the pressure drops


class TurbineRows(ShaftLowering, Device, kind="turbine"):
    """Conversion to table rows of turbines: restrictions that follow their hill chart."""

    law = law
    quantities = ("head", "speed", "torque", "power", "opening")
    small = 1.0  # rad/s

    def inputs(self, model, name, part):
        return opening_input(model, name) | {"speed": Input(ANGULAR_SPEED, int(self.row_of(model, name)["schedule"]))}

    def restriction(self, draft, name, link, row) -> None:
        density = draft.fluid.density
        row["data"], row["schedule"] = len(draft.floats), draft.schedules.add(link.opening)
        draft.floats += chart_numbers(link, density * draft.case.gravity)
        row["conductance"] = density * draft.floats[row["data"] + charts.FLOW] ** 2 / draft.case.gravity

    def numbers(self, draft, name, part) -> list[float]:
        by_index = self.drive_numbers(draft, name, part) | {INERTIA: part.inertia or np.inf, RATED: 1.0}
        return numbers_of(by_index, self.torque_schedules(draft, name), [])

    def energy_rows(self, model, part, row, y, out) -> list[dict[int, float]]:
        return [{int(row["y"]): math.sqrt(0.5 * part.inertia)}] if row["y"] >= 0 else []

    def above(self, model, part, row) -> float:
        speed = float(model.tables.valves[row["valve"]]["drive"])
        return 0.5 * part.inertia * speed**2 if row["y"] >= 0 else 0.0

    def passing_notice(self, model, name, part, time) -> Notice:
        moment = model.case.amount(time, "time", 6)
        text = (f"{name}: leaves its hill chart at {moment}; beyond the chart the curves are straight lines to the "
                "flow at rest and to the speed without flow; give more points there")  # fmt: skip
        return Notice("range", f"links.{name}", text, "hill_chart")

    def edge(self, start, k: int):
        row = start.valves[k]
        i, j = int(row["from_node"]), int(row["to_node"])
        row["drive"] = omega = self.speed_at(start, k)
        vanes = float(start.schedule_value(row["schedule"]))
        row["open"] = g = row["conductance"] * vanes * vanes if vanes * vanes >= law.SHUT_SHARE else 0.0
        if g <= 0.0:
            return Edge(i, j, None, 0.0, shut=True)
        if start.rest:
            row["open"] = 0.0
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0)
        floats, at, rho = start.draft.tables.floats, int(row["data"]), start.density_at(i)
        weight, ratio = rho * start.case.gravity, rho / start.draft.fluid.density

        def newton(flow, present):
            present = float(present * ratio)
            first = charts.flow_bound(floats, at, vanes, weight, present)  # finds the greatest of several flows
            a, s = charts.chart_step(floats, at, vanes, omega, rho, weight, 0.0, float(g), float(flow), present, first)
            return 1.0 / s, ratio, a / s

        first = rho * floats[at + charts.FLOW] * charts.capacity(floats, at, vanes)
        return Edge(i, j, newton, float(first), drives=omega != 0.0)

    def follow(self, start, k) -> None:
        """Do nothing: the function `begin` sets the drop of turbine k."""

    def begin(self, start, part, row) -> list[str]:
        draft, valve, moving = start.draft, start.valves[int(row["valve"])], []
        name = draft.valve_names[row["valve"]]
        if valve["open"] > 0.0:
            rho, floats = start.density_at(int(valve["from_node"])), draft.tables.floats
            vanes = float(start.schedule_value(valve["schedule"]))
            at = floats, int(valve["data"]), vanes, float(valve["drive"])
            drop = rho * start.case.gravity * charts.chart_head(*at, float(valve["flow"]) / rho)[0]
            ratio = rho / draft.fluid.density
            if abs(drop - valve["drop"] * ratio) > FLOW_TOLERANCE * (abs(drop) + abs(valve["drop"])) + 1e-3:
                moving.append(f"turbine {name}: its flow at the start is not on its hill chart")
                valve["open"] = 0.0
            elif draft.case.law.linear:
                valve["drop"] = drop
        draft.warnings += [
            *folded_curve_notice(start, name, part, valve),
            *unusual_inertia_notice(start, name, part, valve),
        ]
        return moving + self.set_free_shaft(start, part, row, valve)

    def fluid_torque(self, start, row, valve) -> float:
        rho = start.density_at(int(valve["from_node"]))
        vanes, omega = float(start.schedule_value(valve["schedule"])), float(valve["drive"])
        floats, density_ratio = start.draft.tables.floats, rho / start.draft.fluid.density
        return -density_ratio * charts.chart_torque(
            floats, int(valve["data"]), vanes, omega, float(valve["flow"]) / rho
        )


def folded_curve_notice(start, name: str, part, valve) -> list[Notice]:
    """Notice if a turbine with folded curves is between two nodes that are not junctions; as a list."""
    ends = (start.nodes["kind"][int(valve[key])] for key in ("from_node", "to_node"))
    if rec.JUNCTION in ends or not any(map(has_fold, part.hill_chart.curves)):
        return []
    cause = f"{part.from_} and {part.to} both set their own pressures"
    text = (f"{name}: its hill chart is folded, with several flows at one head, and {cause}: the turbine may jump "
            "between these flows; connect the turbine through a pipe or rigid-column")  # fmt: skip
    return [Notice("range", f"links.{name}", text, "hill_chart")]


def unusual_inertia_notice(start, name: str, part, valve) -> list[Notice]:
    """Notice if the inertia of a turbine is far from the usual value for its power; as a list.

    The power is the greatest of the hill chart at the initial head.
    """
    speed, ends = float(np.max(np.abs(part.speed.value))), [int(valve["from_node"]), int(valve["to_node"])]
    if part.inertia is None or speed == 0.0 or start.weight == 0.0:
        return []
    high, low = start.nodes["pressure"][ends] / start.weight + start.nodes["elevation"][ends]
    unit = max(n * torque for curve in part.hill_chart.curves
               for n, torque in zip(curve.speed, curve.torques(start.weight), strict=True))  # fmt: skip
    power = math.pi / 30.0 * unit * part.diameter**2 * max(high - low, 0.0) ** 1.5
    return unusual_inertia(start.case, name, part.inertia, power, speed) if power > 0.0 else []


def has_fold(curve) -> bool:
    """True if the unit speed, where it is positive, rises somewhere with the angle of the points of a curve."""
    points = list(zip(curve.speed, curve.flow, strict=True))
    rising = points[0][0] * points[1][1] > points[0][1] * points[1][0]
    ahead = points if rising else points[::-1]
    return any(n < m for (n, _), (m, _) in pairwise(ahead) if n > 0.0 and m > 0.0)

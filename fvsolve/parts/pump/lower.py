"""Pumps in the tables of a model: their steady start, and notices about it."""

import math

import numpy as np

from fvsolve import units
from fvsolve.core.assembly.lowering import SPEED, Device
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.steady import Edge
from fvsolve.errors import Notice
from fvsolve.parts.pump import law, law_energy
from fvsolve.parts.pump.energy_use import STATES, energy_numbers, energy_scales
from fvsolve.parts.pump.lower_shaft import (
    ShaftLowering,
    curve_numbers,
    inertia,
    joined_table,
    numbers_of,
    rated_point,
    rated_power,
    shaft_points,
    specific_speed,
    usual_inertia,
)
from fvsolve.parts.pump.parallel import combined_pump, single_pump

SPEED_TOLERANCE = 1e-6  # difference of heads regarded as rounding [m]
# velocity in adjacent pipes at the rated flow, above which a notice is given [m/s]
MAX_VELOCITY = 15.0
# velocity below which a notice is given: 1/100 of usual mains; a wrong unit gives 1/1000
MIN_VELOCITY = 0.01
# allowed ratio to the usual inertia: flywheels give 10, a wrong unit gives 1000
INERTIA_RATIO = 30.0
NO_FLOW = 1e-7  # flow below which a pump of constant power has stalled [m3/s]
ROUNDING = 1e-9
LEAST_SHARE = 0.02  # least efficiency at the rated flow
UNITS = (("l/s", 1e-3), ("m3/h", 1.0 / 3600.0), ("l/min", 1e-3 / 60.0))


def reversed_pump(start, name: str, part, valve) -> list[Notice]:
    """Notice if a pump that runs at the start delivers to a lower head, or to the lowest water level; as a list."""
    i, j = int(valve["from_node"]), int(valve["to_node"])
    heads = start.nodes["pressure"] / start.weight + start.nodes["elevation"]
    fixed = np.isin(start.nodes["kind"], (rec.FIXED, rec.TANK))
    lowest = (
        fixed[j]
        and not fixed[i]
        and heads[j] < heads[fixed].max() - SPEED_TOLERANCE
        and heads[j] == heads[fixed].min()
    )
    if valve["drive"] <= 0.0 or start.rest or not (heads[i] > heads[j] + SPEED_TOLERANCE or lowest):
        return []
    target = f"where the head is {start.case.amount(heads[i] - heads[j], 'head', span=True)} lower"
    target = "which has the lowest water level" if lowest else target
    text = (
        f"{name}: it pumps from {part.from_} to {part.to}, {target}; check its "
        "direction (`from` is the suction side)"
    )
    return [Notice("range", f"links.{name}", text, "from", float(heads[i] - heads[j]), 0.0)]


def stalled_power(start, name: str, part, valve) -> list[Notice]:
    """Notice if a pump of constant power has no flow at the start, so that its power gives no head; as a list."""
    flow = float(valve["flow"]) / start.draft.fluid.density
    if part.power is None or start.rest or valve["open"] <= 0.0 or not abs(flow) < NO_FLOW:
        return []
    head = start.case.amount(-float(valve["drop"]) / start.weight, "head", span=True)
    text = (
        f"{name}: constant power without flow determines no head; its head here, {head}, and the pressures behind "
        "it have no meaning; give `curve` instead of `power`, or make it a valve with opening = 0"
    )
    return [Notice("range", f"links.{name}", text, "power", flow, NO_FLOW)]


def estimated_inertia(draft, name: str, part) -> list[Notice]:
    """Notice of the estimated inertia if a pump trips and its inertia is not given; as a list."""
    if part.trip is None or part.inertia is not None:
        return []
    value = inertia(single_pump(part), draft.fluid.density * draft.case.gravity)
    share = f" of each of {part.count} pumps" if part.count > 1 else ""
    text = (
        f"{name}: its inertia is estimated from power and speed: {value:.4g} kg m2 for impeller, water and "
        f"motor{share}; the surge depends on this value; give the key `inertia` from the manufacturer"
    )
    return [Notice("range", f"links.{name}", text, "inertia", value)]


def rated_point_notes(draft, name: str, part) -> list[Notice]:
    """Notices if the inertia or the shaft power of a pump is implausible for its rated point; as a list."""
    part, weight = single_pump(part), draft.fluid.density * draft.case.gravity
    if weight == 0.0:
        return []
    notices, power = [], rated_power(part, weight)
    if part.inertia is not None:
        notices += unusual_inertia(draft.case, name, part.inertia, power, part.rated_speed)
    flow, head = rated_point(part, weight)
    taken = weight * flow * head
    plausible = (1.0 - ROUNDING) * taken <= power <= taken / LEAST_SHARE
    if part.shaft_power is not None and part.power is None and not plausible:
        stated, fluid = (draft.case.amount(value, "power") for value in (power, taken))
        likely = units.likely(power, "power", taken, taken / LEAST_SHARE)
        text = (
            f"{name}: shaft_power is {stated} at the rated flow, but the fluid takes up {fluid} there"
            f"{likely or '; check values and units of `shaft_power`'}"
        )
        notices.append(Notice("range", f"links.{name}", text, "shaft_power", power, taken))
    return notices


def unusual_inertia(case, name: str, given: float, power: float, speed: float) -> list[Notice]:
    """Notice if an inertia [kg m2] is far from the usual value at a power [W] and speed [rad/s]; as a list."""
    usual = usual_inertia(power, speed)
    if usual / INERTIA_RATIO <= given <= usual * INERTIA_RATIO:
        return []
    likely = units.likely(given, "inertia", usual / INERTIA_RATIO, usual * INERTIA_RATIO)
    rated = f"{case.amount(power, 'power')} at {speed * 30.0 / math.pi:.4g} rpm"
    hint = likely or "; check value and unit"
    text = f"{name}: an inertia of {given:.4g} kg m2, where {usual:.3g} kg m2 is usual for {rated}{hint}"
    return [Notice("range", f"links.{name}", text, "inertia", given, usual)]


def unusual_flow(draft, name: str, part) -> list[Notice]:
    """Notice if the rated flow of a pump is too fast or too slow in all adjacent pipes; as a list.

    Pumping stations have 1 to 4 m/s (Sanks, Pumping Station Design).
    """
    pipes = [pipe for pipe in draft.case.links.values() if pipe.kind in ("pipe", "rigid-column")]
    bores = [pipe.diameter for pipe in pipes if {pipe.from_, pipe.to} & {part.from_, part.to}]
    if not bores or part.power is not None:
        return []
    flow = rated_point(combined_pump(part), draft.fluid.density * draft.case.gravity)[0]
    most, least = (flow / (math.pi / 4.0 * bore**2) for bore in (min(bores), max(bores)))
    if least <= MAX_VELOCITY and most >= MIN_VELOCITY:
        return []
    if least > MAX_VELOCITY:
        speed = least
        limit = MAX_VELOCITY
        extreme = "widest"
        suggestion = next(
            (f'"{flow:.4g} {unit}"' for unit, size in UNITS if speed * size <= MAX_VELOCITY),
            "another unit",
        )
    else:
        speed = most
        limit = MIN_VELOCITY
        extreme = "narrowest"
        suggestion = "another unit"
    rated, velocity = draft.case.amount(flow, "flow"), draft.case.amount(speed, "velocity")
    text = f"{name}: its rated flow of {rated} is {velocity} in the {extreme} adjacent pipe; did you mean {suggestion}?"
    key = "suter" if part.suter is not None else "curve"
    return [Notice("range", f"links.{name}", text, key, speed, limit)]


SMALL_SHARE = 1e-6  # flow at which a pump counts as not running, over its rated flow
SMALL_FLOW = 1e-9  # reverse flow regarded as rounding, over the flow scale of the model
# range of specific speeds that the published tables cover
SMALL_SPECIFIC_SPEED, LARGE_SPECIFIC_SPEED = 20.0, 320.0


class PumpRows(ShaftLowering, Device, kind="pump"):
    """Conversion to table rows of pumps: restrictions with a head curve.

    In the steady state no flow passes the check valve of a pump backward.
    """

    law = law
    quantities = ("head", "speed", "torque", "power", "electric_power", "total_electric_power")
    events = ("check valve shuts", "check valve opens")
    small = 0.01  # relative speed
    remedy = "replace the check_valve of the pump by a check-valve link with a time_constant"

    def inputs(self, model, name, part):
        return self.speed_input(model, name, SPEED)

    def restriction(self, draft, name, link, row) -> None:
        link, weight = combined_pump(link), draft.fluid.density * draft.case.gravity
        flow, head = rated_point(link, weight)
        row["data"] = len(draft.floats)
        draft.floats += curve_numbers(link, weight)
        row["conductance"] = (draft.fluid.density * flow) ** 2 / (weight * head)

    def numbers(self, draft, name, part) -> list[float]:
        part = combined_pump(part)
        rated, weight = part.rated_speed or 1.0, draft.fluid.density * draft.case.gravity
        numbers, own = self.drive_numbers(draft, name, part), shaft_points(part, weight)
        numbers |= {
            law.CHECK: part.check_valve,
            law.INERTIA: (inertia(part, weight) or np.inf) * rated,
            law.RATED: rated,
            law.COUNT_OR_TORQUE: own[0],
            law.HAS_SHAFT_POWER: self.dissipates(part),
        }
        given = self.torque_schedules(draft, name)
        numbers[law.ENERGY] = law.OWN_NUMBERS + len(given) + len(own) - 1
        rest = SMALL_SHARE * rated_point(part, weight)[0]
        return numbers_of(numbers, given, [*own[1:], *energy_numbers(draft, name, part, rest)])

    def states_of(self, draft, name, part):
        return super().states_of(draft, name, part) + (
            STATES if draft.case.energy is not None else ()
        )

    def integrals(self, row) -> int:
        return len(STATES) if row["states"] >= len(STATES) else 0

    def scales(self, draft, name, part):
        shaft = [self.small for _ in super().states_of(draft, name, part)]
        if draft.case.energy is None:
            return shaft
        part, weight = combined_pump(part), draft.fluid.density * draft.case.gravity
        flow, head = rated_point(part, weight)
        return shaft + energy_scales(draft, weight * flow * head, flow)

    def schedules_of_rates(self, row, valves, floats):
        return [int(floats[row["data"] + int(floats[row["data"] + law.ENERGY]) + law_energy.PRICE])]

    def dissipates(self, part) -> bool:
        return (
            not part.inertia
            is part.trip
            is part.efficiency
            is part.shaft_power
            is part.suter
            is None
        )

    def energy_rows(self, model, part, row, y, out) -> list[dict[int, float]]:
        if not self.has_free_shaft(model, row):
            return []
        return [{int(row["y"]): part.rated_speed * math.sqrt(0.5 * self.inertia(model, part))}]

    def above(self, model, part, row) -> float:
        speed = float(model.tables.valves[row["valve"]]["drive"])
        if not self.has_free_shaft(model, row):
            return 0.0
        return 0.5 * self.inertia(model, part) * (part.rated_speed * speed) ** 2

    def inertia(self, model, part) -> float:
        """Inertia of all rotating masses of all pumps of a part that runs free [kg m2]."""
        return inertia(combined_pump(part), weight_of(model))

    def has_free_shaft(self, model, row) -> bool:
        """True if the speed of the shaft is a state; row : of the device"""
        return bool(model.tables.floats[int(row["data"]) + law.MODE] != law.HELD_SPEED)

    def passing_notice(self, model, name, part, time) -> Notice:
        """Notice that a pump was outside its head curve in a way that its law allows, first at `time` [s]."""
        part, moment = single_pump(part), model.case.moment(time)
        rated = rated_point(part, weight_of(model))
        if (table := joined_table(part, *rated)) is None:
            text = (
                f"{name}: from {moment} on its flow is beyond the last flow of its curve, where its head "
                "follows a parabola; for a Suter table there give rated_speed, without "
                'curve_extrapolation = "parabola"'
            )
            return Notice("range", f"links.{name}", text, "curve")
        speed = specific_speed(part, *rated)
        source = (
            table.words
            if SMALL_SPECIFIC_SPEED <= speed <= LARGE_SPECIFIC_SPEED
            else f"{table.words}, the nearest"
        )
        text = (
            f"{name}: the pump leaves its curve at {moment}; outside the curve, head and torque follow the "
            f"Suter table {source}, joined to the curve and chosen by the specific speed of the pump, "
            f"{speed:.4g} (rpm, m3/s, m); "
            "for a pump of several stages or inlets give the key `suter`"
        )
        return Notice("range", f"links.{name}", text, "curve_extrapolation", speed)

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
        floats = start.draft.tables.floats
        at = int(row["data"])
        g = float(row["conductance"])
        rho, gravity = start.density_at(i), start.case.gravity
        ratio = rho / start.draft.fluid.density

        def newton(flow, present):
            a, s = law.curve_step(
                floats, at, speed, rho, rho * gravity, g, float(flow), float(present * ratio)
            )
            return 1.0 / s, ratio, a / s

        first = rho * floats[at + law.SCALE] * speed
        return Edge(i, j, newton, float(first), drives=True)

    def follow(self, start, k) -> None:
        """Do nothing: the function `begin` sets the drop of pump k."""

    def lift(self, start, row, flow: float) -> float:
        """Pressure rise [Pa] of a pump at a mass flow [kg/s] in the steady start; row : its row in the valve table"""
        floats, rho = start.draft.tables.floats, start.density_at(int(row["from_node"]))
        at, speed = int(row["data"]), float(row["drive"])
        return float(
            rho * start.case.gravity * law.curve_head(floats, at, speed, float(flow) / rho)[0]
        )

    def revise_state(self, start, part, row) -> bool:
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

    def flags_at_start(self, start, part, row) -> dict[int, bool]:
        return {int(row["event"]): int(row["valve"]) in start.shut}

    def begin(self, start, part, row) -> list[str]:
        k, draft = int(row["valve"]), start.draft
        valve = start.valves[k]
        name = draft.valve_names[k]
        moving = []
        ratio = start.density_at(int(valve["from_node"])) / draft.fluid.density
        if valve["open"] > 0.0:
            drop = -self.lift(start, valve, float(valve["flow"]))
            tolerance = 1e-6 * (abs(drop) + abs(self.lift(start, valve, 0.0))) + 1e-3
            if abs(drop - valve["drop"] * ratio) > tolerance:
                valve["open"] = 0.0
            elif draft.case.law.linear:
                valve["drop"] = drop
        if valve["open"] == 0.0 and k not in start.shut:
            text = f"pump {name}: its flow at the start is not on its characteristic at the relative speed "
            moving.append(f"{text}{valve['drive']:.4g}")
        draft.warnings += [
            *reversed_pump(start, name, part, valve),
            *unusual_flow(draft, name, part),
            *stalled_power(start, name, part, valve),
            *estimated_inertia(draft, name, part),
            *rated_point_notes(draft, name, part),
        ]
        return moving + self.set_free_shaft(start, part, row, valve)

    def fluid_torque(self, start, row, valve) -> float:
        floats, rho = start.draft.tables.floats, start.density_at(int(valve["from_node"]))
        speed = float(valve["drive"])
        flow = float(valve["flow"]) / rho
        dense = rho / start.draft.fluid.density
        return law.fluid_torque(floats, int(row["data"]), int(valve["data"]), speed, flow, dense)


def weight_of(model) -> float:
    """Specific weight rho g [N/m3] of the fluid of a model."""
    settings = model.tables.settings[0]
    return float(settings["rho"] * settings["gravity"])

"""Displacement pumps and motors in the tables of a model: their shaft, their setting and their steady start."""

import math
from typing import ClassVar

import numpy as np

from fvsolve.core.assembly.features import with_slot
from fvsolve.core.assembly.lowering import ANGULAR_SPEED, POSITION, Device, Input
from fvsolve.core.steady import Edge
from fvsolve.parts import law_elements as codes
from fvsolve.parts.displacement import law
from fvsolve.parts.displacement.part import LAG
from fvsolve.parts.law_elements import SLOT
from fvsolve.parts.network_elements import (
    FLOW,
    Element,
    fill_network_probe,
    network_of,
    node_or_reference,
)
from fvsolve.parts.network_parts import dry_friction
from fvsolve.parts.rotation import resistances

# sizes of speeds [rad/s], where nothing states one, and of pressure drops [Pa]
SPEED, PRESSURE = 100.0, 1e5
FULL, REGULATING, NONE = "full", "regulating", "none"  # modes of a compensator in the steady start
SMALL_SHARE = 1e-9  # share of the displacement that counts as rounding


class MachineRows(Device, kind="displacement-pump"):
    """Conversion to table rows of displacement machines: restrictions whose flow their speed gives."""

    law = law
    quantities = ("torque", "setting")  # then the torque of a pump
    # of the probe `torque`, as a torque that turns the shaft forward
    direction: ClassVar[float] = -1.0
    remedy = "give the pump a longer setting_time or its compensator a greater range"

    def of(self, part):
        return COMPENSATED if compensator_of(part) is not None else self

    def states_of(self, draft, name, part) -> tuple[str, ...]:
        return (
            ("setting",)
            if compensator_of(part) is not None or part.setting_time is not None
            else ()
        )

    def scales(self, draft, name, part) -> list[float]:
        return [0.1 for _ in self.states_of(draft, name, part)]

    def turns_with(self, part):
        return part.shaft if part.speed is None else None

    def schedules_of_rates(self, row, valves, floats):
        if row["states"] == 0:
            return []
        return [int(valves[row["valve"]]["schedule"]), int(floats[row["data"] + law.SET_SCHEDULE])]

    def inputs(self, model, name, part):
        row = self.row_of(model, name)
        own = {"setting": Input(POSITION, int(model.tables.valves[row["valve"]]["schedule"]))}
        return (
            own
            if part.speed is None
            else own | {"speed": Input(ANGULAR_SPEED, int(row["schedule"]))}
        )

    def network_elements(self, case, name, part):
        """Elements of the shaft: torque of the fluid and friction, each into the part."""
        place = f"links.{name}"
        shaft = None if part.shaft is None else node_or_reference(case, part.shaft)
        if shaft is None:
            return [], []
        ends, (_, viscous, dry) = (shaft, None), part.losses
        found = [
            Element(
                FLOW,
                f"{place}.fluid",
                place,
                ends,
                reads=(codes.DEVICE_INPUT, (name, "torque", -1.0)),
            )
        ]
        found += resistances(place, ends, viscous)
        friction, switches = (
            dry_friction(place, ends, (dry, dry, 0.0, 1.0)) if dry > 0.0 else ([], [])
        )
        return found + friction, switches

    def probe(self, draft, name, probe, row) -> None:
        if probe.quantity == "torque" and f"links.{name}" in getattr(
            network_of(draft), "total_numbers", {}
        ):
            fill_network_probe(draft, row, f"links.{name}", "all flows", -self.direction)
            return
        super().probe(draft, name, probe, row)
        if probe.quantity == "torque" and self.direction < 0.0:
            row["side"] = law.TAKEN

    def restriction(self, draft, name, link, row) -> None:
        row["schedule"] = draft.schedules.add(link.setting)
        speeds = [link.rated_speed or 0.0]
        if link.speed is not None:
            speeds += np.abs(link.speed.value[np.isfinite(link.speed.value)]).tolist()
        flow = draft.fluid.density * link.displacement * (max(speeds) or SPEED)  # its usual size
        row["conductance"] = flow**2 / PRESSURE

    def numbers(self, draft, name, part) -> list[float]:
        device = draft.device_table[draft.device_names.index(name)]
        leakage, viscous, dry = part.losses
        if part.speed is not None:
            device["schedule"] = draft.schedules.add(part.speed)
        numbers = {
            law.DISPLACEMENT: part.displacement,
            law.LEAKAGE: leakage,
            law.VISCOUS: viscous,
            law.DRY: dry,
            law.SHAFT: -1.0,
            law.LAG: part.setting_time or LAG,
            law.SET_SCHEDULE: -1.0,
            law.SENSED: -1.0,
        }
        return [float(numbers.get(k, 0.0)) for k in range(law.COUNT)]

    def part(self, start, k: int):
        """Part of valve row k."""
        return start.draft.devices[start.valves[k]["device"]][1]

    # steady start -------------------------------------------------------------------------------------------------

    def speed_at(self, start, k: int) -> float:
        """Angular velocity at the start [rad/s]."""
        part, row = self.part(start, k), start.draft.device_table[start.valves[k]["device"]]
        if row["schedule"] >= 0:
            return start.schedule_value(row["schedule"])
        return with_slot(start.draft.features, SLOT).potentials(start)[part.shaft]

    def share(self, start, k: int) -> float:
        """Share of the displacement that a compensator allows at the start."""
        return 1.0

    def edge(self, start, k: int):
        row, part = start.valves[k], self.part(start, k)
        i, j = int(row["from_node"]), int(row["to_node"])
        speed, setting = self.speed_at(start, k), float(start.schedule_value(row["schedule"]))
        row["open"] = row["conductance"]
        if start.rest:
            row["open"] = 0.0
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0)
        density_ratio, ratio = start.density_ratios.get(k, (1.0, 1.0))
        density = start.density_at(i if setting * speed >= 0.0 else j)
        full = density * part.displacement * setting * speed
        slope = start.draft.fluid.density * density_ratio * part.losses[0]
        return self.edge_of(
            start, k, full, slope, ratio, Edge(i, j, None, full, drives=speed != 0.0)
        )

    def edge_of(self, start, k: int, full: float, slope: float, ratio: float, edge: Edge) -> Edge:
        """Edge in the steady problem with the mass flow full + slope drop.

        full : mass flow at full share [kg/s]; slope : derivative by the drop [kg/s/Pa]; ratio : of drops
        """
        if slope == 0.0:
            edge.shut = edge.flow == 0.0
            return edge
        per = PRESSURE / math.sqrt(float(start.valves[k]["conductance"]) * PRESSURE)

        def newton(flow, present):
            return per, per * slope * ratio, per * (full + slope * ratio * present - flow)

        edge.row = newton
        return edge

    def follow(self, start, k) -> None:
        """Do nothing: the law is linear in the drop, and `begin` sets the flow."""

    def begin(self, start, part, row) -> list[str]:
        k, draft = int(row["valve"]), start.draft
        floats = draft.tables.floats
        at = int(row["data"])
        valve = start.valves[int(row["valve"])]
        setting = float(start.schedule_value(valve["schedule"])) * self.share(start, k)
        floats[at + law.SETTING] = setting
        valve["drive"] = setting * self.speed_at(start, k)
        if row["schedule"] < 0:
            floats[at + law.SHAFT] = with_slot(draft.features, SLOT).shafts.index(part.shaft)
            floats[at + law.LIGHTNESS] = network_of(draft).lightness(part.shaft)
        return []

    def source_at_start(self, start, part, row, quantity, flow) -> float:
        drop = start.valve_drive(int(row["valve"]))[0]
        setting = start.draft.tables.floats[row["data"] + law.SETTING]
        return float(setting) * part.displacement * float(drop)


class MotorRows(MachineRows, kind="displacement-motor"):
    """Conversion to table rows of displacement motors."""

    direction = 1.0


class CompensatedRows(MachineRows, kind=""):
    """Conversion to table rows of displacement pumps with a compensator."""

    events = (
        "has full displacement",
        "is destroked",
        "has no displacement",
        "delivers again",
        "is limited by its set_pressure",
        "follows the sensed pressure",
    )

    def of(self, part):
        return self

    def numbers(self, draft, name, part) -> list[float]:
        numbers, own = super().numbers(draft, name, part), part.compensator
        numbers[law.RANGE] = own.range
        if own.set_pressure is not None:
            numbers[law.SET_SCHEDULE] = draft.schedules.add(own.set_pressure)
        if own.senses is not None:
            numbers[law.SENSED] = node = draft.node_index[own.senses]
            draft.device_table["node"][draft.device_names.index(name)] = node
        return numbers

    def shares(self, start, k: int) -> tuple[float, float]:
        """(share that the set pressure gives, share that the sensed pressure gives) in the latest solution.

        They are not limited to 0 to 1; a large number stands for a share that does not exist.
        """
        own = self.part(start, k).compensator
        behind, values = start.pressure(int(start.valves[k]["to_node"])), [1e300, 1e300]
        if own.set_pressure is not None:
            values[0] = (self.set_pressure(start, k) - behind) / own.range
        if own.senses is not None:
            values[1] = (
                start.pressure(start.draft.node_index[own.senses]) + own.margin - behind
            ) / own.range
        return values[0], values[1]

    def share(self, start, k):
        mode = start.valve_modes.get(k, FULL)
        if mode == REGULATING and not start.rest:
            return min(max(min(self.shares(start, k)), 0.0), 1.0)
        return float(mode == FULL)

    def edge_of(self, start, k, full, slope, ratio, edge):
        mode, own = start.valve_modes.setdefault(k, FULL), self.part(start, k).compensator
        if mode != REGULATING or full == 0.0:
            edge.flow = full if mode == FULL else 0.0
            return super().edge_of(start, k, edge.flow, slope, ratio, edge)
        per = PRESSURE / math.sqrt(float(start.valves[k]["conductance"]) * PRESSURE)
        by_set, by_sense = self.shares(start, k)
        places = (edge.j, start.draft.node_index[own.senses]) if by_sense < by_set else (edge.j,)
        edge.sensed_nodes, steep, height = places, per * full / own.range, start.nodes["elevation"]

        def newton(flow, present, *potentials):
            behind, *sensed = (
                start.law.pressure_of(p, height[i]) for p, i in zip(potentials, places, strict=True)
            )
            goal = sensed[0] + own.margin if sensed else self.set_pressure(start, k)
            target = full * (goal - behind) / own.range + slope * ratio * present
            return (
                per,
                per * slope * ratio,
                per * (target - flow),
                *([-steep, steep][: len(places)]),
            )

        edge.row = newton
        return edge

    def set_pressure(self, start, k: int) -> float:
        """Set pressure of valve row k at the start [Pa]."""
        return start.schedule_value(
            start.draft.tables.floats[self.data_of(start, k) + law.SET_SCHEDULE]
        )

    def data_of(self, start, k: int) -> int:
        """Index of the numbers of valve row k in `floats`."""
        return int(start.draft.device_table[start.valves[k]["device"]]["data"])

    def revise_state(self, start, part, row) -> bool:
        k = int(row["valve"])
        if start.rest:
            return False
        before, share = start.valve_modes[k], min(self.shares(start, k))
        after = {
            FULL: REGULATING if share < 1.0 - SMALL_SHARE else FULL,
            REGULATING: FULL
            if share > 1.0 + SMALL_SHARE
            else NONE
            if share < -SMALL_SHARE
            else REGULATING,
            NONE: REGULATING if share > SMALL_SHARE else NONE,
        }[before]
        start.valve_modes[k] = after
        return after != before

    def begin(self, start, part, row) -> list[str]:
        k = int(row["valve"])
        floats = start.draft.tables.floats
        at = int(row["data"])
        floats[at + law.SHARE], floats[at + law.SENSED_SHARE] = self.shares(start, k)
        if part.compensator.set_pressure is not None:
            floats[at + law.SET_PRESSURE] = self.set_pressure(start, k)
        return super().begin(start, part, row)


COMPENSATED = CompensatedRows()


def compensator_of(part):
    """Compensator of a machine; None without one."""
    return getattr(part, "compensator", None)

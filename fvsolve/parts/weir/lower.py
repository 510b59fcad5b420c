"""Weirs, and the base of structures, in the tables of a model."""

import math
from collections.abc import Callable

from fvsolve.core.assembly.lowering import CREST, TYPICAL_DROP, Device, Input
from fvsolve.core.kernels.dtypes import FIRM_SLOPE
from fvsolve.core.kernels.structures import LINEAR_FALL
from fvsolve.core.steady import Edge
from fvsolve.errors import Notice

from . import law

# difference from the flow of the law at the start that counts as none, over the flow
SMALL_FLOW = 1e-6


class StructureRows(Device, kind=""):
    """Base of the conversion to table rows of structures between two water levels.

    setting : key of the scheduled crest or opening, "" for none; setting_input : its kind of input
    bottom_key : key of the levels at which water enters, see `bottoms`
    """

    quantities = ("regime",)
    setting = ""
    setting_input = CREST
    bottom_key = "crest"

    def size(self, draft, part) -> float:
        """Flow [m3/s] at a head of about 1 m, by which small flows are measured."""
        raise NotImplementedError

    def restriction(self, draft, name, link, row) -> None:
        """Set the conductance M^2 over the drop at a head of 1 m, and the flow at LINEAR_FALL by the same law."""
        weight = draft.fluid.density * draft.case.gravity
        row["conductance"] = (draft.fluid.density * self.size(draft, link)) ** 2 / weight
        row["transition"] = math.sqrt(row["conductance"] * weight * LINEAR_FALL)
        ends = (draft.case.places[end] for end in (link.from_, link.to))
        # which limit the rate of its flow
        row["chained"] = any(node.kind == "junction" for node in ends)

    def bottoms(self, part) -> tuple[float, float]:
        """Least levels [m] at which water enters the structure at its ends `from` and `to`."""
        raise NotImplementedError

    def begin(self, start, part, row) -> list[str]:
        """Add a notice to a structure between reservoirs whose levels never reach it."""
        ends = [start.case.nodes.get(end) for end in (part.from_, part.to)]
        levels = [
            float(node.head.value.max()) for node in ends if getattr(node, "head", None) is not None
        ]
        if len(levels) == 2 and all(
            level <= low for level, low in zip(levels, self.bottoms(part), strict=True)
        ):
            name, key = start.draft.valve_names[row["valve"]], self.bottom_key
            text = f"{name}: the heads of {part.from_} and {part.to} never reach its `{key}`, so that no water flows"
            start.draft.warnings.append(Notice("range", f"links.{name}", text, key))
        return []

    def schedule(self, draft, name, part) -> None:
        """Write the index of the scheduled setting to the row of the device."""
        if self.setting:
            row = draft.device_table[draft.device_names.index(name)]
            row["schedule"] = draft.schedules.add(getattr(part, self.setting))

    def inputs(self, model, name, part):
        if not self.setting:
            return {}
        return {self.setting: Input(self.setting_input, int(self.row_of(model, name)["schedule"]))}

    def linear_law(self, start, k: int) -> Callable:
        """Function (flow [kg/s], drop, potential of `from` [Pa]) -> (flow of the law [kg/s], two slopes [kg/s/Pa]).

        The slopes are those over the drop, and over the potential at a constant drop.
        """
        row, weight = start.valves[k], start.weight
        rho = start.draft.fluid.density * start.density_ratios.get(k, (1.0, 1.0))[0]
        ambient = start.law.potential_of(start.case.ambient_pressure, 0.0)
        floats = start.draft.tables.floats
        at = int(row["data"])
        setting = float(row["drive"])

        def linear(flow, drop, potential):
            z = (potential - ambient) / weight
            q, *slopes = self.law.line(
                floats, at, setting, float(z), float(drop / weight), float(flow / rho), FIRM_SLOPE
            )
            return rho * q, *(slope / start.case.gravity for slope in slopes)

        return linear

    def edge(self, start, k: int) -> Edge:
        row = start.valves[k]
        schedule = start.draft.device_table[row["device"]]["schedule"]
        row["drive"] = start.schedule_value(schedule) if self.setting else 0.0
        row["open"] = g = float(row["conductance"])
        i, j = int(row["from_node"]), int(row["to_node"])
        if start.rest:
            return Edge(i, j, None, 0.0, drop=lambda flow: 0.0)
        per, linear = math.sqrt(TYPICAL_DROP / g), self.linear_law(start, k)

        def newton(flow, drop, potential):
            found, by_drop, by_level = linear(flow, drop, potential)
            return per, per * by_drop, per * (found - flow), per * by_level

        return Edge(i, j, newton, sensed_nodes=(i,))

    def follow(self, start, k: int) -> None:
        """Count the structure as not open if its flow at the start does not follow from the levels."""
        row = start.valves[k]
        flow, potential = float(row["flow"]), float(start.answer.potential[row["from_node"]])
        found = self.linear_law(start, k)(flow, float(row["drop"]), potential)[0]
        if abs(found - flow) > SMALL_FLOW * (SMALL_FLOW * start.flow_scale + abs(flow)):
            row["open"] = 0.0


class WeirRows(StructureRows, kind="weir"):
    """Conversion to table rows of weirs."""

    law, setting = law, "crest"

    def bottoms(self, part) -> tuple[float, float]:
        return (float(part.crest.value.min()),) * 2

    def size(self, draft, part) -> float:
        return weir_size(draft, part.width, part.discharge_coefficient)

    def numbers(self, draft, name, part) -> list[float]:
        self.schedule(draft, name, part)
        return [self.size(draft, part)]


def weir_size(draft, width: float, coefficient: float) -> float:
    """Number 2/3 C sqrt(2 g) b [m^1.5/s] of a weir of width b [m] and coefficient C."""
    return 2.0 / 3.0 * coefficient * math.sqrt(2.0 * draft.case.gravity) * width

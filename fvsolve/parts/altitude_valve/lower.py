"""Altitude valves in the tables of a model."""

from fvsolve.core.assembly.lowering import Device

from . import law

# rounding: over the flow scale of the model [-], of potentials [Pa]
SMALL_FLOW, SMALL_DROP = 1e-9, 1e-6
NO_LEVEL = 1e300


class AltitudeValveRows(Device, kind="altitude-valve"):
    """Conversion to table rows of altitude valves; in the steady state they shut by the level of their tank."""

    law, events_only = law, True
    quantities = ("opening",)
    events = ("shuts: the tank is full", "opens", "shuts: the tank is empty", "opens")

    def numbers(self, draft, name, part) -> list[float]:
        return [
            NO_LEVEL if part.full_level is None else part.full_level,
            -NO_LEVEL if part.empty_level is None else part.empty_level,
            part.differential,
        ]

    def shut_reason(self, start, k):
        part = start.case.conduits[start.draft.valve_names[k]]
        return (
            "the tank is full"
            if start.case.nodes[part.to].level == part.full_level
            else "the tank is empty"
        )

    def flags_at_start(self, start, part, row) -> dict[int, bool]:
        shut = int(row["valve"]) in start.shut
        level = start.case.nodes[part.to].level
        at = int(row["event"])
        return {
            at + law.FULL: shut and level == part.full_level,
            at + law.EMPTY: shut and level == part.empty_level,
        }

    def revise_state(self, start, part, row) -> bool:
        k, level = int(row["valve"]), start.case.nodes[part.to].level
        full, empty = (
            limit is not None and level == limit for limit in (part.full_level, part.empty_level)
        )
        if k in start.shut:
            outside, inside = start.across(k)
            drop = outside - inside
            opens = (full and drop < -law.MARGIN - SMALL_DROP) or (
                empty and drop > law.MARGIN + SMALL_DROP
            )
            start.shut -= {k} if opens else set()
            return opens
        flow, least = float(start.valve_flows()[k]), SMALL_FLOW * start.flow_scale
        shuts = (full and flow > least) or (empty and flow < -least)
        start.shut |= {k} if shuts else set()
        return shuts

"""Air valves in the tables of a model, and their states at the start."""

import math

from fvsolve.core.assembly.lowering import Device
from fvsolve.errors import Notice
from fvsolve.parts.air_valve import law
from fvsolve.parts.air_valve.part import AirFlow

GAS_CONSTANT = 287.05  # of air [J/kg/K]


class AirValveRows(Device, kind="air-valve"):
    """Conversion to table rows of the chambers of air valves; all valves are shut at the start."""

    law = law
    vessel = events_only = True
    states = ("air",)
    quantities = ("air_volume", "air_mass", "air_pressure")
    events = ("opens", "shuts")
    remedy = "try a greater or smaller `volume` of the air valve"

    def of(self, part) -> Device:
        return self if part.throttled_outlet is None else ThrottledAirValveRows()

    def place(self, draft, name, node, row) -> None:
        super().place(draft, name, node, row)
        row["density"] = draft.case.law.open_density
        row["y"] = draft.states([f"{name}.mass"], row["density"] * node.volume)

    def pressure_at_start(self, start, i, node, row) -> float:
        return start.case.ambient_pressure

    def gate(self, name: str) -> str:
        return name.removesuffix(".inside") + ".connection"

    def numbers(self, draft, name, part) -> list[float]:
        rt = GAS_CONSTANT * part.temperature
        air_mass = draft.case.ambient_pressure * part.volume / rt
        bores = part.inlet, part.outlet, part.throttled_outlet
        into, wide, small, always = (
            0.0
            if d is None or isinstance(d, AirFlow)
            else part.discharge_coefficient * math.pi / 4.0 * d**2
            for d in (*bores, part.automatic)
        )
        own = [
            part.volume,
            air_mass,
            rt,
            into,
            wide + always,
            part.switch or 0.0,
            small + always,
            0.0,
        ]
        tables: list[float] = []
        density = draft.case.ambient_pressure / rt
        for bore, place in zip(
            bores, (law.INLET_TABLE, law.OUTLET_TABLE, law.THROTTLED_TABLE), strict=True
        ):
            given = isinstance(bore, AirFlow)
            own.append(float(law.OWN_NUMBERS + len(tables) - place) if given else 0.0)
            tables += (
                [len(bore.pressure), *bore.pressure, *((density * q) ** 2 for q in bore.flow)]
                if given
                else []
            )
        return own + tables

    def scales(self, draft, name, part) -> list[float]:
        return [self.numbers(draft, name, part)[law.AIR_MASS]]

    def revise_state(self, start, part, row) -> bool:
        k = int(row["valve"])
        new = k not in start.shut
        start.shut |= {k}
        return new

    def begin(self, start, part, row) -> list[str]:
        nodes = start.nodes
        node, place = nodes[row["node"]], nodes[start.valves[row["valve"]]["from_node"]]
        node["pressure"], node["mass"] = start.case.ambient_pressure, 0.0
        node["stiffness"] = start.case.ambient_pressure / (part.volume * node["density"])
        deficit = start.case.ambient_pressure - float(place["pressure"])
        name = list(start.case.places)[row["node"]].removesuffix(".inside")
        if deficit <= law.PRESSURE_MARGIN:
            return []
        below = start.case.amount(deficit, "pressure", span=True)
        text = f"{name}: the air valve is open at the start, at a pressure of {below} below ambient"
        start.draft.warnings.append(
            Notice("start", f"nodes.{name}", text, "pressure", float(deficit), 0.0)
        )
        return [f"air valve {name} opens, at a pressure of {below} below ambient"]

    def energy_rows(self, model, part, row, y, out):
        """List with the only row of the energy matrix L, as {state index: factor}.

        |L dy|^2 is the energy [J] of a small deviation dy.

        The energy is R T / (2 m) (dm + m / (V rho) dy)^2 of air and fluid in the chamber, with air mass m, air volume
        V, fluid density rho, and deviations dm and dy of air and fluid mass.
        """
        st = model.tables.settings[0]
        floats = model.tables.floats
        node = model.tables.nodes
        node, at = node[row["node"]], int(row["data"])
        _, volume, mass = law.air_state(
            st, floats, node, at, float(y[node["y"]]), float(y[row["y"]])
        )
        root = math.sqrt(floats[at + law.RT] / (2.0 * mass))
        return [
            {int(row["y"]): root, int(node["y"]): root * mass / (volume * float(node["density"]))}
        ]


class ThrottledAirValveRows(AirValveRows, kind=""):
    """Conversion to table rows of air valves with `throttled_outlet`, a smaller bore for the outflow of air.

    Air leaves through it above the gauge pressure `switch`, or above the fluid velocity `switch_velocity`.
    """

    events = (*AirValveRows.events, "throttles", "stops throttling")

    def begin(self, start, part, row) -> list[str]:
        place, widest = start.valves[row["valve"]]["from_node"], 0.0
        for table in (start.pipes, start.columns):
            joins = (table["from_node"] == place) | (table["to_node"] == place)
            widest = max(widest, *table["area"][joins], 0.0)
        density = start.nodes[row["node"]]["density"]
        start.draft.tables.floats[row["data"] + law.SWITCH_FLOW] = (
            (part.switch_velocity or 0.0) * density * widest
        )
        return super().begin(start, part, row)

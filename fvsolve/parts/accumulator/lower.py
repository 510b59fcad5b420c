"""Accumulators and air vessels in the tables of a model, and their states at the start."""

import math

import numpy as np

from fvsolve.core.assembly.lowering import Device
from fvsolve.errors import Notice
from fvsolve.parts.accumulator import law, law_vessel
from fvsolve.parts.accumulator.part import UPRIGHT, height_of, length_of

# axis rise over radius below which a cylinder counts as horizontal; likewise for upright
SLOPE_TOLERANCE = 1e-6


class VesselStart:
    """Gas and fluid of a vessel with a shape, at the start.

    gas, fluid_volume : volumes of gas and fluid [m3]; level : level of the fluid above the bottom [m]
    centroid : height of the centroid of the fluid above the bottom [m]
    bottom : height of the bottom above the node [m]
    """

    def __init__(self, start, part) -> None:
        self.law, self.gravity, self.bottom = start.law, start.case.gravity, part.bottom or 0.0
        shape = np.array(shape_numbers(part))
        self.gas = part.gas_volume
        if self.gas is None:
            self.gas = part.volume - float(law_vessel.volume_below(shape, 0, part.level))
        self.fluid_volume = part.volume - self.gas
        self.level = float(law_vessel.level_at(shape, 0, self.fluid_volume))
        below = float(law_vessel.moment_below(shape, 0, self.level))
        self.centroid = below / self.fluid_volume if self.fluid_volume > 0.0 else 0.0

    def gas_pressure(self, p: float) -> tuple[float, float]:
        """(pressure of the gas [Pa], mass of the fluid [kg]) at a pressure p of the node [Pa]."""
        if self.law.linear:
            rho = self.law.rho
            return p - rho * self.gravity * (self.bottom + self.level), rho * self.fluid_volume
        potential = self.gravity * (self.bottom + self.centroid)
        q = float(self.law.pressure_of_enthalpy(self.law.enthalpy(p) - potential))
        rho = float(self.law.density(q))
        return q - rho * self.gravity * (self.level - self.centroid), rho * self.fluid_volume

    def node_pressure(self, gas: float) -> float:
        """Pressure of the node [Pa] at a pressure `gas` of the gas [Pa]."""
        if self.law.linear:
            return gas + self.law.rho * self.gravity * (self.bottom + self.level)
        q = gas
        for _ in range(20):
            q = gas + float(self.law.density(q)) * self.gravity * (self.level - self.centroid)
        return float(
            self.law.pressure_of_enthalpy(
                self.law.enthalpy(q) + self.gravity * (self.bottom + self.centroid)
            )
        )


def shape_numbers(part) -> list[float]:
    """Parameters of the shape of a vessel: kind, level when full [m], three sizes, and for a table of areas its values.

    The sizes are the area [m2] of a prism; or radius [m], length [m] and slope [rad] of a cylinder; or the number of
    levels, after which levels [m], areas [m2] and volumes [m3] follow.
    """
    top = height_of(part)
    if part.diameter is None:
        if not hasattr(part.area, "level") or len(part.area.level) == 1:
            area = part.area if not hasattr(part.area, "level") else part.area.area[0]
            return [law_vessel.PRISM, top, float(area), 0.0, 0.0]
        level, area = part.area.level, part.area.area
        steps = [
            0.5 * (a + b) * (high - low)
            for low, high, a, b in zip(level, level[1:], area, area[1:], strict=False)
        ]
        volume = [math.fsum(steps[:k]) for k in range(len(level))]
        return [
            law_vessel.AREA_TABLE,
            top,
            len(level),
            0.0,
            0.0,
            *map(float, (*level, *area, *volume)),
        ]
    radius = 0.5 * part.diameter
    length = length_of(part)
    slope = UPRIGHT if part.slope is None else part.slope
    if radius * math.cos(slope) <= SLOPE_TOLERANCE * length * math.sin(slope):
        return [law_vessel.PRISM, top, math.pi * radius**2, 0.0, 0.0]
    if length * math.sin(slope) <= SLOPE_TOLERANCE * radius * math.cos(slope):
        return [law_vessel.HORIZONTAL_CYLINDER, top, radius, length, 0.0]
    return [law_vessel.INCLINED_CYLINDER, top, radius, length, slope]


# Share of the released mass added to the scale of errors in the neck, so that it exceeds rounding
NECK_ERROR_SHARE = 1e-5
NECK_SHARE = 0.01  # volume of the neck of a bladder accumulator over its volume


class AccumulatorRows(Device, kind="accumulator"):
    """Conversion to table rows of accumulators: vessels, whose node has the pressure of the gas."""

    law = law
    vessel = True
    quantities = ("gas_volume", "gas_pressure")
    events = ("is empty", "holds fluid again")
    remedy = "give the accumulator a connection, whose loss damps the flow in and out"

    def of(self, part) -> Device:
        return (
            self
            if not part.has_shape
            else ShapedRows()
            if part.compressor is None
            else CompressorRows()
        )

    def place(self, draft, name, node, row) -> None:
        super().place(draft, name, node, row)
        row["y"] = draft.states([f"{name}.mass"], 0.1 * draft.fluid.density * node.volume)

    def pressure_at_start(self, start, i, node, row) -> float | None:
        if node.initial_pressure is None or not node.has_shape:
            return node.initial_pressure
        return VesselStart(start, node).node_pressure(node.initial_pressure)

    def numbers(self, draft, name, part) -> list[float]:
        return [0.0] * law.NUMBER_COUNT

    def apply_event(self, run_data, row, t, y, scale) -> None:
        model = run_data.model
        floats, at = model.tables.floats[row["data"] :], model.tables.nodes[row["node"]]["y"]
        scale[at] = model.scale[at]
        # the neck takes up far less mass
        if floats[law.NECK_STIFFNESS] > 0.0 and run_data.armed[row["event"]] > 0.0:
            scale[at] = -(
                1e5 / floats[law.NECK_STIFFNESS] + NECK_ERROR_SHARE * abs(floats[law.EMPTY_MASS])
            )

    def begin(self, start, part, row) -> list[str]:
        draft, fluid = start.draft, start.draft.fluid
        node = draft.node_table[row["node"]]
        p, density = float(node["pressure"]), draft.case.law.density
        neck = NECK_SHARE * part.volume if part.precharge is not None else 0.0
        charge_pressure = part.precharge if part.precharge is not None else p
        gas = part.gas_volume or part.volume * min(
            1.0, (charge_pressure / p) ** (1.0 / part.exponent)
        )
        total = part.volume + neck
        mass = density(p) * (total - gas)
        excess = (charge_pressure if neck else p * (gas / part.volume) ** part.exponent) - p
        stiffness = fluid.bulk_modulus / (fluid.density * neck) if neck else 0.0
        empty = density(p + excess) * neck - mass
        if draft.case.law.linear:
            empty = (
                excess / stiffness
                if neck and excess > 0.0
                else -fluid.density * (part.volume - gas)
            )
        floats = draft.tables.floats
        floats[row["data"] : row["data"] + law.NUMBER_COUNT] = [
            part.exponent,
            gas,
            total,
            stiffness,
            empty,
            excess,
        ]
        node["mass"] = mass
        node["stiffness"] = (
            stiffness if excess > 0.0 and neck else part.exponent * p / (fluid.density * gas)
        )
        if neck and excess >= 0.0:
            name = list(draft.case.places)[row["node"]].removesuffix(".inside")
            charge, pressure = (
                draft.case.amount(value, "pressure", 6) for value in (charge_pressure, p)
            )
            text = f"{name}: empty at the start: precharge {charge} is not below the pressure at the node, {pressure}"
            draft.warnings.append(
                Notice(
                    "start", f"nodes.{name}", text, "precharge", float(charge_pressure), float(p)
                )
            )
        return []

    def change(self, model, row, y: float) -> float:
        """Pressure of the node minus that at the start [Pa], after an inflow y since the start [kg].

        row : row of the accumulator in the table of devices
        """
        st = model.tables.settings[0]
        floats = model.tables.floats
        node = model.tables.nodes[row["node"]]
        return law.gas_state(st, floats, node, int(row["data"]), y)[1]

    def energy(self, model, row, y: float) -> float:
        """Stored energy minus that at the start [J], after an inflow y since the start [kg].

        row : row of the accumulator in the table of devices
        """
        st = model.tables.settings[0]
        floats = model.tables.floats
        node = model.tables.nodes[row["node"]]
        return law.accumulator_energy(st, floats, node, int(row["data"]), y)

    def above(self, model, part, row) -> float:
        """Energy [J] that the accumulator can release from its state at the start.

        It is the stored energy at the start minus the least stored energy. In the state of least energy, the energy per
        mass of the fluid at the node (`energy_head`) is 0, or no fluid is left.
        """
        from fvsolve.core.kernels.network_energy import energy_head

        st, floats = model.tables.settings[0], model.tables.floats
        node, at = model.tables.nodes[row["node"]], int(row["data"])

        def head(y: float) -> float:
            return energy_head(
                st, floats, node, float(node["pressure"] + self.change(model, row, y))
            )

        low = (
            float(floats[at + law.EMPTY_MASS])
            if not floats[at + law.NECK_STIFFNESS]
            else -0.999 * float(node["mass"])
        )
        high = (1.0 - 1e-6) * model.case.properties.density * float(floats[at + law.GAS_VOLUME])
        if head(low) < 0.0:
            for _ in range(200):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if head(middle) < 0.0 else (low, middle)
        return -float(self.energy(model, row, low))


class ShapedRows(AccumulatorRows, kind=""):
    """Conversion to table rows of air vessels with a shape; the weight of their fluid acts on the node."""

    law = law_vessel
    quantities = (*AccumulatorRows.quantities, "level")

    def numbers(self, draft, name, part) -> list[float]:
        compressor = [0.0, 0.0, 0.0]
        if part.compressor is not None:
            compressor = [0.0, part.compressor.start, part.compressor.stop]
        return (
            [0.0] * law.NUMBER_COUNT
            + [0.0, 0.0, part.bottom or 0.0, *compressor]
            + shape_numbers(part)
        )

    def begin(self, start, part, row) -> list[str]:
        draft, n = start.draft, part.exponent
        node, at = draft.node_table[row["node"]], row["data"]
        at_start = VesselStart(start, part)
        p, mass = at_start.gas_pressure(float(node["pressure"]))
        if not p > 0.0:
            name = list(draft.case.places)[row["node"]].removesuffix(".inside")
            height = at_start.level + at_start.bottom
            pressure = draft.case.amount(node["pressure"], "pressure", 6)
            head = draft.case.amount(height, "head", span=True)
            text = (
                f"no steady state: the pressure at the node, {pressure}, is below that of the fluid column, {head} "
                "high, so the gas would have no pressure; set the key `bottom` or `level` "
                "lower, or `gas_volume` greater"
            )
            draft.fault(
                f"nodes.{name}.{'level' if part.gas_volume is None else 'gas_volume'}", text
            )
            return []
        floats = draft.tables.floats
        empty = -draft.fluid.density * at_start.fluid_volume if start.law.linear else -mass
        floats[at : at + law.NUMBER_COUNT] = [n, at_start.gas, part.volume, 0.0, empty, 0.0]
        floats[at + self.law.GAS_PRESSURE], floats[at + self.law.LEVEL] = p, at_start.level
        if part.compressor is not None:
            floats[at + self.law.COMPRESSOR_RATE] = (
                part.compressor.flow * start.case.ambient_pressure / (p * at_start.gas)
            )
        node["mass"] = mass
        st = draft.tables.settings[0]
        node["stiffness"] = self.law.pressure_and_stiffness(st, floats, node, int(at), 0.0, 0.0)[1]
        return []

    def change(self, model, row, y: float) -> float:
        st = model.tables.settings[0]
        floats = model.tables.floats
        node = model.tables.nodes[row["node"]]
        return self.law.pressure_and_stiffness(st, floats, node, int(row["data"]), y, 0.0)[0]

    def energy(self, model, row, y: float) -> float:
        st = model.tables.settings[0]
        floats = model.tables.floats
        node = model.tables.nodes[row["node"]]
        return self.law.stored_energy_change(st, floats, node, int(row["data"]), y, 0.0)


class CompressorRows(ShapedRows, kind=""):
    """Conversion to table rows of air vessels with a compressor, which limits the level."""

    states = ("gas",)
    events = (*ShapedRows.events, "compressor starts", "compressor stops")

    def scales(self, draft, name, part) -> list[float]:
        return [0.1]

    def energy_rows(self, model, part, row, y, out):
        """List of rows of the energy matrix L, each as {state index: factor}.

        |L dy|^2 is the energy [J] of a small deviation dy.

        With added gas a, inflow y, density rho, gas pressure p and volume V, exponent n and free surface S, the energy
        is n p V / 2 (da / (1 + a) + dy / (rho V))^2 of the gas and g / (2 rho S) dy^2 of the weight of the fluid.
        """
        st = model.tables.settings[0]
        floats = model.tables.floats
        node = model.tables.nodes[row["node"]]
        at = int(row["data"])
        mass = int(node["y"])
        a = float(y[row["y"]])
        rho = model.case.properties.density
        u, change, _, _ = self.law.vessel_state(st, floats, node, at, float(y[mass]), a)
        gas = floats[at + law.GAS_VOLUME] * math.exp(u)
        p = floats[at + self.law.GAS_PRESSURE] + change
        root = math.sqrt(0.5 * part.exponent * p * gas)
        total = super().energy_rows(model, part, row, y, out)[0][mass]
        rest = math.sqrt(max(0.0, total**2 - (root / (rho * gas)) ** 2))
        return [{int(row["y"]): root / (1.0 + a), mass: root / (rho * gas)}, {mass: rest}]

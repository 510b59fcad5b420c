"""Accumulators and air vessels: keys, shapes, ranges and faults."""

import math
from typing import Annotated, Any, ClassVar

from fvsolve.parts.connection import Connection, ConnectionTable, with_connection
from fvsolve.parts.hydraulic_nodes import Junction
from fvsolve.parts.nodes_and_links import Node
from fvsolve.parts.table_model import CaseContext, Faults, Nested, Table, missing_key_faults
from fvsolve.parts.tank import Surface
from fvsolve.parts.value import Number, Quantity, Range, UsualRange, nonnegative, positive

LEVELS = UsualRange(0.0, 50.0, "pilot vessels to towers")
UPRIGHT = 0.5 * math.pi


class Compressor(Table):
    """Compressor that adds gas: starts when the level rises to `start`, stops when the level falls to `stop`."""

    start: Annotated[
        float,
        Quantity("level", nonnegative, "fluid level at which the compressor starts [m]", LEVELS),
    ]
    stop: Annotated[
        float,
        Quantity(
            "level",
            nonnegative,
            "fluid level, below `start`, at which the compressor stops [m]",
            LEVELS,
        ),
    ]
    flow: Annotated[
        float,
        Quantity(
            "flow",
            positive,
            "flow of free air, at ambient pressure and the initial temperature of the gas [m3/s]",
            UsualRange(1e-5, 10.0, "workshops to stations"),
        ),
    ]


def length_of(vessel: Any) -> float:
    """Length of a cylindrical vessel [m], from its volume and diameter."""
    return vessel.volume / (math.pi * (0.5 * vessel.diameter) ** 2)


def height_of(vessel: Any) -> float:
    """Level above the bottom [m] at which a vessel with a shape is full."""
    if vessel.diameter is not None:
        slope = UPRIGHT if vessel.slope is None else vessel.slope
        across = vessel.diameter * math.cos(slope) if slope < UPRIGHT else 0.0
        return length_of(vessel) * math.sin(slope) + across
    if not hasattr(vessel.area, "level"):
        return vessel.volume / vessel.area
    level = vessel.area.level
    area = vessel.area.area
    left = vessel.volume
    for z, end, low, high in zip(level, level[1:], area, area[1:], strict=False):
        growth, layer = (high - low) / (end - z), 0.5 * (low + high) * (end - z)
        if left <= layer:
            return float(
                z + 2.0 * left / (low + math.sqrt(max(low * low + 2.0 * growth * left, 0.0)))
            )
        left -= layer
    return float(level[-1] + left / area[-1])


VOLUMES = UsualRange(1e-7, 1e5, "pilot accumulators to air cushions in rock")
GAS_PRESSURES = UsualRange(1e4, 2e8, "vacuum to test rigs")
EXPONENTS = UsualRange(1.0, 2.0, "isothermal to adiabatic real gases")
SHAPE_KEYS = ("diameter", "area")  # keys that define a shape
# keys that have no effect without a shape
KEYS_WITH_SHAPE = ("level", "slope", "bottom", "compressor")
GAS_KEYS = ("precharge", "gas_volume", "level")  # keys that determine the amount of gas


class Accumulator(Node, kind="accumulator"):
    """A bladder accumulator (`precharge`) or an air vessel (`gas_volume`, `level`), with p V^n constant in its gas.

    Ports: any number, at one pressure: that of the gas, plus the weight of the fluid column above the node if a shape
    (`diameter` or `area`) is given. Stored energy [J]: p0 V0 ((V0 / V)^(n-1) - 1) / (n - 1) of the gas, minus the work
    of ambient pressure, plus the potential energy of the fluid; p is pressure, V gas volume, p0 and V0 at the start,
    n `exponent`. Dissipated energy: that of its connection.

    A bladder fills `volume` at `precharge`. Below that pressure only the fluid in the neck, 1 % of `volume`, is
    compressed. An air vessel that runs empty lets its air into the node.
    """

    no_scalars: ClassVar[str] = (
        "its contents carry no scalars yet; leave out this part, or `[scalars]`"
    )
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (GAS_KEYS, SHAPE_KEYS)
    quantities: ClassVar[dict[str, str]] = {
        **Node.quantities,
        "gas_pressure": "pressure",
        "gas_volume": "volume",
    }
    fixes_pressure: ClassVar[bool] = True
    synonyms: ClassVar[dict[str, str]] = {
        "height": "volume, from which the height follows",
        "length": "volume, from which the length follows",
        "inclination": "slope",
        "base": "bottom",
        "initial_level": "level",
        "liquid_level": "level",
        "gas_exponent": "exponent",
    }

    volume: Annotated[
        float, Quantity("volume", positive, "total volume of gas and fluid [m3]", VOLUMES)
    ]
    precharge: Annotated[
        float | None,
        Quantity(
            "pressure",
            about="gas pressure at which the bladder fills `volume` [Pa]; required without `gas_volume` and `level`",
            usual=GAS_PRESSURES,
        ),
    ] = None
    gas_volume: Annotated[
        float | None,
        Quantity(
            "volume",
            positive,
            "gas volume of an air vessel at the start [m3]; required without `precharge` and `level`",
            VOLUMES,
        ),
    ] = None
    level: Annotated[
        float | None,
        Quantity(
            "level",
            nonnegative,
            "fluid level above the bottom at the start [m]; required without `precharge` and `gas_volume`",
            LEVELS,
        ),
    ] = None
    diameter: Annotated[
        float | None,
        Quantity(
            "length",
            positive,
            "diameter of a cylinder with flat ends, whose length follows from `volume` [m]",
            UsualRange(0.01, 10.0, "pilot vessels to field-built ones"),
        ),
    ] = None
    slope: Annotated[
        float | None,
        Quantity(
            "angle",
            nonnegative,
            "angle of the axis above the horizontal [rad]; upright if left out",
            UsualRange(0.0, UPRIGHT, "horizontal to upright"),
        ),
    ] = None
    area: Annotated[Any, Surface()] = None
    bottom: Annotated[
        float | None,
        Quantity(
            "length",
            about="height of the lowest point above the elevation of the node [m]; 0 if left out",
            usual=UsualRange(-50.0, 50.0, "below or above the line"),
        ),
    ] = None
    compressor: Annotated[
        Compressor | None,
        Nested(Compressor, "compressor that adds gas at a high level; none if left out"),
    ] = None
    exponent: Annotated[
        float,
        Number(
            Range(1.0), "polytropic exponent n in p V^n: 1 isothermal, 1.4 adiabatic air", EXPONENTS
        ),
    ] = 1.2
    initial_pressure: Annotated[
        float | None,
        Quantity(
            "pressure", about="gas pressure at the start [Pa]; that of the steady state if left out"
        ),
    ] = None
    connection: Annotated[Connection | None, ConnectionTable()] = None

    @classmethod
    def variant(cls, given: dict[str, Any]) -> type[Node]:
        return Vessel if any(key in given for key in SHAPE_KEYS) else Accumulator

    @property
    def has_shape(self) -> bool:
        """True if the key `diameter` or `area` is given, so that the level of the fluid is known."""
        return self.diameter is not None or self.area is not None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        faults += [
            (keys, f"no gas; {message}") for keys, message in missing_key_faults(given, GAS_KEYS)
        ]
        shapes = [key for key in SHAPE_KEYS if key in given]
        if not shapes:
            text = "has no effect on a vessel without a shape; give the key `diameter` or `area`, or remove this key"
            faults += [((key,), text) for key in KEYS_WITH_SHAPE if key in given]
        elif "precharge" in given:
            text = "is not valid with `precharge` (a bladder); remove this key, or replace `precharge` by "
            text += "`gas_volume` or `level`"
            faults += [((key,), text) for key in shapes]
        if "slope" in given and shapes == ["area"]:
            faults.append(
                (
                    ("slope",),
                    "applies only with `diameter`; `area` gives the surface at all levels; remove this key",
                )
            )
        return faults

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        return with_connection(name, self, Junction.model_construct(elevation=self.elevation))

    def faults(self, name: str, around: CaseContext) -> Faults:
        if (self.gas_volume or 0.0) > self.volume:
            text = f"{self.gas_volume:g} m3 is greater than `volume`, {self.volume:g} m3"
            yield ("gas_volume",), f"{text}; expected at most `volume`"
        if self.initial_pressure is not None:
            yield from around.boiling_faults(
                "nodes", name, "initial_pressure", [self.initial_pressure]
            )
        if not self.has_shape:
            return
        if self.slope is not None and self.slope > UPRIGHT:
            text = f"{math.degrees(self.slope):g} deg is steeper than upright; expected 0 to 90 deg"
            yield ("slope",), text + f', did you mean "{self.slope:g} deg"' * (self.slope <= 90.0)
            return
        top = height_of(self)
        if self.level is not None and self.level >= top:
            yield (
                ("level",),
                f"{self.level:g} m leaves no volume for gas; the vessel is full at {top:.6g} m",
            )
        if self.compressor is not None:
            start, stop = self.compressor.start, self.compressor.stop
            if stop >= start:
                message = f"{stop:g} m is not below the level `start`, {start:g} m; expected a lower level"
                yield ("compressor", "stop"), message
            if start >= top:
                message = f"{start:g} m is never reached; expected less than {top:.6g} m, at which the vessel is full"
                yield ("compressor", "start"), message


class Vessel(Accumulator):
    """An accumulator with a shape, so that its level can be probed."""

    quantities: ClassVar[dict[str, str]] = {**Accumulator.quantities, "level": "level"}

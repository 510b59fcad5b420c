"""Air valves: keys, ranges and faults."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve.parts.connection import Connection, behind_throat
from fvsolve.parts.hydraulic_nodes import Junction
from fvsolve.parts.nodes_and_links import Node
from fvsolve.parts.schedule import constant
from fvsolve.parts.table_model import (
    CaseContext,
    Faults,
    ListTable,
    check_table,
    keys_json,
    read_lists,
)
from fvsolve.parts.value import (
    NEEDED,
    PROFILE,
    Number,
    Quantity,
    ReadContext,
    Rows,
    UsualRange,
    Value,
    ValueFault,
    between,
    positive,
)
from fvsolve.units import show

BORE_RANGE = between(0, 1, open=True)  # m; a plain 50 would be in mm
# diameter and length of the float chamber if its volume is not given, in inlet diameters
CHAMBER_SIZE = 3.0
LINE_KINDS = ("pipe", "rigid-column")
SWITCH_KEYS = ("switch", "switch_velocity")  # thresholds of throttling
# [kg/m3], [-] for the size of a bore with the flow of a table
AIR_DENSITY, USUAL_COEFFICIENT = 1.2, 0.6
# diameter of the throat between fluid and air, in inlet diameters; its loss coefficient is 1
THROAT_SIZE = 30.0


@dataclass(frozen=True, eq=False)
class AirFlow(ListTable):
    """Table of the maker of an air valve: flow of free air [m3/s] over the pressure difference to ambient [Pa].

    Free air is at ambient pressure and at the temperature of the air valve.
    """

    pressure: tuple[float, ...]
    flow: tuple[float, ...]

    @property
    def bore(self) -> float:
        """Diameter of an orifice with the flow of the first point [m]."""
        velocity = USUAL_COEFFICIENT * math.sqrt(2.0 * self.pressure[0] / AIR_DENSITY)
        return math.sqrt(4.0 / math.pi * self.flow[0] / velocity)


@dataclass(frozen=True)
class Bore(Value):
    """Value of a case file for a bore of an air valve: its diameter, or the table of its maker { pressure, flow }."""

    about: str = ""
    changes: str = PROFILE
    takes: ClassVar[str] = "m, above 0, 1 at most, or `{ pressure = [...], flow = [...] }`"
    keys: ClassVar[dict[str, tuple[Value, Any]]] = {
        "pressure": (Rows("pressure_drop", positive), NEEDED),
        "flow": (Rows("flow", positive), NEEDED),
    }

    def read(self, given: Any, setting: ReadContext) -> float | AirFlow:
        if isinstance(given, AirFlow):
            return given
        if not isinstance(given, dict):
            return Quantity("length", BORE_RANGE).read(given, setting)
        check_table(
            given,
            'for example { pressure = ["0.1 bar", "0.3 bar"], flow = ["900 m3/h", "1500 m3/h"] }',
        )
        table = AirFlow(*read_lists(given, self.keys, setting, "pressures"))
        for k, (before, after) in enumerate(zip(table.flow, table.flow[1:], strict=False)):
            if after < before:
                text = f"{show(given['flow'][k + 1])} comes after {show(given['flow'][k])}"
                raise ValueFault(
                    [(("flow", k + 1), f"{text}; the flow must not fall as the pressure rises")]
                )
        return table

    def json(self) -> dict[str, Any]:
        return {"anyOf": [Quantity("length").json(), keys_json(self.keys)]}


def bore_of(given: float | AirFlow) -> float:
    """Diameter of a bore [m], or that of an orifice with the flow of its table."""
    return given.bore if isinstance(given, AirFlow) else given


class AirValve(Node, kind="air-valve"):
    """A junction that admits air when its pressure falls below ambient, and releases it above ambient.

    Air flows isentropically through a bore for each direction, choked beyond the critical pressure ratio, and keeps
    `temperature`: p V = m R T. The chamber of the float, `volume`, is full of air at the start. The valve shuts, with a
    pressure surge, when fluid has replaced all air in excess of `volume`. Ports: any number. Stored energy:
    m R T (ln(p / p_ambient) - 1) + p_ambient V [J] of air with pressure p, volume V and mass m. Dissipated power:
    R T ln(p_ambient / p) times the mass flow of air [W].
    With `switch` or `switch_velocity` it throttles the outflow until the air inside is at ambient pressure again.
    """

    no_scalars: ClassVar[str] = (
        "its contents carry no scalars yet; leave out this part, or `[scalars]`"
    )
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (SWITCH_KEYS,)
    quantities: ClassVar[dict[str, str]] = {
        **Node.quantities,
        "air_volume": "volume",
        "air_mass": "mass",
        "air_pressure": "pressure",
    }

    inlet: Annotated[
        Any,
        Bore("diameter of the bore for air inflow, or free air over the pressure below ambient"),
    ]
    outlet: Annotated[
        Any,
        Bore("diameter of the bore for air outflow, or free air over the pressure above ambient"),
    ]
    switch: Annotated[
        float | None,
        Quantity(
            "pressure_drop",
            positive,
            "gauge pressure above which air leaves through `throttled_outlet` instead of `outlet` [Pa]",
            UsualRange(100.0, 1e5, "anti-slam discs"),
        ),
    ] = None
    switch_velocity: Annotated[
        float | None,
        Quantity(
            "velocity",
            positive,
            "fluid velocity to the valve above which air leaves through `throttled_outlet`, instead of `switch` [m/s]",
            UsualRange(0.01, 20.0, "anti-slam discs"),
        ),
    ] = None
    throttled_outlet: Annotated[
        Any,
        Bore(
            "diameter of the bore for throttled air outflow, or free air over the pressure above ambient"
        ),
    ] = None
    automatic: Annotated[
        float | None,
        Quantity(
            "length", BORE_RANGE, "diameter of the automatic bore, always open for air outflow [m]"
        ),
    ] = None
    discharge_coefficient: Annotated[
        float, Number(between(0, 1, open=True), "discharge coefficient Cd of all bores")
    ] = 0.6
    volume: Annotated[
        float | None,
        Quantity(
            "volume",
            positive,
            "volume of the float chamber [m3]; a cylinder three inlet diameters long and wide if left out",
        ),
    ] = None
    temperature: Annotated[
        float,
        Quantity(
            "temperature",
            positive,
            "constant temperature of the air [K]",
            UsualRange(220.0, 370.0, "outdoors to hot rooms"),
        ),
    ] = 293.15

    initial_pressure: ClassVar[None] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        switches = [key for key in SWITCH_KEYS if key in given]
        if switches and "throttled_outlet" not in given:
            faults.append(
                (
                    (switches[0],),
                    "has no effect without `throttled_outlet`; give both keys, or remove this key",
                )
            )
        elif "throttled_outlet" in given and not switches:
            text = "has no effect without `switch` or `switch_velocity`; give one of them, or remove this key"
            faults.append((("throttled_outlet",), text))
        return faults

    def faults(self, name: str, around: CaseContext) -> Faults:
        if isinstance(self.inlet, AirFlow) and self.inlet.pressure[-1] >= around.ambient:
            text = f"{self.inlet.pressure[-1]:g} Pa is not below ambient pressure, {around.ambient:g} Pa; expected how"
            yield ("inlet", "pressure"), f"{text} far the pressure is below ambient"
        if self.throttled_outlet is not None and not bore_of(self.throttled_outlet) < bore_of(
            self.outlet
        ):
            small, wide = (bore_of(bore) for bore in (self.throttled_outlet, self.outlet))
            yield (
                ("throttled_outlet",),
                f"{small:g} m does not throttle; expected less than `outlet`, {wide:g} m",
            )
        lines = [link for link in around.links.values() if link.kind in LINE_KINDS]
        if self.switch_velocity is not None and not any(
            name in link.ports.values() for link in lines
        ):
            message = "no pipe or rigid column joins this node to give a fluid velocity; give the key `switch` instead"
            yield ("switch_velocity",), message

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        bore = bore_of(self.inlet)
        size = Connection.model_construct(
            area=None, diameter=THROAT_SIZE * bore, loss_in=1.0, loss_out=1.0
        )
        volume = (
            self.volume if self.volume is not None else math.pi / 4.0 * (CHAMBER_SIZE * bore) ** 3
        )
        chamber = self.model_copy(update={"volume": volume})
        place = Junction.model_construct(elevation=self.elevation, demand=constant(0.0))
        return behind_throat(name, chamber, place, size)

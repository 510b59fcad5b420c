"""Air valves: keys, ranges and faults."""

import math
from typing import Annotated, Any, ClassVar

from fvsolve.parts.connection import Connection, behind_throat
from fvsolve.parts.hydraulic_nodes import Junction
from fvsolve.parts.nodes_and_links import Node
from fvsolve.parts.schedule import constant
from fvsolve.parts.table_model import CaseContext, Faults
from fvsolve.parts.value import Number, Quantity, UsualRange, between, positive

BORE_RANGE = between(0, 1, open=True)  # m; a plain 50 would be in mm
CHAMBER_SIZE = 3.0  # diameter and length of the float chamber if its volume is not given, in inlet diameters
LINE_KINDS = ("pipe", "rigid-column")
SWITCH_KEYS = ("switch", "switch_velocity")  # thresholds of throttling
THROAT_SIZE = 30.0  # diameter of the throat between fluid and air, in inlet diameters; its loss coefficient is 1


class AirValve(Node, kind="air-valve"):
    """A junction that admits air when its pressure falls below ambient, and releases it above ambient.

    Air flows isentropically through a bore for each direction, choked beyond the critical pressure ratio, and keeps
    `temperature`: p V = m R T. The chamber of the float, `volume`, is full of air at the start. The valve shuts, with a
    pressure surge, when fluid has replaced all air in excess of `volume`. Ports: any number. Stored energy:
    m R T (ln(p / p_ambient) - 1) + p_ambient V [J] of air with pressure p, volume V and mass m. Dissipated power:
    R T ln(p_ambient / p) times the mass flow of air [W].
    With `switch` or `switch_velocity` it throttles the outflow until the air inside is at ambient pressure again.
    """

    no_scalars: ClassVar[str] = "its contents carry no scalars yet; leave out this part, or `[scalars]`"
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (SWITCH_KEYS,)
    quantities: ClassVar[dict[str, str]] = {
        **Node.quantities, "air_volume": "volume", "air_mass": "mass", "air_pressure": "pressure",
    }  # fmt: skip

    inlet: Annotated[float, Quantity("length", BORE_RANGE, "diameter of the bore for air inflow [m]")]
    outlet: Annotated[float, Quantity("length", BORE_RANGE, "diameter of the bore for air outflow [m]")]
    switch: Annotated[float | None, Quantity(
        "pressure_drop", positive,
        "gauge pressure above which air leaves through `throttled_outlet` instead of `outlet` [Pa]",
        UsualRange(100.0, 1e5, "anti-slam discs"),
    )] = None  # fmt: skip
    switch_velocity: Annotated[float | None, Quantity(
        "velocity", positive,
        "fluid velocity to the valve above which air leaves through `throttled_outlet`, instead of `switch` [m/s]",
        UsualRange(0.01, 20.0, "anti-slam discs"),
    )] = None  # fmt: skip
    throttled_outlet: Annotated[
        float | None, Quantity("length", BORE_RANGE, "diameter of the bore for throttled air outflow [m]")
    ] = None
    automatic: Annotated[
        float | None, Quantity("length", BORE_RANGE, "diameter of the automatic bore, always open for air outflow [m]")
    ] = None
    discharge_coefficient: Annotated[
        float, Number(between(0, 1, open=True), "discharge coefficient Cd of all bores")
    ] = 0.6
    volume: Annotated[float | None, Quantity(
        "volume", positive,
        "volume of the float chamber [m3]; a cylinder three inlet diameters long and wide if left out",
    )] = None  # fmt: skip
    temperature: Annotated[float, Quantity(
        "temperature", positive, "constant temperature of the air [K]",
        UsualRange(220.0, 370.0, "outdoors to hot rooms"),
    )] = 293.15  # fmt: skip

    initial_pressure: ClassVar[None] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        switches = [key for key in SWITCH_KEYS if key in given]
        if switches and "throttled_outlet" not in given:
            faults.append(
                ((switches[0],), "has no effect without `throttled_outlet`; give both keys, or remove this key")
            )
        elif "throttled_outlet" in given and not switches:
            text = "has no effect without `switch` or `switch_velocity`; give one of them, or remove this key"
            faults.append((("throttled_outlet",), text))
        return faults

    def faults(self, name: str, around: CaseContext) -> Faults:
        if self.throttled_outlet is not None and not self.throttled_outlet < self.outlet:
            text = f"{self.throttled_outlet:g} m does not throttle; expected less than `outlet`, {self.outlet:g} m"
            yield ("throttled_outlet",), text
        lines = [link for link in around.links.values() if link.kind in LINE_KINDS]
        if self.switch_velocity is not None and not any(name in link.ports.values() for link in lines):
            message = "no pipe or rigid column joins this node to give a fluid velocity; give the key `switch` instead"
            yield ("switch_velocity",), message

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        size = Connection.model_construct(area=None, diameter=THROAT_SIZE * self.inlet, loss_in=1.0, loss_out=1.0)
        volume = self.volume if self.volume is not None else math.pi / 4.0 * (CHAMBER_SIZE * self.inlet) ** 3
        chamber = self.model_copy(update={"volume": volume})
        place = Junction.model_construct(elevation=self.elevation, demand=constant(0.0))
        return behind_throat(name, chamber, place, size)

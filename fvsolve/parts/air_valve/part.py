"""A valve that lets air in and out. Knows its bores; evaluates no flow."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar

from fvsolve.parts.around import Around, Faults
from fvsolve.parts.connection.part import Connection, behind
from fvsolve.parts.junction.part import Junction
from fvsolve.parts.node import Node
from fvsolve.parts.schedule import constant
from fvsolve.parts.value import Number, Quantity, Usual, between, positive

BORE = between(0, 1, open=True)  # m: a bare 50 is meant in mm
BODY = 3.0  # width and length of the float's chamber where its volume is not given, in diameters of the inlet
LINES = ("pipe", "rigid-column")
SWITCHES = ("switch", "switch_velocity")  # from what on it throttles
WIDE = 30.0  # throat between fluid and air, in diameters of the inlet, of loss 1


class AirValve(Node, kind="air-valve"):
    """A junction until its pressure falls below ambient; then air comes in, and goes out where it exceeds ambient.

    Air flows isentropically through bores of their own each way, choked beyond their critical pressures, and stays at
    `temperature`: p V = m R T. The float's chamber, `volume`, holds air from the start; once the fluid has filled all
    else the valve shuts, with the blow that this makes. Ports: any number. Stored energy: m R T (ln(p / p_ambient) - 1)
    + p_ambient V [J]. Dissipated power: R T ln(p_ambient / p) times the flow of air [W]. With `switch` or
    `switch_velocity` it throttles what goes out, until the air inside is at ambient again.
    """

    no_scalars: ClassVar[str] = "its contents carry no scalars yet"
    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (SWITCHES,)
    quantities: ClassVar[dict[str, str]] = {
        **Node.quantities, "air_volume": "volume", "air_mass": "mass", "air_pressure": "pressure",
    }  # fmt: skip

    inlet: Annotated[float, Quantity("length", BORE, "diameter of the bore for air in [m]")]
    outlet: Annotated[float, Quantity("length", BORE, "diameter of the bore for air out [m]")]
    switch: Annotated[
        float | None,
        Quantity(
            "pressure_drop",
            positive,
            "of the air over ambient, from which on it goes out through throttled_outlet in place of outlet",
            Usual(100.0, 1e5, "anti-slam discs"),
        ),
    ] = None
    switch_velocity: Annotated[
        float | None,
        Quantity(
            "velocity",
            positive,
            "of the fluid that fills the line towards it, from which on likewise, in place of switch [m/s]",
            Usual(0.01, 20.0, "anti-slam discs"),
        ),
    ] = None
    throttled_outlet: Annotated[
        float | None, Quantity("length", BORE, "diameter of the small bore for air out beyond the switch [m]")
    ] = None
    automatic: Annotated[
        float | None, Quantity("length", BORE, "diameter of the automatic bore, by which air goes out at all times [m]")
    ] = None
    discharge_coefficient: Annotated[float, Number(between(0, 1, open=True), "Cd of all bores")] = 0.6
    volume: Annotated[
        float | None,
        Quantity("volume", positive, "of the float's chamber [m3]; a cylinder three inlets long and wide if left out"),
    ] = None
    temperature: Annotated[
        float,
        Quantity(
            "temperature", positive, "of the air, which keeps it [K]", Usual(220.0, 370.0, "outdoors to hot rooms")
        ),
    ] = 293.15

    initial_pressure: ClassVar[None] = None

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        switches = [key for key in SWITCHES if key in given]
        if switches and "throttled_outlet" not in given:
            faults.append(((switches[0],), "says nothing without throttled_outlet; give both, or leave it out"))
        elif "throttled_outlet" in given and not switches:
            text = "says nothing without switch or switch_velocity; give one, or leave it out"
            faults.append((("throttled_outlet",), text))
        return faults

    def faults(self, name: str, around: Around) -> Faults:
        if self.throttled_outlet is not None and not self.throttled_outlet < self.outlet:
            text = f"{self.throttled_outlet:g} m throttles nothing; wanted less than outlet, {self.outlet:g} m"
            yield ("throttled_outlet",), text
        lines = [
            one for one in around.links.values() if one.kind in ("pipe", "rigid-column") and name in one.ports.values()
        ]
        if self.switch_velocity is not None and not lines:
            yield ("switch_velocity",), "no pipe or rigid column ends here for the fluid to fill; give switch"

    def inner(self, name: str) -> tuple[dict[str, Any], dict[str, Any]]:
        size = Connection.model_construct(area=None, diameter=WIDE * self.inlet, loss_in=1.0, loss_out=1.0)
        volume = self.volume if self.volume is not None else math.pi / 4.0 * (BODY * self.inlet) ** 3
        chamber = self.model_copy(update={"volume": volume})
        place = Junction.model_construct(elevation=self.elevation, demand=constant(0.0))
        return behind(name, chamber, place, size)

"""What pipes and rigid columns share: length, bore and fittings. Turns names of sizes into numbers; knows no flow."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from fvsolve import units
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.friction import NONE, Friction
from fvsolve.parts.link import TwoPort
from fvsolve.parts.sizes import FITTINGS, bore, loss
from fvsolve.parts.value import (
    COUNTED,
    PROFILE,
    Misfit,
    Number,
    Quantity,
    Setting,
    Text,
    Usual,
    Value,
    nonnegative,
    positive,
)
from fvsolve.units import show

BORES = Usual(5e-5, 14.0, "capillaries to pressure tunnels")  # the tunnels of Tarbela are 13.7 m wide
LENGTH = Quantity("length", positive, "along its axis [m]", Usual(1e-4, 1e7, "fittings to pipelines"), COUNTED)
DIAMETER = Quantity("length", positive, "inner diameter [m]", BORES, COUNTED)
LOSS = Number(nonnegative, "loss coefficient on its velocity, spread along it")


ROUGHEST = 0.05  # relative roughness, Moody 1944


class Fittings(Value):
    """A list of names of fittings; a name may stand there several times."""

    about = "fittings by name, their loss coefficients are added to minor_loss"
    takes = "list of names"
    changes = PROFILE

    def read(self, given: Any, setting: Setting) -> list[str]:
        if not isinstance(given, (list, tuple)):
            raise Misfit([((), f'{show(given)} is no list; wanted one such as ["bend-90", "gate-valve"]')])
        faults = []
        for index, name in enumerate(given):
            if name not in FITTINGS:
                near = did_you_mean(str(name), FITTINGS) or f"; fittings are {listing(list(FITTINGS))}"
                faults.append(((index,), f"no fitting named {show(name)}{near}"))
        if faults:
            raise Misfit(faults)
        return list(given)

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": {"enum": list(FITTINGS)}}


class Conduit(TwoPort):
    """A pipe of whatever kind; `nominal` and `fittings` are read as `diameter`, `thickness` and `minor_loss`."""

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = (("diameter", "nominal"), ("diameter", "schedule"))

    needs: ClassVar[tuple[tuple[str, ...], ...]] = (("diameter", "nominal"),)

    meant: ClassVar[dict[str, str]] = dict.fromkeys(
        ("roughness", "factor", "friction_factor", "darcy_factor"),
        'friction = { model = "quasi-steady", roughness = "0.1 mm" } or { model = "steady", factor = 0.02 }',
    ) | dict.fromkeys(
        ("celerity", "sound_speed", "youngs_modulus", "thickness", "wall_thickness", "material"),
        'wave_speed, or wall = { youngs_modulus = "210 GPa", thickness = "8 mm" }',
    )

    length: Annotated[float, LENGTH]
    diameter: Annotated[float, DIAMETER] = None  # nominal stands in for it
    nominal: Annotated[str | None, Text('"DN100", "NPS 4" or "NPS 1-1/2", in place of diameter', COUNTED)] = None
    schedule: Annotated[
        str | None, Text('of the nominal size: "40", "80", "STD", "10S"; "40" if left out', COUNTED)
    ] = None
    friction: Friction = NONE
    minor_loss: Annotated[float, LOSS] = 0.0
    fittings: Annotated[list[str] | None, Fittings()] = None
    initial_flow: Annotated[
        float | None, Quantity("flow", about="at the start [m3/s]; that of the steady state if left out")
    ] = None

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        if self.diameter > self.length:
            text = f"{self.diameter:g} m is more than its length of {self.length:g} m, and the flow is not along it"
            yield ("diameter",), self.diameter, self.length, text
        rough, most = self.friction.roughness or 0.0, ROUGHEST * self.diameter
        if rough > most:
            text = f"{rough:g} m in a bore of {self.diameter:g} m; Moody's chart ends at {ROUGHEST:g} of the bore"
            likely = units.likely(rough, "length", 0.0, most) if rough <= 1e3 * most else ""
            yield ("friction", "roughness"), rough, most, text + likely

    @classmethod
    def in_numbers(cls, given: dict[str, Any], setting: Setting) -> dict[str, Any]:
        """Names turned into `diameter`, wall `thickness` and `minor_loss`; Misfit where one means nothing."""
        found, faults = {**given}, []
        if isinstance(given.get("nominal"), str) and "diameter" not in given:
            try:
                found["diameter"], thickness = sized(found.pop("nominal"), found.pop("schedule", "40"))
                if isinstance(given.get("wall"), dict):
                    found["wall"] = {"thickness": thickness, **given["wall"]}
            except Misfit as error:
                faults += error.faults
        if "fittings" in found:
            try:
                names = Fittings().read(found.pop("fittings"), setting)
                own = LOSS.read(found.get("minor_loss", 0.0), setting)
                found["minor_loss"] = own + loss(names, DIAMETER.read(found["diameter"], setting))
            except Misfit as error:
                faults += [(("fittings", *keys), text) for keys, text in error.faults]
            except (KeyError, ValueError):  # a key that is read, and blamed, in its own right
                pass
        if faults:
            raise Misfit(faults)
        return found


def sized(nominal: str, schedule: Any) -> tuple[float, float]:
    """`bore` of what the file says; Misfit with the key to blame."""
    try:
        return bore(nominal, str(schedule))
    except ValueError as error:
        key = "schedule" if "schedule named" in str(error) else "nominal"
        raise Misfit([((key,), str(error))]) from None

"""Altitude valves: no flow into a full tank, none out of an empty tank."""

from typing import Annotated, Any, ClassVar

from fvsolve.parts.nodes_and_links import TwoPort
from fvsolve.parts.table_model import CaseContext, Faults
from fvsolve.parts.tank import LEVELS
from fvsolve.parts.value import SHAPE, Quantity, nonnegative, positive
from fvsolve.parts.valve import Sized


class AltitudeValve(Sized, TwoPort, kind="altitude-valve"):
    """Altitude valve before the tank `to`: q = Cd A sqrt(2 |dp| / rho) sign(dp) while it is open, dp the drop.

    At `full_level` it shuts against flow q into the tank, at `empty_level` against flow out of it. It opens as soon as
    the pressures drive flow in the allowed direction, or the level has moved away from the limit by `differential`,
    for example by an outlet of its own (docs/course.md, 79). Ports: from, to. Stored energy: none.
    Dissipated power: dp q [W].
    """

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    full_level: Annotated[
        float | None,
        Quantity(
            "level",
            positive,
            "level of the tank at which no more flows into it [m]; no limit if left out",
            LEVELS,
            SHAPE,
        ),
    ] = None
    empty_level: Annotated[
        float | None,
        Quantity(
            "level",
            nonnegative,
            "level of the tank at which no more flows out of it [m]; no limit if left out",
            LEVELS,
            SHAPE,
        ),
    ] = None

    differential: Annotated[
        float,
        Quantity(
            "level",
            positive,
            "distance of the level from `full_level` or `empty_level` at which the shut valve opens [m]",
            LEVELS,
        ),
    ] = 0.005

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        if not {"full_level", "empty_level"} & given.keys():
            faults.append(
                ((), "level is missing; expected `full_level`, `empty_level` or both, or a valve")
            )
        return faults

    def faults(self, name: str, around: CaseContext) -> Faults:
        tank = around.nodes.get(self.to)
        full = self.full_level
        empty = self.empty_level
        if full is not None and empty is not None and full <= empty:
            yield (
                ("full_level",),
                f"{full:g} m is not above `empty_level`, {empty:g} m; expected a higher level",
            )
        if tank is None:
            return
        if tank.kind != "tank":
            text = f"{self.to} is not a tank; an altitude valve acts by the level of the tank at its end `to`"
            yield ("to",), f"{text}; expected a tank, or a check-valve"
            return
        if tank.connection is not None:
            yield (
                ("to",),
                f"{self.to} has a `connection`; join the valve to a tank without this key",
            )
        if full is not None and tank.level > full:
            text = f"{self.to} starts at {tank.level:g} m, above `full_level`, {full:g} m"
            yield ("full_level",), f"{text}; expected a level of the tank of at most that"
        if empty is not None and tank.level < empty:
            text = f"{self.to} starts at {tank.level:g} m, below `empty_level`, {empty:g} m"
            yield ("empty_level",), f"{text}; expected a level of the tank of at least that"

"""A valve that lets flow pass one way. Knows its size; evaluates no flow."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve.parts.disc.part import DROPS, Disc
from fvsolve.parts.link import TwoPort
from fvsolve.parts.table import keys_json, read_keys
from fvsolve.parts.value import NEEDED, Misfit, Quantity, Rows, Setting, Value, check_rising, nonnegative, positive
from fvsolve.parts.valve.part import Sized


@dataclass(frozen=True)
class SlamCurve:
    """Reverse velocity at which a valve slams over the deceleration of its column, linear between entries.

    rate : rising [m/s2]; reverse_velocity : [m/s], of its bore
    """

    rate: tuple[float, ...]
    reverse_velocity: tuple[float, ...]

    def table(self) -> dict[str, list[float]]:
        """What the file would say."""
        return {"rate": [*self.rate], "reverse_velocity": [*self.reverse_velocity]}


class Slams(Value):
    """A maker's curve of slams."""

    about = "reverse velocity at which it shuts over the deceleration with which the flow turned, by its maker"
    takes = "`{ rate = [...], reverse_velocity = [...] }`, m/s2 and m/s"
    keys = {
        "rate": (Rows("acceleration", nonnegative), NEEDED),
        "reverse_velocity": (Rows("velocity", nonnegative), NEEDED),
    }

    def read(self, given: Any, setting: Setting) -> SlamCurve:
        if isinstance(given, SlamCurve):
            return given
        if not isinstance(given, dict):
            raise ValueError(f"is no table; wanted {self.takes}")
        found, faults = read_keys(given, self.keys, setting), []
        rate, velocity = found["rate"], found["reverse_velocity"]
        if len(rate) != len(velocity):
            faults.append((("reverse_velocity",), f"{len(velocity)} values for {len(rate)} rates"))
        try:
            check_rising(rate, given["rate"], "rates")
        except ValueError as error:
            faults.append((("rate",), str(error)))
        if faults:
            raise Misfit(faults)
        return SlamCurve(rate, velocity)

    def json(self) -> dict[str, Any]:
        return keys_json(self.keys)


class CheckValve(Disc, Sized, TwoPort, kind="check-valve"):
    """Open, a turbulent restriction q = Cd A sqrt(2 dp / rho) (79); it shuts where the flow reverses, and then q = 0.

    It opens again once the drop from `from` to `to` exceeds `cracking_pressure`. With a time_constant or a
    natural_frequency it takes its time, q = x Cd A sqrt(2 |dp| / rho) sign(dp), its disc drawn to
    x = (dp - cracking_pressure) / overpressure: then flow turns back before it shuts. With `deceleration` it shuts at
    the reverse velocity that this says. Ports: from, to. Stored energy: none, its disc's is not counted. Dissipated
    power: dp q [W].
    """

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    cracking_pressure: Annotated[
        float, Quantity("pressure_drop", nonnegative, "drop above which it opens [Pa]", DROPS)
    ] = 0.0
    overpressure: Annotated[
        float | None,
        Quantity(
            "pressure_drop",
            positive,
            "drop above cracking_pressure that opens it fully [Pa], with a disc that takes its time",
            DROPS,
        ),
    ] = None
    deceleration: Annotated[Any, Slams()] = None

    @property
    def bore(self) -> float:
        """Area that the velocities of `deceleration` are of [m2]."""
        return self.area if self.area is not None else math.pi / 4.0 * self.diameter**2

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        moves = "time_constant" in given or "natural_frequency" in given
        if moves and "overpressure" not in given:
            faults.append(((), "overpressure is missing: the drop above cracking_pressure that holds it fully open"))
        if "overpressure" in given and not moves:
            faults.append((("overpressure",), "wants a time_constant or a natural_frequency beside it"))
        if "deceleration" in given and moves:
            text = "says how it shuts, as its time_constant or natural_frequency does; leave one out"
            faults.append((("deceleration",), text))
        if "deceleration" in given and not {"area", "diameter"} & set(given):
            text = "its velocities are of a bore; wanted diameter or area, with loss_coefficient in place of Kv or Cv"
            faults.append((("deceleration",), text))
        return faults

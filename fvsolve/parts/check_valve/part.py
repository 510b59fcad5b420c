"""Check valves: keys, faults and the curve of slam velocities."""

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from fvsolve.parts.disc.part import DROPS, Disc
from fvsolve.parts.link import TwoPort
from fvsolve.parts.table_model import keys_json, read_keys
from fvsolve.parts.value import (
    NEEDED,
    Quantity,
    ReadContext,
    Rows,
    Value,
    ValueFault,
    check_increasing,
    nonnegative,
    positive,
)
from fvsolve.parts.valve import Sized


@dataclass(frozen=True)
class SlamCurve:
    """Reverse velocity at which a check valve shuts, over the deceleration of the flow; linear between entries.

    rate : deceleration, ascending [m/s2]; reverse_velocity : velocity in the bore [m/s]
    """

    rate: tuple[float, ...]
    reverse_velocity: tuple[float, ...]

    def table(self) -> dict[str, list[float]]:
        """Curve as a table of a case file: key -> list."""
        return {"rate": [*self.rate], "reverse_velocity": [*self.reverse_velocity]}


class SlamCurveTable(Value):
    """Value of a case file for a manufacturer's curve of slam velocities."""

    about = "manufacturer's curve of the reverse velocity at which the valve shuts, over the deceleration of the flow"
    takes = "`{ rate = [...], reverse_velocity = [...] }`, m/s2 and m/s"
    keys = {
        "rate": (Rows("acceleration", nonnegative), NEEDED),
        "reverse_velocity": (Rows("velocity", nonnegative), NEEDED),
    }

    def read(self, given: Any, setting: ReadContext) -> SlamCurve:
        if isinstance(given, SlamCurve):
            return given
        if not isinstance(given, dict):
            raise ValueError(f"is not a table; expected {self.takes}")
        values, faults = read_keys(given, self.keys, setting), []
        rate, velocity = values["rate"], values["reverse_velocity"]
        if len(rate) != len(velocity):
            faults.append(
                (
                    ("reverse_velocity",),
                    f"has length {len(velocity)}, but `rate` has length {len(rate)}; expected equal lengths",
                )
            )
        try:
            check_increasing(rate, given["rate"], "rates")
        except ValueError as error:
            faults.append((("rate",), str(error)))
        if faults:
            raise ValueFault(faults)
        return SlamCurve(rate, velocity)

    def json(self) -> dict[str, Any]:
        return keys_json(self.keys)


class CheckValve(Disc, Sized, TwoPort, kind="check-valve"):
    """Check valve: a turbulent restriction q = Cd A sqrt(2 dp / rho) while open, shut when the flow reverses.

    It opens again when the drop dp from `from` to `to` exceeds `cracking_pressure`. With `time_constant` or
    `natural_frequency` its disc moves with a delay: q = x Cd A sqrt(2 |dp| / rho) sign(dp), and the lift x of the disc
    tends to (dp - cracking_pressure) / overpressure, so the flow reverses before the valve shuts. With `deceleration`
    it shuts at the reverse velocity of that curve. Ports: from, to (docs/course.md, 79). Stored energy: none, that of
    the disc is neglected. Dissipated power: dp q [W].
    """

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    cracking_pressure: Annotated[
        float, Quantity("pressure_drop", nonnegative, "pressure drop above which the valve opens [Pa]", DROPS)
    ] = 0.0
    overpressure: Annotated[
        float | None,
        Quantity(
            "pressure_drop",
            positive,
            "drop above `cracking_pressure` that opens the valve fully, with time_constant or natural_frequency [Pa]",
            DROPS,
        ),
    ] = None
    deceleration: Annotated[Any, SlamCurveTable()] = None

    @property
    def bore_area(self) -> float:
        """Area of the bore [m2], to which the velocities of the key `deceleration` refer."""
        return self.area if self.area is not None else math.pi / 4.0 * self.diameter**2

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        moves = "time_constant" in given or "natural_frequency" in given
        if moves and "overpressure" not in given:
            faults.append(
                ((), "overpressure is missing: the drop above `cracking_pressure` that holds the valve fully open")
            )
        if "overpressure" in given and not moves:
            faults.append((("overpressure",), "needs the key `time_constant` or `natural_frequency`"))
        if "deceleration" in given and moves:
            text = (
                "is not valid with `time_constant` or `natural_frequency`, which also define how the valve shuts; "
                "keep either this key or the others"
            )
            faults.append((("deceleration",), text))
        if "deceleration" in given and not {"area", "diameter"} & set(given):
            text = (
                "the velocities of this curve refer to a bore, whose size is missing; give `diameter` or `area`, and "
                "`loss_coefficient` instead of Kv or Cv"
            )
            faults.append((("deceleration",), text))
        return faults

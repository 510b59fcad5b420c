"""A valve that lets flow pass one way. Knows its size; evaluates no flow."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar

from fvsolve.parts.disc.part import DROPS, Disc
from fvsolve.parts.link import TwoPort
from fvsolve.parts.value import Quantity, nonnegative, positive
from fvsolve.parts.valve.part import Sized


class CheckValve(Disc, Sized, TwoPort, kind="check-valve"):
    """Open, a turbulent restriction q = Cd A sqrt(2 dp / rho) (79); it shuts where the flow reverses, and then q = 0.

    It opens again once the drop from `from` to `to` exceeds `cracking_pressure`. With a time_constant or a
    natural_frequency it takes its time, q = x Cd A sqrt(2 |dp| / rho) sign(dp), its disc drawn to
    x = (dp - cracking_pressure) / overpressure: then flow turns back before it shuts. Ports: from, to. Stored energy:
    none, its disc's is not counted. Dissipated power: dp q [W].
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

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list:
        faults = super().key_faults(given)
        moves = "time_constant" in given or "natural_frequency" in given
        if moves and "overpressure" not in given:
            faults.append(((), "overpressure is missing: the drop above cracking_pressure that holds it fully open"))
        if "overpressure" in given and not moves:
            faults.append((("overpressure",), "wants a time_constant or a natural_frequency beside it"))
        return faults

"""A valve that opens where the pressure before it is too high. Knows its spring; evaluates no flow."""

from __future__ import annotations

from typing import Annotated, ClassVar

from fvsolve.parts.disc.part import DROPS, Disc
from fvsolve.parts.link import TwoPort
from fvsolve.parts.value import Quantity, positive
from fvsolve.parts.valve.part import Sized


class ReliefValve(Disc, Sized, TwoPort, kind="relief-valve"):
    """q = x Cd A sqrt(2 |dp| / rho) sign(dp), x = (p_from - set_pressure) / overpressure between 0 and 1.

    x follows at once, or where it has a time_constant or a natural_frequency as its disc moves. Ports: from, to.
    Stored energy: none, its disc's is not counted. Dissipated power: dp q [W].
    """

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    set_pressure: Annotated[
        float, Quantity("pressure", about="at `from`, above which it opens, gauge or absolute as its unit says [Pa]")
    ]
    overpressure: Annotated[
        float, Quantity("pressure_drop", positive, "above set_pressure that opens it fully [Pa]", DROPS)
    ]

"""Relief valves: keys."""

from typing import Annotated, ClassVar

from fvsolve.parts.disc.part import DROPS, Disc
from fvsolve.parts.link import TwoPort
from fvsolve.parts.value import Quantity, positive
from fvsolve.parts.valve import Sized


class ReliefValve(Disc, Sized, TwoPort, kind="relief-valve"):
    """Relief valve, q = x Cd A sqrt(2 |dp| / rho) sign(dp), with flow q, drop dp and lift x between 0 and 1.

    x = (p_from - set_pressure) / overpressure. The lift follows the pressure at once, or with the dynamics of a disc
    that has a time_constant or a natural_frequency. Ports: from, to. Stored energy: none, that of the disc is
    neglected. Dissipated power: dp q [W].
    """

    quantities: ClassVar[dict[str, str]] = {"flow": "flow", "opening": "number"}

    set_pressure: Annotated[
        float,
        Quantity(
            "pressure", about="pressure at `from` above which the valve opens, gauge or absolute by its unit [Pa]"
        ),
    ]
    overpressure: Annotated[
        float,
        Quantity(
            "pressure_drop", positive, "pressure above `set_pressure` at which the valve is fully open [Pa]", DROPS
        ),
    ]

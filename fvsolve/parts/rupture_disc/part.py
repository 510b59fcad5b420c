"""Rupture discs: keys."""

from typing import Annotated

from fvsolve.parts.disc.part import DROPS
from fvsolve.parts.outlet.part import Relieving
from fvsolve.parts.value import Quantity, positive


class RuptureDisc(Relieving, kind="rupture-disc"):
    """Disc that is shut until p_from - p_to exceeds burst_pressure, and then always open.

    The flow is then q = Cd A sqrt(2 |dp| / rho) sign(dp) at the drop dp. Without `to` it opens to ambient at the
    elevation of its place, without backflow. Ports: from, to. Stored energy: none. Dissipated power: dp q [W].
    """

    burst_pressure: Annotated[
        float, Quantity("pressure_drop", positive, "pressure drop above which the disc bursts [Pa]", DROPS)
    ]

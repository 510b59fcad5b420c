"""A disc that bursts once and stays open. Knows its size and strength; evaluates no flow."""

from __future__ import annotations

from typing import Annotated

from fvsolve.parts.disc.part import DROPS
from fvsolve.parts.outlet.part import Relieving
from fvsolve.parts.value import Quantity, positive


class RuptureDisc(Relieving, kind="rupture-disc"):
    """Shut until p_from - p_to passes burst_pressure, then for good q = Cd A sqrt(2 |dp| / rho) sign(dp).

    Without `to` it opens to ambient on the level of its place, from where nothing comes back. Ports: from, to. Stored
    energy: none. Dissipated power: dp q [W].
    """

    burst_pressure: Annotated[
        float, Quantity("pressure_drop", positive, "of `from` over what lies behind it, above which it bursts", DROPS)
    ]

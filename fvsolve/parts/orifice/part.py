"""Orifices: valves whose opening is usually fixed."""

from fvsolve.parts.valve.part import Valve


class Orifice(Valve, kind="orifice"):
    """A restriction whose opening is usually fixed: q = f(opening) Cd A sqrt(2 |dp| / rho) sign(dp), as a valve.

    q is the flow, f the characteristic, Cd the discharge coefficient, A the area, dp the drop (docs/course.md, 79).
    Ports: from, to. Stored energy: none. Dissipated power: dp q [W].
    """

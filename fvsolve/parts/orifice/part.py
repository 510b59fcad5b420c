"""Orifices: valves whose opening is usually fixed."""

from fvsolve.parts.valve.part import Valve


class Orifice(Valve, kind="orifice"):
    """A restriction with the law of a valve, whose opening is usually fixed.

    q = f(opening) Cd A sqrt(2 |dp| / rho) sign(dp), with flow q, characteristic f, size Cd A and drop dp
    (docs/course.md, 79). Ports: from, to. Stored energy: none. Dissipated power: dp q [W].
    """

"""Orifices: valves whose opening is usually fixed."""

from fvsolve.parts.valve.part import Valve


class Orifice(Valve, kind="orifice"):
    """A fixed restriction with the law of a valve, q = f(opening) Cd A sqrt(2 |dp| / rho) sign(dp) (79).

    Ports: from, to. Stored energy: none. Dissipated power: dp q [W].
    """

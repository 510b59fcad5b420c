"""A fixed hole. Knows what a valve knows; the name says that nobody turns it."""

from fvsolve.parts.valve.part import Valve


class Orifice(Valve, kind="orifice"):
    """The valve's law, q = f(opening) Cd A sqrt(2 |dp| / rho) sign(dp) (79).

    Ports: from, to. Stored energy: none. Dissipated power: dp q [W].
    """

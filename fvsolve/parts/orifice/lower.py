"""Orifices in the tables of a model."""

from fvsolve.parts.valve.lower import Valve


class Orifice(Valve, kind="orifice"):
    """As a valve."""

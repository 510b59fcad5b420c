"""Orifices in the tables of a model."""

from fvsolve.parts.valve.lower import ValveRows


class OrificeRows(ValveRows, kind="orifice"):
    """Model table rows of orifices, which are those of valves."""

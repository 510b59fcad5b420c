"""Orifices in the tables of a model."""

from fvsolve.parts.valve.lower import ValveRows


class OrificeRows(ValveRows, kind="orifice"):
    """Conversion to table rows of orifices: the same rows as those of valves."""

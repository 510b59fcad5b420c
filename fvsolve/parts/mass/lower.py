"""Masses in the tables of a model."""

from fvsolve.assembly.mechanics import AxisLowering


class MassRows(AxisLowering, kind="mass"):
    """Conversion to table rows of masses: bodies on an axis, moved by forces."""

"""Masses in the tables of a model."""

from fvsolve.model.mass_tables import AxisLowering


class MassRows(AxisLowering, kind="mass"):
    """Conversion to table rows of masses: bodies on an axis, moved by forces."""

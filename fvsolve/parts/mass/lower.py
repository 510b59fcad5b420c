"""Masses in the tables of a model."""

from fvsolve.model.masses import OnAxis


class MassRows(OnAxis, kind="mass"):
    """A body that forces move."""

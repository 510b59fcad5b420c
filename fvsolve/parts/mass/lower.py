"""Masses in the tables of a model."""

from fvsolve.model.masses import OnAxis


class MassRows(OnAxis, kind="mass"):
    """A body on an axis, moved by forces."""

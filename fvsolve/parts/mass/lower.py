"""Masses in the tables of a model."""

from fvsolve.model.bodies import Body


class MassRows(Body, kind="mass"):
    """A body that forces move."""

"""Frames in the tables of a model."""

from fvsolve.model.bodies import Body


class Frame(Body, kind="frame"):
    """A body that stands still."""

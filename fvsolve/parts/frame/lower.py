"""Frames in the tables of a model."""

from fvsolve.model.bodies import Body


class FrameRows(Body, kind="frame"):
    """A body that stands still."""

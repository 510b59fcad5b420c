"""Frames in the tables of a model."""

from fvsolve.model.masses import OnAxis


class FrameRows(OnAxis, kind="frame"):
    """A fixed body on the axis."""

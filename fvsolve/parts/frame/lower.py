"""Frames in the tables of a model."""

from fvsolve.model.mass_tables import AxisLowering


class FrameRows(AxisLowering, kind="frame"):
    """A fixed body on the axis."""

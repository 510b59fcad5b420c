"""Frames in the tables of a model."""

from fvsolve.assembly.mechanics import AxisLowering


class FrameRows(AxisLowering, kind="frame"):
    """Conversion to table rows of frames: fixed bodies on the axis."""

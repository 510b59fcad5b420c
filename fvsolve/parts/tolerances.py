"""Tolerances of lengths and heads in a case file, which readers and importers share.

Numbers of a file are rounded, most of all where they are converted from other units: a riser of 4 ft between two
elevations that differ by 4 ft has 1.2192 m, and a rise that is greater by rounding.
"""

ROUNDING = 1e-9  # of a length or an elevation in a file, relative: importers write ten digits
HEAD_ROUNDING = 1e-6  # of a head that follows from a pressure, relative, and in metres


def is_shorter_than_rise(length: float, start: float, end: float) -> bool:
    """True if a pipe is shorter than its ends differ in elevation, by more than rounding; equal means vertical.

    length : of the pipe [m]; start, end : elevations of its ends [m]
    """
    return abs(end - start) - length > ROUNDING * (length + abs(start) + abs(end))


def is_head_above(head: float, other: float) -> bool:
    """True if a head [m] is above another head [m] by more than rounding."""
    return head > other + HEAD_ROUNDING * (1.0 + abs(other))

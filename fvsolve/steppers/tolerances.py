"""Least relative tolerance and least step (relative to the time) that rounding allows."""

LEAST_TOLERANCE = 1e-13  # below it rounding errors dominate
LEAST_STEP = 4e-16  # relative to the time

"""Least tolerance and least step that rounding allows."""

LEAST_TOLERANCE = 1e-13  # below it rounding errors dominate
LEAST_STEP = 4e-16  # relative to the time

"""What rounding leaves of steps and tolerances. Knows no method."""

LEAST_TOLERANCE = 1e-13  # below it rounding rules
LEAST_STEP = 4e-16  # of the time it moves

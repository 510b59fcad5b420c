"""Names of the files of greatest values, run-ups and grids in a run directory, as glob patterns."""

GRID_FILES = "grids/*.*"
MAXIMA_FILES, RUN_UP_FILES = "maxima-*.vtu", "run_up-*.csv"
RUN_UP_PICTURES = "run_up-*.png"

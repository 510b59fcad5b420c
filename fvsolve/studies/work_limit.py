"""Estimated CPU time of a study, and its limit, so that all machines refuse the same cases."""

from fvsolve.errors import FvsolveError

TIME_LIMIT = 30.0  # greatest estimated CPU time of a prediction [s]
# Rates of one core of 2020
DENSE_RATE = 4e10  # operations in products of full matrices [1/s]
SPARSE_RATE = 2e9  # operations in products of a sparse matrix and a block of vectors [1/s]
CALL_TIME = 3e-5  # additional time of such a product [s]
FEWER_CELLS = (
    "give pipes or basins fewer cells, --set links.NAME.cells=100 or nodes.NAME.cells=[20,20] (or, for pipes that "
    "state no cells, a greater numerics.cell_time; the limit as a Courant number changes little)"
)


class TooLarge(FvsolveError):
    """Error: a study would take longer than its time limit."""


class WorkLimit:
    """Estimated CPU time of a study so far, `spent` [s]; what, remedy : plural subject and remedy of the message."""

    def __init__(self, what: str, remedy: str) -> None:
        self.what, self.remedy, self.spent = what, remedy, 0.0

    def check(self, seconds: float) -> None:
        """Raise TooLarge if the next operations, of this estimated time [s], exceed the limit."""
        if self.spent + seconds > TIME_LIMIT:
            raise TooLarge(
                f"{self.what} take longer than {TIME_LIMIT:g} s of CPU time: {self.remedy}"
            )

    def spend(self, seconds: float) -> None:
        """Add the estimated time of the next operations [s]; raises TooLarge as `check`."""
        self.check(seconds)
        self.spent += seconds

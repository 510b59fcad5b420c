"""Greatest error of the model during a run of a basin, with its time."""

from __future__ import annotations

import numpy as np

from fvsolve.errors import Notice


class ErrorWatch:
    """Greatest error of one kind during a run of a basin.

    by(basin, y) : size of the error and two related values; notice(basin, values, when) : its notice
    least : size up to which there is no notice
    kept : float64[4]  time, size and both values of the greatest error; nan before any error
    """

    def __init__(self, basin, by, notice, least: float) -> None:
        self.basin, self.by, self.notice, self.least, self.greatest = basin, by, notice, least, np.full(4, np.nan)

    def check(self, t: float, y: np.ndarray) -> None:
        """Check a model's state."""
        error = self.by(self.basin, self.basin.deviations(y))
        if error[0] > 0.0 and not error[0] <= self.greatest[1]:
            self.greatest[:] = t, *error

    def notices(self) -> list[Notice]:
        """Notices of the greatest error."""
        t, *error = self.greatest.tolist()
        if not error[0] > self.least:
            return []
        return [self.notice(self.basin, error, f" at {self.basin.case.amount(t, 'time')}")]

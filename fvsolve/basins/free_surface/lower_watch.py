"""Greatest error of a model assumption in a basin during a run, with its time."""

from __future__ import annotations

import numpy as np

from fvsolve.errors import Notice


class ErrorWatch:
    """Greatest error of one kind in a basin during a run.

    by(basin, y) : function for the error and two related values at deviations y
    notice(basin, values, when) : function for the notice of these three values; when : text of the time
    least : error up to which no notice is given
    greatest : float64[4]  time [s], error and both related values at the greatest error; nan before any error
    """

    def __init__(self, basin, by, notice, least: float) -> None:
        self.basin, self.by, self.notice, self.least, self.greatest = basin, by, notice, least, np.full(4, np.nan)

    def check(self, t: float, y: np.ndarray) -> None:
        """Update the greatest error with the error of a state y of the model at time t [s]."""
        error = self.by(self.basin, self.basin.deviations(y))
        if error[0] > 0.0 and not error[0] <= self.greatest[1]:
            self.greatest[:] = t, *error

    def notices(self) -> list[Notice]:
        """List with the notice of the greatest error; empty if this error is not above `least`."""
        t, *error = self.greatest.tolist()
        if not error[0] > self.least:
            return []
        return [self.notice(self.basin, error, f" at {self.basin.case.amount(t, 'time')}")]

"""The worst of an error of the model that a run of a basin shows, with its time. Knows states; knows no error."""

from __future__ import annotations

import numpy as np

from fvsolve.errors import Notice


class Watch:
    """The worst error of a kind in a run of a basin.

    by(basin, y) : its size and two facts about it; notice(basin, found, when) : its notice
    least : size up to which no notice is due
    kept : float64[4]  time and what was found then; nan before any error
    """

    def __init__(self, basin, by, notice, least: float) -> None:
        self.basin, self.by, self.notice, self.least, self.kept = basin, by, notice, least, np.full(4, np.nan)

    def look(self, t: float, y: np.ndarray) -> None:
        """At a model's state."""
        found = self.by(self.basin, self.basin.of(y))
        if found[0] > 0.0 and not found[0] <= self.kept[1]:
            self.kept[:] = t, *found

    def notices(self) -> list[Notice]:
        """Notices of the worst error."""
        t, *found = self.kept.tolist()
        if not found[0] > self.least:
            return []
        return [self.notice(self.basin, found, f" at {self.basin.case.amount(t, 'time')}")]

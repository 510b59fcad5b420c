"""The sink of a run that writes nothing: rows in memory. Knows arrays; knows no files."""

from __future__ import annotations

import numpy as np

from fvsolve.output.column import converted, probe_columns, time_column
from fvsolve.output.envelope import in_units, with_start


class MemorySink:
    """Keeps the probe rows and the envelope; fields and checkpoints are only for disk."""

    folder = None
    restart = None
    ended = False

    def __init__(self, model):
        self.model = model
        self.time = time_column(model.case)
        self.columns = probe_columns(model)
        self._blocks: list[np.ndarray] = []
        self._summary = None

    def begin(self, model, state) -> None:
        """Nothing to open."""

    def rows(self, t, values) -> None:
        """Append probe rows: `t : float64[k]` [s], `values : float64[k, probes]` in SI."""
        block = np.empty((len(t), 1 + len(self.columns)))
        block[:, 0], block[:, 1:] = self.time.from_si(np.asarray(t)), converted(self.columns, np.asarray(values))
        self._blocks.append(block)

    def field(self, t: float, frame: dict) -> None:
        """Not kept."""

    def checkpoint(self, state, extra: dict) -> None:
        """Not kept."""

    def end(self, summary) -> None:
        """Keep the envelope."""
        self._summary = summary

    def close(self) -> None:
        """Nothing is open."""

    def table(self) -> np.ndarray:
        """`float64[rows, 1 + probes]`: time and probes in the columns' units."""
        return np.concatenate([np.empty((0, 1 + len(self.columns))), *self._blocks])

    @property
    def last(self) -> np.ndarray:
        """The last row of the table."""
        return self._blocks[-1][-1]

    def envelope(self) -> dict:
        """Pipe -> quantity -> float64[cells], in the units of envelope.csv."""
        if not self._summary:  # of a run that never ended
            return {}
        return in_units(with_start(self._summary, self.model), self.model.case)

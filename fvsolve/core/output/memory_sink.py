"""Receiver of the results of a run without a directory: rows are stored in memory."""

import numpy as np

from fvsolve.core.output.csv_files import envelope_in_units, with_initial_heads
from fvsolve.core.output.unit_columns import probe_columns, time_column, to_column_units


class MemorySink:
    """Receiver of the results of a run that stores probe rows and envelope in memory, not fields and checkpoints."""

    folder = None
    restart = None
    ended = False
    continued = ()
    takes_fields = False  # field frames need not be computed

    def __init__(self, model):
        self.model = model
        self.time = time_column(model.case)
        self.columns = probe_columns(model)
        self._blocks: list[np.ndarray] = []
        self._summary = None

    def begin(self, model, state) -> None:
        """Do nothing: there is no file to open."""

    def rows(self, t, values) -> None:
        """Append rows of probe values. t : float64[k] [s]; values : float64[k, probes] in SI"""
        block = np.empty((len(t), 1 + len(self.columns)))
        block[:, 0], block[:, 1:] = (
            self.time.from_si(np.asarray(t)),
            to_column_units(self.columns, np.asarray(values)),
        )
        self._blocks.append(block)

    def field(self, t: float, frame: dict) -> None:
        """Do nothing: fields are not stored."""

    def checkpoint(self, state) -> None:
        """Do nothing: checkpoints are not stored."""

    def end(self, summary) -> None:
        """Store the summary of the run, from which `envelope` is computed."""
        self._summary = summary

    def close(self) -> None:
        """Do nothing: there is no file to close."""

    def table(self) -> np.ndarray:
        """Time and probe values in the units of the columns : float64[rows, 1 + probes]."""
        return np.concatenate([np.empty((0, 1 + len(self.columns))), *self._blocks])

    @property
    def last(self) -> np.ndarray:
        """Last row of the last block of rows : float64[1 + probes]."""
        return self._blocks[-1][-1]

    def maxima(self) -> dict:
        """Greatest values in the cells of basins: basin -> quantity -> float64[cells] in SI; {} before the end."""
        return self._summary.maxima if self._summary else {}

    def envelope(self) -> dict:
        """Envelope: pipe -> quantity -> float64[cells] in the units of envelope.csv; {} before the end of the run."""
        if not self._summary:
            return {}
        return envelope_in_units(with_initial_heads(self._summary, self.model), self.model.case)

"""Runs of a model from an initial state: rows and frames of results go to an output sink; a summary is returned."""

from fvsolve.solve.advance import advance
from fvsolve.solve.run_summary import Mark, Summary
from fvsolve.solve.solve import initial_state, solve

__all__ = ["Mark", "Summary", "advance", "initial_state", "solve"]

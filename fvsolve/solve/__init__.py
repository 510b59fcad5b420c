"""Runs of a model: from a model and a state to a summary, with rows and frames written to a sink."""

from fvsolve.solve.advance import advance
from fvsolve.solve.run_summary import Mark, Summary
from fvsolve.solve.solve import initial_state, solve

__all__ = ["Mark", "Summary", "advance", "initial_state", "solve"]

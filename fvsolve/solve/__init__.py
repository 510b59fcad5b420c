"""A model in, a summary out: segments between events, rows and frames to a sink."""

from fvsolve.solve.advance import advance
from fvsolve.solve.solve import initial_state, solve
from fvsolve.solve.summary import Mark, Summary

__all__ = ["Mark", "Summary", "advance", "initial_state", "solve"]

"""Files of a run directory: writing and reading."""

from fvsolve.output.directory import RunDirectory

__all__ = ["RunDirectory"]

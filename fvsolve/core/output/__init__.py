"""Writing and reading of the files of a run directory."""

from fvsolve.core.output.directory import RunDirectory

__all__ = ["RunDirectory"]

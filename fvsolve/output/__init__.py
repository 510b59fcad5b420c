"""Writing and reading of the files of a run directory."""

from fvsolve.output.directory import RunDirectory

__all__ = ["RunDirectory"]

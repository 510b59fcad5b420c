"""The run directory: what a run leaves on disk, and how it is read back. Knows files; knows no physics."""

from fvsolve.output.directory import RunDirectory

__all__ = ["RunDirectory"]

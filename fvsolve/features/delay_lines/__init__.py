"""Delay lines: pipes whose waves are a history instead of cells."""

from pathlib import Path

from fvsolve.jit import add_sources

add_sources(Path(__file__).parent, "kernels/*.py")

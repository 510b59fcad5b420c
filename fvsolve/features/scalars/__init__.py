"""Scalars that the flow carries, their reactions, and heat of the fluid."""

from pathlib import Path

from fvsolve.jit import add_sources

add_sources(Path(__file__).parent, "kernels/*.py")

"""Networks of potential and flow: rotation, electricity and heat, with the forces on masses that they move."""

from pathlib import Path

from fvsolve.jit import add_sources

add_sources(Path(__file__).parent, "kernels/*.py")

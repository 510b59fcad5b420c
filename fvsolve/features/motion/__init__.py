"""Motion: masses on an axis, rigid bodies with their joints, force elements between them, fluid that they carry."""

from pathlib import Path

from fvsolve.jit import add_sources

add_sources(Path(__file__).parent, "kernels/*.py")

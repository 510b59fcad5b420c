"""Controls: blocks that read values of the case and set schedules, with the kinds of blocks in folders of their own."""

from pathlib import Path

from fvsolve.jit import add_sources

add_sources(Path(__file__).parent, "kernels/*.py", "*/law*.py")

"""Compiled functions of delay lines, whose machine code is stored apart from that of the core."""

from pathlib import Path

from fvsolve.jit import add_sources

add_sources(Path(__file__).parent)

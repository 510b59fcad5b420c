"""Compiled functions of floats, arrays and integer codes."""

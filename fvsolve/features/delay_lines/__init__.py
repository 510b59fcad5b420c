"""Delay lines: pipes whose waves are a history instead of cells."""

"""Compiled functions of blocks."""

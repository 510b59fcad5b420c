"""Compiled functions of delay lines."""

"""Friction that remembers the past of the flow; loaded and compiled by scenes that have it alone."""

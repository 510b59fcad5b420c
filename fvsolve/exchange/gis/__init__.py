"""Layers of GIS files as parts of a case, and results as layers; may import `core`, `case` and `parts`."""

"""Basins: what all physics share, and a folder for each; loaded and compiled by scenes that have one alone."""

"""Walls that give way in time; loaded and compiled by scenes that have them alone."""

"""Unsteady friction; imported and compiled only for scenes that use it."""

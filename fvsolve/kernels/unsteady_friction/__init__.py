"""Unsteady friction; imported and compiled only for models that use it."""

"""Conversion of parts to rows of the tables of a model: base classes, and the tables while they are filled."""

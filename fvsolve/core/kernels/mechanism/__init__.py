"""Multibody system: joints, forces at points, mass matrix; imported and compiled only for cases that contain bodies."""

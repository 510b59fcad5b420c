"""Runge-Kutta methods as data and the loop that steps them. Knows arrays and time; knows no physics."""

from fvsolve.steppers import methods  # noqa: F401  (registers them)

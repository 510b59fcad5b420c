"""Passivity of ports: tests for positive real transfer functions."""

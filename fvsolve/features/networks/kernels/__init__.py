"""Compiled functions of networks."""

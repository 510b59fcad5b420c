"""Compiled functions of masses, bodies and the fluid that bodies carry."""

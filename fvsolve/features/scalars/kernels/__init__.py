"""Compiled functions of scalars, reactions and heat."""

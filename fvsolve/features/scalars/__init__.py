"""Scalars that the flow carries, their reactions, and heat of the fluid."""

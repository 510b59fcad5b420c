"""Linearisation of a case about a state: matrices A, B, C, D and eigenvalues."""

"""Exact numbers: fractions, algebraic numbers, polynomials of them, and how they are written. Knows no method."""

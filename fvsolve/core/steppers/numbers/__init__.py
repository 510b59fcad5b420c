"""Exact numbers: fractions, algebraic numbers, polynomials with exact coefficients, and a parser of exact numbers."""

"""Exact numbers: fractions, algebraic numbers, polynomials with such coefficients, and their parser."""

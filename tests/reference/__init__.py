"""Independent truth for the tests: closed forms and exact constructions. Imports nothing of fvsolve."""

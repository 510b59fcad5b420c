"""Compilation by numba: compiled functions, their cache, and all that depends on private names of numba.

`docs/numba.md` says what to do if a new version of numba changes one of these names. Other folders import `fvsolve.jit`
and, for generated machine code, `code_generation`.
"""

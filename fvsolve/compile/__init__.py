"""Compilation by numba: compiled functions, their cache, and private names of numba; imports only `errors`.

`docs/numba.md` says what to do if a new version of numba changes one of these names. Other folders import `fvsolve.jit`
and, for generated machine code, `code_generation`.
"""

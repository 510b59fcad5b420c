"""Compilation by numba: compiled functions, their cache, and private names of numba; imports only `errors`.

`docs/developing.md` has the remedies if a new version of numba changes a name. Other folders import `fvsolve.jit`
and, for generated machine code, `code_generation`.
"""

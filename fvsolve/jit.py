"""Compilation of functions by `njit`, and the folder of compiled code: public names of `fvsolve.compile`.

Numba checks only the file of a compiled function. After an edit in another file, whose functions it calls, the old
machine code would run. Here each function is cached in a folder named by the hash of all sources that compiled code can
depend on, in a subfolder for the machine; site-packages stays unchanged. Functions that Python calls, or that are
called by address, are stored a second time, in a form that is loaded without numba (`compile.store`).
"""

from fvsolve.compile.cache_folders import (
    COMPILING,
    add_sources,
    cache_folder,
    code_folder,
    is_cold,
    other_caches,
    reading_folders,
    source_hash,
)
from fvsolve.compile.functions import (
    ARRAYS,
    DeclaredFunction,
    Intrinsic,
    compile_in_parallel,
    compile_once,
    compile_signature,
    declare_function,
    inline,
    njit,
    plain_kinds,
    specialise,
)

__all__ = [
    "ARRAYS",
    "COMPILING",
    "DeclaredFunction",
    "Intrinsic",
    "add_sources",
    "cache_folder",
    "code_folder",
    "compile_in_parallel",
    "compile_once",
    "compile_signature",
    "declare_function",
    "inline",
    "is_cold",
    "njit",
    "other_caches",
    "plain_kinds",
    "reading_folders",
    "source_hash",
    "specialise",
]

"""Classes of numba that are extended: dispatcher, code library, cache file; addresses of a compiled function."""

from __future__ import annotations

import functools
import hashlib
import pickle
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fvsolve.compile.cache_folders import code_folder, warn_not_cached
from fvsolve.compile.store import IN_USE, Code

DIGEST = hashlib.sha256().digest_size
LOADED_CODE: dict[str, bytes] = {}  # machine code that numba has loaded and the store lacks, by its symbol
CACHE_DIR_LOCK = threading.Lock()  # locked while numba's cache folder is set


@functools.cache
def numba_module():
    """Module numba, imported at the first compilation; its warning about first-class functions is disabled."""
    import numba
    from numba.core.errors import NumbaExperimentalFeatureWarning

    generate_code_on_request()
    compare_flags_quickly()
    warnings.filterwarnings("ignore", category=NumbaExperimentalFeatureWarning)
    return numba


def compare_flags_quickly() -> None:
    """Let numba compare its compiler flags by their dictionaries, which saves a tenth of the compile time.

    Numba compares them at each look-up of a function, by a list of all options of both.
    """
    from numba.core.targetconfig import TargetConfig

    in_full = TargetConfig.__eq__

    def equal(flags: TargetConfig, others: Any) -> bool:
        known = isinstance(others, TargetConfig) and flags._values == others._values
        return (known and type(flags) is type(others)) or in_full(flags, others)

    TargetConfig.__eq__, TargetConfig.__hash__ = equal, lambda flags: hash(type(flags))


def generate_code_on_request() -> None:
    """Let numba generate the machine code of a function when its address is requested.

    Numba generates it for every function. A function that only compiled code calls does not need it, because its
    optimised intermediate code is linked into its callers. This saves a fifth of the compile time.
    """
    from llvmlite.binding import parse_bitcode
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.registry import cpu_target

    codegen, environments = cpu_target.target_context.codegen(), {}
    set_environment_now = codegen.set_env

    def set_environment(name: str, environment: Any) -> None:
        environments[name] = environment
        if codegen._engine.get_global_value_address(name):
            set_environment_now(name, environment)

    class CodeLibrary(JITCodeLibrary):
        generated = False

        def _finalize_final_module(self) -> None:
            self._finalize_dynamic_globals()
            self._verify_declare_only_symbols()
            self._finalized = True
            if self._object_caching_enabled and self._compiled_object is not None:  # from a cache file
                self.generate()

        @global_compiler_lock
        def generate(self) -> None:
            """Generate and load the machine code of the functions of this library."""
            if not self.generated:
                self.generated, self._dynamic_globals = True, []
                super()._finalize_final_module()
                for variable in self._final_module.global_variables:
                    if variable.name in environments:
                        set_environment(variable.name, environments[variable.name])

        def get_pointer_to_function(self, name: str) -> int:
            self._ensure_finalized()
            if not self.generated and name in {function.name for function in self.get_defined_functions()}:
                self.generate()
            return super().get_pointer_to_function(name) if self.generated else 0

        @classmethod
        def _unserialize(cls, codegen: Any, state: tuple) -> Any:
            name, kind, data = state
            if kind == "object":
                return super()._unserialize(codegen, state)
            library = codegen.create_library(name)
            library.enable_object_caching()
            library._final_module = parse_bitcode(data)
            library._finalize_final_module()
            return library

        def serialize_using_object_code(self) -> tuple:  # for cache files
            return super().serialize_using_object_code() if self.generated else self.serialize_using_bitcode()

    codegen.set_env, codegen._library_class = set_environment, CodeLibrary


@functools.cache
def dispatcher_class() -> type:
    """Dispatcher class of numba, extended by a second dispatcher for calls from compiled code.

    Numba adds two wrappers to each function, for calls from Python and from C. With twenty arrays to unpack they are
    larger than the function. The second dispatcher compiles without wrappers, which saves a fifth of the compile time.
    """
    numba = numba_module()
    from numba.core.registry import CPUDispatcher

    bare = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

    class Dispatcher(CPUDispatcher):
        def __init__(self, function: Callable, cache: bool, folder: str = "", **options: Any) -> None:
            super().__init__(function, targetoptions=options)
            self.cache, self.folder, self.options = cache, folder, options
            if cache:
                with CACHE_DIR_LOCK:
                    before = numba.config.CACHE_DIR
                    numba.config.CACHE_DIR = str(code_folder() / folder)
                    try:
                        self.enable_caching()
                    finally:
                        numba.config.CACHE_DIR = before
                self._cache._cache_file.__class__ = cache_file_class()

        @functools.cached_property
        def within(self) -> CPUDispatcher:
            """Dispatcher without wrappers, created at first use by compiled code."""
            if bare.items() <= self.options.items():
                return self
            return Dispatcher(self.py_func, self.cache, f"{self.folder}/within".strip("/"), **self.options | bare)

        @property
        def _numba_type_(self):
            return numba.types.Dispatcher(self.within)

        def _reduce_class(self) -> type:  # written to cache files for functions passed as arguments
            return CPUDispatcher

    return Dispatcher


@functools.cache
def cache_file_class() -> type:
    """Cache file class of numba that treats a damaged file as missing and does not fail on a full disk."""
    from numba.core.caching import IndexDataCacheFile, dumps

    class CacheFile(IndexDataCacheFile):
        def _load_index(self) -> dict:
            try:
                return super()._load_index()
            except Exception:  # any error of pickle in an incomplete file
                return {}

        def _load_data(self, name: str) -> Any:
            digest, data = (content := Path(self._data_path(name)).read_bytes())[:DIGEST], content[DIGEST:]
            if hashlib.sha256(data).digest() != digest:
                raise OSError(f"{name} is damaged")  # numba then compiles it again
            content = pickle.loads(data)
            (_, kind, code), names, *_ = content
            if IN_USE and kind == "object":  # LLVM does not return it later
                LOADED_CODE[names.llvm_func_name], _ = code
            return content

        def _save_data(self, name: str, data: Any) -> None:
            data = dumps(data)
            with self._open_for_write(self._data_path(name)) as file:
                file.write(hashlib.sha256(data).digest() + data)

        def save(self, key: Any, data: Any) -> None:
            try:
                super().save(key, data)
            except OSError as error:
                warn_not_cached(error.strerror or str(error))

    return CacheFile


def code_of(compiled, wrappers: bool = True) -> Code:
    """Addresses and Python entry point of a function compiled by numba.

    wrappers : True if it has wrappers for calls from Python and C
    """
    find, names = compiled.library.get_pointer_to_function, compiled.fndesc
    pointer = find(names.llvm_cfunc_wrapper_name) if wrappers else 0
    return Code(find(names.llvm_func_name), pointer, compiled.entry_point if wrappers else None, compiled)

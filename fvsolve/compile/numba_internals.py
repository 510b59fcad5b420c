"""Classes of numba that are extended: dispatcher, code library, cache file; addresses of a compiled function."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import pickle
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fvsolve.compile import file_access
from fvsolve.compile.cache_folders import code_folder, warn_not_cached
from fvsolve.compile.shorter_compilation import shorten_compilation
from fvsolve.compile.store import IN_USE, Code

DIGEST = hashlib.sha256().digest_size
# machine code that numba has loaded and the store lacks, by its symbol
LOADED_CODE: dict[str, bytes] = {}
CACHE_DIR_LOCK = threading.Lock()  # locked while numba's cache folder is set


@functools.cache
def numba_module():
    """Module numba, imported at the first compilation; its warning about first-class functions is disabled."""
    import numba
    from numba.core import config
    from numba.core.errors import NumbaExperimentalFeatureWarning

    # Numba also reads settings from a file of the present folder, at each compilation. Code compiled with the settings
    # of a stranger's folder would be stored for all later runs.
    config._config_fname = ""
    numba.config.reload_config()
    shorten_compilation()
    warnings.filterwarnings("ignore", category=NumbaExperimentalFeatureWarning)
    return numba


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
        def __init__(
            self, function: Callable, cache: bool, folder: str = "", **options: Any
        ) -> None:
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
            return Dispatcher(
                self.py_func, self.cache, f"{self.folder}/within".strip("/"), **self.options | bare
            )

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
            if file_access.fault(Path(self._index_path)):
                return {}
            try:
                return super()._load_index()
            except Exception:  # any error of pickle in an incomplete file
                return {}

        def _load_data(self, name: str) -> Any:
            content = file_access.read(Path(self._data_path(name)))
            if content is None:
                # numba then compiles it again
                raise OSError(f"{name} cannot be read, or others can write it")
            digest, data = content[:DIGEST], content[DIGEST:]
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

        @contextlib.contextmanager
        def _open_for_write(self, path: str):
            with super()._open_for_write(path) as file:
                file_access.close_to_others(file.fileno())
                yield file

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
    return Code(
        find(names.llvm_func_name), pointer, compiled.entry_point if wrappers else None, compiled
    )

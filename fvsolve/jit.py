"""Compilation of functions by `njit`, and the folder of compiled code.

Numba checks only the file of a compiled function. After an edit in another file, whose functions it calls, the old
machine code would run. Here each function is cached in a folder named by the hash of all sources that compiled code can
depend on, in a subfolder for the machine; site-packages stays unchanged. Functions that Python calls, or that are
called by address, are stored a second time, in a form that is loaded without numba (`store`).
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
import threading
import warnings
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from fvsolve import store
from fvsolve.store import Code

__all__ = [
    "Intrinsic",
    "add_sources",
    "compile_in_parallel",
    "cache_folder",
    "inline",
    "njit",
    "compile_once",
    "source_hash",
    "specialise",
]

TEST_BYTES = 65536  # bytes that are written to test if a folder can hold caches
DIGEST = hashlib.sha256().digest_size
COMPILE_TIMEOUT = 60.0  # longest wait for a second process that compiles [s]
KEPT_GENERATIONS = 3  # generations of compiled code kept in addition to the present one

PACKAGE = Path(__file__).resolve().parent
# Sources that compiled code can depend on: packages and modules with compiled functions and, by import contract, all
# that they may import; of `parts` the law files, of `basins` all files without a prefix of `UNCOMPILED_PREFIXES`.
SOURCE_ROOTS = ("kernels", "steppers", "jit", "store", "units", "errors")
UNCOMPILED_PREFIXES = ("part", "lower")  # prefixes of files of `basins` without compiled functions
EXTRA_FOLDERS: dict[Path, str] = {}  # other folders with compiled functions -> their folder below the code folder
COMPILE_LOCK = threading.RLock()  # locked while functions are compiled
LOADED_CODE: dict[str, bytes] = {}  # machine code that numba has loaded from its cache, by the symbol of the function
CACHE_DIR_LOCK = threading.Lock()  # locked while numba's cache folder is set
COMPILING = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")


@functools.cache
def cache_folder() -> Path:
    """Folder of cached data: compiled code and fluid properties.

    It is `FVSOLVE_CACHE` if set, else the cache folder of the user; if not writable, a folder below the temporary
    folder.
    """
    for folder in (_preferred_folder(), Path(tempfile.gettempdir()) / f"fvsolve-cache-{_user()}"):
        if _writable(folder):
            return folder
    return Path(tempfile.mkdtemp(prefix="fvsolve-cache-"))


@functools.cache
def source_hash() -> str:
    """Hash of all sources of compiled code: sixteen hexadecimal digits of the sha256 of file names and contents."""
    return _digest(PACKAGE, _sources())


def add_sources(folder: Path) -> None:
    """Allow caching of functions defined in a folder outside the package, under the hash of all sources in it."""
    folder = Path(folder).resolve()
    EXTRA_FOLDERS[folder] = f"outside/{_digest(folder, sorted(folder.rglob('*.py')))}"


def _digest(top: Path, paths) -> str:
    digest = hashlib.sha256()
    for path in paths:
        digest.update(str(path.relative_to(top)).encode() + b"\0")
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def njit(function: Callable | None = None, /, **options: Any) -> Callable:
    """Decorate a function for compilation by `numba.njit` with `error_model="numpy"` and caching by source hash.

    Arrays are not reference counted (`_nrt=False`): each count is an atomic operation, and with the tables of a
    model the counts cost microseconds per step. So compiled code allocates no memory; a function that must allocate
    sets `_nrt=True`. The GIL is released during a call from Python (`nogil=True`).
    Use the decorator bare or with options of numba. With `NUMBA_DISABLE_JIT=1` it returns the plain function.
    Only functions in the hashed sources (`_sources`) and in added folders are cached: the hash covers no other files.
    """
    if function is None:
        return functools.partial(njit, **options)
    if not COMPILING:
        return function
    return Function(function, {"error_model": "numpy", "_nrt": False, "nogil": True} | options)


class Function:
    """Function that `njit` returns, for calls from compiled code and from Python.

    Its machine code comes from the store, or else from numba, which is imported only if something is compiled.
    `.py_func` is the plain function, `.numba` its numba dispatcher.
    """

    def __init__(self, function: Callable, options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func, self.options = function, options
        self.targetoptions = {"nopython": True, "boundscheck": None} | options  # numba reads this attribute
        self.__code__, self.__defaults__ = function.__code__, function.__defaults__
        self.codes: dict[str, Code] = {}  # by signature; after a dot for code without wrappers
        self.by_types: dict[tuple, Callable] = {}  # callables by types of arguments, all of them numbers
        self.declared: DeclaredFunction | None = None

    @functools.cached_property
    def folder(self) -> str | None:
        """Subfolder of the code folder for the machine code of this function, "" for the code folder itself.

        None if its source is not hashed, that is, neither a compiled source of the package nor
        in a folder of `add_sources`.
        """
        home = Path(self.__code__.co_filename).resolve()
        return "" if home in _sources() else next((EXTRA_FOLDERS[f] for f in home.parents if f in EXTRA_FOLDERS), None)

    @functools.cached_property
    def numba(self):
        """Numba dispatcher of this function."""
        with COMPILE_LOCK:
            return _dispatcher()(self.py_func, self.folder is not None, self.folder or "", **self.targetoptions)

    @property
    def _numba_type_(self):
        return self.numba._numba_type_

    def __reduce__(self):
        if "<" in self.__qualname__:
            return Function, (self.py_func, self.options)
        return _attribute_of, (self.__module__, self.__qualname__)

    def declare(self, letters: str, kinds: Callable[[str], tuple]) -> DeclaredFunction:
        """Compile the function for a single signature; calls from Python then accept no other signature.

        If it is declared already, the existing declaration is returned, whatever the arguments.
        letters : signature, see `kernels.calls`
        kinds : function that gives the numba types of the arguments for `letters`
        """
        if self.declared is None:
            self.declared = DeclaredFunction(self, letters, self.code(letters, lambda: kinds(letters)))
        return self.declared

    def address(self, letters: str, kinds: Callable[[str], tuple]) -> int:
        """Address of the function compiled for a signature, for calls from compiled code.

        letters, kinds : as in `declare`
        """
        return self.code(letters, lambda: kinds(letters), wrappers=False).address

    def __call__(self, *arguments: Any) -> Any:
        if self.declared is not None:
            return self.declared(*arguments)
        if (python := self.by_types.get(kinds := tuple(map(type, arguments)))) is not None:
            return python(*arguments)
        try:
            letters = "".join(map(signature_of, arguments))
        except KeyError:  # a type without letter
            return self.numba(*arguments)
        python = self.code(letters, lambda: tuple(map(_numba().typeof, arguments))).python
        if LETTERS.keys() >= set(kinds):
            self.by_types[kinds] = python
        return python(*arguments)

    def code(self, letters: str, kinds: Callable[[], tuple], wrappers: bool = True) -> Code:
        """Machine code for a signature, loaded from the store or compiled.

        letters : signature, see `kernels.calls`
        kinds : function without arguments that gives the numba types of the arguments
        wrappers : True for code with wrappers for calls from Python and C
        """
        key = letters if wrappers else f".{letters}"
        if key not in self.codes:
            with COMPILE_LOCK:
                if key not in self.codes:
                    self.codes[key] = self._stored(key) or self._compiled(key, kinds(), wrappers)
        return self.codes[key]

    def _stored(self, key: str) -> Code | None:
        path = self._path(key)
        return None if path is None else store.read(path, self._identity(key))

    def _compiled(self, key: str, kinds: tuple, wrappers: bool) -> Code:
        compiler = self.numba if wrappers else self.numba.within
        compiler.compile(kinds)
        compiled = compiler.overloads[kinds]
        if (path := self._path(key)) is not None:
            try:
                loaded = LOADED_CODE.pop(compiled.fndesc.llvm_func_name, None)
                store.write(
                    path, self._identity(key), compiled, loaded or compiled.library._get_compiled_object(), wrappers
                )
            except OSError as error:
                _warn_not_cached(error.strerror or str(error))
        return code_of(compiled, wrappers)

    def _path(self, key: str) -> Path | None:
        """Path of the file for the machine code of a signature; None for a function whose code is not stored.

        Closures, local functions and functions of sources that are not hashed are not stored; nothing is stored where
        `store.CAN_LINK` is False.
        key : text of the signature
        """
        if self.folder is None or "<" in self.__qualname__ or self.py_func.__closure__ or not store.CAN_LINK:
            return None
        digest = hashlib.sha256(self._identity(key).encode()).hexdigest()[:12]
        return code_folder() / self.folder / f"{self.__name__}-{digest}{store.SUFFIX}"

    def _identity(self, key: str) -> str:
        options = " ".join(f"{name}={value}" for name, value in sorted(self.options.items()))
        return f"{self.__module__}.{self.__qualname__} line {self.__code__.co_firstlineno} {options} ({key})"


def _attribute_of(module: str, name: str) -> Any:
    """Object `name` of the module with the name `module`, which is imported."""
    return getattr(importlib.import_module(module), name)


def code_of(compiled, wrappers: bool = True) -> Code:
    """Addresses and Python entry point of a function compiled by numba.

    wrappers : True if it has wrappers for calls from Python and C
    """
    find, names = compiled.library.get_pointer_to_function, compiled.fndesc
    pointer = find(names.llvm_cfunc_wrapper_name) if wrappers else 0
    return Code(find(names.llvm_func_name), pointer, compiled.entry_point if wrappers else None, compiled)


class DeclaredFunction:
    """Compiled function of a single signature, for calls from Python, and by address from compiled code.

    `.address` is its address for C. Calls from Python raise TypeError for an array of another type, or one that is
    read-only or not C-contiguous.
    Exceptions are lost in calls by address: these functions report errors in their output.
    """

    def __init__(self, function: Any, letters: str, code: Code) -> None:
        self.function, self.code, self.address, self.python = function, code, code.pointer, code.python
        self.arrays = [(i, letter) for i, letter in enumerate(letters) if letter in ARRAYS]

    def __call__(self, *arguments: Any) -> Any:
        for i, letter in self.arrays:  # machine code does not check them
            actual = signature_of(arguments[i]) if type(arguments[i]) is np.ndarray else type(arguments[i]).__name__
            if actual != letter:
                expected = "{} with {} dimension(s)".format(*ARRAYS[letter])
                raise TypeError(f"argument {i} is {actual}; expected a writable C-contiguous array of {expected}")
        return self.python(*arguments)


@functools.cache
def plain_kinds() -> dict:
    """Numba types of numbers and of arrays of numbers : letter of a signature -> type."""
    types = _numba().types
    kinds = {"t": types.float64, "i": types.int64, "b": types.boolean, "c": types.complex128}
    return kinds | {letter: types.Array(getattr(types, kind), axes, "C") for letter, (kind, axes) in ARRAYS.items()}


def declare_function(function: Callable, letters: str, kinds: Callable[[str], tuple]) -> Callable:
    """Compile a function for a single signature; return it unchanged if compilation is disabled.

    letters, kinds : as in `Function.declare`
    """
    return function.declare(letters, kinds) if isinstance(function, Function) else function


LETTERS = {float: "t", np.float64: "t", int: "i", np.int64: "i", bool: "b", np.bool_: "b", complex: "c"}
ARRAYS = {"v": ("float64", 1), "w": ("float64", 2), "h": ("int64", 1), "s": ("int64", 2), "z": ("complex128", 1)}
ARRAY_LETTERS = {(np.dtype(kind).char, axes): letter for letter, (kind, axes) in ARRAYS.items()}
WRITABLE, COLUMNS = 0x501, 2  # numpy flags: C-contiguous, aligned and writable; Fortran-contiguous


def signature_of(argument: Any) -> str:
    """Signature of an argument: a letter of `LETTERS` or `ARRAYS`, or a text in brackets.

    Other arrays, records and tuples have such a text. Raises KeyError for any other type.
    """
    if type(argument) is not np.ndarray:
        if isinstance(argument, tuple):
            return f"({type(argument).__qualname__} {''.join(map(signature_of, argument))})"
        return f"[{_dtype_text(argument.dtype)}]" if type(argument) is np.void else LETTERS[type(argument)]
    kind, flags = argument.dtype, argument.flags.num
    if flags & WRITABLE == WRITABLE and (letter := ARRAY_LETTERS.get((kind.char, argument.ndim))) is not None:
        return letter
    return f"[{_dtype_text(kind)} {argument.ndim} {flags & (WRITABLE | COLUMNS)}]"


@functools.cache
def _dtype_text(kind: np.dtype) -> str:
    """Short text for a dtype; for records a hash of the names, types and offsets of their fields."""
    text = f"{kind.descr} {kind.itemsize} {kind.alignment}" if kind.names else ""
    return hashlib.sha256(text.encode()).hexdigest()[:12] if text else kind.str


def compile_once(function: Callable) -> Callable:
    """Decorate a function that compiles, so that it runs only once for the same arguments, even in several threads.

    Concurrent calls wait for the first call and get its result, as from `functools.cache`.
    """
    cached = functools.cache(function)

    @functools.wraps(function)
    def locked(*arguments: Any) -> Any:
        with COMPILE_LOCK:
            return cached(*arguments)

    return locked


def inline(function: Callable) -> Callable:
    """Decorate a function like `njit`, with forced inlining, so that passing arrays costs nothing.

    It suits functions that are called from a single place.
    """
    return njit(function, forceinline=True)


def specialise(template: FunctionType, name: str, **constants: Any) -> Callable:
    """Compile a copy of a plain function in which global names have other values, such as functions, codes or None.

    Branches on these constants are decided at compile time. The copy sees the globals of its module as they are at
    this call. Numba caches such copies, which it does not do for closures.
    name : name of the result; the module must assign the result to it, because code is stored and pickled under it
    constants : values of global names of the template, and `__name__=__name__` in another module than the template's
    """
    function = FunctionType(template.__code__, template.__globals__ | constants, name, template.__defaults__)
    function.__qualname__, function.__doc__ = name, template.__doc__  # its module is the constant `__name__`
    return njit(function)


class Intrinsic:
    """Replacement of `numba.extending.intrinsic` that imports numba only when compiled code first uses the function."""

    def __init__(self, define: Callable) -> None:
        functools.update_wrapper(self, define)
        self.define = define

    def __reduce__(self):
        return _attribute_of, (self.__module__, self.__qualname__)

    @functools.cached_property
    def _numba_type_(self):
        from numba.core.typing.templates import builtin_registry
        from numba.extending import intrinsic

        intrinsic_function = intrinsic(self.define)
        return next(kind for value, kind in reversed(builtin_registry.globals) if value is intrinsic_function)


def is_cold() -> bool:
    """True if compilation is enabled and the store contains no functions of this version for this machine.

    Then they must be compiled first.
    """
    return COMPILING and not any(code_folder().glob(f"*{store.SUFFIX}"))


def other_caches() -> str:
    """Text about cached code from other machines or sources, which cannot be used here; "" without such code."""
    own = code_folder()
    folders = {path.parent for path in cache_folder().glob(f"code/*/*/*{store.SUFFIX}")}
    machines = sorted(path.name for path in folders if path.parent == own.parent and path != own)
    others = sorted({path.parent.name for path in folders} - {own.parent.name})
    if machines:
        return f"{own.parent} contains code compiled for {', '.join(machines)}; this machine is {own.name}"
    if others:
        return (
            f"{own.parent.parent} contains code compiled from other versions of the sources ({', '.join(others)}), "
            f"which cannot be used with the present version, {own.parent.name}"
        )
    return ""


@contextlib.contextmanager
def compile_in_parallel(code: str, cached: str):
    """Context manager during which a second process runs the Python text `code`, to compile functions.

    It halves the time of a cold start. cached : name of a function that the process compiles. No process is started if
    the store contains this function, on a single processor, or if compilation is disabled.
    At its end the context waits for the process, for `COMPILE_TIMEOUT` at most, and then ends it. Functions that the
    process does not compile are compiled by the caller.
    """
    if not COMPILING or (os.cpu_count() or 1) < 2 or any(code_folder().glob(f"{cached}-*{store.SUFFIX}")):
        yield
        return
    path = os.pathsep.join([str(PACKAGE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    quiet = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    process = subprocess.Popen([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": path}, **quiet)
    try:
        yield
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(COMPILE_TIMEOUT)
    finally:
        process.kill()


@functools.cache
def _sources() -> tuple[Path, ...]:
    packages = [path for root in SOURCE_ROOTS for path in (PACKAGE / root).rglob("*.py")]
    modules = [path for root in SOURCE_ROOTS if (path := PACKAGE / f"{root}.py").is_file()]
    basins = [path for path in (PACKAGE / "basins").rglob("*.py") if not path.name.startswith(UNCOMPILED_PREFIXES)]
    return tuple(sorted([*packages, *modules, *(PACKAGE / "parts").rglob("law*.py"), *basins]))


@functools.cache
def _numba():
    """Module numba, imported at the first compilation; its warning about first-class functions is disabled."""
    import numba
    from numba.core.errors import NumbaExperimentalFeatureWarning

    warnings.filterwarnings("ignore", category=NumbaExperimentalFeatureWarning)
    return numba


@functools.cache
def _dispatcher() -> type:
    """Dispatcher class of numba, extended by a second dispatcher for calls from compiled code.

    Numba adds two wrappers to each function, for calls from Python and from C. With twenty arrays to unpack they are
    larger than the function. The second dispatcher compiles without wrappers, which saves a fifth of the compile time.
    """
    numba = _numba()
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
                self._cache._cache_file.__class__ = _cache_file_class()

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
def _cache_file_class() -> type:
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
            (_, _, (LOADED_CODE[content[1].llvm_func_name], _)), *_ = content  # LLVM does not return it later
            return content

        def _save_data(self, name: str, data: Any) -> None:
            data = dumps(data)
            with self._open_for_write(self._data_path(name)) as file:
                file.write(hashlib.sha256(data).digest() + data)

        def save(self, key: Any, data: Any) -> None:
            try:
                super().save(key, data)
            except OSError as error:
                _warn_not_cached(error.strerror or str(error))

    return CacheFile


@functools.cache
def _warn_not_cached(reason: str) -> None:
    text = f"{cache_folder()}: compiled code cannot be saved: {reason}; each start compiles it again"
    warnings.warn(f"{text}. Free space there, or set FVSOLVE_CACHE to another folder", RuntimeWarning, stacklevel=2)


@functools.cache
def code_folder() -> Path:
    """Folder for the code compiled from the present sources for this machine.

    It is created if missing; the oldest folders of other sources are deleted.
    """
    folder = cache_folder() / "code" / source_hash()
    own = folder / store.target()["name"]
    own.mkdir(parents=True, exist_ok=True)
    with contextlib.suppress(OSError):  # a full disk is reported when code is saved
        store.write_target(own)
    os.utime(folder)
    _prune(folder)
    return own


def _prune(present: Path) -> None:
    """Delete the folders of code from other sources, except the newest `KEPT_GENERATIONS`.

    present : folder of the present sources. Another process may delete these folders at the same time.
    """
    others = []
    for path in present.parent.iterdir():
        try:
            others.append((path.stat().st_mtime, path))
        except OSError:
            continue
    others = sorted((item for item in others if item[1] != present), reverse=True)
    for _, path in others[KEPT_GENERATIONS:]:
        shutil.rmtree(path, ignore_errors=True)


def _preferred_folder() -> Path:
    if stated := os.environ.get("FVSOLVE_CACHE"):
        return Path(stated).expanduser().absolute()
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local") / "fvsolve" / "cache"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "fvsolve"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fvsolve"


def _user() -> str:
    return str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(TEST_BYTES))  # fails on a full disk
        return True
    except OSError:
        return False

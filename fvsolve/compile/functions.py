"""Compiled functions: `njit`, functions of a single signature for calls by address, copies of a template."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib
import os
import subprocess
import sys
import threading
import weakref
from collections.abc import Callable
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from fvsolve.compile import cache_folders as folders
from fvsolve.compile import store
from fvsolve.compile.child_process import python_command, python_environment
from fvsolve.compile.store import Code

COMPILE_TIMEOUT = 60.0  # longest wait for a second process that compiles [s]
COMPILE_LOCK = threading.RLock()  # locked while functions are compiled
# Letters of a signature: of numbers, by their type; of arrays, their dtype and number of dimensions.
LETTERS = {
    float: "t",
    np.float64: "t",
    int: "i",
    np.int64: "i",
    bool: "b",
    np.bool_: "b",
    complex: "c",
}
ARRAYS = {
    "v": ("float64", 1),
    "w": ("float64", 2),
    "h": ("int64", 1),
    "s": ("int64", 2),
    "z": ("complex128", 1),
}
ARRAY_LETTERS = {(np.dtype(kind).char, axes): letter for letter, (kind, axes) in ARRAYS.items()}
WRITABLE, COLUMNS = 0x501, 2  # numpy flags: C-contiguous, aligned and writable; Fortran-contiguous


def njit(function: Callable | None = None, /, **options: Any) -> Callable:
    """Decorate a function for compilation by `numba.njit` with `error_model="numpy"` and caching by source hash.

    Arrays are not reference counted (`_nrt=False`): each count is an atomic operation, and with the tables of a
    model the counts cost microseconds per step. So compiled code allocates no memory; a function that must allocate
    sets `_nrt=True`. The GIL is released during a call from Python (`nogil=True`).
    Use the decorator bare or with options of numba. With `NUMBA_DISABLE_JIT=1` it returns the plain function.
    Only functions in the hashed sources (`compiled_sources`) and in added folders are cached, since the hash covers no
    other files.
    """
    if function is None:
        return functools.partial(njit, **options)
    if not folders.COMPILING:
        return function
    return Function(function, {"error_model": "numpy", "_nrt": False, "nogil": True} | options)


def compile_signature(function: Any, letters: str, kinds: tuple) -> DeclaredFunction:
    """Compile a numba dispatcher, which `numba.njit` returns, for a single signature.

    letters, kinds : signature as letters and as numba types of the arguments
    """
    function.compile(kinds)
    return DeclaredFunction(function, letters, internals().code_of(function.overloads[kinds]))


def inline(function: Callable) -> Callable:
    """Decorate a function like `njit`, with forced inlining, so that passing arrays costs nothing.

    It suits functions that are called from a single place.
    """
    return njit(function, forceinline=True)


# (file, line of a template, name of a copy) -> module of the copy
COPIES: dict[tuple[str, int, str], str] = {}


def specialise(template: FunctionType, name: str, **constants: Any) -> Callable:
    """Compile a copy of a plain function in which global names have other values, such as functions, codes or None.

    Branches on these constants are decided at compile time. The copy sees the globals of its module as they are at
    this call. Numba caches such copies, which it does not do for closures.
    name : name of the result; the module must assign the result to it, because code is stored and pickled under it
    constants : values of global names of the template, and `__name__=__name__` in another module than the template's
    Raises ValueError if another module compiles the same template under this name, or if that `__name__` is missing:
    numba stores code by template and name, so that the second copy would run the code of the first.
    """
    module = sys._getframe(1).f_globals["__name__"]
    key = template.__code__.co_filename, template.__code__.co_firstlineno, name
    first = COPIES.setdefault(key, module)
    if first != module:
        raise ValueError(
            f'{module}: {first} has a copy of {template.__name__} with the name "{name}"; give another name'
        )
    if constants.get("__name__", template.__module__) != module:
        raise ValueError(
            f"{module}: the copy {name} of {template.__name__} needs __name__=__name__"
        )
    function = FunctionType(
        template.__code__, template.__globals__ | constants, name, template.__defaults__
    )
    # its module is the constant `__name__`
    function.__qualname__, function.__doc__ = name, template.__doc__
    return njit(function)


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


@contextlib.contextmanager
def compile_in_parallel(code: str, cached: str):
    """Context manager during which a second process runs the Python text `code`, to compile functions.

    It halves the time of a cold start. cached : name of a function that the process compiles. No process is started if
    this function is cached, on a single processor, or if compilation is disabled.
    At its end the context waits for the process, for `COMPILE_TIMEOUT` at most, and then ends it. Functions that the
    process does not compile are compiled by the caller.
    """
    if not folders.COMPILING or (os.cpu_count() or 1) < 2 or folders.is_cached(cached):
        yield
        return
    quiet = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    process = subprocess.Popen(python_command("-c", code), env=python_environment(), **quiet)
    try:
        yield
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(COMPILE_TIMEOUT)
    finally:
        process.kill()


class Function:
    """Function that `njit` returns, for calls from compiled code and from Python.

    Its machine code comes from the store, or else from numba, which is imported only if something is compiled.
    `.py_func` is the plain function, `.numba` its numba dispatcher.
    """

    numba_caches = True  # False for a function that only the store keeps

    def __init__(self, function: Callable, options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func, self.options = function, options
        # numba reads this attribute
        self.targetoptions = {"nopython": True, "boundscheck": None} | options
        self.__code__, self.__defaults__ = function.__code__, function.__defaults__
        self.codes: dict[str, Code] = {}  # by signature; after a dot for code without wrappers
        # callables by types of arguments, all of them numbers
        self.by_types: dict[tuple, Callable] = {}
        self.declared: DeclaredFunction | None = None

    @functools.cached_property
    def folder(self) -> str | None:
        """Subfolder of the code folder for the machine code of this function, "" for the code folder itself.

        None if its source is not hashed, that is, neither a compiled source of the package nor
        in a folder of `add_sources`.
        """
        home = Path(self.__code__.co_filename).resolve()
        return (
            ""
            if home in folders.compiled_sources()
            else next(
                (folders.EXTRA_FOLDERS[f] for f in home.parents if f in folders.EXTRA_FOLDERS), None
            )
        )

    @functools.cached_property
    def numba(self):
        """Numba dispatcher of this function."""
        with COMPILE_LOCK:
            cached = self.folder is not None and self.numba_caches
            return internals().dispatcher_class()(
                self.py_func, cached, self.folder or "", **self.targetoptions
            )

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
            self.declared = DeclaredFunction(
                self, letters, self.code(letters, lambda: kinds(letters))
            )
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
        python = self.code(
            letters, lambda: tuple(map(internals().numba_module().typeof, arguments))
        ).python
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
        if (name := self._file_name(key)) is None:
            return None
        identity = self._identity(key)
        codes = (store.read(folder / name, identity) for folder in folders.code_folders())
        return next((code for code in codes if code is not None), None)

    def _compiled(self, key: str, kinds: tuple, wrappers: bool) -> Code:
        compiler = self.numba if wrappers else self.numba.within
        compiler.compile(kinds)
        compiled = compiler.overloads[kinds]
        code = internals().code_of(compiled, wrappers)
        if (name := self._file_name(key)) is not None:
            path = folders.code_folder() / name
            try:
                loaded = internals().LOADED_CODE.get(compiled.fndesc.llvm_func_name)
                store.write(
                    path,
                    self._identity(key),
                    compiled,
                    loaded or compiled.library._get_compiled_object(),
                    wrappers,
                )
            except OSError as error:
                folders.warn_not_cached(error.strerror or str(error))
        return code

    def _file_name(self, key: str) -> str | None:
        """File for the machine code of a signature, below the folder of code; None if its code is not stored.

        Closures, local functions and functions of sources that are not hashed are not stored; nothing is stored where
        `store.IN_USE` is False.
        key : text of the signature
        """
        if (
            self.folder is None
            or "<" in self.__qualname__
            or self.py_func.__closure__
            or not store.IN_USE
        ):
            return None
        digest = hashlib.sha256(self._identity(key).encode()).hexdigest()[:12]
        return f"{self.folder}/{self.__name__}-{digest}{store.SUFFIX}".lstrip("/")

    def _identity(self, key: str) -> str:
        options = " ".join(f"{name}={value}" for name, value in sorted(self.options.items()))
        return f"{self.__module__}.{self.__qualname__} line {self.__code__.co_firstlineno} {options} ({key})"


def _attribute_of(module: str, name: str) -> Any:
    """Object `name` of the module with the name `module`, which is imported."""
    return getattr(importlib.import_module(module), name)


class DeclaredFunction:
    """Compiled function of a single signature, for calls from Python, and by address from compiled code.

    `.address` is its address for C. Calls from Python raise TypeError for an array of another type, or one that is
    read-only or not C-contiguous; the same array at the same place as in the last call is not checked again.
    Exceptions are lost in calls by address: these functions report errors in their output.
    """

    def __init__(self, function: Any, letters: str, code: Code) -> None:
        self.function, self.code, self.address, self.python = (
            function,
            code,
            code.pointer,
            code.python,
        )
        self.letters = letters.lower()
        self.arrays = [i for i, letter in enumerate(self.letters) if letter in ARRAYS]
        # weak reference to the array of the last call at each place, or a function that returns None
        self.checked: list[Callable[[], Any]] = [lambda: None] * len(letters)

    def __call__(self, *arguments: Any) -> Any:
        checked = self.checked
        for i in self.arrays:
            known = checked[i]()
            if known is None or known is not arguments[i]:
                self.check(i, arguments[i])
        return self.python(*arguments)

    def check(self, i: int, array: Any) -> None:
        """Raise TypeError if an argument is not an array of the type of place i, which machine code does not check."""
        letter = self.letters[i]
        actual = signature_of(array) if type(array) is np.ndarray else type(array).__name__
        if actual != letter:
            expected = "{} with {} dimension(s)".format(*ARRAYS[letter])
            raise TypeError(
                f"argument {i} is {actual}; expected a writable C-contiguous array of {expected}"
            )
        self.checked[i] = weakref.ref(array)


def internals() -> ModuleType:
    """Module `numba_internals`, imported at the first compilation: a start with stored code needs nothing of numba."""
    from fvsolve.compile import numba_internals

    return numba_internals


@functools.cache
def plain_kinds() -> dict:
    """Numba types of numbers and of arrays of numbers : letter of a signature -> type."""
    types = internals().numba_module().types
    kinds = {"t": types.float64, "i": types.int64, "b": types.boolean, "c": types.complex128}
    return kinds | {
        letter: types.Array(getattr(types, kind), axes, "C")
        for letter, (kind, axes) in ARRAYS.items()
    }


def declare_function(function: Callable, letters: str, kinds: Callable[[str], tuple]) -> Callable:
    """Compile a function for a single signature; return it unchanged if compilation is disabled.

    letters, kinds : as in `Function.declare`
    """
    return function.declare(letters, kinds) if isinstance(function, Function) else function


def signature_of(argument: Any) -> str:
    """Signature of an argument: a letter of `LETTERS` or `ARRAYS`, or a text in brackets.

    Other arrays, records and tuples have such a text. Raises KeyError for any other type.
    """
    if type(argument) is not np.ndarray:
        if isinstance(argument, tuple):
            return f"({type(argument).__qualname__} {''.join(map(signature_of, argument))})"
        return (
            f"[{_dtype_text(argument.dtype)}]"
            if type(argument) is np.void
            else LETTERS[type(argument)]
        )
    kind, flags = argument.dtype, argument.flags.num
    if (
        flags & WRITABLE == WRITABLE
        and (letter := ARRAY_LETTERS.get((kind.char, argument.ndim))) is not None
    ):
        return letter
    return f"[{_dtype_text(kind)} {argument.ndim} {flags & (WRITABLE | COLUMNS)}]"


@functools.cache
def _dtype_text(kind: np.dtype) -> str:
    """Short text for a dtype; for records a hash of the names, types and offsets of their fields."""
    text = f"{kind.descr} {kind.itemsize} {kind.alignment}" if kind.names else ""
    return hashlib.sha256(text.encode()).hexdigest()[:12] if text else kind.str


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
        return next(
            kind
            for value, kind in reversed(builtin_registry.globals)
            if value is intrinsic_function
        )

"""The package's one `njit`, and the folder its caches live in. Knows numba's cache; knows no physics.

Numba looks only at the file that holds a jitted function, so an edit in *another* file that it calls
would go unnoticed and the old machine code would run. Here every function is cached in a folder named
by the hash of every source that compiled code can depend on, within it by the machine, and site-packages stays clean.
What is called, by Python or by address, is kept a second time where numba is not needed to load it (`store`).
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
from typing import Any

import numpy as np

from fvsolve import store
from fvsolve.store import Code

__all__ = ["Intrinsic", "add_sources", "beside", "cache_folder", "inner", "njit", "once", "source_hash"]

ROOM = 65536  # bytes that a folder must take to be one for caches
DIGEST = hashlib.sha256().digest_size
PATIENCE = 60.0  # for a process that compiles beside this one [s]
KEPT = 3  # generations of compiled code kept beside the present one

PACKAGE = Path(__file__).resolve().parent
# What compiled code can depend on: the rooms that compile and, by contract, all they may import; of parts the laws, of
# basins all but declarations and what lowers them.
ROOMS = ("kernels", "steppers", "jit", "store", "units", "errors")
PYTHON = ("part", "lower")  # what names of files of basins begin with that compile nothing
OUTSIDE: dict[Path, str] = {}  # folders whose sources may be compiled and cached too, and where below the code folder
MAKING = threading.RLock()  # held while compiled functions are made
LOADED: dict[str, bytes] = {}  # machine code that numba has taken from its cache, by the function's symbol
SETTING = threading.Lock()  # held while numba is told of a folder
COMPILING = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")


@functools.cache
def cache_folder() -> Path:
    """Folder for everything that fvsolve may compute again: compiled code and fluid properties.

    `FVSOLVE_CACHE` if set, else the user's cache folder, else (not writable) one below the temporary folder.
    """
    for folder in (_wanted_folder(), Path(tempfile.gettempdir()) / f"fvsolve-cache-{_user()}"):
        if _writable(folder):
            return folder
    return Path(tempfile.mkdtemp(prefix="fvsolve-cache-"))


@functools.cache
def source_hash() -> str:
    """Sixteen hexadecimal digits that change with any source of `ROOMS`: sha256 over names and bytes."""
    return _digest(PACKAGE, _sources())


def add_sources(folder: Path) -> None:
    """Let functions of modules in a folder outside the package be cached too, in a folder named by all its sources."""
    folder = Path(folder).resolve()
    OUTSIDE[folder] = f"outside/{_digest(folder, sorted(folder.rglob('*.py')))}"


def _digest(top: Path, paths) -> str:
    digest = hashlib.sha256()
    for path in paths:
        digest.update(str(path.relative_to(top)).encode() + b"\0")
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def njit(function: Callable | None = None, /, **options: Any) -> Callable:
    """`numba.njit` as the package wants it: `error_model="numpy"`, cached in a folder named by the sources.

    Arrays are not reference counted (`_nrt=False`): each count is an atomic operation, and with the tables of a
    model they cost microseconds a step. So compiled code allocates nothing; a function that must says `_nrt=True`.
    While one runs that Python has called, other threads of Python do (`nogil=True`).
    Used bare or with numba's own options. With `NUMBA_DISABLE_JIT=1` the plain function comes back.
    Only functions of `ROOMS` and of folders that were added are cached: no hash sees other files.
    """
    if function is None:
        return functools.partial(njit, **options)
    if not COMPILING:
        return function
    return Function(function, {"error_model": "numpy", "_nrt": False, "nogil": True} | options)


class Function:
    """A function that compiled code calls, and Python too; its machine code comes from the store, else from numba.

    `.py_func` is the plain one; numba, loaded only where something is to be compiled, sees its dispatcher (`.numba`).
    """

    def __init__(self, function: Callable, options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func, self.options = function, options
        self.targetoptions = {"nopython": True, "boundscheck": None} | options  # which numba looks for by that name
        self.__code__, self.__defaults__ = function.__code__, function.__defaults__
        self.codes: dict[str, Code] = {}  # by kinds of arguments, behind a dot without doors
        self.of_numbers: dict[tuple, Callable] = {}  # what Python calls, by types of arguments that are numbers all
        self.declared: Declared | None = None

    @functools.cached_property
    def folder(self) -> str | None:
        """Below the code folder, where its machine code is kept; None where no hash sees its source."""
        home = Path(self.__code__.co_filename).resolve()
        return "" if home in _sources() else next((OUTSIDE[f] for f in home.parents if f in OUTSIDE), None)

    @functools.cached_property
    def numba(self):
        """Numba's own function."""
        with MAKING:
            return _dispatcher()(self.py_func, self.folder is not None, self.folder or "", **self.targetoptions)

    @property
    def _numba_type_(self):
        return self.numba._numba_type_

    def __reduce__(self):
        if "<" in self.__qualname__:
            return Function, (self.py_func, self.options)
        return _named, (self.__module__, self.__qualname__)

    def declare(self, letters: str, kinds: Callable[[str], tuple]) -> Declared:
        """Compile for arguments of these kinds, and for no others that Python gives.

        kinds(letters) : numba's types of them
        """
        if self.declared is None:
            self.declared = Declared(self, letters, self.code(letters, lambda: kinds(letters)))
        return self.declared

    def address(self, letters: str, kinds: Callable[[str], tuple]) -> int:
        """Where compiled code finds it, compiled for arguments of these kinds."""
        return self.code(letters, lambda: kinds(letters), doors=False).address

    def __call__(self, *given: Any) -> Any:
        if self.declared is not None:
            return self.declared(*given)
        if (python := self.of_numbers.get(kinds := tuple(map(type, given)))) is not None:
            return python(*given)
        try:
            letters = "".join(map(letter_of, given))
        except KeyError:  # of a kind that has no letter
            return self.numba(*given)
        python = self.code(letters, lambda: tuple(map(_numba().typeof, given))).python
        if LETTERS.keys() >= set(kinds):
            self.of_numbers[kinds] = python
        return python(*given)

    def code(self, letters: str, kinds: Callable[[], tuple], doors: bool = True) -> Code:
        """Its machine code for arguments of these kinds, with doors for Python and C or for compiled code alone."""
        key = letters if doors else f".{letters}"
        if key not in self.codes:
            with MAKING:
                if key not in self.codes:
                    self.codes[key] = self._kept(key) or self._compiled(key, kinds(), doors)
        return self.codes[key]

    def _kept(self, key: str) -> Code | None:
        path = self._path(key)
        return None if path is None else store.read(path, self._who(key))

    def _compiled(self, key: str, kinds: tuple, doors: bool) -> Code:
        compiler = self.numba if doors else self.numba.within
        compiler.compile(kinds)
        compiled = compiler.overloads[kinds]
        if (path := self._path(key)) is not None:
            try:
                loaded = LOADED.pop(compiled.fndesc.llvm_func_name, None)
                store.write(path, self._who(key), compiled, loaded or compiled.library._get_compiled_object(), doors)
            except OSError as error:
                _cannot_keep(error.strerror or str(error))
        return code_of(compiled, doors)

    def _path(self, key: str) -> Path | None:
        """The file of the store; None of what is made anew by each call of a function, and has no name of its own."""
        if self.folder is None or "<" in self.__qualname__ or self.py_func.__closure__ or not store.LINKS:
            return None
        digest = hashlib.sha256(self._who(key).encode()).hexdigest()[:12]
        return code_folder() / self.folder / f"{self.__name__}-{digest}{store.SUFFIX}"

    def _who(self, key: str) -> str:
        options = " ".join(f"{name}={value}" for name, value in sorted(self.options.items()))
        return f"{self.__module__}.{self.__qualname__} line {self.__code__.co_firstlineno} {options} ({key})"


def _named(module: str, name: str) -> Any:
    """What a module has by a name."""
    return getattr(importlib.import_module(module), name)


def code_of(compiled, doors: bool = True) -> Code:
    """What numba has compiled, as it is called."""
    find, names = compiled.library.get_pointer_to_function, compiled.fndesc
    pointer = find(names.llvm_cfunc_wrapper_name) if doors else 0
    return Code(find(names.llvm_func_name), pointer, compiled.entry_point if doors else None, compiled)


class Declared:
    """A compiled function of one signature, as Python calls it and as compiled code takes it as an argument.

    `.address` is where C finds it. What it raises there is lost: such functions say what went wrong by what they write.
    """

    def __init__(self, function: Any, letters: str, code: Code) -> None:
        self.function, self.code, self.address, self.python = function, code, code.pointer, code.python
        self.arrays = [(i, letter) for i, letter in enumerate(letters) if letter in ARRAYS]

    def __call__(self, *given: Any) -> Any:
        for i, letter in self.arrays:  # which machine code does not look at
            found = letter_of(given[i]) if type(given[i]) is np.ndarray else type(given[i]).__name__
            if found != letter:
                wanted = "{} of {} axes".format(*ARRAYS[letter])
                raise TypeError(f"argument {i} is {found}; wanted an array by rows, to be written, of {wanted}")
        return self.python(*given)


@functools.cache
def plain_kinds() -> dict:
    """Letter -> numba's type of a number, or of an array of numbers."""
    types = _numba().types
    kinds = {"t": types.float64, "i": types.int64, "b": types.boolean, "c": types.complex128}
    return kinds | {letter: types.Array(getattr(types, kind), axes, "C") for letter, (kind, axes) in ARRAYS.items()}


def declared(function: Callable, letters: str, kinds: Callable[[str], tuple]) -> Callable:
    """A function compiled for arguments of these kinds and no others; itself where JIT is off."""
    return function.declare(letters, kinds) if isinstance(function, Function) else function


LETTERS = {float: "t", np.float64: "t", int: "i", np.int64: "i", bool: "b", np.bool_: "b", complex: "c"}
ARRAYS = {"v": ("float64", 1), "w": ("float64", 2), "h": ("int64", 1), "s": ("int64", 2), "z": ("complex128", 1)}
LETTER = {(np.dtype(kind).char, axes): letter for letter, (kind, axes) in ARRAYS.items()}
WRITTEN, COLUMNS = 0x501, 2  # flags of arrays: contiguous by rows, aligned, to be written; contiguous by columns


def letter_of(given: Any) -> str:
    """The kind of an argument, as `kernels.calls` spells it, in brackets where it has no letter there; KeyError."""
    if type(given) is not np.ndarray:
        if isinstance(given, tuple):
            return f"({type(given).__qualname__} {''.join(map(letter_of, given))})"
        return f"[{_spelt(given.dtype)}]" if type(given) is np.void else LETTERS[type(given)]
    kind, flags = given.dtype, given.flags.num
    if flags & WRITTEN == WRITTEN and (letter := LETTER.get((kind.char, given.ndim))) is not None:
        return letter
    return f"[{_spelt(kind)} {given.ndim} {flags & (WRITTEN | COLUMNS)}]"


@functools.cache
def _spelt(kind: np.dtype) -> str:
    """A dtype in a few letters; records by their fields and where they lie."""
    said = f"{kind.descr} {kind.itemsize} {kind.alignment}" if kind.names else ""
    return hashlib.sha256(said.encode()).hexdigest()[:12] if said else kind.str


def once(function: Callable) -> Callable:
    """`functools.cache` of what compiles: threads that ask for the same at one time wait for it, and get the same."""
    found = functools.cache(function)

    @functools.wraps(function)
    def asked(*given: Any) -> Any:
        with MAKING:
            return found(*given)

    return asked


def inner(function: Callable) -> Callable:
    """`njit` for what compiled code calls from one place: arrays cost nothing to pass."""
    return njit(function, forceinline=True)


class Intrinsic:
    """`numba.extending.intrinsic`, made where compiled code first asks for it: until then numba is not loaded."""

    def __init__(self, define: Callable) -> None:
        functools.update_wrapper(self, define)
        self.define = define

    def __reduce__(self):
        return _named, (self.__module__, self.__qualname__)

    @functools.cached_property
    def _numba_type_(self):
        from numba.core.typing.templates import builtin_registry
        from numba.extending import intrinsic

        made = intrinsic(self.define)
        return next(kind for value, kind in reversed(builtin_registry.globals) if value is made)


def cold() -> bool:
    """Whether nothing of this version has been compiled on this machine yet."""
    return COMPILING and not any(code_folder().glob(f"*{store.SUFFIX}"))


def elsewhere() -> str:
    """What compiled code lies in the cache and is of no use here, in words; "" of none."""
    own = code_folder()
    there = {path.parent for path in cache_folder().glob(f"code/*/*/*{store.SUFFIX}")}
    machines = sorted(path.name for path in there if path.parent == own.parent and path != own)
    others = sorted({path.parent.name for path in there} - {own.parent.name})
    if machines:
        return f"{own.parent} holds code for {', '.join(machines)}, and this machine is {own.name}"
    if others:
        return f"{own.parent.parent} holds code of other sources, {', '.join(others)}, and these are {own.parent.name}"
    return ""


@contextlib.contextmanager
def beside(code: str, cached: str):
    """While the body compiles, a second process runs `code` to compile something else, so a cold start takes half.

    cached : a function that it compiles; where the store has it nothing is left to do.
    Whatever the second process fails to leave there, the caller compiles itself.
    """
    if not COMPILING or (os.cpu_count() or 1) < 2 or any(code_folder().glob(f"{cached}-*{store.SUFFIX}")):
        yield
        return
    path = os.pathsep.join([str(PACKAGE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    quiet = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    second = subprocess.Popen([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": path}, **quiet)
    try:
        yield
        with contextlib.suppress(subprocess.TimeoutExpired):
            second.wait(PATIENCE)
    finally:
        second.kill()


@functools.cache
def _sources() -> tuple[Path, ...]:
    rooms = [path for room in ROOMS for path in (PACKAGE / room).rglob("*.py")]
    modules = [path for room in ROOMS if (path := PACKAGE / f"{room}.py").is_file()]
    basins = [path for path in (PACKAGE / "basins").rglob("*.py") if not path.name.startswith(PYTHON)]
    return tuple(sorted([*rooms, *modules, *(PACKAGE / "parts").rglob("law*.py"), *basins]))


@functools.cache
def _numba():
    """Numba itself, imported where something is to be compiled, its notice about first-class functions silenced."""
    import numba
    from numba.core.errors import NumbaExperimentalFeatureWarning

    warnings.filterwarnings("ignore", category=NumbaExperimentalFeatureWarning)
    return numba


@functools.cache
def _dispatcher() -> type:
    """Numba's class of compiled functions, each with a second one that compiled code calls in its place.

    Numba gives every function two doors, by which Python and C call it; with twenty arrays to unpack they are more code
    than the function. What compiled code calls has none, which saves a fifth of all compiling.
    """
    numba = _numba()
    from numba.core.registry import CPUDispatcher

    bare = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}

    class Dispatcher(CPUDispatcher):
        def __init__(self, function: Callable, cache: bool, folder: str = "", **options: Any) -> None:
            super().__init__(function, targetoptions=options)
            self.cache, self.folder, self.options = cache, folder, options
            if cache:
                with SETTING:
                    before = numba.config.CACHE_DIR
                    numba.config.CACHE_DIR = str(code_folder() / folder)
                    try:
                        self.enable_caching()
                    finally:
                        numba.config.CACHE_DIR = before
                self._cache._cache_file.__class__ = _kept_file()

        @functools.cached_property
        def within(self) -> CPUDispatcher:
            """The same without doors, made when compiled code first asks for it."""
            if bare.items() <= self.options.items():
                return self
            return Dispatcher(self.py_func, self.cache, f"{self.folder}/within".strip("/"), **self.options | bare)

        @property
        def _numba_type_(self):
            return numba.types.Dispatcher(self.within)

        def _reduce_class(self) -> type:  # of a function that is an argument, which names it in a file of the cache
            return CPUDispatcher

    return Dispatcher


@functools.cache
def _kept_file() -> type:
    """Numba's files of one function, of which a damaged one is as one that is not there, and a full disk no end."""
    from numba.core.caching import IndexDataCacheFile, dumps

    class Kept(IndexDataCacheFile):
        def _load_index(self) -> dict:
            try:
                return super()._load_index()
            except Exception:  # whatever pickle makes of half a file
                return {}

        def _load_data(self, name: str) -> Any:
            digest, data = (found := Path(self._data_path(name)).read_bytes())[:DIGEST], found[DIGEST:]
            if hashlib.sha256(data).digest() != digest:
                raise OSError(f"{name} is damaged")  # for numba to compile anew
            found = pickle.loads(data)
            (_, _, (LOADED[found[1].llvm_func_name], _)), *_ = found  # which LLVM takes and gives no more
            return found

        def _save_data(self, name: str, data: Any) -> None:
            data = dumps(data)
            with self._open_for_write(self._data_path(name)) as file:
                file.write(hashlib.sha256(data).digest() + data)

        def save(self, key: Any, data: Any) -> None:
            try:
                super().save(key, data)
            except OSError as error:
                _cannot_keep(error.strerror or str(error))

    return Kept


@functools.cache
def _cannot_keep(why: str) -> None:
    text = f"{cache_folder()}: compiled code cannot be kept: {why}; every start compiles it again until it can"
    warnings.warn(f"{text}, or until FVSOLVE_CACHE names another folder", RuntimeWarning, stacklevel=2)


@functools.cache
def code_folder() -> Path:
    """The folder of code of these sources for this machine; of other sources the oldest are deleted."""
    folder = cache_folder() / "code" / source_hash()
    own = folder / store.target()["name"]
    own.mkdir(parents=True, exist_ok=True)
    with contextlib.suppress(OSError):  # a full disk is told where code is to be kept
        store.describe(own)
    os.utime(folder)
    _prune(folder)
    return own


def _prune(present: Path) -> None:
    """Delete all but the newest generations beside `present`; another process may be doing the same."""
    others = []
    for path in present.parent.iterdir():
        try:
            others.append((path.stat().st_mtime, path))
        except OSError:
            continue
    others = sorted((item for item in others if item[1] != present), reverse=True)
    for _, path in others[KEPT:]:
        shutil.rmtree(path, ignore_errors=True)


def _wanted_folder() -> Path:
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
            file.write(bytes(ROOM))  # which a full disk refuses
        return True
    except OSError:
        return False

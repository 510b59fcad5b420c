"""The package's one `njit`, and the folder its caches live in. Knows numba's cache; knows no physics.

Numba looks only at the file that holds a jitted function, so an edit in *another* file that it calls
would go unnoticed and the old machine code would run. Here every function is cached in a folder named
by the hash of every source that compiled code can depend on, and site-packages stays clean.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
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

__all__ = ["add_sources", "argument", "beside", "cache_folder", "inner", "njit", "once", "source_hash"]

ROOM = 65536  # bytes that a folder must take to be one for caches
DIGEST = hashlib.sha256().digest_size
KEPT = 3  # generations of compiled code kept beside the present one

PACKAGE = Path(__file__).resolve().parent
# What compiled code can depend on: the rooms that compile and, by contract, all they may import; of parts the laws, of
# basins all but declarations and what lowers them.
ROOMS = ("kernels", "steppers", "jit", "units", "errors")
PYTHON = ("part", "lower")  # what names of files of basins begin with that compile nothing
OUTSIDE: dict[Path, str] = {}  # folders whose sources may be compiled and cached too, and where below the code folder
MAKING = threading.RLock()  # held while compiled functions are made
SETTING = threading.Lock()  # held while numba is told of a folder


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
    if _disabled():
        return function
    home = Path(function.__code__.co_filename).resolve()
    folder = "" if home in _sources() else next((OUTSIDE[f] for f in home.parents if f in OUTSIDE), None)
    options = {"error_model": "numpy", "cache": folder is not None, "_nrt": False, "nogil": True} | options
    return _dispatcher()(function, folder=folder or "", **options)


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


class Argument:
    """A compiled function of one signature as compiled code takes it as an argument.

    Numba would ask a dispatcher for its type and address at every call, which takes 40 microseconds a function.
    What it raises is lost: such functions say what went wrong by what they write.
    """

    def __init__(self, function: Any) -> None:
        from numba import types

        (compiled,) = function.overloads.values()
        self.function = function
        self.address = compiled.library.get_pointer_to_function(compiled.fndesc.llvm_cfunc_wrapper_name)
        self._numba_type_ = types.FunctionType(compiled.signature)

    def __wrapper_address__(self) -> int:
        return self.address

    def __call__(self, *arguments: Any) -> Any:
        return self.function(*arguments)


def argument(function: Callable) -> Callable:
    """The same function, quick to pass to compiled code; itself where JIT is off."""
    return Argument(function) if hasattr(function, "overloads") else function


def cold() -> bool:
    """Whether nothing of this version has been compiled on this machine yet."""
    return not _disabled() and not any(_code_folder().rglob("*.nbi"))


def _disabled() -> bool:
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")


@contextlib.contextmanager
def beside(code: str, cached: str):
    """While the body compiles, a second process runs `code` to compile something else, so a cold start takes half.

    cached : name of a cache file, with wildcards; where one lies in the code folder nothing is left to do.
    Whatever the second process fails to leave there, the caller compiles itself.
    """
    if _disabled() or (os.cpu_count() or 1) < 2 or any(_code_folder().rglob(cached)):
        yield
        return
    path = os.pathsep.join([str(PACKAGE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    quiet = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
    second = subprocess.Popen([sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": path}, **quiet)
    try:
        yield
        second.wait()
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
    """Numba itself, imported at the first decoration, its notice about first-class functions silenced."""
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
            super().__init__(function, targetoptions={"nopython": True, "boundscheck": None} | options)
            self.cache, self.folder, self.options = cache, folder, options
            if cache:
                with SETTING:
                    before = numba.config.CACHE_DIR
                    numba.config.CACHE_DIR = str(_code_folder() / folder)
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
            return pickle.loads(data)

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
def _code_folder() -> Path:
    """This generation's folder of compiled code; the oldest of the others are deleted."""
    folder = cache_folder() / "code" / source_hash()
    folder.mkdir(parents=True, exist_ok=True)
    os.utime(folder)
    _prune(folder)
    return folder


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

"""Folders of cached data: compiled code, named by the hash of all sources on which it depends, and fluid properties."""

from __future__ import annotations

import atexit
import contextlib
import functools
import hashlib
import os
import shutil
import sys
import tempfile
import warnings
from collections.abc import Iterable
from pathlib import Path

from fvsolve.compile import file_access, store
from fvsolve.errors import FvsolveError

TEST_BYTES = 65536  # bytes that are written to test if a folder can hold caches
KEPT_GENERATIONS = 3  # generations of compiled code kept in addition to the present one
# of files of compiled code; the second is numba's own
CODE_SUFFIX = store.SUFFIX if store.IN_USE else ".nbc"
COMPILING = os.environ.get("NUMBA_DISABLE_JIT", "0") in ("", "0")

PACKAGE = Path(__file__).resolve().parent.parent
# Sources that compiled code can depend on: packages and modules with compiled functions and, by import contract, all
# that they may import; of `parts` the law files. Features state their own sources, see `add_sources`.
SOURCE_ROOTS = ("core/kernels", "core/steppers", "jit", "compile", "units", "errors")
# other folders with compiled functions -> their folder below the code folder
EXTRA_FOLDERS: dict[Path, str] = {}


@functools.cache
def cache_folder() -> Path:
    """Folder in which cached data are stored: compiled code and fluid properties.

    It is `FVSOLVE_CACHE` if set, else the cache folder of the user; if not writable, a private folder below the
    temporary folder. Raises FvsolveError if another user can write in the preferred folder: its code would run.
    """
    preferred = _preferred_folder()
    _check_access(preferred)
    if _writable(preferred):
        _check_access(preferred)  # another user may have created it in between
        return preferred
    return _private_folder()


def reading_folders() -> tuple[Path, ...]:
    """Folders from which cached data are read: `cache_folder`, and before it a preferred folder that is read-only."""
    return tuple(
        dict.fromkeys(folder for folder in (_preferred_folder(), cache_folder()) if folder.is_dir())
    )


def _check_access(folder: Path) -> None:
    """Raise FvsolveError if another user can write in an existing folder."""
    if fault := file_access.fault(folder):
        stated = "FVSOLVE_CACHE = " if os.environ.get("FVSOLVE_CACHE") else ""
        raise FvsolveError(
            f"{stated}{folder}: {fault}, so that another user could store machine code that would run here; expected a "
            f"folder of this user or of root that only its owner can write; {file_access.REMEDY}, or set FVSOLVE_CACHE "
            "to another folder"
        )


def _private_folder() -> Path:
    """Folder below the temporary folder that only this user can read and write.

    Its name is the same at each start, so that code is compiled once. If another user occupies the name, the folder
    has a random name and is deleted at the end of the process.
    """
    folder = Path(tempfile.gettempdir()) / f"fvsolve-cache-{_user()}"
    with contextlib.suppress(OSError):
        folder.mkdir(mode=0o700)
    if not folder.is_symlink() and not file_access.fault(folder) and _writable(folder):
        return folder
    folder = Path(tempfile.mkdtemp(prefix="fvsolve-cache-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


@functools.cache
def source_hash() -> str:
    """Hash of all sources of compiled code: sixteen hexadecimal digits of the sha256 of file names and contents."""
    return _digest(PACKAGE, compiled_sources())


def add_sources(folder: Path, *patterns: str, called: Iterable[Path] = ()) -> None:
    """Allow caching of functions defined in a folder under the hash of its sources, beside those of the core.

    An edit there compiles only these functions again. folder : of another package, or of a feature
    patterns : files in it on which compiled functions depend; all its modules if none is given
    called : folders that have been added and whose functions these functions call
    """
    folder = Path(folder).resolve()
    paths = {path for pattern in patterns or ("**/*.py",) for path in folder.glob(pattern)}
    others = "".join(EXTRA_FOLDERS[Path(other).resolve()] for other in called)
    EXTRA_FOLDERS[folder] = f"outside/{_digest(folder, sorted(paths), others)}"


def _digest(top: Path, paths, others: str = "") -> str:
    digest = hashlib.sha256(others.encode())
    for path in paths:
        digest.update(str(path.relative_to(top)).encode() + b"\0")
        digest.update(path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@functools.cache
def code_folder() -> Path:
    """Folder for the code compiled from the present sources for this machine.

    It is created if missing; the oldest folders of other sources are deleted.
    """
    folder = cache_folder() / "code" / source_hash()
    own = folder / store.target()["name"]
    for path in (folder.parent, folder, own):
        path.mkdir(mode=0o755, exist_ok=True)
        _check_access(path)
    with contextlib.suppress(OSError):  # a full disk is reported when code is saved
        store.write_target(own)
    os.utime(folder)
    _prune(folder)
    return own


@functools.cache
def code_folders() -> tuple[Path, ...]:
    """Folders from which code is loaded: `code_folder`, and before it that of a preferred folder that is read-only."""
    below = Path("code", source_hash(), store.target()["name"])
    others = [folder / below for folder in reading_folders() if folder != cache_folder()]
    for path in (path for other in others for path in (other, *other.parents[:2]) if path.is_dir()):
        _check_access(path)
    return (*(other for other in others if other.is_dir()), code_folder())


def is_cold() -> bool:
    """True if compilation is enabled and no function of this version is cached for this machine.

    Then they must be compiled first.
    """
    return COMPILING and not any(
        path for folder in code_folders() for path in folder.rglob(f"*{CODE_SUFFIX}")
    )


def is_cached(name: str) -> bool:
    """True if the code of a function of the package is cached for this machine."""
    if store.IN_USE:
        return any(
            path for folder in code_folders() for path in folder.glob(f"{name}-*{CODE_SUFFIX}")
        )
    return any(code_folder().rglob(f"*.{name}-*{CODE_SUFFIX}"))


def other_caches() -> str:
    """Text about cached code from other machines or sources, which cannot be used here; "" without such code."""
    own = code_folder()
    folders = [
        path for path in cache_folder().glob("code/*/*") if any(path.rglob(f"*{CODE_SUFFIX}"))
    ]
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


@functools.cache
def compiled_sources() -> tuple[Path, ...]:
    packages = [path for root in SOURCE_ROOTS for path in (PACKAGE / root).rglob("*.py")]
    modules = [path for root in SOURCE_ROOTS if (path := PACKAGE / f"{root}.py").is_file()]
    return tuple(sorted([*packages, *modules, *(PACKAGE / "parts").rglob("law*.py")]))


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
        return (
            Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
            / "fvsolve"
            / "cache"
        )
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches" / "fvsolve"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "fvsolve"


def _user() -> str:
    return str(os.getuid()) if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(mode=0o755, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(TEST_BYTES))  # fails on a full disk
        return True
    except OSError:
        return False


@functools.cache
def warn_not_cached(reason: str) -> None:
    text = (
        f"{cache_folder()}: compiled code cannot be saved: {reason}; each start compiles it again"
    )
    warnings.warn(
        f"{text}. Free space there, or set FVSOLVE_CACHE to another folder",
        RuntimeWarning,
        stacklevel=2,
    )

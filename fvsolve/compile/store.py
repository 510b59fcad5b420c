"""Machine code on disk, loaded by llvmlite without numba; not used with `FVSOLVE_STORE=0`.

A file contains a function for a single signature: the object code compiled by numba, and its symbols. The name of its
folder follows from the target: all properties on which machine code depends, apart from the sources.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import hashlib
import importlib.util
import itertools
import json
import os
import re
import sys
import warnings
from collections.abc import Callable
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from pathlib import Path
from typing import Any, NamedTuple

from fvsolve.compile import file_access

DIGEST = hashlib.sha256().digest_size
SUFFIX = ".code"
# True if the store is used: LLVM's linker can link numba's objects on all systems but Windows.
IN_USE = sys.platform != "win32" and os.environ.get("FVSOLVE_STORE", "1") != "0"
# Environment variables of numba that do not change code, or whose values the target states by other names; all others
# are part of the target.
IGNORED_SETTINGS = re.compile(
    r"NUMBA_(CACHE|CHROME|COLOR|CPU|CUDA|DEBUG(?!INFO)|DEVELOPER|DUMP|DISABLE_(JIT|CUDA|PERF|TYPEINFER)|"
    r"FORCE_CUDA|FULL|HIGHLIGHT|NUM_|NRT_STATS|PARALLEL_DIAG|THREADING|TRACE)"
)
LIBRARY_NUMBERS = itertools.count()  # for unique names of libraries


class Code(NamedTuple):
    """Compiled function in memory.

    address : for calls from compiled code; pointer : address for C, or 0; python : callable for Python, or None
    """

    address: int
    pointer: int
    python: Callable | None
    owner: Any  # owner of the memory, kept alive as long as the function


@functools.cache
def target() -> dict[str, str]:
    """Properties on which machine code depends apart from sources: processor, versions, settings of numba.

    The processor is the present one, or what NUMBA_CPU_NAME and NUMBA_CPU_FEATURES state, such as x86-64-v3 without
    further features: then other processors that have its instructions have the same target.
    The entry `name` is the name of the folder for the code: processor, and eight digits of the hash of all properties.
    """
    import llvmlite
    import numpy
    from llvmlite import binding

    try:
        features = binding.get_host_cpu_features().flatten()
    except RuntimeError:  # as in numba
        features = ""
    settings = {
        "processor": os.environ.get("NUMBA_CPU_NAME", binding.get_host_cpu_name()),
        "features": os.environ.get("NUMBA_CPU_FEATURES", features),
        "system": binding.get_process_triple(),
        "python": sys.implementation.cache_tag,
        "numba": numba_version(),
        "llvmlite": llvmlite.__version__,
        "numpy": numpy.__version__,
        "settings": " ".join(
            sorted(
                f"{name}={value}"
                for name, value in os.environ.items()
                if name.startswith("NUMBA_") and not IGNORED_SETTINGS.match(name)
            )
        ),
    }
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()[:8]
    return settings | {"name": f"{settings['processor']}-{digest}"}


@functools.cache
def numba_version() -> str:
    """Version of numba, read without importing numba."""
    folder = numba_folder()
    text = (folder / "_version.py").read_text(encoding="utf-8") if folder else ""
    match = re.search(r'version"?\s*[:=]\s*["\']([^"\']+)', text)
    return (
        match[1]
        if match
        else sys.modules["numba"].__version__
        if "numba" in sys.modules
        else "unknown"
    )


def numba_folder() -> Path | None:
    """Folder in which numba is installed; None if it is not installed."""
    spec = importlib.util.find_spec("numba")
    return Path(spec.origin).parent if spec and spec.origin else None


def write_target(folder: Path) -> None:
    """Write the properties on which machine code depends (see `target`) to a new file target.json in a folder.

    An existing file is left unchanged.
    """
    path = folder / "target.json"
    if not path.exists():
        _replace(path, json.dumps(target(), indent=1).encode())


def write(path: Path, identity: str, compiled, code: bytes, wrappers: bool) -> None:
    """Save a function compiled by numba to a file. Raises OSError if the file cannot be written.

    identity : text that identifies function and signature; compiled : result of numba's compilation
    code : its object code; wrappers : True if the code has wrappers for calls from Python and C
    Code with wrappers that refers to Python objects is not saved.
    """
    names = compiled.fndesc
    symbols = {"address": names.llvm_func_name}
    if wrappers:
        if compiled.environment.consts:  # Python objects, which a file cannot contain
            return
        symbols |= {
            "pointer": names.llvm_cfunc_wrapper_name,
            "python": names.llvm_cpython_wrapper_name,
        }
        symbols["environment"] = names.env_name
    needed = [name for name in runtime_symbols() if name.encode() in code]
    head = {"function": identity, "target": target()["name"], "symbols": symbols, "wanted": needed}
    data = json.dumps(head).encode() + b"\n" + code
    path.parent.mkdir(parents=True, exist_ok=True)
    _replace(path, hashlib.sha256(data).digest() + data)


def _replace(path: Path, data: bytes) -> None:
    fresh = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        with open(fresh, "wb") as file:
            file_access.close_to_others(file.fileno())
            file.write(data)
        os.replace(fresh, path)
    except OSError:
        fresh.unlink(missing_ok=True)
        raise


def read(path: Path, identity: str) -> Code | None:
    """Load a function from a file; None if its code is missing, damaged, or cannot be used, or others can write it.

    Code for another target, and code that cannot be linked, cause a warning.
    identity : text that identifies function and signature; it must be that of `write`
    """
    content = file_access.read(path)
    if content is None:
        return None
    digest, data = content[:DIGEST], content[DIGEST:]
    if hashlib.sha256(data).digest() != digest:
        return None  # damaged: treated as missing
    header, _, object_code = data.partition(b"\n")
    head = json.loads(header)
    if head["target"] != target()["name"]:
        _warn(
            f"{path.parent} contains code compiled for {head['target']}; this machine is {target()['name']}; the "
            "code is compiled again"
        )
        return None
    if head["function"] != identity:
        return None
    missing = [name for name in head["wanted"] if name not in runtime_symbols()]
    if not missing:
        with contextlib.suppress(RuntimeError):  # LLVM writes missing symbols to standard error
            return _link(head["symbols"], head["wanted"], object_code, identity)
    reason = (
        f"numba {numba_version()} has no {', '.join(missing)}"
        if missing
        else "it calls functions that are not loaded"
    )
    _warn(f"{path}: code of {identity.split()[0]} cannot be loaded: {reason}; it is compiled again")
    return None


@functools.cache
def _warn(text: str) -> None:
    warnings.warn(text, RuntimeWarning, stacklevel=2)


def _link(symbols: dict[str, str], needed: list[str], object_code: bytes, identity: str) -> Code:
    """Load object code into a library of its own, so that symbols of different functions do not conflict.

    Raises RuntimeError if a symbol is missing.
    symbols : name of each entry point of the function; needed : names of symbols of numba and Python that it uses
    identity : text that identifies function and signature
    """
    from llvmlite import binding

    built = binding.JITLibraryBuilder().add_object_img(object_code).add_current_process()
    for symbol in symbols.values():
        built.export_symbol(symbol)
    for name in needed:
        built.import_symbol(name, runtime_symbols()[name])
    library = built.link(linker(), f"{identity} {next(LIBRARY_NUMBERS)}")
    python = None
    if "python" in symbols:
        own = numba_extension("_dynfunc")
        environment = own.Environment({})
        ctypes.c_void_p.from_address(library[symbols["environment"]]).value = id(environment)
        python = own.make_function(
            sys.modules[__name__],
            identity.split()[0],
            identity,
            library[symbols["python"]],
            environment,
            (library,),
        )
    pointer = library[symbols["pointer"]] if "pointer" in symbols else 0
    return Code(library[symbols["address"]], pointer, python, library)


@functools.cache
def linker():
    """Linker of LLVM for code that this process runs."""
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine(jit=True)
    return binding.create_lljit_compiler(machine, use_jit_link=True)


@functools.cache
def runtime_symbols() -> dict[str, int]:
    """Addresses of functions and objects of numba and Python that machine code uses : symbol -> address.

    The linker does not find these symbols by itself.
    """
    import builtins

    addresses = {"_Py_NoneStruct": id(None)}
    for module in (numba_extension("_helperlib"), numba_extension("_dynfunc")):
        addresses |= {f"numba_{name}": address for name, address in module.c_helpers.items()}
    exceptions = (
        e for e in vars(builtins).values() if isinstance(e, type) and issubclass(e, BaseException)
    )
    return addresses | {f"PyExc_{e.__name__}": id(e) for e in exceptions}


@functools.cache
def numba_extension(name: str):
    """Compiled extension module of numba, loaded without importing numba."""
    full = f"numba.{name}"
    if full in sys.modules:
        return sys.modules[full]
    path = next(
        candidate
        for end in EXTENSION_SUFFIXES
        if (candidate := numba_folder() / f"{name}{end}").is_file()
    )
    loader = ExtensionFileLoader(full, str(path))
    module = importlib.util.module_from_spec(
        importlib.util.spec_from_file_location(full, path, loader=loader)
    )
    loader.exec_module(module)
    return module

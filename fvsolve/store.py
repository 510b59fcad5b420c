"""Machine code on disk, and how it is called where numba is not loaded. Knows llvmlite; knows no function's meaning.

A file holds one function for one kind of arguments: a relocatable object as numba made it, and what its symbols are.
Files lie in a folder named by what machine code depends on beside sources: the target.
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

DIGEST = hashlib.sha256().digest_size
SUFFIX = ".code"
LINKS = sys.platform != "win32"  # where LLVM's linker knows the objects that numba makes
# Variables of numba's that change no code; all others are part of the target.
HARMLESS = re.compile(r"NUMBA_(CACHE|CHROME|COLOR|CUDA|DEBUG(?!INFO)|DEVELOPER|DUMP|DISABLE_(JIT|CUDA|PERF|TYPEINFER)|"
                      r"FORCE_CUDA|FULL|HIGHLIGHT|NUM_|NRT_STATS|PARALLEL_DIAG|THREADING|TRACE)")  # fmt: skip
NUMBERS = itertools.count()  # of libraries, whose names are taken once


class Code(NamedTuple):
    """A function in memory: where compiled code calls it, where C calls it, what Python calls; 0 or None without."""

    address: int
    pointer: int
    python: Callable | None
    kept: Any  # alive as long as it may be called


@functools.cache
def target() -> dict[str, str]:
    """What machine code depends on beside sources: processor, versions, numba's settings; `name` names them all.

    name : of the folder, the processor's and eight digits
    """
    import llvmlite
    import numpy
    from llvmlite import binding

    try:
        features = binding.get_host_cpu_features().flatten()
    except RuntimeError:  # as numba does
        features = ""
    said = {
        "processor": binding.get_host_cpu_name(),
        "features": features,
        "system": binding.get_process_triple(),
        "python": sys.implementation.cache_tag,
        "numba": numba_version(),
        "llvmlite": llvmlite.__version__,
        "numpy": numpy.__version__,
        "settings": " ".join(sorted(f"{name}={value}" for name, value in os.environ.items()
                                    if name.startswith("NUMBA_") and not HARMLESS.match(name))),
    }  # fmt: skip
    digest = hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()[:8]
    return said | {"name": f"{said['processor']}-{digest}"}


@functools.cache
def numba_version() -> str:
    """As numba says it, without loading it."""
    folder = numba_folder()
    text = (folder / "_version.py").read_text(encoding="utf-8") if folder else ""
    found = re.search(r'version"?\s*[:=]\s*["\']([^"\']+)', text)
    return found[1] if found else sys.modules["numba"].__version__ if "numba" in sys.modules else "unknown"


def numba_folder() -> Path | None:
    """Where numba is installed."""
    found = importlib.util.find_spec("numba")
    return Path(found.origin).parent if found and found.origin else None


def describe(folder: Path) -> None:
    """Say in a folder of a target what target it is, once."""
    path = folder / "target.json"
    if not path.exists():
        _replace(path, json.dumps(target(), indent=1).encode())


def write(path: Path, who: str, compiled, code: bytes, doors: bool) -> None:
    """Keep what numba has compiled, with its `doors` for Python and C or without; OSError where that cannot be."""
    names = compiled.fndesc
    symbols = {"address": names.llvm_func_name}
    if doors:
        if compiled.environment.consts:  # Python's objects, which no file holds
            return
        symbols |= {"pointer": names.llvm_cfunc_wrapper_name, "python": names.llvm_cpython_wrapper_name}
        symbols["environment"] = names.env_name
    wanted = [name for name in helpers() if name.encode() in code]
    head = {"function": who, "target": target()["name"], "symbols": symbols, "wanted": wanted}
    data = json.dumps(head).encode() + b"\n" + code
    path.parent.mkdir(parents=True, exist_ok=True)
    _replace(path, hashlib.sha256(data).digest() + data)


def _replace(path: Path, data: bytes) -> None:
    fresh = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        fresh.write_bytes(data)
        os.replace(fresh, path)
    except OSError:
        fresh.unlink(missing_ok=True)
        raise


def read(path: Path, who: str) -> Code | None:
    """What a file holds, ready to be called; None where there is none, or none that can be, which a warning tells."""
    try:
        found = path.read_bytes()
    except OSError:
        return None
    digest, data = found[:DIGEST], found[DIGEST:]
    if hashlib.sha256(data).digest() != digest:
        return None  # damaged: as if it were not there
    head, _, object_code = data.partition(b"\n")
    said = json.loads(head)
    if said["target"] != target()["name"]:
        _refuse(f"{path.parent} holds code for {said['target']}, and this machine is {target()['name']}; it is "
                "compiled again")  # fmt: skip
        return None
    if said["function"] != who:
        return None
    lacks = [name for name in said["wanted"] if name not in helpers()]
    if not lacks:
        with contextlib.suppress(RuntimeError):  # LLVM says on standard error what it does not find
            return _linked(said["symbols"], said["wanted"], object_code, who)
    why = f"numba {numba_version()} has no {', '.join(lacks)}" if lacks else "it calls what is not here"
    _refuse(f"{path}: code of {who.split()[0]} cannot be loaded: {why}; it is compiled again")
    return None


@functools.cache
def _refuse(text: str) -> None:
    warnings.warn(text, RuntimeWarning, stacklevel=2)


def _linked(symbols: dict[str, str], wanted: list[str], object_code: bytes, who: str) -> Code:
    """Machine code in memory, in a library of its own: no symbol of it meets another's."""
    from llvmlite import binding

    built = binding.JITLibraryBuilder().add_object_img(object_code).add_current_process()
    for symbol in symbols.values():
        built.export_symbol(symbol)
    for name in wanted:
        built.import_symbol(name, helpers()[name])
    library = built.link(linker(), f"{who} {next(NUMBERS)}")
    python = None
    if "python" in symbols:
        own = extension("_dynfunc")
        environment = own.Environment({})
        ctypes.c_void_p.from_address(library[symbols["environment"]]).value = id(environment)
        python = own.make_function(
            sys.modules[__name__], who.split()[0], who, library[symbols["python"]], environment, (library,)
        )
    pointer = library[symbols["pointer"]] if "pointer" in symbols else 0
    return Code(library[symbols["address"]], pointer, python, library)


@functools.cache
def linker():
    """LLVM's linker of this process."""
    from llvmlite import binding

    binding.initialize_native_target()
    binding.initialize_native_asmprinter()
    machine = binding.Target.from_default_triple().create_target_machine(jit=True)
    return binding.create_lljit_compiler(machine, use_jit_link=True)


@functools.cache
def helpers() -> dict[str, int]:
    """Addresses of what machine code of numba's calls in numba and Python: all that is not found by name."""
    import builtins

    found = {"_Py_NoneStruct": id(None)}
    for module in (extension("_helperlib"), extension("_dynfunc")):
        found |= {f"numba_{name}": address for name, address in module.c_helpers.items()}
    faults = (one for one in vars(builtins).values() if isinstance(one, type) and issubclass(one, BaseException))
    return found | {f"PyExc_{one.__name__}": id(one) for one in faults}


@functools.cache
def extension(name: str):
    """One of numba's own compiled modules, without numba."""
    full = f"numba.{name}"
    if full in sys.modules:
        return sys.modules[full]
    path = next(one for end in EXTENSION_SUFFIXES if (one := numba_folder() / f"{name}{end}").is_file())
    loader = ExtensionFileLoader(full, str(path))
    module = importlib.util.module_from_spec(importlib.util.spec_from_file_location(full, path, loader=loader))
    loader.exec_module(module)
    return module

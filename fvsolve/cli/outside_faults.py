"""Messages about errors in modules of other packages: package, file, line, fault and remedy."""

import inspect
import os
import re
import sys
from types import FrameType, TracebackType

from fvsolve.core.assembly.lowering_checks import source_of
from fvsolve.errors import did_you_mean

# Error messages of numba: place of a fault, of records without a column, and lines that only repeat.
PLACE = re.compile(r'(?:\bat|File) "?([^"\s]+\.py)"?(?:, line | \()(\d+)')
NO_COLUMN = re.compile(r"Field '(\w+)' was not found in record with fields \(([^)]*)\)")
UNDEFINED = re.compile(r"name '(\w+)' is not defined")
NO_FIELD = re.compile(r"no field of name (\w+)")  # of numpy
PLAIN = re.compile(r"\x1b\[[0-9;]*m")
REPEATED = re.compile(r"(Failed in|During|File|Rejected|-+$|- )")


def outside_fault(error: BaseException) -> str:
    """Text about an error in a module of another package; "" if only code of fvsolve and of libraries failed."""
    if type(error).__module__.partition(".")[0] == "numba":
        found = _compiled_place(str(error)) or _function_place(error.__traceback__, str(error))
    else:
        found = _traceback_place(error.__traceback__)
    if found is None:
        return ""
    source, file, line, frame = found
    return f"{source} failed at {file}, line {line}: {fault_text(error, frame)}\nCorrect it, or remove the package."


def _traceback_place(
    trace: TracebackType | None,
) -> tuple[str, str, int, FrameType | None] | None:
    """Source, file, line and frame of the last function of another package in a traceback; None if it has none."""
    found = None
    while trace is not None:
        frame = trace.tb_frame
        if source := source_of(frame.f_globals.get("__name__") or ""):
            found = source, frame.f_code.co_filename, trace.tb_lineno, frame
        trace = trace.tb_next
    return found


def _compiled_place(text: str) -> tuple[str, str, int, FrameType | None] | None:
    """Source, file and line of a function of another package that numba cannot compile; None for other functions."""
    for file, line in PLACE.findall(PLAIN.sub("", text)):
        path = os.path.abspath(file)
        for name, module in list(sys.modules.items()):
            own = getattr(module, "__file__", None)
            if own and os.path.abspath(own) == path and (source := source_of(name)):
                return source, path, int(line), None
    return None


def _function_place(
    trace: TracebackType | None, text: str
) -> tuple[str, str, int, FrameType | None] | None:
    """Source, file and line of the function of another package that was compiled last; None for other functions.

    Of an undefined name numba tells no place: the line is the first one of the function with this name.
    """
    found = None
    while trace is not None:
        own = getattr(trace.tb_frame.f_locals.get("self"), "py_func", None)
        if source := source_of(getattr(own, "__module__", "")):
            found = source, own
        trace = trace.tb_next
    if found is None:
        return None
    source, own = found
    lines, first = inspect.getsourcelines(own)
    name = UNDEFINED.search(text)
    pattern = re.compile(rf"\b{name[1]}\b") if name else None
    line = next((k for k, row in enumerate(lines) if pattern and pattern.search(row)), 0)
    return source, own.__code__.co_filename, first + line, None


def fault_text(error: BaseException, frame: FrameType | None) -> str:
    """Fault in one line; of an unknown column with the nearest names of columns."""
    text = PLAIN.sub("", str(error))
    if found := NO_COLUMN.search(text):
        return _unknown_column(found[1], re.findall(r"\w+", found[2]))
    if found := NO_FIELD.search(text):
        rows = frame.f_locals.values() if frame else ()
        columns = [name for row in rows for name in _columns(row)]
        return _unknown_column(found[1], columns)
    lines = [line.strip() for line in text.splitlines()]
    first = next((line for line in lines if line and not REPEATED.match(line)), text.strip())
    return f"{type(error).__name__}: {first}"


def _columns(row: object) -> tuple[str, ...]:
    return getattr(getattr(row, "dtype", None), "names", None) or ()


def _unknown_column(name: str, columns: list[str]) -> str:
    hint = did_you_mean(name, columns) or f"; expected one of {', '.join(columns)}"
    return f'unknown column "{name}"{hint}'

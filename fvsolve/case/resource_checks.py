"""Memory, disk space and step size that a case needs, checked before the model is built.

Sizes were measured: a pipe cell takes 0.36 kB in a model (names of states, arrays) and 0.16 kB in an explicit run.
"""

import math
import os
import re
from collections.abc import Iterator
from typing import Any

from fvsolve.core.steppers.loop_records import LEAST_STEP
from fvsolve.core.steppers.tableau import METHODS
from fvsolve.units import show

LONGEST_NAME = 60  # letters; names are parts of file names, which may have 255 bytes
CELL, IMPLICIT_CELL, BASIN_CELL = 500, 3000, 600  # memory of a cell [B]
NUMBER = 8  # memory of a number of a row [B]; rows are copied once
TEXT, LEAST_TEXT = 18, 4  # size of a number in history.csv, usual and smallest [B]
ALWAYS_FREE = 1e7  # memory that every machine has [B]
FRAME_CELL = 60  # size of a cell of a frame on disk [B]


def find_faults(
    numerics: Any, output: Any, links: dict[str, Any], meshes: dict[str, Any]
) -> Iterator[tuple[tuple, str]]:
    """Faults (key path, message) of cells or rows that need too much memory, and of too short output intervals.

    An output interval must exceed the rounding of the time. meshes : meshes of basins
    """
    pipes = {name: link for name, link in links.items() if link.kind == "pipe"}
    method, span = METHODS.get(numerics.method), numerics.end - numerics.start
    implicit = method is None or not method.explicit
    cells = sum(pipe.cells or 0 for pipe in pipes.values())
    memory = (
        cells * (IMPLICIT_CELL if implicit else CELL)
        + sum(len(mesh.cells) for mesh in meshes.values()) * BASIN_CELL
    )
    if pipes and not fits(memory):
        worst = max(pipes, key=lambda name: pipes[name].cells or 0)
        text = f"{cells:.3g} cells take about {byte_text(memory)} of memory, and {byte_text(free_memory())} are free"
        text += "; expected fewer cells"
        yield ("links", worst, "cells"), text
    least = LEAST_STEP * max(abs(numerics.start), abs(numerics.end))
    if output.every is not None and not output.every > least:
        text = f"{output.every:g} s is below the rounding error of the time; expected more than {least:.2g} s"
        yield ("output", "every"), text
    elif output.every is not None and output.probes is not None and span > 0.0:
        rows, columns = span / output.every, 1 + len(output.probes)
        if not fits(2 * NUMBER * rows * columns):
            text = f"{output.every:g} s gives {rows:.3g} rows of {columns} numbers, about "
            size, free = byte_text(2 * NUMBER * rows * columns), byte_text(free_memory())
            text += f"{size} to read back, and {free} of memory are free"
            yield ("output", "every"), f"{text}; expected a longer interval or fewer probes"


def rounding_faults(numerics: Any, crossing: float) -> Iterator[tuple[tuple, str]]:
    """Yield a fault if the steps of a Courant number are below the rounding of the time.

    crossing : shortest travel time of a wave through a cell [s]
    """
    least = LEAST_STEP * max(abs(numerics.start), abs(numerics.end))
    if numerics.courant is not None and not numerics.courant * crossing > least:
        text = f"{numerics.courant:g} gives steps of {numerics.courant * crossing:.2g} s"
        text += ", below the rounding error of the time"
        yield ("numerics", "courant"), f"{text}; expected more than {least / crossing:.2g}"


def name_faults(name: str) -> Iterator[str]:
    """Texts of the faults of a name in the case: invalid characters, or too many letters for the name of a file."""
    if not re.fullmatch(r"[\w-]+", name):
        yield f"{show(name)} is not a valid name; a name has only letters, digits, _ and -"
    if len(name) > LONGEST_NAME:
        yield f"has {len(name)} letters; expected at most {LONGEST_NAME}"


def disk_size(case: Any, text: int = TEXT, frame_cell: int = FRAME_CELL) -> float:
    """Estimated size of history.csv and the frames [B]; text, frame_cell : bytes per number and per cell of a frame."""
    numerics, output = case.numerics, case.output
    cells = sum(link.cells for link in case.links.values() if link.kind == "pipe")
    cells += sum(len(mesh.cells) for mesh in case.meshes.values())
    rows = (numerics.end - numerics.start) / output.every
    return text * rows * (1 + len(case.probes)) + frame_cell * output.fields * cells


def byte_text(count: float) -> str:
    """Text of a number of bytes, with a decimal prefix."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000.0:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} TB"


def fits(count: float) -> bool:
    """True if `count` bytes of memory are free; small counts are accepted without a query."""
    return count <= ALWAYS_FREE or count <= free_memory()


def free_memory() -> float:
    """Available memory [B]; the total memory if the system does not report it, inf if it reports neither."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            entries = dict(line.split(":", 1) for line in file)
        return 1024.0 * int(entries["MemAvailable"].split()[0])
    except (OSError, KeyError, ValueError):
        pass
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return math.inf

"""What a case will take, before anything is built: memory, rows, frames, steps. Knows counts; runs nothing.

Bytes are measured: a pipe cell takes 0.36 kB in a model (names of states, tables) and 0.16 kB in an explicit run.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import Any

from fvsolve.parts import Pipe
from fvsolve.steppers.methods import METHODS
from fvsolve.steppers.tolerances import LEAST_STEP

LONGEST_NAME = 60  # letters, as names are parts of file names, of which systems take 255 bytes
CELL, IMPLICIT_CELL, BASIN_CELL = 500, 3000, 600  # of memory [B]
NUMBER = 8  # of a row in memory [B], which is copied once
TEXT, LEAST_TEXT = 18, 4  # of a number in history.csv, usual and at least [B]
LITTLE = 1e7  # B that any machine has
FRAME_CELL = 60  # of a frame on disk [B]


def misfits(numerics: Any, output: Any, links: dict[str, Any], meshes: dict[str, Any]) -> Iterator[tuple[tuple, str]]:
    """Faults of counts that cannot fit and of steps that cannot advance."""
    pipes = {name: link for name, link in links.items() if isinstance(link, Pipe)}
    method, span = METHODS.get(numerics.method), numerics.end - numerics.start
    implicit = method is None or not method.explicit
    cells = sum(pipe.cells or 0 for pipe in pipes.values())
    memory = cells * (IMPLICIT_CELL if implicit else CELL) + sum(len(one.cells) for one in meshes.values()) * BASIN_CELL
    if pipes and not fits(memory):
        worst = max(pipes, key=lambda name: pipes[name].cells or 0)
        said = (
            f"{cells:.3g} cells take about {size(memory)} of memory, and {size(free_memory())} are free; wanted fewer"
        )
        yield ("links", worst, "cells"), said
    least = LEAST_STEP * max(abs(numerics.start), abs(numerics.end))
    if output.every is not None and not output.every > least:
        yield ("output", "every"), f"{output.every:g} s would not move the time; wanted more than {least:.2g} s"
    elif output.every is not None and output.probes is not None and span > 0.0:
        rows, columns = span / output.every, 1 + len(output.probes)
        if not fits(2 * NUMBER * rows * columns):
            said = f"{output.every:g} s makes {rows:.3g} rows of {columns} numbers, about "
            said += f"{size(2 * NUMBER * rows * columns)} to read back, and {size(free_memory())} of memory are free"
            yield ("output", "every"), f"{said}; wanted a longer one or fewer probes"


def standstill(numerics: Any, crossing: float) -> Iterator[tuple[tuple, str]]:
    """The fault of a Courant number whose steps do not move the time; crossing : of the quickest cell [s]."""
    least = LEAST_STEP * max(abs(numerics.start), abs(numerics.end))
    if numerics.courant is not None and not numerics.courant * crossing > least:
        said = f"{numerics.courant:g} makes steps of {numerics.courant * crossing:.2g} s, which would not move the time"
        yield ("numerics", "courant"), f"{said}; wanted more than {least / crossing:.2g}"


def on_disk(case: Any, text: int = TEXT, frame_cell: int = FRAME_CELL) -> float:
    """What history.csv and the frames will take, estimated [B]."""
    numerics, output = case.numerics, case.output
    cells = sum(link.cells for link in case.links.values() if isinstance(link, Pipe))
    cells += sum(len(mesh.cells) for mesh in case.meshes.values())
    rows = (numerics.end - numerics.start) / output.every
    return text * rows * (1 + len(case.probes)) + frame_cell * output.fields * cells


def size(count: float) -> str:
    """Bytes as people say them."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000.0:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} TB"


def fits(wanted: float) -> bool:
    """Whether so many bytes can be had; of few the system is not asked."""
    return wanted <= LITTLE or wanted <= free_memory()


def free_memory() -> float:
    """Memory that can still be had [B], as far as the system tells; inf where it does not."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:
            told = dict(line.split(":", 1) for line in file)
        return 1024.0 * int(told["MemAvailable"].split()[0])
    except (OSError, KeyError, ValueError):
        pass
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (AttributeError, ValueError, OSError):
        return math.inf

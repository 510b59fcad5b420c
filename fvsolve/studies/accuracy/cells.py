"""What of a case has cells, pipes and basins: how many, how large, how quickly waves cross them. Runs nothing."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from fvsolve.errors import CaseError, FvsolveError, listing
from fvsolve.model.delay import followed
from fvsolve.parts import Basin, Pipe
from fvsolve.schemes import SCHEMES
from fvsolve.studies.accuracy.plane import contents
from fvsolve.studies.lines import lines
from fvsolve.studies.outcome import prepared

Counts = dict[str, tuple[int, ...]]  # dotted key -> numbers of cells: one of a pipe, two of a basin
PLANE_ORDER = 2  # of `muscl`, which stands for all schemes that a basin has not
JUMP = 0.75  # share of the greatest step between neighbours at the start that is still there on half the cells


def pipes(case) -> dict[str, Pipe]:
    """The pipes of a case, by name."""
    return {name: link for name, link in case.links.items() if isinstance(link, Pipe)}


def in_cells(case) -> dict[str, Pipe]:
    """Those of them that have cells, and so are no delay lines."""
    delayed = lines(case)
    return {name: pipe for name, pipe in pipes(case).items() if name not in delayed}


def basins(case) -> dict[str, Basin]:
    """The basins of a case that have cells, by name."""
    return {name: case.nodes[name] for name in case.meshes}


def counts(case) -> Counts:
    """Numbers of cells that refine a case: of pipes that are no delay lines, and of basins that are rectangles."""
    found: Counts = {f"links.{name}.cells": (pipe.cells,) for name, pipe in in_cells(case).items()}
    return found | {f"nodes.{name}.cells": basin.cells for name, basin in basins(case).items() if basin.cells}


def from_files(case) -> list[str]:
    """Basins whose cells a file has, so that nothing refines them."""
    return [name for name, basin in basins(case).items() if basin.cells is None]


def keys(found: Counts) -> dict[str, Any]:
    """Numbers of cells as keys of a case."""
    return {key: list(numbers) if len(numbers) > 1 else numbers[0] for key, numbers in found.items()}


def scaled(found: Counts, factor: float) -> Counts:
    """So many times the cells along every side, one at least."""
    return {key: tuple(max(1, round(n * factor)) for n in numbers) for key, numbers in found.items()}


def total(case, found: Counts) -> int:
    """Cells of all pipes and basins."""
    fixed = sum(case.meshes[name].area.size for name in from_files(case))
    return fixed + sum(held(case, key, numbers) for key, numbers in found.items())


def held(case, key: str, numbers: tuple[int, ...]) -> int:
    """Cells of one part; holes of a rectangle hold none."""
    room = key.split(".")[0]
    if room == "links":
        return numbers[0]
    name = key.split(".")[1]
    own = case.nodes[name].cells
    return round(case.meshes[name].area.size * math.prod(numbers) / math.prod(own))


def most(found: Counts) -> int:
    """Cells along the side that has most."""
    return max(max(numbers) for numbers in found.values())


def size(case, key: str, numbers: tuple[int, ...]) -> float:
    """Size of the cells of a part [m], of rectangles their longer side on average."""
    room, name, _ = key.split(".")
    lengths = (case.links[name].length,) if room == "links" else case.nodes[name].size
    return max(length / n for length, n in zip(lengths, numbers, strict=True))


def loads(case, found: Counts) -> bool:
    """Whether a case can be said with so many cells: patches and holes begin and end between cells."""
    from fvsolve.case import load

    try:
        load(case, keys(found))
    except CaseError:
        return False
    return True


def greatest_rate(case, found: Mapping[str, tuple[int, ...]]) -> float:
    """Cells that the quickest wave crosses in a second [1/s], in basins as they count them and at the start."""
    rates = [case.wave_speed(name) * found[f"links.{name}.cells"][0] / pipe.length
             for name, pipe in in_cells(case).items()]  # fmt: skip
    rates += [one.rate for one in followed(case).values() if one.line == "delay"]
    if basins(case):
        own = {key: numbers for key, numbers in counts(case).items() if key.startswith("nodes.")}
        finer = max((max(found[key]) / max(numbers) for key, numbers in own.items()), default=1.0)
        rates.append(finer * prepared(case).wave_rate)
    return max(rates)


def space_order(case) -> int:
    """Order of the scheme in all that has cells, where all is smooth."""
    one = SCHEMES[case.numerics.scheme]
    return min([one.order, *(one.on(bool(basin.cells) and not basin.holes).order for basin in basins(case).values())])


def order_varies(case) -> bool:
    """Whether that is an upper bound: water in the plane comes down to second order, along one axis it does not."""
    fifth = space_order(case) > PLANE_ORDER
    return fifth and any(basin.own.steep for basin in basins(case).values())


def starts_with_jump(case, coarse: Mapping, fine: Mapping) -> bool:
    """Whether a basin starts from a jump: neighbours lie as far apart on finer cells."""
    if not any(basin.start or getattr(basin, "scalars", {}) for basin in basins(case).values()):
        return False
    steps = [step_at_start(prepared(case, one)) for one in (coarse, fine)]
    return any(b > JUMP * a > 0.0 for a, b in zip(*steps, strict=True))


def step_at_start(model) -> list[float]:
    """Greatest step between neighbours at the start, of every quantity of every basin."""
    found = []
    for basin in model.basins:
        inner = basin.mesh.inner
        left, right = basin.mesh.left[:inner], basin.mesh.right[:inner]
        values = contents(basin, model.start).values()
        found += [float(np.max(np.abs(one[left] - one[right]), initial=0.0)) for one in values]
    return found


def refinable(case) -> Counts:
    """Numbers of cells that can be doubled; FvsolveError where there are none."""
    found = counts(case)
    if not found:
        files = from_files(case)
        what = (
            f"the mesh of {listing(files)} is a file, which nothing refines"
            if files
            else "this case has no pipe or basin and so no cells"
        )
        raise FvsolveError(f'{what}: refine "both" or "space" cannot be; wanted "time"')
    return found

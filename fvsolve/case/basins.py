"""What must hold of basins and between them and the rest of a case. Knows their sides; knows no network."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fvsolve.case.sections import Numerics
from fvsolve.parts import Basin
from fvsolve.steppers.methods import AUTO, METHODS
from fvsolve.units import show

Found = Iterator[tuple[tuple, str]]

WHOLE = 1e-6  # of a cell, by which the end of a stretch may lie beside an edge


def misfits(nodes: dict[str, Any], numerics: Numerics, fluid: Any) -> Found:
    """Faults of patches and dams, and of what basins do not go with yet."""
    found = {name: node for name, node in nodes.items() if isinstance(node, Basin)}
    method = METHODS.get(numerics.method or "")
    if found and (numerics.method == AUTO or (method is not None and not method.explicit)):
        yield ("numerics", "method"), f"{show(numerics.method)} is implicit; basins are stepped by explicit methods"
    if found and fluid is not None and fluid.law != "linear":
        what = f"{show(fluid.law)} does not go with basins, whose water has one density"
        yield ("fluid", "law"), f'{what}; wanted "linear"'
    for name, basin in found.items():
        yield from _patches(name, basin)
        if basin.dam is not None and basin.dam.x >= basin.size[0]:
            yield ("nodes", name, "dam", "x"), f"{basin.dam.x:g} m lies beyond the basin, 0 m to {basin.size[0]:g} m"


def _patches(name: str, basin: Basin) -> Found:
    """Faults of stretches that leave their side or cut a cell, and of cells that two patches share."""
    taken: dict[int, str] = {}
    for patch, one in basin.patches.items():
        axis = 1 if one.side in ("west", "east") else 0
        along, cell, key = basin.size[axis], basin.size[axis] / basin.cells[axis], ("nodes", name, "patches", patch)
        low, high = one.span or (0.0, along)
        said = f"{low:g} m to {high:g} m"
        if not low < high <= along * (1.0 + 1e-9):
            yield (*key, "span"), f"{said} is no stretch of the {one.side} side, 0 m to {along:g} m"
            continue
        first, last = round(low / cell), max(round(high / cell), round(low / cell) + 1)
        if max(abs(low / cell - first), abs(high / cell - last)) > WHOLE:
            near = f"{first * cell:.6g} m to {last * cell:.6g} m"
            yield (*key, "span"), f"{said} cuts cells of {cell:.6g} m; wanted whole ones, for example {near}"
            continue
        cells = basin.span_of(patch).tolist()
        other = next((taken[cell] for cell in cells if cell in taken), None)
        if other is not None:
            yield key, f"has cells of {other}; patches share none"
        taken |= dict.fromkeys(cells, patch)

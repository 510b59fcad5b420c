"""Basins with a wall on faces between cells, on a grid and on triangles."""

import numpy as np

from reference.basins import on_sides
from reference.meshes import boundary, triangles, write
from reference.scenes import scene

SIZE, CREST, C = (24.0, 6.0), 1.5, 0.577
ACROSS = [[12.05, 0.0], [12.05, 6.0]]  # the nearest grid line is x = 12
NUMERICS = {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.9}
METHODS = {
    "explicit": {},
    "implicit": {"method": "radau-iia-5", "courant": None, "rtol": 1e-6},
    "rosenbrock": {"method": "rodas-5p", "courant": None, "rtol": 1e-6},
}


def pool(
    line=ACROSS,
    patches=None,
    cells=(24, 6),
    end=60.0,
    numerics=None,
    probes=(),
    sections=None,
    **basin,
) -> dict:
    """Basin with a wall, open to patches in the west ("up") and in the east ("down")."""
    own = {
        "type": "basin",
        "size": list(SIZE),
        "cells": list(cells),
        "level": 1.0,
        "elevation": 0.0,
    }
    own["walls"] = {"levee": {"line": line, "crest": CREST}}
    sides = {"up": "west", "down": "east"}
    own["patches"] = {name: {"side": sides[name], **keys} for name, keys in (patches or {}).items()}
    given = {
        key: value for key, value in (NUMERICS | (numerics or {})).items() if value is not None
    }
    case = scene({"reach": own | basin}, {}, end, given, probes, end / 30)
    case["output"] |= {"sections": sections} if sections else {}
    return case


def on_triangles(case: dict, folder, spacing=1.0) -> dict:
    """The same case with triangles."""
    points, cells = triangles(SIZE, spacing)
    groups = on_sides(points, boundary(cells), SIZE, ["west", "east"])
    names = {"west": "up", "east": "down"}
    write(
        folder / "t.msh",
        points,
        cells.tolist(),
        {names[name]: ends for name, ends in groups.items()},
    )
    return with_mesh(case, folder / "t.msh")


def with_mesh(case: dict, path) -> dict:
    basin = {
        key: value for key, value in case["nodes"]["reach"].items() if key not in ("size", "cells")
    }
    patches = {
        name: {k: v for k, v in one.items() if k != "side"}
        for name, one in basin["patches"].items()
    }
    return case | {"nodes": {"reach": basin | {"mesh": {"file": str(path)}, "patches": patches}}}


def depth(model, state) -> np.ndarray:
    return model.meshed[0].depth + model.meshed[0].deviations(state.y)[0]


LINES = {
    "across": ACROSS,
    "oblique": [[9.0, 0.0], [15.0, 6.0]],
    "steep": [[10.5, 6.0], [13.5, 0.0]],
}


def dam(scheme: str, **more) -> dict:
    """A wave that overflows an oblique wall and drowns it."""
    start = {"level": "where(x < 6, 2.2, 1)", "v": 0.1}
    return pool(LINES["steep"], start=start, numerics={"scheme": scheme}, **{"end": 12.0} | more)

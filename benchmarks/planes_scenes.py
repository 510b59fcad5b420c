"""Basins of planes.py as cases for fvsolve."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from networks import WATER

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))
from reference.meshes import triangles, write_msh  # noqa: E402

SIZE = 10.0  # [m]
BED = "0.3*sin(x)*cos(y)"
HUMP = "exp(-((x - 5)**2 + (y - 5)**2))"
BASINS = {
    "advection": {
        "physics": "transport",
        "velocity": {"expression": "swirl", "size": SIZE},
        "scalars": {"dye": HUMP},
    },
    "free surface with bed": {"level": 1.0, "bed": BED, "start": {"level": f"1 + 0.2*{HUMP}"}},
    "liquid": {
        "physics": "liquid",
        "pressure": 1e6,
        "thickness": 1.0,
        "start": {"pressure": f"1e6 + 1e5*{HUMP}"},
    },
}


def scene(basin: dict, end: float, **numerics) -> dict:
    """Case of a single basin between walls, by default with muscl, van Leer's limiter and SSP-RK2."""
    used = {
        "end": end,
        "scheme": "muscl",
        "limiter": "van-leer",
        "method": "ssp-rk2",
        "courant": 0.9,
    } | numerics
    if used["scheme"] != "muscl":
        del used["limiter"]
    made = {
        "schema": 1,
        "title": "a basin",
        "fluid": dict(WATER),
        "nodes": {"pool": {"type": "basin"} | basin},
    }
    scalars = {"scalars": {"dye": {"unit": "mg/l"}}} if "scalars" in basin else {}
    return made | scalars | {"numerics": used, "output": {"fields": 0}}


def square(cells: int, size: float = SIZE) -> dict:
    """Keys of a grid of cells^2."""
    return {"size": [size, size], "cells": [cells, cells]}


def of_triangles(path: Path, cells: int) -> dict:
    """Keys of a mesh of about cells^2 triangles of this square; `lid` is its eastern side.

    The mesh file is written if it does not exist.
    """
    if not path.exists():
        east = {"lid": lambda x, y: np.abs(x - SIZE) < 1e-6}
        write_msh(path, *triangles((SIZE, SIZE), SIZE / cells * np.sqrt(4.0 / np.sqrt(3.0))), east)
    return {"mesh": {"file": str(path)}}

"""Frames of a run as meshes of PyVista in the units of a reader. Knows .vtu files; knows no camera."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.draw import water
from fvsolve.draw.scene import DrawnScene
from fvsolve.draw.sheet import span
from fvsolve.errors import did_you_mean, listing

TUBE = 0.008  # radius of a pipe as part of the picture's diagonal


def measured(scene: DrawnScene) -> tuple[tuple[float, float], np.ndarray, bool]:
    """Range of a field over all frames, their box float64[6], whether there is water; exits where no field is."""
    known, lows, highs, boxes, wet, field = {}, [], [], [], False, scene.quantity.name
    for file in (file for _, files in scene.frames for file in files):
        mesh = read(file, scene)
        known |= dict.fromkeys(name for name in mesh.cell_data if name not in ("pipe", "normal"))
        if field in mesh.cell_data:
            values = mesh[field]
            if "depth" in mesh.cell_data and field != "bed":
                values = values[mesh["depth"] > water.WET * scene.height.factor]  # all that is drawn
            lows.append(float(values.min(initial=math.inf)))
            highs.append(float(values.max(initial=-math.inf)))
        boxes.append(box(mesh))
        wet |= "depth" in mesh.cell_data
    if not lows:
        sys.exit(f"no field {field!r}{did_you_mean(field, known)}; fields are {listing(known)}")
    limits = span(min(lows), max(highs)) if min(lows) <= max(highs) else (0.0, 1.0)  # all dry
    return limits, np.array([(min if k % 2 == 0 else max)(one[k] for one in boxes) for k in range(6)]), wet


def read(file: str | Path, scene: DrawnScene) -> Any:
    """A frame's file with its lengths and its field in the reader's units; vectors by their magnitude."""
    import pyvista

    mesh, asked = pyvista.read(file), scene.quantity
    if Path(file).suffix == ".pvtu":  # whose pieces have points of their own where they meet
        mesh = mesh.clean()
    if asked.name in mesh.cell_data:
        values = np.asarray(mesh.cell_data[asked.name])
        asked.unit = asked.unit or unit_of(mesh, asked.name)
        size = np.linalg.norm(values, axis=1) if values.ndim == 2 else values
        mesh.cell_data[asked.name] = asked.factor * size + asked.shift
    if scene.length.factor != 1.0 or scene.height.factor != 1.0:
        mesh.points = scene.shown(mesh.points)
        for name in {"depth", "surface"} & set(mesh.cell_data) - {asked.name}:
            mesh.cell_data[name] = scene.height.factor * mesh.cell_data[name]
    return mesh


def unit_of(mesh: Any, field: str) -> str:
    """The unit that an array carries."""
    from vtkmodules.vtkCommonCore import vtkDataArray

    return mesh.GetCellData().GetArray(field).GetInformation().Get(vtkDataArray.UNITS_LABEL()) or "-"


def box(mesh: Any) -> list[float]:
    """How far a frame reaches, water included: x, y, z, least and greatest of each."""
    found = list(mesh.bounds)
    if "surface" in mesh.cell_data:
        found[5] = max(found[5], float((mesh["depth"] + mesh.points[:, 2].max() if "normal" in mesh.cell_data
                                        else mesh["surface"]).max()))  # fmt: skip
    return found


def tubes(mesh: Any, box) -> Any:
    """Lines as tubes."""
    reach = math.dist(box[::2], box[1::2])
    return mesh.extract_surface(algorithm=None).tube(radius=TUBE * max(reach, 1e-9))

"""Frames of a run as PyVista meshes, with lengths and the drawn field in output units."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from fvsolve.draw import water_surface
from fvsolve.draw.scene import DrawnScene
from fvsolve.draw.sheet import colour_range
from fvsolve.errors import did_you_mean, listing

TUBE_RADIUS = 0.008  # radius of a pipe as a fraction of the diagonal of the scene


def field_extent(scene: DrawnScene) -> tuple[tuple[float, float], np.ndarray, bool]:
    """Extent of all frames : (colour range (low, high), bounding box float64[6], True if a frame has depths of water).

    The colour range covers the values of the field in all frames, in basins only in wet cells; see `colour_range`.
    It is (0, 1) if all cells are dry. The bounding box is in output units: least and greatest x, then y, then z.
    The process exits with a message if no frame has the field, since the function runs in a process of its own.
    """
    known, lows, highs, boxes, wet, field = {}, [], [], [], False, scene.quantity.name
    for file in (file for _, files in scene.frames for file in files):
        mesh = read_frame(file, scene)
        known |= dict.fromkeys(name for name in mesh.cell_data if name not in ("pipe", "normal"))
        if field in mesh.cell_data:
            values = mesh[field]
            if "depth" in mesh.cell_data and field != "bed":
                values = values[
                    mesh["depth"] > water_surface.WET_DEPTH * scene.height.factor
                ]  # only wet cells are drawn
            lows.append(float(values.min(initial=math.inf)))
            highs.append(float(values.max(initial=-math.inf)))
        boxes.append(mesh_box(mesh))
        wet |= "depth" in mesh.cell_data
    if not lows:
        sys.exit(f"unknown field {field!r}{did_you_mean(field, known)}; fields are {listing(known)}")
    limits = colour_range(min(lows), max(highs)) if min(lows) <= max(highs) else (0.0, 1.0)  # all dry
    return limits, np.array([(min if k % 2 == 0 else max)(bounds[k] for bounds in boxes) for k in range(6)]), wet


def read_frame(file: str | Path, scene: DrawnScene) -> Any:
    """Read a frame, and convert its lengths and the drawn field to output units; a vector becomes its magnitude.

    If the quantity of the scene has no unit, its unit is set to that in the file.
    """
    import pyvista

    mesh, quantity = pyvista.read(file), scene.quantity
    if Path(file).suffix == ".pvtu":  # its pieces have duplicate points at common edges
        mesh = mesh.clean()
    if quantity.name in mesh.cell_data:
        values = np.asarray(mesh.cell_data[quantity.name])
        quantity.unit = quantity.unit or array_unit(mesh, quantity.name)
        size = np.linalg.norm(values, axis=1) if values.ndim == 2 else values
        mesh.cell_data[quantity.name] = quantity.factor * size + quantity.shift
    if scene.length.factor != 1.0 or scene.height.factor != 1.0:
        mesh.points = scene.shown(mesh.points)
        for name in {"depth", "surface"} & set(mesh.cell_data) - {quantity.name}:
            mesh.cell_data[name] = scene.height.factor * mesh.cell_data[name]
    return mesh


def array_unit(mesh: Any, field: str) -> str:
    """Unit that the file stores with the array of a field; "-" without a unit."""
    from vtkmodules.vtkCommonCore import vtkDataArray

    return mesh.GetCellData().GetArray(field).GetInformation().Get(vtkDataArray.UNITS_LABEL()) or "-"


def mesh_box(mesh: Any) -> list[float]:
    """Bounding box of a frame with its water : least and greatest x, least and greatest y, least and greatest z."""
    bounds = list(mesh.bounds)
    if "surface" in mesh.cell_data:
        bounds[5] = max(bounds[5], float((mesh["depth"] + mesh.points[:, 2].max() if "normal" in mesh.cell_data
                                        else mesh["surface"]).max()))  # fmt: skip
    return bounds


def tubes(mesh: Any, box) -> Any:
    """Tubes around the lines of a mesh, with a radius proportional to the diagonal of `box`.

    box : bounding box of the scene, as from `field_extent`
    """
    reach = math.dist(box[::2], box[1::2])
    return mesh.extract_surface(algorithm=None).tube(radius=TUBE_RADIUS * max(reach, 1e-9))

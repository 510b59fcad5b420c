"""Cases of a field with rain and a soil, on rectangles and on triangles."""

from reference.basins import on_sides
from reference.meshes import boundary, triangles, write
from reference.scenes import scene

MM_PER_HOUR = 1.0 / 3.6e6  # [m/s]
NUMERICS = {"scheme": "muscl", "method": "ssp-rk2", "courant": 0.9}
TOTALS = [
    f"field.{name}"
    for name in ("volume", "wet_area", "rain", "rained", "infiltration", "infiltrated")
]


def field(end, numerics=None, patches=None, every=None, **basin) -> dict:
    own = {
        "type": "basin",
        "size": [10.0, 10.0],
        "cells": [4, 4],
        "level": -1.0,
        "elevation": 0.0,
        **basin,
    }
    own |= {"patches": patches} if patches else {}
    given = {
        key: value for key, value in (NUMERICS | (numerics or {})).items() if value is not None
    }
    return scene({"field": own}, {}, end, given, TOTALS, every or end / 20)


CONDUCTIVITY, SUCTION, DEFICIT = 6.5 * MM_PER_HOUR, 0.1668, 0.34
GREEN_AMPT = {
    "model": "green-ampt",
    "conductivity": "6.5 mm/h",
    "suction": "166.8 mm",
    "deficit": DEFICIT,
}
HORTON = {"model": "horton", "initial": "60 mm/h", "final": "10 mm/h", "decay": "2 1/h"}
HILLS = "0.3*sin(1.7*x)*cos(2.3*y) + 0.04*x"
OPEN = {"out": {"side": "east", "boundary": "critical"}}


def on_triangles(case: dict, sides, folder) -> dict:
    """The same case with triangles."""
    basin = dict(case["nodes"]["field"])
    size = basin.pop("size")
    del basin["cells"]
    points, cells = triangles(size, 1.0)
    write(folder / "t.msh", points, cells.tolist(), on_sides(points, boundary(cells), size, sides))
    patches = {
        name: {key: value for key, value in patch.items() if key != "side"}
        for name, patch in basin["patches"].items()
    }
    patches = {side: patches["out"] for side in sides}
    return case | {
        "nodes": {"field": basin | {"mesh": {"file": str(folder / "t.msh")}, "patches": patches}}
    }

"""Layers of GIS files become the same parts as typed ones, in every format, reference system and order of features."""

from pathlib import Path

import numpy as np
import pytest
from reference.gis_layers import EAST, HOME, NORTH, write_layer

import fvsolve

pytest.importorskip("pyogrio.raw")
pytest.importorskip("rasterio")

FLUID = {"name": "Water", "law": "linear"}
SHAFTS = {
    "upper": (0.0, 0.0, 2.45),
    "lower": (60.0, 80.0, 1.2),
    "end": (120.0, 80.0, 0.5),
}
SEWER = {
    "collector": ("upper", "lower", 600, 2.5, 1.3),
    "main": ("lower", "end", 800, 1.3, 0.6),
}


def typed_sewer() -> dict:
    nodes = {
        name: {"type": "tank", "elevation": z, "area": 1.8, "level": 0.2, "height": 5.0}
        | {"position": [x, y]}
        for name, (x, y, z) in SHAFTS.items()
    }
    nodes["street"] = {"type": "inflow", "elevation": 2.5, "flow": 0.05, "position": [-60.0, 0.0]}
    nodes["river"] = {"type": "reservoir", "elevation": 0.0, "head": 0.6, "position": [180.0, 80.0]}
    links = {
        name: {"type": "conduit", "from": low, "to": high, "diameter": d * 1e-3, "cells": 10}
        | {"inverts": [first, last], "manning": 0.013, "length": 60.0 if name == "main" else 100.0}
        for name, (low, high, d, first, last) in SEWER.items()
    }
    pipe = {"type": "conduit", "manning": 0.013, "diameter": 0.6, "cells": 10, "length": 60.0}
    links["head"] = pipe | {"from": "street", "to": "upper", "inverts": [2.8, 2.5]}
    links["outfall"] = pipe | {"from": "end", "to": "river", "inverts": [0.6, 0.4]}
    numerics = {"end": 60.0, "scheme": "muscl", "method": "ssp-rk2", "courant": 0.9}
    probes = ["upper.level", "lower.level", "collector.flow", "main.depth@0.5"]
    return {
        "title": "sewer",
        "fluid": FLUID,
        "nodes": nodes,
        "links": links,
        "numerics": numerics,
        "output": {"every": 5.0, "probes": probes},
    }


def layered_sewer(folder: Path, suffix: str, crs: str, turn: bool = False) -> dict:
    """The same sewer, with shafts and conduits from files; turn : True for another order of the features"""
    case = typed_sewer()
    order = (lambda items: list(items)[::-1]) if turn else list
    shafts = [((x, y), {"ID": name, "SOHLE": z}) for name, (x, y, z) in SHAFTS.items()]
    conduits = [
        ([SHAFTS[low][:2], SHAFTS[high][:2]], {"ID": name, "DN": d, "ZU": first, "ZD": last})
        for name, (low, high, d, first, last) in SEWER.items()
    ]
    one_file = suffix == ".gpkg"
    files = [folder / f"{'sewer' if one_file else name}{suffix}" for name in ("shafts", "conduits")]
    write_layer(files[0], "Point", order(shafts), crs, "shafts" if one_file else None)
    write_layer(files[1], "LineString", order(conduits), crs, "conduits" if one_file else None)
    layers = {
        "conduits": {"file": str(files[1]), "becomes": "links", "name": "{ID}"},
        "shafts": {"file": str(files[0]), "becomes": "nodes", "name": "{ID}"},
    }
    if one_file:
        for name, layer in layers.items():
            layer["layer"] = name
    layers["shafts"]["keys"] = {"type": "tank", "elevation": "{SOHLE} m", "area": "1.8 m2"} | {
        "level": 0.2,
        "height": 5.0,
    }
    layers["conduits"]["keys"] = {"type": "conduit", "diameter": "{DN} mm", "cells": 10} | {
        "inverts": ["{ZU} m", "{ZD} m"],
        "manning": 0.013,
    }
    case["gis"] = {"crs": HOME, "origin": [EAST, NORTH], "layers": layers}
    for name in SHAFTS:
        del case["nodes"][name]
    for name in SEWER:
        del case["links"][name]
    return case


@pytest.mark.parametrize(
    ("suffix", "crs", "turn"),
    [
        (".geojson", "EPSG:4326", False),
        (".geojson", HOME, True),
        (".gpkg", HOME, False),
        (".gpkg", "EPSG:25832", True),
        (".shp", "EPSG:3857", False),
        (".shp", "EPSG:31468", True),
        (".fgb", "EPSG:4258", False),
    ],
)
def test_a_sewer_of_layers_runs_as_the_typed_sewer(tmp_path, suffix, crs, turn):
    """Formats, reference systems in metres and degrees, orders of features; inverts are attributes of conduits."""
    case = layered_sewer(tmp_path, suffix, crs, turn)
    found = fvsolve.load(case)
    for name, (x, y, z) in SHAFTS.items():
        assert found.nodes[name].elevation == z
        assert found.nodes[name].position == pytest.approx((x, y), abs=2e-3)
    for name, (low, high, *_) in SEWER.items():
        assert (found.links[name].from_, found.links[name].to) == (low, high)
    lengths = {"collector": 100.0, "main": 60.0}
    for name, length in lengths.items():
        assert found.links[name].length == pytest.approx(length, abs=2e-3)
    typed, layered = fvsolve.run(typed_sewer()), fvsolve.run(case)
    assert typed.ok and layered.ok
    for probe in typed_sewer()["output"]["probes"]:
        assert np.allclose(layered[probe], typed[probe], rtol=1e-4, atol=1e-6)

"""Layers of GIS files become the same parts as typed ones, in every format, reference system and order of features."""

from pathlib import Path

import numpy as np
import pytest
from reference.gis_layers import EAST, HOME, NORTH, write_layer

import fvsolve
from fvsolve.errors import CaseError

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


def ascii_grid(
    path: Path, ground, size=(10.0, 10.0), count=(60, 40), corner=(EAST - 50.0, NORTH - 50.0)
) -> Path:
    """Write an ESRI ASCII grid of a function of x and y relative to the origin, at the centres of pixels."""
    x = corner[0] - EAST + (np.arange(count[0]) + 0.5) * size[0]
    y = corner[1] - NORTH + (np.arange(count[1]) + 0.5) * size[1]
    rows = ground(*np.meshgrid(x, y))[::-1]
    head = f"ncols {count[0]}\nnrows {count[1]}\nxllcorner {corner[0]}\nyllcorner {corner[1]}\ncellsize {size[0]}\n"
    text = "\n".join(" ".join(f"{value:.12g}" for value in row) for row in rows)
    path.write_text(f"{head}NODATA_value -9999\n{text}\n")
    return path


def ground(x, y):
    return 50.0 + 0.05 * x + 0.02 * y


PIPE = {
    "type": "pipe",
    "diameter": "{DN} mm",
    "wave_speed": 1000.0,
    "friction": {"model": "steady", "factor": 0.02},
}


def network(tmp_path, **layer) -> dict:
    """Case of two pipes from a file, a source in the case and a hydrant from the file of nodes."""
    lines = [
        ([(0.0, 0.0), (60.0, 80.0), (160.0, 80.0)], {"ID": "a", "DN": 300}),
        ([(160.0, 80.0), (160.0, 180.0)], {"ID": "b", "DN": 200}),
    ]
    points = [((160.0, 180.0), {"ID": "hydrant", "Q": 20.0})]
    layers = {
        "pipes": {
            "file": str(write_layer(tmp_path / "pipes.shp", "LineString", lines)),
            "becomes": "links",
        }
        | {"name": "{ID}", "keys": PIPE, "heights": str(ascii_grid(tmp_path / "dem.asc", ground))}
        | {"offset": "-1.5 m", "junctions": "J"}
        | layer,
        "ends": {
            "file": str(write_layer(tmp_path / "ends.shp", "Point", points)),
            "becomes": "nodes",
        }
        | {"name": "{ID}", "heights": str(tmp_path / "dem.asc"), "offset": -1.5}
        | {"keys": {"type": "junction", "demand": "{Q} l/s"}},
    }
    source = {"type": "reservoir", "elevation": 48.5, "head": 80.0, "position": [0.0, 0.0]}
    return {
        "title": "network",
        "fluid": FLUID,
        "nodes": {"source": source},
        "gis": {"crs": HOME, "origin": [EAST, NORTH], "layers": layers},
        "numerics": {"end": 1.0},
        "output": {"probes": ["hydrant.head", "a.flow@1"]},
    }


def test_pipes_follow_the_ground_and_join_where_their_ends_lie_together(tmp_path):
    """Profiles are those of the raster less the cover; ends without a node become junctions."""
    case = fvsolve.load(network(tmp_path))
    assert set(case.nodes) == {"source", "hydrant", "J1"}
    assert (case.links["a"].from_, case.links["a"].to) == ("source", "J1")
    assert (case.links["b"].from_, case.links["b"].to) == ("J1", "hydrant")
    profile = case.links["a"].profile
    bend = np.hypot(100.0, 4.6)  # along the slope
    end = bend + np.hypot(100.0, 5.0)
    for x, y, distance in ((0.0, 0.0, 0.0), (60.0, 80.0, bend), (160.0, 80.0, end)):
        assert profile.at(distance) == pytest.approx(ground(x, y) - 1.5, abs=1e-6)
        assert profile.plan_at(distance)[0] == pytest.approx((x, y), abs=1e-5)
    assert case.links["a"].length == pytest.approx(end, rel=1e-9)
    assert case.elevations["hydrant"] == pytest.approx(ground(160.0, 180.0) - 1.5, abs=1e-9)
    found = fvsolve.run(case)
    assert found.ok
    assert found["a.flow@1"][0] == pytest.approx(0.02, rel=1e-9)


def test_ends_further_than_snap_are_a_fault_with_the_nearest_node(tmp_path):
    given = network(tmp_path)
    del given["gis"]["layers"]["pipes"]["junctions"]
    with pytest.raises(CaseError) as error:
        fvsolve.load(given)
    assert "no node lies within 0.1 m of the end `to` of pipes.shp, feature 0" in str(error.value)
    assert "the nearest is hydrant at 100 m" in str(error.value)
    given = network(tmp_path, snap=0.5)
    given["nodes"]["source"]["position"] = [0.3, -0.3]
    assert fvsolve.load(given).links["a"].from_ == "source"


def test_two_nodes_at_the_same_end_are_a_fault(tmp_path):
    """Networks of EPANET often have the inlet and the outlet of a pump at a single place."""
    given = network(tmp_path)
    given["nodes"]["inlet"] = given["nodes"]["source"] | {"type": "junction"}
    del given["nodes"]["inlet"]["head"]
    with pytest.raises(CaseError) as error:
        fvsolve.load(given)
    assert "inlet, source lie at the end `from` of pipes.shp, feature 0" in str(error.value)


def test_a_reversed_line_is_a_reversed_link(tmp_path):
    """The direction of a line is that of its link: the flow changes its sign, nothing else."""
    found = {}
    for turn in (False, True):
        folder = tmp_path / str(turn)
        folder.mkdir()
        given = network(folder)
        lines = [
            ([(0.0, 0.0), (60.0, 80.0), (160.0, 80.0)], {"ID": "a", "DN": 300}),
            ([(160.0, 80.0), (160.0, 180.0)], {"ID": "b", "DN": 200}),
        ]
        if turn:
            lines = [(points[::-1], row) for points, row in lines]
        path = write_layer(folder / "again.gpkg", "LineString", lines)
        given["gis"]["layers"]["pipes"]["file"] = str(path)
        given["output"]["probes"] = ["hydrant.head", "a.flow@0.5"]
        found[turn] = fvsolve.run(given)
    assert np.allclose(found[True]["hydrant.head"], found[False]["hydrant.head"], rtol=1e-9)
    assert np.allclose(found[True]["a.flow@0.5"], -found[False]["a.flow@0.5"], rtol=1e-9)


POOL = {
    "type": "basin",
    "elevation": 0.0,
    "size": [20.0, 10.0],
    "cells": [40, 20],
    "level": 1.0,
    "origin": [EAST, NORTH],
}


def pool(layers: dict, **keys) -> dict:
    return {
        "title": "pool",
        "fluid": {"name": "Water"},
        "nodes": {"pool": POOL | keys},
        "gis": {"layers": layers},
        "numerics": {"end": 0.5, "scheme": "muscl"},
    }


@pytest.mark.parametrize(
    ("suffix", "crs"), [(".geojson", "EPSG:4326"), (".gpkg", HOME), (".shp", "EPSG:25832")]
)
def test_walls_patches_gauges_and_sections_are_those_that_are_typed(tmp_path, suffix, crs):
    """Layers state a basin of a case with its system; names with blanks are joined by _."""
    layers = {
        "levees": (
            "LineString",
            "walls",
            [([(10.1, -5.0), (10.1, 15.0)], {"ID": "dyke A", "CREST": 3.2})],
        ),
        "pits": (
            "Polygon",
            "patches",
            [([[(2.0, 2.0), (4.0, 2.0), (3.0, 4.0), (2.0, 2.0)]], {"ID": "pit"})],
        ),
        "points": ("Point", "gauges", [((5.1, 5.1), {"ID": "g1"}), ((15.1, 5.1), {"ID": "g/2"})]),
        "lines": (
            "LineString",
            "sections",
            [([(15.1, -1.0), (14.1, 5.0), (15.1, 11.0)], {"ID": "s"})],
        ),
    }
    given = {}
    for name, (kind, becomes, features) in layers.items():
        path = write_layer(tmp_path / f"{name}{suffix}", kind, features, crs)
        given[name] = {"file": str(path), "becomes": becomes, "name": "{ID}"}
    given["levees"]["keys"] = {"crest": "{CREST} m", "coefficient": 0.5}
    typed = pool({}, crs=HOME)
    typed["nodes"]["pool"] |= {
        "walls": {
            "dyke_A": {"line": [[10.1, -5.0], [10.1, 15.0]], "crest": 3.2, "coefficient": 0.5}
        },
        "patches": {"pit": {"polygon": [[2.0, 2.0], [4.0, 2.0], [3.0, 4.0]]}},
    }
    typed["output"] = {
        "gauges": {
            name: {"basin": "pool", "at": [x, 5.1]} for name, x in (("g1", 5.1), ("g_2", 15.1))
        },
        "sections": {"s": {"basin": "pool", "line": [[15.1, -1.0], [14.1, 5.0], [15.1, 11.0]]}},
    }
    first, second = fvsolve.load(pool(given, crs=HOME)), fvsolve.load(typed)
    for case in (first, second):
        fvsolve.build(case)
    mesh = first.meshes["pool"]
    for wall in ("dyke_A",):
        chains = [case.nodes["pool"].walls[wall].chain(mesh).faces for case in (first, second)]
        assert (chains[0] == chains[1]).all() and chains[0].size == 20
    assert (mesh.interior["pit"] == second.meshes["pool"].interior["pit"]).all()
    for name, gauge in second.output.gauges.items():
        assert first.output.gauges[name].at == pytest.approx(gauge.at, abs=1e-6)
    chains = [case.output.sections["s"].chain(mesh).faces for case in (first, second)]
    assert (chains[0] == chains[1]).all() and chains[0].size > 20


@pytest.mark.parametrize("source", ["raster", "shape"])
def test_crests_of_walls_follow_the_ground_or_the_heights_of_the_line(tmp_path, source):
    """Crests of segments are those of the ground at their middles; together they are the wall of the whole line."""
    crest = lambda x: 2.0 + 0.1 * x  # noqa: E731
    line = [(0.0, 5.1), (10.0, 5.1), (20.0, 5.1)]
    if source == "shape":
        line = [(x, y, crest(x)) for x, y in line]
        heights = "shape"
    else:
        heights = str(
            ascii_grid(tmp_path / "dem.asc", lambda x, y: crest(x), (1.0, 1.0), (120, 120))
        )
    path = write_layer(tmp_path / "levee.gpkg", "LineString", [(line, {"ID": "levee"})])
    layer = {
        "file": str(path),
        "becomes": "walls",
        "name": "{ID}",
        "heights": heights,
        "offset": "0.2 m",
    }
    case = fvsolve.load(pool({"levees": layer | {"spacing": "2.5 m"}}, crs=HOME))
    mesh, walls = case.meshes["pool"], case.nodes["pool"].walls
    assert len(walls) == 8
    faces = np.concatenate([wall.chain(mesh).faces for wall in walls.values()])
    assert np.unique(faces).size == faces.size == 40
    for wall in walls.values():
        middle = np.mean([x for x, _ in wall.line])
        assert wall.crest.first == pytest.approx(crest(middle) + 0.2, abs=1e-9)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"file": "pipe.shp"}, 'gis.layers.pipes.file: "pipe.shp": there is no such file'),
        ({"becomes": "pipes"}, "gis.layers.pipes.becomes"),
        ({"becomes": "gauges"}, "heights"),
        ({"name": "{id}"}, 'has no attribute "id"; did you mean "ID"?'),
        ({"name": "x"}, 'features 0 and 1 of pipes.shp are both named "x"'),
        ({"where": {"ID": "z"}}, "no feature of pipes.shp fulfils it"),
        ({"where": {"IDD": "a"}}, 'has no attribute "IDD"; did you mean "ID"?'),
        ({"keys": PIPE | {"diameter": "{dn} mm"}}, 'has no attribute "dn"; did you mean "DN"?'),
        ({"keys": PIPE | {"diameter": "{ID} mm"}}, "links.a.diameter"),
        ({"heights": "shape"}, "has no z"),
        ({"layer": "pipe"}, 'has no layer "pipe"; did you mean "pipes"?'),
        ({"keyz": 1}, "unknown key"),
        ({"crs": "UTM33"}, "is not a coordinate reference system"),
        ({"crs": "EPSG:4326"}, "is in degrees (EPSG:4326), but has coordinates such as"),
    ],
)
def test_faults_of_layers_state_place_and_remedy(tmp_path, change, text):
    with pytest.raises(CaseError) as error:
        fvsolve.load(network(tmp_path, **change))
    assert text in str(error.value)


def test_conditions_choose_features(tmp_path):
    given = network(tmp_path, where={"DN": [200, 100]})
    given["nodes"]["source"]["position"] = [160.0, 80.0]
    given["nodes"]["source"]["elevation"] = float(ground(160.0, 80.0)) - 1.5
    given["output"]["probes"] = ["hydrant.head"]
    assert set(fvsolve.load(given).links) == {"b"}


def test_systems_of_basin_and_case_have_to_agree(tmp_path):
    path = write_layer(tmp_path / "points.gpkg", "Point", [((5.0, 5.0), {"ID": "g"})])
    layer = {"points": {"file": str(path), "becomes": "gauges"}}
    given = pool(layer, crs="EPSG:25832")
    given["gis"]["crs"] = HOME
    with pytest.raises(CaseError, match='"EPSG:25832" is not the system of the case, EPSG:25833'):
        fvsolve.load(given)
    given = pool(layer)
    case = fvsolve.load(given)
    assert case.nodes["pool"].crs == HOME  # that of the file
    assert case.output.gauges["points-1"].at == pytest.approx((5.0, 5.0), abs=1e-9)


def test_overrides_and_lines_of_messages_know_parts_of_layers(tmp_path):
    """`--set` changes a part of a layer, or a key of the layer itself; a fault has the line of the layer."""
    network(tmp_path)
    text = f"""schema = 1
title = "network"
[fluid]
name = "Water"
[nodes.source]
type = "reservoir"
elevation = 48.5
head = 80
position = [0, 0]
[gis]
crs = "{HOME}"
origin = [{EAST}, {NORTH}]
[gis.layers.pipes]
file = "pipes.shp"
becomes = "links"
name = "{{ID}}"
keys = {{ type = "pipe", diameter = "{{DN}} mm", wave_speed = 1000, friction = {{ model = "steady", factor = 0.02 }} }}
heights = "dem.asc"
offset = -1.5
junctions = "J"
[numerics]
end = 1.0
"""
    path = tmp_path / "case.toml"
    path.write_text(text)
    case = fvsolve.load(path, set={"links.a.diameter": 0.4, "gis.layers.pipes.offset": -1.6})
    assert case.links["a"].diameter == 0.4 and case.links["b"].diameter == 0.2
    assert case.elevations["J1"] == pytest.approx(ground(160.0, 80.0) - 1.6, abs=1e-9)
    path.write_text(text.replace("{DN} mm", "{DN} kg"))
    with pytest.raises(CaseError) as error:
        fvsolve.load(path)
    assert "line 13" in str(error.value) and "links.a.diameter" in str(error.value)
    again = fvsolve.load(case, set={"links.b.diameter": 0.25})
    assert again.links["b"].diameter == 0.25


def test_a_resumed_or_resolved_case_needs_no_files_of_layers(tmp_path):
    given = network(tmp_path)
    assert fvsolve.run(given, out=tmp_path / "run", pictures=False).ok
    for path in tmp_path.glob("pipes.*"):
        path.unlink()
    again = fvsolve.load(tmp_path / "run" / "case.toml")
    assert set(again.links) == {"a", "b"} and again.declared["gis"].crs == HOME

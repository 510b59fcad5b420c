"""GeoPackages of results have each part at its place in the reference system, with the extremes of the run."""

import numpy as np
import pytest
import pyvista
from reference.gis_layers import EAST, HOME, NORTH

import fvsolve
from fvsolve.errors import RunError
from fvsolve.parts.vector_files import read_features
from fvsolve.report.maps.network_figure import network_figure
from fvsolve.report.maps.network_map import network_map
from fvsolve.report.maps.result_layers import column_name, write_layers

pytest.importorskip("pyogrio.raw")
pytest.importorskip("rasterio")

MAIN = {
    "title": "main",
    "fluid": {"name": "Water", "law": "linear"},
    "nodes": {
        "lake": {"type": "reservoir", "elevation": 90.0, "head": 100.0, "position": [0.0, 0.0]},
        "gate": {"type": "junction", "elevation": 20.0, "position": [600.0, 800.0]},
        "sea": {"type": "reservoir", "elevation": 20.0, "head": 20.0, "position": [600.0, 900.0]},
    },
    "links": {
        "main": {"type": "pipe", "from": "lake", "to": "gate", "length": 1005.0, "diameter": 0.4}
        | {"wave_speed": 1000.0, "friction": {"model": "steady", "factor": 0.02}, "cells": 20},
        "valve": {"type": "valve", "from": "gate", "to": "sea", "area": 1e-3}
        | {"opening": {"time": [0.5, 0.6], "value": [1.0, 0.0]}},
    },
    "gis": {"crs": HOME, "origin": [EAST, NORTH]},
    "numerics": {"end": 4.0},
    "output": {
        "probes": ["gate.head", "main.flow@0", "main.flow@1"],
        "units": {"pressure": "barg"},
    },
}
STREET = {
    "title": "street",
    "fluid": {"name": "Water", "law": "linear"},
    "nodes": {
        "street": {"type": "basin", "elevation": 0.0, "size": [20.0, 10.0], "cells": [20, 10]}
        | {"level": 0.3, "origin": [EAST, NORTH], "crs": HOME}
        | {"walls": {"kerb": {"line": [[10.0, 0.0], [10.0, 10.0]], "crest": 0.5}}}
        | {"patches": {"gully": {"at": [15.5, 5.5], "area": 1.0}}},
        "shaft": {"type": "tank", "elevation": -2.0, "area": 1.0, "level": 0.5},
    },
    "links": {
        "lid": {"type": "manhole", "from": "street.gully", "to": "shaft", "crest": 0.0}
        | {"area": 0.3, "perimeter": 2.0}
    },
    "numerics": {"end": 2.0, "scheme": "muscl"},
    "output": {
        "probes": ["shaft.level", "street.depth@g", "s.flow"],
        "gauges": {"g": {"basin": "street", "at": [12.5, 2.5]}},
        "sections": {"s": {"basin": "street", "line": [[14.0, 0.0], [14.0, 10.0]]}},
    },
}


def rows(path, layer):
    found = read_features(path, layer)
    assert found.crs == HOME
    return {
        row.get("name") or k: (shape, row)
        for k, (shape, row) in enumerate(zip(found.shapes, found.attributes, strict=True))
    }


def test_a_network_has_its_nodes_links_and_pieces_with_extremes(tmp_path):
    result = fvsolve.run(MAIN, out=tmp_path / "run", pictures=False)
    path = write_layers(result, tmp_path / "run.gpkg")
    nodes, links = rows(path, "nodes"), rows(path, "links")
    assert nodes.keys() == {"lake", "gate", "sea"} and links.keys() == {"main"}
    shape, values = nodes["gate"]
    assert shape.pieces[0][0, :2] == pytest.approx((EAST + 600.0, NORTH + 800.0), abs=1e-6)
    head = result.summary["extremes"]["gate.head"]
    assert values["max_head_m"] == head["maximum"] and values["min_head_m"] == head["minimum"]
    assert values["elevation_m"] == 20 and values["type"] == "junction"
    shape, values = links["main"]
    assert shape.pieces[0][-1, :2] == pytest.approx((EAST + 600.0, NORTH + 800.0), abs=1e-6)
    flows = [result.summary["extremes"][f"main.flow@{x}"]["maximum"] for x in (0, 1)]
    assert values["max_flow_m3_s"] == max(flows) and values["diameter_m"] == 0.4
    assert values["max_pressure_barg"] == result.envelope["main"]["max_pressure"].max()
    pieces = rows(path, "pipe_pieces")
    greatest = [row["greatest_pressure_barg"] for _, row in pieces.values()]
    assert max(greatest) == pytest.approx(values["max_pressure_barg"], rel=1e-9)


def test_frames_and_plans_of_a_network_state_its_reference_system(tmp_path):
    result = fvsolve.run(MAIN, out=tmp_path / "run", pictures=False)
    frame = pyvista.read(sorted((tmp_path / "run" / "fields").glob("*.vtu"))[0])
    assert frame.field_data["epsg"].tolist() == [25833]
    assert frame.field_data["origin"].tolist() == [EAST, NORTH]
    plan = network_map(result)
    assert plan.crs == HOME and plan.nodes["gate"].tolist() == [EAST + 600.0, NORTH + 800.0]
    figure = network_figure(plan, result.case)
    assert figure["layout"]["xaxis"]["title"]["text"] == f"easting ({HOME}) [m]"


def test_a_basin_has_its_gauges_sections_walls_and_shafts(tmp_path):
    result = fvsolve.run(STREET, out=tmp_path / "run", pictures=False)
    path = write_layers(result, tmp_path / "run.gpkg")
    shape, values = rows(path, "gauges")["g"]
    assert shape.pieces[0][0, :2] == pytest.approx((EAST + 12.5, NORTH + 2.5), abs=1e-6)
    depth = result.summary["extremes"]["street.depth@g"]
    assert values["max_depth_m"] == depth["maximum"]
    shape, values = rows(path, "sections")["s"]
    assert values["max_flow_m3_s"] == result.summary["extremes"]["s.flow"]["maximum"]
    assert np.allclose(shape.pieces[0][:, 0], EAST + 14.0)
    assert np.allclose(rows(path, "walls")["street.kerb"][0].pieces[0][:, 0], EAST + 10.0)
    shape, values = rows(path, "nodes")["shaft"]
    assert shape.pieces[0][0, :2] == pytest.approx((EAST + 15.5, NORTH + 5.5), abs=1e-6)
    assert values["max_level_m"] == result.summary["extremes"]["shaft.level"]["maximum"]


def test_layers_of_results_are_layers_of_a_case(tmp_path):
    """What one run writes another case reads: the walls, and the gauges, at the same faces and cells."""
    result = fvsolve.run(STREET, out=tmp_path / "run", pictures=False)
    path = write_layers(result, tmp_path / "run.gpkg")
    basin = {key: value for key, value in STREET["nodes"]["street"].items() if key != "walls"}
    gauges = {"file": str(path), "layer": "gauges", "becomes": "gauges", "name": "{name}"}
    case = fvsolve.load(
        STREET
        | {"nodes": STREET["nodes"] | {"street": basin}, "gis": {"layers": {"points": gauges}}}
        | {"output": {"probes": ["street.depth@g"]}}
    )
    assert case.output.gauges["g"].at == pytest.approx((12.5, 2.5), abs=1e-6)


def test_a_run_without_places_is_refused(tmp_path):
    case = MAIN | {"nodes": {name: dict(node) for name, node in MAIN["nodes"].items()}}
    for node in case["nodes"].values():
        del node["position"]
    result = fvsolve.run(case, out=tmp_path / "run", pictures=False)
    with pytest.raises(RunError, match="no part of the case has a place"):
        write_layers(result, tmp_path / "run.gpkg")


def test_the_command_report_writes_the_layers_next_to_its_page(tmp_path, fvs):
    fvsolve.run(MAIN, out=tmp_path / "run", pictures=False)
    code, printed, _ = fvs("report", tmp_path / "run", "--gpkg")
    assert code == 0 and "report.gpkg" in printed and (tmp_path / "run" / "report.gpkg").is_file()


@pytest.mark.parametrize(
    ("name", "unit", "expected"),
    [
        ("max_flow", "m3/s", "max_flow_m3_s"),
        (
            "utilisation of the allowable pressure",
            "%",
            "utilisation_of_the_allowable_pressure_percent",
        ),
        ("max_filling", "-", "max_filling"),
    ],
)
def test_names_of_columns_have_units_in_letters(name, unit, expected):
    assert column_name(name, unit) == expected

"""Roughness, soils, beds and holes by polygons of GIS files, against exact areas and typed values."""

import json

import numpy as np
import pytest
from reference.gis_layers import EAST, HOME, NORTH, write_layer

import fvsolve
from fvsolve.case.interior_patches import in_polygon
from fvsolve.errors import CaseError
from fvsolve.parts.polygon_values import owners
from fvsolve.parts.vector_files import read_features

pytest.importorskip("pyogrio.raw")
pytest.importorskip("rasterio")


def square(west, south, east, north):
    return [[(west, south), (east, south), (east, north), (west, north), (west, south)]]


def pool(**keys) -> dict:
    basin = {"type": "basin", "elevation": 0.0, "size": [20.0, 10.0], "cells": [20, 10]} | {
        "level": 1.0,
        "origin": [EAST, NORTH],
        "crs": HOME,
    }
    return {
        "title": "polygons",
        "fluid": {"name": "Water"},
        "nodes": {"pool": basin | keys},
        "numerics": {"end": 1.0, "scheme": "muscl"},
    }


@pytest.mark.parametrize(
    ("suffix", "crs"), [(".geojson", "EPSG:4326"), (".gpkg", HOME), (".shp", "EPSG:25832")]
)
def test_roughness_by_classes_of_land_use(tmp_path, suffix, crs):
    """Means over cells are those of the areas, in each format and reference system; the last polygon counts."""
    features = [
        (square(-1.0, -1.0, 10.5, 11.0), {"USE": "meadow"}),
        (square(4.0, 2.0, 6.0, 4.0), {"USE": "road"}),
    ]
    path = write_layer(tmp_path / f"use{suffix}", "Polygon", features, crs)
    given = {"polygons": str(path), "value": "{USE}", "classes": {"meadow": 0.05, "road": 0.015}}
    case = fvsolve.load(pool(manning=given | {"outside": 0.03}))
    found = case.nodes["pool"].manning.rule.over(case.meshes["pool"]).reshape(10, 20)
    expected = np.full((10, 20), 0.03)
    expected[:, :10] = 0.05
    expected[:, 10] = 0.04
    expected[2:4, 4:6] = 0.015
    assert np.allclose(found, expected, rtol=0.0, atol=1e-15)


def test_means_of_a_slanted_polygon_are_its_areas(tmp_path):
    """A triangle covers cells in part; 16 points find the share of a cell to 1/16, and its area to 1 %."""
    ring = [[(0.0, 0.0), (17.0, 3.0), (5.0, 9.0), (0.0, 0.0)]]
    path = write_layer(tmp_path / "a.gpkg", "Polygon", [(ring, {"N": 0.08})])
    case = fvsolve.load(pool(manning={"polygons": str(path), "value": "{N}", "outside": 0.0}))
    found = case.nodes["pool"].manning.rule.over(case.meshes["pool"])
    area = 0.5 * abs(17.0 * 9.0 - 5.0 * 3.0)
    assert found.sum() / 0.08 == pytest.approx(area, rel=1e-2)
    assert found.min() == 0.0 and found.max() == 0.08


def test_buildings_are_holes_or_raise_the_bed(tmp_path):
    """A ring of houses with a courtyard: the courtyard is cut out too; raised houses keep the bed elsewhere."""
    block = [square(5.0, 2.0, 11.0, 8.0)[0], square(7.0, 4.0, 9.0, 6.0)[0]]
    features = [(block, {"H": 6.0}), (square(14.0, 1.0, 16.0, 3.0), {"H": 4.0})]
    path = write_layer(tmp_path / "houses.shp", "Polygon", features)
    case = fvsolve.load(pool(holes={"polygons": str(path)}))
    index = case.meshes["pool"].grid.index
    cut = np.zeros((10, 20), bool)
    cut[2:8, 5:11] = cut[1:3, 14:16] = True
    assert ((index < 0) == cut).all()
    assert any("a courtyard of 4 m2" in note for note in case.meshes["pool"].notes)
    raised = {"polygons": str(path), "add": "{H} m", "outside": "0.01*x"}
    case = fvsolve.load(pool(bed=raised))
    bed = case.nodes["pool"].bed.rule.over(case.meshes["pool"]).reshape(10, 20)
    height = np.where(cut, 6.0, 0.0)
    height[1:3, 14:16] = 4.0
    height[4:6, 7:9] = 0.0  # the courtyard
    assert np.allclose(bed, 0.01 * (np.arange(20) + 0.5) + height, atol=1e-14)
    assert fvsolve.run(pool(bed=raised, level=0.5)).ok


def test_houses_from_side_to_side_are_a_fault_and_no_courtyard(tmp_path):
    """Holes that cut the basin in two leave both halves for the user to decide on."""
    path = write_layer(tmp_path / "row.gpkg", "Polygon", [(square(-1.0, 4.0, 21.0, 6.0), {"H": 1})])
    with pytest.raises(CaseError, match="the holes leave 2 pieces that share no face"):
        fvsolve.load(pool(holes={"polygons": str(path)}))


def test_owners_of_points_are_those_of_each_polygon_by_itself(tmp_path):
    """Random points and overlapping polygons with many corners, against a test of every point with every polygon."""
    rng = np.random.default_rng(3)
    features = []
    for _ in range(30):
        angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, 40))
        radius = rng.uniform(0.5, 4.0, 40)
        middle = rng.uniform(0.0, 20.0, 2)
        ring = np.column_stack(
            [middle[0] + radius * np.cos(angle), middle[1] + radius * np.sin(angle)]
        )
        features.append(([[*ring.tolist(), ring[0].tolist()]], {"N": 1}))
    path = write_layer(tmp_path / "stars.gpkg", "Polygon", features)
    found = read_features(path)
    x, y = rng.uniform(-5.0, 25.0, (2, 3000)) + np.array([[EAST], [NORTH]])
    expected = np.full(x.size, -1)
    for k, shape in enumerate(found.shapes):
        expected[in_polygon(np.column_stack([x, y]), shape.pieces[0][:-1, :2])] = k
    assert (owners(found, x, y) == expected).all() and (expected >= 0).sum() > 300


def test_soils_by_polygons_infiltrate_as_typed_soils(tmp_path):
    features = [
        (square(0.0, 0.0, 10.0, 10.0), {"KS": 20.0}),
        (square(10.0, 0.0, 20.0, 10.0), {"KS": 5.0}),
    ]
    path = write_layer(tmp_path / "soils.geojson", "Polygon", features)
    soil = {"model": "green-ampt", "suction": 0.1, "deficit": 0.3}
    by_file = {"polygons": str(path), "value": "{KS} mm/h"}
    cases = [
        pool(level=0.1, infiltration=soil | {"conductivity": conductivity})
        for conductivity in (by_file, "where(x < 10, 20, 5)/3.6e6")
    ]
    for case in cases:
        case["numerics"]["end"] = 60.0
        case["output"] = {"probes": ["pool.infiltrated"]}
    first, second = map(fvsolve.run, cases)
    assert first["pool.infiltrated"][-1] == pytest.approx(second["pool.infiltrated"][-1], rel=1e-12)
    assert first["pool.infiltrated"][-1] > 0.0


def test_a_run_directory_has_the_polygons_of_its_case(tmp_path):
    """The resolved case with its copies gives an equal case; a shapefile needs its further files."""
    path = write_layer(
        tmp_path / "use.shp", "Polygon", [(square(-1.0, -1.0, 21.0, 11.0), {"N": 0.05})]
    )
    found = fvsolve.run(
        pool(manning={"polygons": str(path), "value": "{N}"}), out=tmp_path / "run", pictures=False
    )
    assert found.ok
    path.unlink()
    again = fvsolve.load(tmp_path / "run" / "case.toml")
    assert (again.nodes["pool"].manning.rule.over(again.meshes["pool"]) == 0.05).all()
    assert {item.suffix for item in (tmp_path / "run").glob("use.*")} >= {
        ".shp",
        ".shx",
        ".dbf",
        ".prj",
    }


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"value": "{n}"}, 'has no attribute "n"; did you mean "N"?'),
        ({"value": "{N}", "crs": "EPSG:9999999"}, "unknown reference system"),
        ({"value": "{N}"}, "does not cover"),
        ({"add": "{N}"}, "outside is missing"),
        ({}, "expected `value`, or `add`"),
        ({"value": "{N}", "classes": {"2": 0.1}}, "which `classes` does not have"),
        ({"value": "{N} m"}, 'manning.value: use.geojson, feature 0: "1 m"'),
        ({"value": "{N}", "layer": "us"}, 'has no layer "us"; did you mean "use"?'),
    ],
)
def test_faults_of_polygons_state_place_and_remedy(tmp_path, keys, text):
    path = write_layer(
        tmp_path / "use.geojson", "Polygon", [(square(0.0, 0.0, 10.0, 10.0), {"N": 1})]
    )
    with pytest.raises(CaseError) as error:
        fvsolve.build(fvsolve.load(pool(manning={"polygons": str(path)} | keys)))
    assert text in str(error.value)


def test_degrees_beyond_their_range_are_refused(tmp_path):
    """Many programs write metres into GeoJSON without a system, which the standard reads as degrees."""
    path = tmp_path / "use.geojson"
    ring = [[EAST + x, NORTH + y] for x, y in square(0.0, 0.0, 20.0, 10.0)[0]]
    feature = {
        "type": "Feature",
        "properties": {"N": 0.05},
        "geometry": {"type": "Polygon", "coordinates": [ring]},
    }
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [feature]}))
    given = {"polygons": str(path), "value": "{N}"}
    with pytest.raises(CaseError, match="is in degrees .*expected the key `crs`"):
        fvsolve.load(pool(manning=given))
    case = fvsolve.load(pool(manning=given | {"crs": HOME}))
    assert (case.nodes["pool"].manning.rule.over(case.meshes["pool"]) == 0.05).all()

"""Grids of pixels written at the end of a run: each pixel has the value of its cell; files read back; faults."""

import sys

import meshio
import numpy as np
import pytest
from pytest import approx
from reference.meshes import boundary, shaken, triangles, write
from reference.refusals import refused
from reference.scenes import scene
from scipy.io import netcdf_file

import fvsolve
from fvsolve.core.mesh import read, rectangle
from fvsolve.core.mesh.mesh import MeshPoints
from fvsolve.core.output.grid_files import cells_of_pixels
from fvsolve.parts.raster_files import read_pixels

EAST, NORTH, UTM = 412000.0, 5650000.0, "EPSG:32633"
FIELDS = ["max_depth", "arrival_time"]


def dam(grids, **more) -> dict:
    """Case of a dam that breaks on a slope of which a part stays dry."""
    own = {
        "type": "basin",
        "size": [12.0, 8.0],
        "cells": [12, 8],
        "level": -1.0,
        "elevation": 0.0,
        "bed": "0.1*x",
        "start": {"level": "where(x < 3, 1, -1)"},
        "origin": [EAST, NORTH],
        "crs": UTM,
    } | more
    case = scene(
        {"pool": {key: item for key, item in own.items() if item is not None}},
        {},
        1.0,
        {"scheme": "muscl"},
    )
    case["output"] |= {"fields": 2, "grids": grids}
    return case


def grid(**more) -> dict:
    return {"basin": "pool", "fields": FIELDS, "format": "netcdf", "cell": "1 m"} | more


def test_a_netcdf_grid_of_the_cells_is_the_field(tmp_path):
    result = fvsolve.run(dam({"flood": grid(fields=[*FIELDS, "depth", "u"])}), out=tmp_path / "run")
    assert result.ok and "grids/flood.nc" in result.summary["files"]
    frame = meshio.read(tmp_path / "run/fields/pool-000002.vtu")
    with netcdf_file(tmp_path / "run/grids/flood.nc", mmap=False) as file:
        assert file.Conventions == b"CF-1.8" and file.variables["depth"].dimensions == (
            "time",
            "y",
            "x",
        )
        assert file.variables["time"][:] == approx([0.0, 0.5, 1.0])
        assert file.variables["x"][:2] == approx([EAST + 0.5, EAST + 1.5], rel=1e-15)
        for name in FIELDS:
            own = result.maxima["pool"][name]
            assert np.isnan(own).any() and np.isfinite(own).any()
            assert np.array_equal(file.variables[name][-1].ravel(), own, equal_nan=True)
        assert (
            file.variables["depth"][-1].ravel() == np.concatenate(frame.cell_data["depth"])
        ).all()
        assert (
            file.variables["u"][-1].ravel() == np.concatenate(frame.cell_data["velocity"])[:, 0]
        ).all()
    assert frame.field_data["origin"].tolist() == [EAST, NORTH] and frame.field_data[
        "epsg"
    ].tolist() == [32633]


KEYS = (
    "latitude_of_projection_origin",
    "longitude_of_central_meridian",
    "scale_factor_at_central_meridian",
    "false_easting",
    "false_northing",
    "semi_major_axis",
    "inverse_flattening",
)
MERCATOR = {  # UTM on WGS 84; the National Grid of the Ordnance Survey on the ellipsoid of Airy
    "EPSG:32633": dict(
        zip(KEYS, (0.0, 15.0, 0.9996, 5e5, 0.0, 6378137.0, 298.257223563), strict=True)
    ),
    "EPSG:27700": dict(
        zip(KEYS, (49.0, -2.0, 0.9996012717, 4e5, -1e5, 6377563.396, 299.3249646), strict=True)
    ),
}


@pytest.mark.parametrize(
    "crs", ["EPSG:32633", "EPSG:27700", "EPSG:3035", "EPSG:2154", "EPSG:31370"]
)
def test_gdal_reads_the_crs_of_a_netcdf_grid(tmp_path, crs):
    """Rasterio opens the file through GDAL, as QGIS does; numbers of the mapping as published."""
    rasterio = pytest.importorskip("rasterio")
    fvsolve.run(dam({"flood": grid()}, crs=crs), out=tmp_path)
    path = tmp_path / "grids/flood.nc"
    with rasterio.open(f"netcdf:{path}:max_depth") as file:
        assert file.crs == rasterio.crs.CRS.from_user_input(crs) and file.crs.is_projected
        assert file.transform.c == EAST and file.transform.f == NORTH + 8.0
    assert read_pixels(path, variable="max_depth", series=True).crs == crs
    with netcdf_file(path, mmap=False) as file:
        stated = file.variables["crs"]._attributes
        assert stated["epsg_code"] == crs.encode() and ("grid_mapping_name" in stated) == (
            crs in MERCATOR
        )
    for key, value in MERCATOR.get(crs, {}).items():
        assert float(stated[key]) == approx(value, rel=1e-9)


def test_without_rasterio_a_netcdf_grid_has_the_code_of_its_crs(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rasterio", None)
    fvsolve.run(dam({"flood": grid()}), out=tmp_path)
    with netcdf_file(tmp_path / "grids/flood.nc", mmap=False) as file:
        assert file.variables["crs"].epsg_code == file.variables["crs"].spatial_ref == UTM.encode()
    assert read_pixels(tmp_path / "grids/flood.nc", variable="max_depth", series=True).crs == UTM


def test_a_geotiff_of_half_cells_is_read_back_as_the_field(tmp_path):
    rasterio = pytest.importorskip("rasterio")
    result = fvsolve.run(
        dam({"flood": grid(format="geotiff", cell="50 cm", fields=[*FIELDS, "depth"])}),
        out=tmp_path,
    )
    for name in FIELDS:
        pixels = read_pixels(tmp_path / f"grids/flood-{name}.tif")
        assert (pixels.x, pixels.y, pixels.dx, pixels.crs) == (EAST, NORTH, 0.5, UTM)
        own = result.maxima["pool"][name].reshape(8, 12).repeat(2, axis=0).repeat(2, axis=1)
        assert np.array_equal(pixels.values, own, equal_nan=True)
    with rasterio.open(tmp_path / "grids/flood-depth.tif") as file:
        assert file.units == ("m",) and file.crs.to_epsg() == 32633 and np.isnan(file.nodata)


def test_a_grid_of_frames_has_their_times_and_is_no_field(tmp_path):
    fvsolve.run(dam({"ground": grid(fields=["bed"])}), out=tmp_path)
    case = dam({}, bed={"raster": str(tmp_path / "grids/ground.nc")})
    with netcdf_file(tmp_path / "grids/ground.nc", mmap=False) as file:
        last = file.variables["bed"][-1].copy()
    assert "has 3 planes" in str(refused(case))
    assert last.ravel() == approx(fvsolve.build(fvsolve.load(dam({}))).meshed[0].bed, rel=1e-15)


@pytest.mark.parametrize("kind", ["triangles", "mixed", "holes"])
def test_a_pixel_has_the_cell_that_contains_its_centre(tmp_path, kind):
    if kind == "holes":
        mesh = rectangle((3.0, 2.0), (6, 4), holes=[(1.0, 0.5, 2.0, 1.5)])
    else:
        points, cells = triangles((3.0, 2.0), 0.3) if kind == "triangles" else shaken()
        cells = [list(cell) for cell in cells]
        groups = {"": boundary(np.array(cells))} if kind == "triangles" else {}
        mesh = read(write(tmp_path / "a.msh", points, cells, groups), "m")
    low, high = mesh.points.min(axis=0) - 0.1, mesh.points.max(axis=0) + 0.1
    x, y = (np.linspace(*ends) for ends in ((low[0], high[0], 42), (low[1], high[1], 30)))
    found, points = cells_of_pixels(mesh, x, y), MeshPoints(mesh)
    # centres on sides have two cells
    assert (found == [[points.cell(a, b) for a in x] for b in y]).mean() > 0.995
    assert ((found < 0) == [[points.cell(a, b) < 0 for a in x] for b in y]).all()


def test_grids_of_a_resumed_run_are_the_same(tmp_path):
    case = dam({"flood": grid(fields=[*FIELDS, "depth"])})
    fvsolve.run(case, out=tmp_path / "run")
    first = (tmp_path / "run/grids/flood.nc").read_bytes()
    (tmp_path / "run/summary.json").unlink()
    fvsolve.run(case, out=tmp_path / "run", resume=True)
    assert (tmp_path / "run/grids/flood.nc").read_bytes() == first
    fvsolve.run(dam({}), out=tmp_path / "run", force=True)
    assert not [*(tmp_path / "run").glob("grids/*")]


def test_faults_of_grids_are_named_all_at_once():
    wall = {"walls": {"side": "east", "travel": {"time": [0, 1], "value": [0, 0.1]}}}
    case = dam(
        {
            "a": grid(fields=["max_dept", "depth"], cell=1e-4),
            "b": grid(basin="pol"),
            "c d": grid(fields=[]),
            "e": grid(format="tif"),
        }
    )
    case["output"]["fields"] = 0
    text = str(refused(case))
    assert 'output.grids.e.format: no format named "tif"; did you mean "geotiff"?' in text
    del case["output"]["grids"]["e"]
    text = str(refused(case))
    for part in (
        'output.grids.a.fields[0]: no field "max_dept"; did you mean "max_depth"?',
        "but `output.fields` is 0",
        "output.grids.a.cell: the grid has 120000 x 80000 cells, more than 1e+08",
        'no basin named "pol"',
        ".fields: names no field; expected some of arrival_time",
        "is not a valid name",
    ):
        assert part in text
    text = str(refused(dam({"a": grid()}, bed=0.0, level=1.0, start=None, patches=wall)))
    assert 'output.grids.a.basin: "pool" has cells that move' in text


def test_a_geotiff_without_rasterio_or_of_an_unknown_crs_is_refused(monkeypatch):
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "rasterio", None)
        assert 'output.grids.a.format: a GeoTIFF needs rasterio: pip install "fvsolve[gis]"' in str(
            refused(dam({"a": grid(format="geotiff")}))
        )
    pytest.importorskip("rasterio")
    assert "has an unknown `crs`" in str(refused(dam({"a": grid(format="geotiff")}, crs="EPSG:1")))

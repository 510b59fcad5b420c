"""Rasters as fields of basins: means over cells, formats of files, meshes over rasters, and their faults."""

import sys

import numpy as np
import pytest
from pytest import approx
from reference.basins import model_of
from reference.meshes import boundary, triangles, write
from reference.raster_files import UTM, WKT, ascii_grid, bed_of, geotiff, heights, netcdf, pond
from reference.refusals import refused
from reference.scenes import scene

import fvsolve
from fvsolve.parts.raster_systems import is_in_degrees

EAST, NORTH = 412000.0, 5650000.0


def netcdf_4(path, values, size=0.5, corner=(0.0, 0.0), names=("y", "x"), **axis):
    pytest.importorskip("h5netcdf")
    xarray = pytest.importorskip("xarray")
    axes = {
        key: low + size * (np.arange(count) + 0.5)
        for key, low, count in zip(names, corner[::-1], values.shape, strict=True)
    }
    data = xarray.Dataset({"height": (names, values)}, axes)
    data[names[0]].attrs.update(axis)
    data.transpose(*(names[::-1] if names != ("y", "x") else names)).to_netcdf(
        path, engine="h5netcdf"
    )
    return path


def cut_off(path):
    path.write_bytes(path.read_bytes()[:300])
    return path


FORMATS = {"asc": ascii_grid, "nc": netcdf, "tif": geotiff, "nc4": netcdf_4}


@pytest.mark.parametrize("cells", [[20, 12], [10, 6], [5, 3], [10, 12]])
def test_the_volume_below_aligned_rectangles_is_that_of_the_pixels(tmp_path, cells):
    values = heights()
    bed, area = bed_of(pond({"raster": str(ascii_grid(tmp_path / "dem.asc", values))}, cells=cells))
    assert bed @ area == approx(values.sum() * 0.25, rel=1e-12)
    blocks = values.reshape(cells[1], 12 // cells[1], cells[0], 20 // cells[0]).mean(axis=(1, 3))
    assert bed == approx(blocks.ravel(), rel=1e-14)


def test_means_over_graded_rectangles_with_holes_are_exact(tmp_path):
    values = heights()
    case = pond(
        {"raster": str(ascii_grid(tmp_path / "dem.asc", values))}, cells=[7, 5], grading=[3.0, 0.5]
    )
    bed, area = bed_of(case)
    assert bed @ area == approx(values.sum() * 0.25, rel=1e-9)
    case = pond({"raster": str(ascii_grid(tmp_path / "dem.asc", values))}, holes=[[2, 2, 4, 4]])
    bed, area = bed_of(case)
    assert bed @ area == approx((values.sum() - values[4:8, 4:8].sum()) * 0.25, rel=1e-12)


def test_the_volume_below_triangles_is_that_of_the_pixels_to_a_thousandth(tmp_path):
    x, y = np.meshgrid(0.25 + 0.5 * np.arange(20), 0.25 + 0.5 * np.arange(12))
    values = 2.0 + np.sin(0.5 * x) * np.cos(0.4 * y)
    points, cells = triangles((10.0, 6.0), 0.6)
    mesh = write(tmp_path / "pond.msh", points, cells.tolist(), {"": boundary(cells)})
    bed, area = bed_of(
        pond(
            {"raster": str(ascii_grid(tmp_path / "dem.asc", values))},
            size=None,
            cells=None,
            mesh={"file": str(mesh)},
        )
    )
    assert bed @ area == approx(values.sum() * 0.25, rel=1e-3)
    flat = ascii_grid(tmp_path / "flat.asc", np.full((12, 20), 1.7))
    bed, _ = bed_of(pond({"raster": str(flat)}, size=None, cells=None, mesh={"file": str(mesh)}))
    assert bed == approx(1.7, rel=1e-14)


@pytest.mark.parametrize("kind", ["nc", "tif", "nc4"])
@pytest.mark.parametrize("cells", [[10, 6], [7, 5]])
def test_all_formats_of_a_raster_give_the_same_bits(tmp_path, kind, cells):
    values, corner = heights(), (EAST - 3.0, NORTH + 7.0)
    frame = {"origin": list(corner), "crs": f"EPSG:{UTM}", "cells": cells}
    first = ascii_grid(tmp_path / "dem.asc", values, corner=corner)
    (tmp_path / "dem.prj").write_text(WKT)
    other = FORMATS[kind](tmp_path / f"dem.{kind}", values, corner=corner)
    (one, _), (two, _) = (bed_of(pond({"raster": str(path)}, **frame)) for path in (first, other))
    assert (one == two).all()


@pytest.mark.parametrize("names, axis", [(("Y", "X"), {}), (("northing", "easting"), {}), (("lat", "lon"), {}),
                                         (("b", "a"), {"axis": "Y"})])  # fmt: skip
def test_a_netcdf_file_may_have_x_before_y(tmp_path, names, axis):
    values = heights()
    expected, _ = bed_of(pond({"raster": str(ascii_grid(tmp_path / "dem.asc", values))}))
    turned = netcdf_4(tmp_path / "dem.nc", values, names=names, **axis)
    assert (bed_of(pond({"raster": str(turned)}))[0] == expected).all()


def test_rows_from_north_bands_and_units_of_files(tmp_path):
    values = heights()
    expected, _ = bed_of(pond({"raster": str(ascii_grid(tmp_path / "dem.asc", values))}))
    north = netcdf(tmp_path / "dem.nc", values, south_first=False, others=("depth",))
    assert (bed_of(pond({"raster": str(north), "variable": "height"}))[0] == expected).all()
    inch = bed_of(pond({"raster": str(tmp_path / "dem.asc"), "unit": "mm"}))[0]
    assert inch == approx(expected / 1000.0, rel=1e-14)
    assert "expected `variable`, of depth, height" in str(refused(pond({"raster": str(north)})))


def test_a_band_of_a_geotiff_is_read(tmp_path):
    path = geotiff(tmp_path / "dem.tif", heights(), count=2)
    one, two = (bed_of(pond({"raster": str(path), "band": band}))[0] for band in (1, 2))
    assert two == approx(2.0 * one, rel=1e-14)
    assert "has 2 bands" in str(refused(pond({"raster": str(path), "band": 3})))


def test_rasters_are_fields_of_all_keys(tmp_path):
    """Manning's n by classes of land use, soil, and the start: the run is that of the same values by formula."""
    classes = np.where(np.arange(20) < 8, 1.0, 7.0) * np.ones((12, 1))
    land, step = ascii_grid(tmp_path / "land.asc", classes), "where(x < 4, {}, {})"
    ascii_grid(tmp_path / "soil.asc", np.where(classes == 1, 10.0, 2.0))
    ascii_grid(tmp_path / "level.asc", np.where(classes == 1, 3.0, 2.5))
    soil = {"model": "constant", "rate": {"raster": str(tmp_path / "soil.asc"), "unit": "mm/h"}}
    given = {
        "manning": {"raster": str(land), "table": {"1": 0.03, "7": 0.06}},
        "infiltration": soil,
        "start": {"level": {"raster": str(tmp_path / "level.asc")}},
    }
    same = {
        "manning": step.format(0.03, 0.06),
        "start": {"level": step.format(3, 2.5)},
        "infiltration": {"model": "constant", "rate": step.format(10 / 3.6e6, 2 / 3.6e6)},
    }
    probes = ["pond.depth@3.5,3", "pond.infiltrated", "pond.volume"]
    rows = [
        np.array([fvsolve.run(pond(0.0, 2.0, probes, **keys))[probe] for probe in probes])
        for keys in (given, same)
    ]
    assert rows[0] == approx(rows[1], rel=1e-9)
    text = str(refused(pond(0.0, manning={"raster": str(land), "table": {"1": 0.03}})))
    assert "`table` has no value of class 7, under 36 of 60 cells" in text


def test_a_case_with_rasters_runs_again_from_its_directory(tmp_path):
    path = ascii_grid(tmp_path / "dem.asc", heights(), corner=(EAST, NORTH))
    case = pond(
        {"raster": str(path)},
        probes=["pond.bed@3,3"],
        origin=[EAST, NORTH],
        crs=f"EPSG:{UTM}",
        size=None,
        cells=None,
        mesh={"raster": str(path), "cell": "1 m", "outside": "hole"},
    )
    first = fvsolve.run(case, out=tmp_path / "run")
    again = fvsolve.run(tmp_path / "run" / "case.toml")
    assert first.ok and (np.array(first["pond.bed@3,3"]) == np.array(again["pond.bed@3,3"])).all()


def test_a_basin_over_a_raster_has_holes_where_it_lacks_data(tmp_path):
    values = heights()
    values[:4, 12:] = np.nan  # an island in the south-east corner, and a pixel at the north
    values[-1, 0] = np.nan
    path = str(ascii_grid(tmp_path / "dem.asc", values, corner=(EAST, NORTH)))
    over = {
        "size": None,
        "cells": None,
        "origin": [EAST - 10.0, NORTH],
        "mesh": {"raster": path, "cell": "1 m"},
    }
    over["mesh"]["outside"] = "hole"
    model = model_of(
        pond({"raster": path}, patches={"out": {"side": "east", "boundary": "critical"}}, **over)
    )
    mesh = model.meshed[0].mesh
    assert len(mesh.cells) == 60 - 8 - 1 and (mesh.grid.nx, mesh.grid.ny) == (10, 6)
    assert mesh.points.min(axis=0) == approx([10.0, 0.0]) and mesh.points.max(axis=0) == approx(
        [20.0, 6.0]
    )
    assert mesh.length[mesh.patch("out")].sum() == approx(4.0)
    whole = np.nansum(values) - np.nansum(values[-2:, :2])
    assert model.meshed[0].bed @ mesh.area == approx(whole * 0.25, rel=1e-12)
    case = pond({"raster": path, "outside": "hole"}, origin=[EAST, NORTH])
    assert len(model_of(case).meshed[0].mesh.cells) == 51
    values[:, 8:10] = np.nan
    ascii_grid(tmp_path / "dem.asc", values, corner=(EAST, NORTH))
    assert "2 pieces that share no face, 23 of 45 cells in the largest" in str(refused(case))


def test_cells_smaller_than_pixels_are_noticed(tmp_path):
    bed = {"raster": str(ascii_grid(tmp_path / "dem.asc", heights()))}
    texts = [str(fvsolve.run(pond(bed, cells=cells)).warnings) for cells in ([20, 12], [40, 24])]
    assert "terraces" not in texts[0] and "missing data" not in texts[0]
    assert (
        "cells of 0.25 m are smaller than the pixels of dem.asc, so the bed has terraces"
        in texts[1]
    )


def test_a_bed_with_undeclared_missing_data_is_noticed(tmp_path):
    values = heights()
    values[4, 4] = -32768.0
    (notice,) = fvsolve.run(
        pond({"raster": str(ascii_grid(tmp_path / "dem.asc", values))})
    ).warnings
    assert "from -81" in str(notice) and "does dem.asc state its value of missing data?" in str(
        notice
    )


def test_faults_of_rasters_name_place_and_remedy(tmp_path):
    values = heights()
    path = ascii_grid(tmp_path / "dem.asc", values)

    def grid(name, values=values, **changes):
        return {"raster": str(ascii_grid(tmp_path / name, values, **changes))}

    none = {"size": None, "cells": None}
    faults = {
        "does not cover 12 of 72 cells, first at 10.5,0.5 m": pond(
            grid("dem.asc"), size=[12.0, 6.0], cells=[12, 6]
        ),
        "or another `origin`": pond({"raster": str(path)}, origin=[1.0, 0.0]),
        "is a raster; expected { raster = ": pond({"file": str(path)}),
        "no such file; a relative": pond({"raster": "dom.asc"}),
        "1000000000 x 1 cells, more than 1e+08": pond(grid("big.asc", ncols=10**9, nrows=1)),
        "no georeference: no lines `xllcorner`": pond(grid("free.asc", xllcorner=None)),
        "has 240 numbers": pond(grid("few.asc", nrows=13)),
        "no data in any pixel": pond(grid("void.asc", values * np.nan)),
        "is in degrees": pond(
            {"raster": str(netcdf(tmp_path / "deg.nc", values, unit="degrees_east"))}
        ),
        "has the CRS EPSG:32633, and the basin EPSG:25832": pond(
            {"raster": str(netcdf(tmp_path / "utm.nc", values))}, crs="EPSG:25832"
        ),
        '"UTM 33" is not a coordinate reference system': pond(0.0, crs="UTM 33"),
        '"EPSG:4326" is in degrees': pond(0.0, crs="EPSG:4326"),
        "cell is missing": pond({"raster": str(path)}, **none, mesh={"raster": str(path)}),
        "measures 10 m by 6 m; expected smaller cells": pond(
            0.0, **none, mesh={"raster": str(path), "cell": 20.0}
        ),
        "file and raster are given": pond(0.0, **none, mesh={"raster": str(path), "file": "a.msh"}),
        "are its coordinates in degrees?": pond(grid("deg.asc", cellsize=0.0008)),
        "bad.nc cannot be read as NetCDF": pond(
            {"raster": str(cut_off(netcdf(tmp_path / "bad.nc", values)))}
        ),
        "nodes.pond: cells without data leave 2 pieces": pond(
            grid("two.asc", np.where(np.arange(20) == 8, np.nan, values)),
            **none,
            mesh={"raster": str(tmp_path / "two.asc"), "cell": 0.5, "outside": "hole"},
        ),
        "gives only the outline": pond(None, **none, mesh={"raster": str(path), "cell": 1.0}),
        "is not the number of a class": pond(0.0, manning={"raster": str(path), "table": {"a": 1}}),
    }
    for text, case in faults.items():
        assert text in str(refused(case)), text
    values[3, 4] = np.nan
    text = str(refused(pond(grid("gap.asc", values))))
    assert (
        "gap.asc has no data under 1 of 60 cells, first at 2.5,1.5 m; expected data, or `outside"
        in text
    )


def test_a_given_velocity_may_be_a_raster_that_covers_the_basin(tmp_path):
    path = ascii_grid(tmp_path / "u.asc", np.ones((12, 20)))
    own = {
        "type": "basin",
        "physics": "transport",
        "size": [10.0, 6.0],
        "cells": [10, 6],
        "velocity": {"u": {"raster": str(path)}},
        "patches": {side: {"side": side, "scalars": {"dye": 1.0}} for side in ("west", "east")},
    }
    case = scene(
        {"pond": own},
        {},
        1.0,
        {"scheme": "upwind"},
        ["pond.dye@1,3"],
        scalars={"dye": {"unit": "mg/l"}},
    )
    same = case | {"nodes": {"pond": own | {"velocity": {"u": 1.0}}}}
    rows, expected = (fvsolve.run(one)["pond.dye@1,3"] for one in (case, same))
    assert rows == approx(expected, rel=1e-12) and rows[-1] > 0.1
    own["size"] = [12.0, 6.0]
    assert "u.asc does not cover x = 10.8 m, y = 0.5 m" in str(
        refused(case | {"nodes": {"pond": own}})
    )


def test_faults_of_geotiffs(tmp_path):
    rasterio = pytest.importorskip("rasterio")
    turn = rasterio.Affine(0.4, 0.3, 0.0, 0.3, -0.4, 6.0)
    for text, path in {
        "has no georeference": geotiff(
            tmp_path / "a.tif", heights(), transform=rasterio.Affine.identity(), crs=None
        ),
        "is turned or mirrored": geotiff(tmp_path / "b.tif", heights(), transform=turn),
        "is in degrees": geotiff(tmp_path / "c.tif", heights(), crs="EPSG:4326"),
    }.items():
        assert text in str(refused(pond({"raster": str(path)})))


@pytest.mark.parametrize(("key", "value"), [("variable", "z"), ("band", 2)])
def test_keys_of_another_format_are_refused(key, value, tmp_path):
    path = ascii_grid(tmp_path / "dem.asc", heights())
    assert f"has no {key}, which only a" in str(refused(pond({"raster": str(path), key: value})))


def test_a_missing_extra_is_named_with_its_command(tmp_path, monkeypatch):
    (tmp_path / "dem.tif").write_bytes(b"II*\0")
    (tmp_path / "dem.nc").write_bytes(b"\x89HDF")
    for name in ("rasterio", "h5netcdf"):
        monkeypatch.setitem(sys.modules, name, None)
    for name in ("tif", "nc"):
        assert 'pip install "fvsolve[gis]"' in str(
            refused(pond({"raster": str(tmp_path / f"dem.{name}")}))
        )


def test_no_projected_crs_counts_as_degrees_and_every_geographic_crs_does():
    """All codes that PROJ of rasterio knows: up to 9140 by its own list, and every projected one beyond."""
    rasterio = pytest.importorskip("rasterio")
    counts = {"degrees": 0, "metres": 0}
    for code in range(2000, 33000):
        try:
            with rasterio.Env():  # its log in place of lines on the terminal
                known = rasterio.crs.CRS.from_epsg(code)
        except ValueError:
            continue
        if known.is_projected:
            counts["metres"] += 1
            assert not is_in_degrees(f"EPSG:{code}")
        elif known.is_geographic and code <= 9140:
            counts["degrees"] += 1
            assert is_in_degrees(f"EPSG:{code}")
    assert counts["degrees"] > 700 and counts["metres"] > 5000


@pytest.mark.parametrize("code", [4230, 4289, 4617, 4937, 6668, 9057])
def test_a_crs_in_degrees_is_refused(code):
    assert f'"EPSG:{code}" is in degrees' in str(refused(pond(0.0, crs=f"EPSG:{code}")))

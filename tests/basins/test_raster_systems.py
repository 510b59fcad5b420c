"""Coordinate systems of rasters: numbers that look like degrees, stretched lengths, decimal commas, units after CF."""

import math
import os
import time
from itertools import product

import numpy as np
import pytest
from pytest import approx
from reference.raster_files import ascii_grid, bed_of, geotiff, heights, netcdf, pond
from reference.refusals import refused
from scipy.io import netcdf_file

import fvsolve
from fvsolve.parts.raster_files import read_pixels
from fvsolve.parts.raster_systems import are_probably_degrees, epsg_code, stretch, utm_code

ARC = 1.0 / 3600.0  # second of arc [deg]
DEGREES = [  # south-west corner, size and number of pixels
    # the scene of the fault: SRTM, 3 seconds of arc
    ((-105.5, 40.1), (0.000833333333, 0.000833333333), (4, 3)),
    ((7.0, 45.0), (ARC, ARC), (3601, 3601)),  # SRTM, a second of arc
    ((7.0, 45.0), (0.00028, 0.00028), (36, 36)),  # with two digits
    ((-0.2, 51.4), (0.000277777777778, 0.000277777777778), (1440, 720)),  # London, on the meridian
    ((34.0, -1.0), (0.000833333333, 0.000833333333), (1200, 1200)),  # Kenya, on the equator
    ((8.0, 52.0), (1.5 * ARC, ARC), (2400, 3600)),  # Copernicus
    ((10.5, 45.5), (ARC / 3.0, ARC / 3.0), (1000, 1000)),  # USGS
    ((10.5, 45.5), (0.0001, 0.0001), (1000, 1000)),
    # a quotient of rounded numbers
    ((10.5, 45.5), (0.0008333333333333209, 0.0008333333333333209), (1000, 1000)),
    ((12.0, 41.0), (0.0166666, 0.0166666), (100, 100)),  # cut off, not rounded
    ((283.0, 41.0), (0.0166667, 0.0166667), (100, 100)),  # to 360 degrees
    ((-180.0, -90.0), (1.0 / 12.0, 1.0 / 12.0), (4320, 2160)),
]
LENGTHS = [  # models of laboratories, and surveys in metres
    ((0.0, 0.0), (0.001, 0.001), (3000, 1000)),
    ((0.0, 0.0), (1.0 / 30.0, 1.0 / 30.0), (300, 30)),
    ((-5.0, -3.0), (0.0083333, 0.0083333), (1200, 720)),
    ((2.5, 1.8), (0.001, 0.001), (300, 200)),  # a window of a model
    ((12.0, 0.0), (0.005, 0.005), (400, 100)),  # part of a flume
    ((100.0, 100.0), (0.005, 0.005), (400, 100)),
    ((50.0, 20.0), (0.05, 0.05), (400, 100)),
    ((412000.0, 5650000.0), (0.05, 0.05), (400, 100)),
    ((0.0, 0.0), (30.0, 30.0), (2, 2)),
]


def test_numbers_of_degrees_and_of_lengths_are_distinguished():
    assert [grid for grid in DEGREES if not are_probably_degrees(*grid)] == []
    assert [grid for grid in LENGTHS if are_probably_degrees(*grid)] == []


def test_zones_of_utm_are_those_of_the_text_books():
    places = {
        (-105.0, 40.0): 32613,
        (7.5, 45.0): 32632,
        (36.8, -1.3): 32737,
        (179.9, -41.0): 32760,
        (355.0, 40.0): 32630,
    }
    assert {place: utm_code(*place) for place in places} == {
        place: f"EPSG:{code}" for place, code in places.items()
    }


def degrees_grid(path, **changes):
    values = 2200.0 + heights(3, 4)
    return ascii_grid(path, values, size=0.000833333333, corner=(-105.5, 40.1), **changes)


@pytest.mark.parametrize("crs", [None, "EPSG:32613"])
def test_a_raster_in_degrees_without_a_system_is_refused(crs, tmp_path):
    """Also where the basin states its own system: no raster of UTM lies there."""
    path = str(degrees_grid(tmp_path / "dem.asc"))
    over = {
        "size": None,
        "cells": None,
        "mesh": {"raster": path, "cell": 0.000833333333},
        "level": 2250.0,
        "crs": crs,
    }
    text = str(refused(pond({"raster": path}, **over)))
    assert (
        "dem.asc states no coordinate system, and its numbers look like degrees: pixels of 0.000833333"
        in text
    )
    assert (
        "-t_srs EPSG:32613; if they are metres, state a system in dem.prj, for example LOCAL_CS["
        in text
    )


def test_a_raster_that_states_metres_is_read_wherever_it_lies(tmp_path):
    path = degrees_grid(tmp_path / "dem.asc")
    (tmp_path / "dem.prj").write_text('LOCAL_CS["local",UNIT["metre",1]]')
    assert read_pixels(path).dx == 0.000833333333
    grid = {"size": 0.000833333333, "corner": (-105.5, 40.1)}
    assert read_pixels(netcdf(tmp_path / "m.nc", heights(3, 4), **grid, wkt="")).metric
    with pytest.raises(
        ValueError, match=r"t.tif states no coordinate system.*state a system in the file"
    ):
        read_pixels(geotiff(tmp_path / "t.tif", heights(3, 4), **grid, crs=None))
    assert read_pixels(geotiff(tmp_path / "u.tif", heights(3, 4), **grid, crs="EPSG:32613")).metric


WGS = 'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],UNIT["degree",0.0174532925199433]]'
IN_DEGREES = {
    "wkt": WGS,
    "wkt of two lines": f"\n {WGS}\n",
    "with heights": f'COMPD_CS["WGS 84 + EGM96",{WGS},VERT_CS["EGM96"]]',
    "wkt 2": 'GEOGCRS["WGS 84",ID["EPSG",4326]]',
    "code": "EPSG:4326\n",
    "proj": "+proj=longlat +datum=WGS84 +no_defs",
    "arcinfo": "Projection    GEOGRAPHIC\nDatum         WGS84\nUnits         DD\nZunits        METERS\nParameters\n",
}


@pytest.mark.parametrize("kind", IN_DEGREES)
def test_all_forms_of_a_system_in_degrees_are_refused(kind, tmp_path):
    (tmp_path / "dem.prj").write_text(IN_DEGREES[kind])
    with pytest.raises(
        ValueError, match=r"dem.asc is in degrees; expected a raster with coordinates in metres"
    ):
        read_pixels(ascii_grid(tmp_path / "dem.asc", heights()))


def test_a_projected_system_in_feet_is_refused_as_in_a_geotiff(tmp_path):
    metres = f'PROJCS["NAD83 / Texas",{WGS},PROJECTION["Lambert"],UNIT["metre",1]]'
    for text, fault in {
        metres: "",
        metres.replace('"metre",1', '"Foot_US",0.3048006096012192'): "is in Foot_US",
        f'COMPD_CS["a",{metres},VERT_CS["b",UNIT["foot",0.3048]]]': "",
    }.items():
        (tmp_path / "dem.prj").write_text(text)
        path = ascii_grid(tmp_path / "dem.asc", heights())
        os.utime(path, ns=(time.time_ns(), time.time_ns()))
        if fault:
            with pytest.raises(ValueError, match=fault):
                read_pixels(path)
        else:
            assert read_pixels(path).metric


ESRI = (
    f'PROJCS["WGS_1984_Web_Mercator_Auxiliary_Sphere",{WGS},'
    'PROJECTION["Mercator_Auxiliary_Sphere"],UNIT["Meter",1.0]]'
)


def test_the_mercator_projection_gives_a_note_with_its_stretch(tmp_path):
    """The factor at the northing of 50 degrees is 1/cos(50 degrees)."""
    north = 6378137.0 * math.log(math.tan(math.radians(0.5 * (90.0 + 50.0))))
    assert stretch("EPSG:3857", north) == approx(1.0 / math.cos(math.radians(50.0)), rel=1e-12)
    assert stretch("EPSG:32633", north) == 1.0 and epsg_code(ESRI) == "EPSG:3857"
    path = ascii_grid(tmp_path / "dem.asc", heights(), corner=(0.0, north - 3.0))
    frame = {"origin": [0.0, north - 3.0]}
    given = {
        "a": pond({"raster": str(path)}, crs="EPSG:3857", **frame),
        "b": pond(0.0, crs="EPSG:900913", **frame),
        "utm": pond(0.0, crs="EPSG:32633", **frame),
    }
    notes = {
        name: [str(note) for note in fvsolve.run(case).warnings] for name, case in given.items()
    }
    for name, code in (("a", 3857), ("b", 900913)):
        found = [note for note in notes[name] if "stretches lengths" in note]
        assert (
            len(found) == 1
            and f"EPSG:{code} stretches lengths by 1/cos(latitude): 1.556 times" in found[0]
        )
        assert "at 50 degrees" in found[0]
    assert not any("stretches" in note for note in notes["utm"])
    (tmp_path / "dem.prj").write_text(ESRI)
    os.utime(path, ns=(time.time_ns(), time.time_ns()))
    assert "EPSG:3857 stretches lengths" in str(
        fvsolve.run(pond({"raster": str(path)}, **frame)).warnings
    )


def test_decimal_commas_of_a_grid_are_named_with_their_line(tmp_path):
    path = ascii_grid(tmp_path / "dem.asc", heights())
    text = path.read_text()
    path.write_text(text.replace(".", ","))
    fault = str(refused(pond({"raster": str(path)})))
    assert (
        "dem.asc" in fault
        and 'has a comma; did you mean "0.0"?; expected numbers with decimal points' in fault
    )
    head, rows = text[: text.index("-9999") + 6], text[text.index("-9999") + 6 :]
    path.write_text(head + rows.replace(".", ","))
    first = rows.split()[0]
    assert (
        f'dem.asc, line 7: "{first.replace(".", ",")}" has a comma; did you mean "{first}"?'
        in str(refused(pond({"raster": str(path)})))
    )
    path.write_text(text.replace("ncols 20", "ncols 20.5"))
    assert "expected whole numbers of pixels above 0" in str(refused(pond({"raster": str(path)})))


@pytest.mark.parametrize("unit", ["metre", "metres", "meter", "meters"])
def test_the_words_of_a_unit_are_those_of_its_symbol(unit, tmp_path):
    values = heights()
    plain = bed_of(pond({"raster": str(ascii_grid(tmp_path / "dem.asc", values))}))[0]
    words = bed_of(
        pond({"raster": str(netcdf(tmp_path / "dem.nc", values, unit=unit)), "unit": unit})
    )[0]
    assert (words == plain).all()


@pytest.mark.parametrize("unit, scale", [("mm h-1", 3.6e6), ("mm hr-1", 3.6e6), ("mm day-1", 86.4e6), ("m s-1", 1.0),
                                         ("kg m-2 s-1", 1000.0), ("kg m**-2 s**-1", 1000.0)])  # fmt: skip
def test_rain_after_cf_falls_as_stated(unit, scale, tmp_path):
    """1e-5 m/s on 60 m2 for a second; a mass flux is a depth of water of 1000 kg/m3."""
    path = tmp_path / "rain.nc"
    with netcdf_file(path, "w") as file:
        for name, count in (("y", 12), ("x", 20)):
            file.createDimension(name, count)
            item = file.createVariable(name, "d", (name,))
            item[:], item.units = 0.5 * (np.arange(count) + 0.5), "m"
        item = file.createVariable("pr", "d", ("y", "x"))
        item[:], item.units, item.standard_name = (
            np.full((12, 20), 1e-5 * scale),
            unit,
            "precipitation_flux",
        )
    result = fvsolve.run(pond(0.0, 1.0, ["pond.rained"], rain={"raster": str(path)}))
    assert result["pond.rained"][-1] == approx(1e-5 * 60.0, rel=1e-9)


def test_a_megabyte_of_equal_characters_in_a_raster_is_read_or_refused_in_bounded_time(tmp_path):
    head, row = "ncols 2\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 10\n", "1 2\n"
    start, count = time.process_time(), 0
    for sign in " 9,\n#a":
        fill = sign * 10**6
        texts = {
            fill,
            fill + head + row,
            head.replace("ncols 2", "ncols " + fill) + row,
            head + "1" + fill + "2\n",
        }
        for text, projection in product(texts, ("", fill)):
            path = tmp_path / f"{count}.asc"
            path.write_text(text)
            path.with_suffix(".prj").write_text(projection)
            count += 1
            try:
                read_pixels(path)
            except ValueError as error:
                assert len(str(error)) < 1000
    assert time.process_time() - start < 5.0 * count

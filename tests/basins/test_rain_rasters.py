"""Rain by frames of a raster: integrals over time and cells, the same in other words, and faults."""

import numpy as np
import pytest
from pytest import approx
from reference.basins import ended, model_of
from reference.rainfall import GREEN_AMPT, HILLS, HORTON, OPEN, field, on_triangles
from reference.raster_files import ascii_grid, geotiff
from reference.refusals import refused
from scipy.io import netcdf_file

import fvsolve

MM_PER_HOUR = 1.0 / 3.6e6  # [m/s]
TIMES = np.array([5.0, 15.0, 20.0, 32.0])  # of frames [s]
# frames [mm/h] on pixels of 2.5 m, rows from the south
RADAR = np.random.default_rng(3).uniform(0.0, 90.0, (4, 4, 4))
# a storm that moves: its mean has no kink in time
RADAR[1] = RADAR[0].mean() * 16.0 * RADAR[1] / RADAR[1].sum()
THIRSTY = {"model": "constant", "rate": "1 m/h"}  # soil that takes all rain at once


def radar(
    path,
    frames=RADAR,
    times=TIMES,
    since="seconds since start",
    unit="mm/h",
    size=2.5,
    corner=(0.0, 0.0),
    order=("time", "y", "x"),
    north_first=False,
    others=(),
    degrees=False,
):
    """Write frames as NetCDF-3 on centres of pixels."""
    frames, rise = np.asarray(frames)[:, :: -1 if north_first else 1], -1 if north_first else 1
    axes = {"time": (times, since)}
    for name, low, count, step in zip("yx", corner[::-1], frames.shape[1:], (rise, 1), strict=True):
        axes[name] = (
            (low + size * (np.arange(count) + 0.5))[::step],
            "degrees_north" if degrees else "m",
        )
    with netcdf_file(path, "w") as file:
        for name, (at, unit_of_axis) in axes.items():
            file.createDimension(name, len(at))
            item = file.createVariable(name, "d", (name,))
            item[:], item.units = at, unit_of_axis
        for name in ("rr", *others):
            item = file.createVariable(name, "d", order)
            item[:] = frames.transpose([("time", "y", "x").index(axis) for axis in order])
            item._FillValue = -9999.0
            if unit:
                item.units = unit
    return str(path)


def heights(frames: np.ndarray, times: np.ndarray, end: float) -> np.ndarray:
    """Height of rain in each pixel [m] until `end`: linear between frames, constant before and after them."""
    t = np.unique([0.0, *times[times < end], end])
    rates = np.array([np.interp(t, times, rate) for rate in frames.reshape(len(frames), -1).T])
    return np.trapezoid(rates, t, axis=1).reshape(frames.shape[1:]) * MM_PER_HOUR


def soaked(case) -> np.ndarray:
    """Infiltrated height in each cell at the end [m], by rows."""
    model, state = ended(case)
    row = model.meshed[0].row
    return state.y[row["infiltrated"] :][: row["n"]].reshape(row["ny"], row["nx"])


METHODS = {
    "ssp-rk2": {"courant": 0.9},
    "rk4": {"courant": 0.9},
    "dormand-prince": {"rtol": 1e-6},
    "tr-bdf2": {"step": 1.0},
    "radau-iia-5": {"rtol": 1e-6},
    "rodas-5p": {"rtol": 1e-6},
}


@pytest.mark.in_turn
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scheme", ["upwind", "muscl", "weno5"])
@pytest.mark.parametrize("mesh", ["grid", "triangles"])
def test_the_volume_of_rain_is_the_integral_of_its_frames(scheme, mesh, method, tmp_path):
    """On triangles of frames that are linear in x and y."""
    numerics, frames = (
        {"scheme": scheme, "method": method, "courant": None} | METHODS[method],
        RADAR,
    )
    if mesh == "triangles":
        y, x = np.mgrid[:4, :4]
        frames = np.array([10.0 + 5.0 * x, 60.0 - 4.0 * x + y, 20.0 + 9.0 * y, 5.0 + x])
    rain = {"raster": radar(tmp_path / "radar.nc", frames)}
    case = field(
        40.0,
        numerics,
        OPEN,
        cells=[8, 8],
        bed=HILLS,
        manning=0.03,
        rain=rain,
        infiltration=GREEN_AMPT,
    )
    found = fvsolve.run(on_triangles(case, ("east",), tmp_path) if mesh == "triangles" else case)
    mass, exact = found.summary["ledgers"]["mass"], 100.0 * heights(frames, TIMES, 40.0).mean()
    assert mass["relative"] < 1e-12
    assert 1e-3 * mass["by_node"]["field.rain"] == approx(
        exact, rel=1e-12 if mesh == "grid" else 1e-3
    )
    assert found["field.rained"][-1] == approx(1e-3 * mass["by_node"]["field.rain"], rel=1e-12)
    assert found["field.infiltrated"][-1] == approx(
        -1e-3 * mass["by_node"]["field.infiltration"], rel=1e-12
    )
    rates = [np.interp(t, TIMES, frames.mean(axis=(1, 2))) * 100.0 * MM_PER_HOUR for t in found.t]
    assert found["field.rain"] == approx(rates, rel=1e-12 if mesh == "grid" else 1e-3)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("cells", [4, 2, 8])
def test_each_cell_gets_the_mean_of_its_pixels(cells, method, tmp_path):
    """A soil takes all rain at once, so its heights are those of the rain: steps end at frames."""
    numerics = {"method": method, "courant": None} | METHODS[method]
    rain = {"raster": radar(tmp_path / "radar.nc")}
    found = soaked(field(40.0, numerics, cells=[cells, cells], rain=rain, infiltration=THIRSTY))
    exact = heights(RADAR, TIMES, 40.0)
    exact = (
        exact.reshape(2, 2, 2, 2).mean(axis=(1, 3))
        if cells == 2
        else np.kron(exact, np.ones((cells // 4,) * 2))
    )
    assert found == approx(exact, rel=1e-12)


def test_frames_in_other_words_are_the_same_rain(tmp_path):
    def case(name="radar.nc", end=40.0, keys=(), start=0.0, size=(10.0, 10.0), **changes):
        rain = {"raster": radar(tmp_path / name, **changes), **dict(keys)}
        own = {"infiltration": THIRSTY, "rain": rain, "size": size} | {
            "origin": changes.get("corner")
        }
        own = {key: item for key, item in own.items() if item is not None}
        return field(end, {"start": start, "end": end}, **own)

    first = soaked(case())
    assert (soaked(case("north.nc", north_first=True)) == first).all()
    assert (soaked(case("turned.nc", order=("time", "x", "y"))) == first).all()
    assert (soaked(case("two.nc", others=("quality",), keys={"variable": "rr"})) == first).all()
    assert soaked(case("si.nc", frames=RADAR * MM_PER_HOUR, unit="m/s")) == approx(first, rel=1e-13)
    assert soaked(case("keyed.nc", unit="", keys={"unit": "mm/h"})) == approx(first, rel=1e-15)
    assert soaked(case("minutes.nc", times=TIMES / 60.0, since="Minutes since start")) == approx(
        first, rel=1e-13
    )
    assert soaked(case("far.nc", corner=(412000.0, 5650000.0))) == approx(first, rel=1e-9)
    late = soaked(case("late.nc", start=100.0, end=140.0))  # times count from the start of the run
    assert late == approx(first, rel=1e-12)
    dated = soaked(
        case("dated.nc", times=TIMES + 86400.0, since="seconds since 2026-01-01 00:00:00", end=30.0)
    )
    # from the first frame
    assert dated == approx(heights(RADAR, TIMES - TIMES[0], 30.0), rel=1e-12)
    mirrored, turned = (
        case("mirrored.nc", frames=RADAR[:, :, ::-1]),
        case("quarter.nc", frames=np.rot90(RADAR, 1, (1, 2))),
    )
    assert (soaked(mirrored) == first[:, ::-1]).all() and (soaked(turned) == np.rot90(first)).all()


def test_rain_that_varies_in_space_only_is_a_raster_or_a_formula(tmp_path):
    x, _ = np.meshgrid(2.5 * np.arange(4) + 1.25, np.arange(4))
    rates = 20.0 + 5.0 * x
    grid = {"raster": str(ascii_grid(tmp_path / "rain.asc", rates, size=2.5)), "unit": "mm/h"}
    # a single frame is constant in time
    one = {"raster": radar(tmp_path / "one.nc", rates[None], times=[7.0])}
    cases = [
        field(30.0, {}, OPEN, bed=HILLS, rain=rain) for rain in (grid, one, "(20 + 5*x)/3.6e6")
    ]
    found = [fvsolve.run(case) for case in cases]
    assert (found[0]["field.volume"] == found[1]["field.volume"]).all()
    assert found[2]["field.volume"] == approx(found[0]["field.volume"], rel=1e-9)
    assert found[0]["field.rained"][-1] == approx(100.0 * 45.0e-3 * 30.0 / 3600.0, rel=1e-12)


def test_a_geotiff_is_rain_that_varies_in_space(tmp_path):
    path = str(geotiff(tmp_path / "rain.tif", RADAR[0], size=2.5))
    found = soaked(field(40.0, rain={"raster": path, "unit": "mm/h"}, infiltration=THIRSTY))
    assert found == approx(RADAR[0] * 40.0 * MM_PER_HOUR, rel=1e-12)


def test_uniform_frames_are_a_schedule(tmp_path):
    frames = np.array([10.0, 40.0, 20.0, 5.0])[:, None, None] * np.ones((4, 4))
    schedule = {"time": TIMES.tolist(), "value": (frames[:, 0, 0] * MM_PER_HOUR).tolist()}
    raster = {"raster": radar(tmp_path / "radar.nc", frames)}
    one, other = (
        fvsolve.run(field(40.0, {}, OPEN, bed=HILLS, manning=0.03, rain=rain))
        for rain in (schedule, raster)
    )
    assert other["field.volume"] == approx(one["field.volume"], rel=1e-10)


@pytest.mark.parametrize("soil", [None, GREEN_AMPT, HORTON], ids=["none", "green-ampt", "horton"])
def test_frames_give_the_same_bits_in_threads_and_resumed(soil, tmp_path):
    more = {} if soil is None else {"infiltration": soil}
    rain = {"raster": radar(tmp_path / "radar.nc", 10.0 * RADAR)}
    case = field(
        40.0,
        {"courant": None, "step": 0.0625},
        OPEN,
        cells=[12, 24],
        bed=HILLS,
        manning=0.03,
        rain=rain,
        **more,
    )
    case["output"]["probes"] = ["field.out.flow", "field.rained", "field.depth@3,4"]
    one, several = (fvsolve.run(case, threads=count) for count in (1, 3))
    assert several.summary["threads"] == 3
    assert all((one[probe] == several[probe]).all() for probe in one.probes)
    assert one.summary["ledgers"]["mass"] == several.summary["ledgers"]["mass"]
    fvsolve.run(case, {"numerics.end": 17.0}, out=tmp_path / "run")
    rest = fvsolve.run(case, out=tmp_path / "run", resume=True)
    assert all(one[probe][-1] == rest[probe][-1] for probe in one.probes)
    assert rest.summary["ledgers"]["mass"]["relative"] < 1e-12


def test_cells_where_a_frame_lacks_data_may_be_left_out(tmp_path):
    frames = RADAR.copy()
    frames[2, :2, 3] = -9999.0
    rain = {"raster": radar(tmp_path / "radar.nc", frames), "outside": "hole"}
    model = model_of(field(40.0, rain=rain))
    assert len(model.meshed[0].mesh.cells) == 14
    del rain["outside"]
    assert "no data under 2 of 16 cells, first at 8.75,1.25 m" in str(
        refused(field(40.0, rain=rain))
    )


def test_a_case_with_frames_runs_again_from_its_directory(tmp_path):
    case = field(40.0, {}, OPEN, bed=HILLS, rain={"raster": radar(tmp_path / "radar.nc")})
    first = fvsolve.run(case, out=tmp_path / "run")
    again = fvsolve.run(tmp_path / "run" / "case.toml")
    assert (np.array(first["field.volume"]) == np.array(again["field.volume"])).all()


def test_rain_that_is_no_rate_is_named_with_its_remedy(tmp_path):
    def rain(name, **changes):
        return {"raster": radar(tmp_path / name, **changes)}

    faults = {
        "times out of order: 15.0 comes after 20.0; expected rising times": rain(
            "a.nc", times=[5, 20, 15, 32]
        ),
        'time has the unit "s"; expected for example "seconds since start"': rain(
            "b.nc", since="s"
        ),
        "has 2 variables; expected `variable`, of quality, rr": rain("c.nc", others=("quality",)),
        "rain: is -1.38889e-06 in a cell; expected no values below 0": rain(
            "d.nc", frames=np.full((4, 4, 4), -5.0)
        ),
        "does not cover 7 of 16 cells": rain("e.nc", size=2.0),
        'states no unit of its values; expected for example `unit = "mm/h"`': rain("f.nc", unit=""),
        "is in degrees": rain("g.nc", degrees=True),
        '"mm" is a length': rain("h.nc", unit="mm"),
        "table: unknown key": {**rain("i.nc"), "table": {"1": 1.0}},
        "no such file": {"raster": "rader.nc"},
    }
    for text, given in faults.items():
        assert text in str(refused(field(1.0, rain=given))), text
    assert "rr has 4 planes; expected one" in str(refused(field(1.0, bed=rain("j.nc"))))
    with netcdf_file(tmp_path / "a.nc", "a") as file:
        file.variables["time"].units = "months since start"
    assert 'has the unit "months since start"' in str(
        refused(field(1.0, rain={"raster": str(tmp_path / "a.nc")}))
    )


def test_too_large_a_number_of_frames_for_the_memory_is_a_fault(tmp_path, monkeypatch):
    rain = {"raster": radar(tmp_path / "radar.nc", np.ones((400, 4, 4)), np.arange(400.0))}
    monkeypatch.setattr("fvsolve.case.basins.free_memory", lambda: 1e6)
    text = str(refused(field(1.0, cells=[16, 12], rain=rain, level=-1.0)))
    assert (
        "rain: 400 frames on 192 cells take about 1.23 MB" in text
        and "expected fewer frames or cells" in text
    )


def test_frames_above_a_cloudburst_get_a_note(tmp_path):
    cases = [
        field(1.0, rain={"raster": radar(tmp_path / name, factor * RADAR)})
        for name, factor in (("a.nc", 1.0), ("b.nc", 10.0))
    ]
    few, many = (fvsolve.load(case).notices for case in cases)
    assert not few and any("cloudburst" in notice.text for notice in many)

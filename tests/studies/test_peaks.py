"""The error of a peak is a band: it holds what is known to be the error, and says where no order is seen."""

from __future__ import annotations

import json

import numpy as np
import pytest
from truth.scenes import area, junction, lake, pipe, ramp, reservoir, scene, valve

import fvsolve
from fvsolve.studies.levels import finer
from fvsolve.studies.peaks import band, peak_errors, pooled


def triple(order: float, coefficient: float = 0.1, exact: float = 3.0) -> tuple[float, float, float]:
    return tuple(exact + coefficient * h**order for h in (2.0, 1.0, 0.5))


@pytest.mark.parametrize("order", [0.5, 0.7, 1.0, 1.3, 2.0, 3.0, 5.0])
@pytest.mark.parametrize("coefficient", [0.1, -0.02])
def test_a_band_holds_the_error_of_any_order(order: float, coefficient: float) -> None:
    values = triple(order, coefficient)
    found = band(values, shared=order)
    assert found["error"] >= abs(coefficient) * (1.0 - 1e-9)
    if 1.0 <= order <= 2.0:
        assert found["error"] <= 1.5 * abs(coefficient) and found["order"] == pytest.approx(order)
    if order < 1.0:
        assert found["order"] is None
        assert found["error"] >= 3.4 * max(abs(values[1] - values[0]), abs(values[2] - values[1]))


def test_where_no_order_shows_it_is_3_4_times_the_greatest_difference() -> None:
    for values in ((1.0, 1.2, 1.1), (1.0, 1.1, 1.3), (1.0, 1.0, 1.2)):
        found = band(values, shared=5.0)
        assert found["order"] is None
        assert found["error"] == pytest.approx(3.414 * np.max(np.abs(np.diff(values))), rel=1e-3)


def test_an_order_that_one_peak_shows_alone_is_luck() -> None:
    lucky = (1.0, 1.2, 1.2001)
    shared = pooled({"a": ("m", lucky), "b": ("m", (2.0, 1.0, 2.5)), "c": ("Pa", lucky)})
    assert band(lucky, shared["m"])["order"] is None and band(lucky, shared["Pa"])["order"] == 2.0
    assert band(lucky, shared["m"])["error"] == pytest.approx(3.414 * 0.2, rel=1e-3)


def test_what_did_not_run_bounds_nothing() -> None:
    assert band((1.0, 1.1, None), 1.0) == {"error": None, "order": None}
    assert band((1.0, None, 1.1), 1.0) == {"error": None, "order": None}
    assert band((None, 1.1, 1.0), 1.0)["error"] == pytest.approx(0.3414, rel=1e-3)
    assert band((1.0, 1.0, 1.0), 1.0)["error"] == pytest.approx(5e-6)


@pytest.mark.parametrize(
    "name", ["accumulator", "gradual-closure", "closed-cylinder", "three-way-junction", "four-bar"]
)
def test_bands_of_shipped_cases_hold_what_four_times_the_resolution_gives(name: str) -> None:
    case = fvsolve.load(name)
    said = peak_errors(fvsolve.run(case), case)
    peaks = said["peaks"]
    fine = fvsolve.run(case, set=finer(case, 4.0) | {"output.every": case.output.every / 4.0})
    for probe, one in peaks.items():
        for side, value in (("least", fine.extremes[probe].least), ("greatest", fine.extremes[probe].greatest)):
            assert abs(value - one[side]["value"]) <= one[side]["error"], (probe, side)
    for claim, one in zip(said["expectations"], fine.expectations, strict=True):
        assert abs(claim["found"] - one.found) <= claim["error"], claim["text"]


def test_where_liquid_parts_no_order_is_believed() -> None:
    """A pumping main after a trip: three grids show order two, and four times the resolution is beyond its band."""
    trip = {"links.pump.trip": 1.0, "links.main.cells": 60, "numerics.end": 14.0, "expect": {}}
    way = {"fluid.law": "mixture", "fluid.cavitation": True, "numerics.scheme": "muscl", "numerics.courant": 0.9}
    case = fvsolve.load("pumping-main", set=trip | way)
    said = peak_errors(fvsolve.run(case), case)
    fine = fvsolve.run(case, set={"links.main.cells": 240})
    assert said["cavities"] and "liquid parts" in said["resolution"]["words"]
    for probe, one in said["peaks"].items():
        assert one["greatest"]["order"] is one["least"]["order"] is None
        assert abs(fine.extremes[probe].greatest - one["greatest"]["value"]) <= one["greatest"]["error"], probe


def throttled(**more) -> dict:
    nodes = {"lake": lake(100.0, elevation=0.0), "gate": junction(elevation=0.0), "air": reservoir(1e5, elevation=0.0)}
    links = {"main": pipe("lake", "gate", 900.0, 0.4, 1000.0, 30),
             "tap": valve("gate", "air", 0.02 * area(0.4), ramp(0.5, 1.0, 1.0, 0.0))}  # fmt: skip
    return scene(nodes, links, 4.0, {"scheme": "muscl", "courant": 0.8}, ["gate.pressure"], **more)


def test_the_command_says_how_far_peaks_and_verdicts_are_off(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    case = throttled(limits={"top": {"on": "main", "quantity": "gauge_pressure", "greatest": "13 bar"}})
    (tmp_path / "scene.toml").write_text(fvsolve.load(case).resolved())
    status, text, _ = fvs("run", "scene.toml", "--error", "--no-pictures")
    assert status in (0, 1) and "+-" in text and "times the resolution" in text and "within" in text
    said = json.loads((tmp_path / "runs" / "scene" / "summary.json").read_text())
    peak, verdict = said["peaks"]["gate.pressure"]["greatest"], said["verdicts"][0]
    assert peak["value"] == said["extremes"]["gate.pressure"]["greatest"]
    assert verdict["error"] == pytest.approx(peak["error"], rel=0.2)
    fine = fvsolve.run(case, set=finer(fvsolve.load(case), 8.0))
    assert abs(fine.extremes["gate.pressure"].greatest - peak["value"]) <= peak["error"]
    assert abs(fine.verdicts[0].value - verdict["value"]) <= verdict["error"]
    assert fvsolve.open_run(tmp_path / "runs" / "scene").verdicts[0].error == verdict["error"]
    assert "+-" not in fvs("run", "scene.toml", "--out", "plain", "--no-pictures")[1]
    for share, state, wanted in ((0.5, "open", 1), (2.0, "holds", 0), (-0.5, "FAILS", 1)):  # of the band, as a margin
        limit = f"limits.top.greatest={verdict['value'] + share * verdict['error']!r} Pag"
        status, text, _ = fvs("run", "scene.toml", "--error", "--no-pictures", "--set", limit, "--out", state)
        (one,) = fvsolve.open_run(tmp_path / state).verdicts
        assert (one.state, status) == (state, wanted) and ("its margin is smaller" in text) == (state == "open")


def test_a_finer_case_is_finer_in_all_that_has_a_resolution() -> None:
    case = fvsolve.load(throttled())
    assert finer(case, 2.0) == {"links.main.cells": 60}
    stepped = fvsolve.load(case, {"numerics.step": "2 ms"})
    assert finer(stepped, 2.0) == {"links.main.cells": 60, "numerics.step": 0.001}
    line = fvsolve.load(case, {"numerics.line": "delay", "numerics.rtol": 1e-5})
    assert finer(line, 0.5) == {"numerics.rtol": 4e-5, "numerics.accuracy": 0.02}

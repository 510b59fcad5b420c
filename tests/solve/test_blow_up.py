"""A run that blows up states the time from which it is not valid, instead of numbers such as -2e30."""

from __future__ import annotations

import json

import pytest
from reference.scenes import area, junction, lake, pipe, ramp, reservoir, scene, valve

import fvsolve
from fvsolve.case.text import write
from fvsolve.studies import scenarios

LARGEST = 1e4  # [m], far above true heads: a closure from 2 m/s gives 200 m by Joukowsky


def blown(step: float = 0.02, scheme: str = "muscl", **more) -> dict:
    """Case of a pipe in steady flow at Courant number 4 by default, with a valve that shuts from 0.5 s on."""
    nodes = {"lake": lake(50.0, elevation=0.0), "gate": junction(elevation=0.0),
             "air": reservoir(1e5, elevation=0.0)}  # fmt: skip
    links = {"main": pipe("lake", "gate", 300.0, 0.2, 1000.0, 60),
             "tap": valve("gate", "air", 0.02 * area(0.2), ramp(0.5, 0.1, 1.0, 0.0))}  # fmt: skip
    limits = {"top": {"on": "main", "maximum": "200 bar"}, "low": {"on": "main", "quantity": "head", "minimum": -1e3},
              "start": {"on": "main", "quantity": "head", "maximum": 40.0}}  # fmt: skip
    claims = {text: {"value": 0.0, "atol": 1e60}
              for text in ("max(gate.head)", "final(gate.head)", "max(main.head)", "mean(gate.head)")}  # fmt: skip
    numerics = {"scheme": scheme, "method": "ssp-rk2", "step": step}
    return scene(nodes, links, 5.0, numerics, ["gate.head", "lake.pressure"], limits=limits, expect=claims, **more)


def numbers(value) -> list[float]:
    """All numbers in nested dicts and lists."""
    if isinstance(value, dict):
        return [x for one in value.values() for x in numbers(one)]
    if isinstance(value, list):
        return [x for one in value for x in numbers(one)]
    return [] if isinstance(value, (str, bool)) or value is None else [value]


@pytest.mark.parametrize("scheme", ["muscl", "upwind5"])
@pytest.mark.parametrize("step", [0.02, 0.2])
def test_extremes_margins_and_claims_are_no_numbers(step: float, scheme: str) -> None:
    result = fvsolve.run(blown(step, scheme))
    said = result.summary
    assert not result.ok and said["invalid_from"] is not None and said["invalid_from"] <= said["t"]
    heads = [one for key in ("extremes", "verdicts", "expectations") for one in numbers(said[key])]
    assert max(map(abs, heads)) <= 1e60  # tolerance of the expectations
    assert max(map(abs, numbers({name: one for name, one in said["extremes"].items() if "head" in name}))) < LARGEST
    assert {one.state for one in result.expectations} == {"open"}
    states = {one.name: one.state for one in result.verdicts}
    assert states["top"] == states["low"] == "open"
    assert all(one.margin is None for one in result.verdicts if one.state == "open")
    assert result.extremes["lake.pressure"].maximum is not None  # constant pressure


def test_all_that_is_printed_says_from_when(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(write(blown()))
    status, text, _ = fvs("run", "scene.toml", "--no-pictures", "--out", "run")
    assert status == 1 and text.count("not valid from t = ") >= 6
    assert "e+1" not in text.replace("1e+60", "").partition("note:")[0]
    said = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert fvs("report", "run", "--xlsx")[0] == 0
    assert f"not valid from t = {said['invalid_from']:.6g} s on" in (tmp_path / "run" / "report.html").read_text()
    (tmp_path / "two.toml").write_text('case = "scene.toml"\n[events.close]\n')
    found = scenarios.study(tmp_path / "two.toml", tmp_path / "out")
    assert not found.ok and found.holds == [] and "not valid from t = " in fvs("study", "two.toml", "--out", "out")[1]
    assert fvs("report", "out")[0] == 0
    assert "not valid from t = " in (tmp_path / "out" / "report.html").read_text()


def test_a_sound_run_is_valid_to_its_end() -> None:
    result = fvsolve.run(blown(0.004))
    assert result.ok and result.summary["invalid_from"] is None and result.extremes["gate.head"].maximum < LARGEST

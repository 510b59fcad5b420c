"""Limits and claims have a common rule: a result that the run cannot confirm is open, and open does not hold."""

import json

import pytest
from reference.scenes import area, junction, lake, pipe, ramp, reservoir, scene, tank, valve

import fvsolve
from fvsolve.case.text import write

PARTS = 0.8  # [s], approximate return of the trough behind the closure: 0.1 s + 600 m / 1000 m/s and some steps


def marked(opening: float = 0.1, **more) -> dict:
    """Case of a pipe shut in 0.1 s under a law without cavities, so that pressure below vapour pressure is a mark."""
    nodes = {"lake": lake(20.0, elevation=0.0), "gate": junction(elevation=0.0),
             "air": reservoir(1e5, elevation=0.0)}  # fmt: skip
    links = {"main": pipe("lake", "gate", 300.0, 0.2, 1000.0, 30),
             "tap": valve("gate", "air", opening * area(0.2), ramp(0.1, 0.1, 1.0, 0.0))}  # fmt: skip
    return scene(nodes, links, 1.2, {}, ["gate.head"], **more)


WIDE = {"value": 0.0, "atol": 1e6}  # any number is within this
CLAIMS = ("min(gate.head)", "final(gate.head)", "mean(gate.head)", "min(main.head)", "at(gate.head, 1 s)")


@pytest.mark.parametrize("text", CLAIMS)
def test_a_claim_of_values_after_a_mark_is_open(text: str) -> None:
    limit = {"top": {"on": "main", "maximum": "1000 bar"}}
    result = fvsolve.run(marked(expect={text: WIDE}, limits=limit))
    assert result.ok and result.marks
    (claim,), (verdict,) = result.expectations, result.verdicts
    assert claim.state == verdict.state == "open" and not claim.ok and not verdict.ok
    sound = fvsolve.run(marked(1e-3, expect={text: WIDE}, limits=limit))
    assert [one.state for one in (*sound.expectations, *sound.verdicts)] == ["holds", "holds"] and not sound.marks


def test_a_claim_of_values_before_it_holds_or_fails() -> None:
    claims = {
        "at(gate.head, 0 s)": {"value": 20.0, "atol": 5.0}, "at(gate.head, 0.05 s)": {"value": 90.0, "atol": 5.0},
        "max(gate.head)": WIDE, "max(main.head)": WIDE, "min(gate.head)": {"value": 0.0, "atol": 1.0},
    }  # fmt: skip
    result = fvsolve.run(marked(expect=claims))
    assert min(mark.time for mark in result.marks) > 0.1
    assert result.extremes["gate.head"].t_max < min(mark.time for mark in result.marks)
    assert [one.state for one in result.expectations] == ["holds", "fails", "holds", "holds", "fails"]


def test_the_command_says_which_and_why(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(write(marked(expect={"final(gate.head)": WIDE})))
    status, text, _ = fvs("run", "scene.toml", "--no-pictures")
    assert status == 1 and "OPEN, because results from" in text and "final(gate.head)" in text
    said = json.loads((tmp_path / "runs" / "scene" / "summary.json").read_text())["expectations"]
    assert [(one["state"], one["ok"]) for one in said] == [("open", False)]
    assert fvs("report", "runs/scene")[0] == 0
    assert "verdict of an expected value is open" in (tmp_path / "runs" / "scene" / "report.html").read_text()


def test_a_tank_that_spills_opens_nothing() -> None:
    nodes = {"basin": tank(2.0, 1.0, height=1.5), "spring": {"type": "inflow", "flow": 0.02}}
    limits = {"level": {"on": "basin", "quantity": "level", "maximum": 1.6},
              "low": {"on": "basin", "quantity": "level", "maximum": 1.2}}  # fmt: skip
    case = scene(nodes, {"pipe": valve("spring", "basin", 0.05)}, 100.0, {"step": 0.1}, ["basin.level"], 1.0,
                 limits=limits, expect={"final(basin.level)": {"value": 1.5, "atol": 1e-6}})  # fmt: skip
    result = fvsolve.run(case)
    assert result.ok and not result.marks and "spilling" in {one.kind for one in result.warnings}
    assert [one.state for one in result.verdicts] == ["holds", "fails"] and result.expectations[0].state == "holds"

"""Isolated parts that draw nothing: no flow determines their pressure, which extremes and limits leave out."""

import json

import pytest
from reference.quasi_steady import main, restated
from reference.scenes import junction, lake, scene, tank, valve

import fvsolve

PROBES = ["x.head", "y.pressure", "a.head", "xy.pressure@0.5", "t.level"]


def pipe_near_high_lake(opening=0.0, demand=None) -> dict:
    """Pipe xy between shut valves to a town at 50 m and to a lake at 900 m: equal leaks would give it 474 m."""
    nodes = {
        "lake": lake(50.0),
        "a": junction(1e-3, elevation=0.0),
        "x": junction(elevation=0.0),
        "y": junction(demand, elevation=0.0),
        "hill": lake(900.0),
        "t": tank(10.0, 5.0, elevation=0.0),
    }
    links = {
        "p": main("lake", "a", 100.0, 0.2),
        "q": main("a", "t", 100.0, 0.1),
        "v1": valve("a", "x", 1e-3, opening),
        "xy": main("x", "y", 10.0, 0.2),
        "v2": valve("y", "hill", 1e-3, 0.0),
    }
    limits = {"all": {"on": "nodes", "quantity": "head", "maximum": 60.0, "minimum": 1.0}}
    return scene(nodes, links, 100.0, {"rtol": 1e-6}, PROBES, 10.0, limits=limits)


def with_waves(case: dict) -> dict:
    for link in case["links"].values():
        if link["type"] == "pipe":
            del link["pipe_model"]
            link["wave_speed"] = 1000.0
    return {
        **case,
        "numerics": {"end": 1.0, "pipe_model": "finite-volume", "courant": 0.8},
        "output": {"every": 0.1, "probes": PROBES},
    }


@pytest.mark.parametrize("waves", [False, True], ids=["quasi-steady", "waves"])
@pytest.mark.parametrize("turned", [False, True])
def test_a_part_between_shut_valves_has_no_extremes_and_no_verdict(tmp_path, waves, turned):
    case = pipe_near_high_lake()
    case = restated(case) if turned else case
    run = fvsolve.run(with_waves(case) if waves else case, out=tmp_path / "out")
    for probe in ("x.head", "y.pressure", "xy.pressure@0.5"):
        assert run.extremes[probe].maximum is None and run.extremes[probe].minimum is None
    assert run.extremes["a.head"].maximum < 50.0
    (verdict,) = run.verdicts
    assert verdict.ok and {row["place"] for row in verdict.worst} == {"a", "t"}
    (note,) = [note for note in run.warnings if note.kind == "isolated"]
    assert note.text.startswith("x, y: ") and "no flow determines its pressure" in note.text
    written = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert written["extremes"]["x.head"]["maximum"] is None


def test_a_part_that_is_joined_for_a_time_has_the_extremes_of_that_time():
    """Its valve shuts at 50 s: before, its head is that of the town; later no row counts."""
    case = pipe_near_high_lake({"time": [0.0, 50.0], "value": [1.0, 0.0], "kind": "step"})
    run = fvsolve.run(case)
    assert run.extremes["x.head"].maximum < 50.0 and run.extremes["x.head"].t_max <= 50.0
    assert run["x.head"][-1] > 400.0
    (verdict,) = run.verdicts
    assert verdict.ok
    (note,) = [note for note in run.warnings if note.kind == "isolated"]
    assert "from 50 s on" in note.text


def test_a_demand_that_is_not_supplied_fails_a_limit_of_pressure():
    case = pipe_near_high_lake(
        {"time": [0.0, 50.0], "value": [1.0, 0.0], "kind": "step"}, demand=1e-4
    )
    run = fvsolve.run(case)
    (verdict,) = run.verdicts
    assert (
        not verdict.ok
        and verdict.place in ("x", "y")
        and verdict.value == pytest.approx(0.0, abs=1e-6)
    )
    (note,) = [note for note in run.warnings if note.kind == "unsupplied"]
    assert note.value == pytest.approx(50.0 * 1e-4, rel=1e-6) and "shut: v1, v2" in note.text

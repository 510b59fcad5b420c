"""A route with a profile and limits in a report: one chainage, through a valve, and what is planted there is shown."""

import numpy as np
import pytest
from truth.scenes import GRAVITY, RHO, junction, lake, pipe, scene, step, valve

import fvsolve
from fvsolve.report.legs import ways
from fvsolve.report.motion import motions
from fvsolve.report.section import section

CHAINAGE, ELEVATION = [0.0, 130.0, 300.0, 500.0], [0.0, 42.0, 5.0, 20.0]
SHUT = 0.3


def over_a_hill(**more) -> dict:
    """A lake, a pipe over a summit, an open valve, a pipe that is drawn the other way round; a flow that stops."""
    nodes = {"lake": lake(100.0, elevation=0.0), "a": junction(elevation=20.0), "b": junction(elevation=20.0),
             "gate": junction(step(SHUT, 0.03, 0.0), elevation=30.0)}  # fmt: skip
    links = {"hill": pipe("lake", "a", 500.0, 0.3, 1000.0, 20), "valve": valve("a", "b", 0.05),
             "last": pipe("gate", "b", 300.0, 0.3, 1000.0, 12)}  # fmt: skip
    links["hill"] |= {"profile": {"chainage": CHAINAGE, "elevation": ELEVATION}}
    del links["hill"]["length"]
    case = scene(nodes, links, 1.5, {}, ["gate.head"], **more)
    case["output"] |= {"fields": 5}
    return case


@pytest.fixture(scope="module")
def main(tmp_path_factory):
    limits = {"class": {"on": "line", "quantity": "gauge_pressure", "greatest": "10 bar"},
              "surge": {"on": "last", "quantity": "pressure_head", "greatest": 400.0}}  # fmt: skip
    case = over_a_hill(routes={"line": {"pipes": ["hill", "last"], "start": "2 km"}}, limits=limits)
    return fvsolve.run(case, out=tmp_path_factory.mktemp("runs") / "main", pictures=False)


def test_a_route_is_the_section_and_its_chainage_runs_through_what_stands_between_its_pipes(main):
    (way,) = ways(main)
    assert (way.name, way.begin, way.end) == ("line", 2000.0, 2800.0)
    assert way.places == [("lake", 2000.0), ("a", 2500.0), ("b", 2500.0), ("gate", 2800.0)]
    one = section(main, way)
    assert (np.diff(one.chainage) >= 0.0).all() and set(2000.0 + np.array(CHAINAGE)) <= set(one.chainage)
    line = np.interp(one.chainage, [*(2000.0 + np.array(CHAINAGE)), 2800.0], [*ELEVATION, 30.0])
    assert one.along["elevation"] == pytest.approx(line)
    assert [name for _, name, _ in one.labels()] == ["lake", "valve", "gate"]


def test_without_a_route_a_section_runs_through_a_link_between_junctions(main, tmp_path):
    (way,) = ways(fvsolve.run(over_a_hill(), out=tmp_path / "run", pictures=False))
    assert (way.name, way.begin, way.end) == ("hill \u2013 last", 0.0, 800.0)
    assert [(leg.pipe, leg.backwards) for leg in way.legs] == [("hill", False), ("last", True)]


def test_a_pipe_that_is_cut_has_a_section_where_no_route_has_all_of_it(tmp_path):
    tap = {"type": "junction", "on": "hill", "at": "200 m"}
    for routes, named in (({}, ["hill", "last"]), ({"line": {"pipes": ["hill", "last"]}}, ["line"])):
        case = over_a_hill(routes=routes)
        case["nodes"]["tap"] = tap
        found = ways(fvsolve.run(case, out=tmp_path / named[0], pictures=False))
        assert [way.name for way in found] == named


def test_limits_are_lines_and_what_passes_one_is_marked_where_it_is_worst(main):
    one = section(main, ways(main)[0])
    bar = 1e6 / (RHO * GRAVITY)
    assert one.lines["class, greatest"] == pytest.approx(one.along["elevation"] + bar, rel=1e-9)
    surge = one.lines["surge, greatest"]
    assert np.isnan(surge[one.pipe == "hill"]).all()
    assert surge[one.pipe == "last"] == pytest.approx(one.along["elevation"][one.pipe == "last"] + 400.0)
    verdict = next(found for found in main.verdicts if found.name == "class")
    assert not verdict.ok and (verdict.chainage, verdict.name) in [(at, name) for at, _, name in one.beyond]
    for at, head, name in one.beyond:
        assert name == "class" and head > np.interp(at, one.chainage, one.lines["class, greatest"])


def test_the_moving_line_has_the_cells_of_a_frame_and_not_the_points_of_the_profile(main):
    (line,) = motions(main, ways(main))
    assert line.chainage == pytest.approx(2012.5 + 25.0 * np.arange(32)) and line.heads.shape == (6, 32)
    one = section(main, ways(main)[0])
    assert line.heads[0] == pytest.approx(np.interp(line.chainage, one.chainage, one.along["initial_head"]), abs=0.01)

"""Route with a profile and limits in a report: one chainage runs through a valve, and exceedances are marked.

`fvsolve plot` draws the requested pictures and names all unknown names at once.
"""

from dataclasses import replace

import numpy as np
import pytest
from reference.scenes import GRAVITY, RHO, junction, lake, pipe, ramp, scene, step, valve

import fvsolve
from fvsolve.report.draw.plot import LIMIT_LOOKS, LINE_LOOKS
from fvsolve.report.figures import section_figure
from fvsolve.report.long_section import head_animations, head_window, section_of, section_paths
from fvsolve.report.report_files import parse_probes, write_pictures

CHAINAGE, ELEVATION = [0.0, 130.0, 300.0, 500.0], [0.0, 42.0, 5.0, 20.0]
SHUT = 0.3


def over_a_hill(**more) -> dict:
    """Case of a lake, a pipe over a summit, an open valve and a reversed pipe; the outflow stops."""
    nodes = {
        "lake": lake(100.0, elevation=0.0),
        "a": junction(elevation=20.0),
        "b": junction(elevation=20.0),
        "gate": junction(step(SHUT, 0.03, 0.0), elevation=30.0),
    }
    links = {
        "hill": pipe("lake", "a", 500.0, 0.3, 1000.0, 20),
        "valve": valve("a", "b", 0.05),
        "last": pipe("gate", "b", 300.0, 0.3, 1000.0, 12),
    }
    links["hill"] |= {"profile": {"chainage": CHAINAGE, "elevation": ELEVATION}}
    del links["hill"]["length"]
    case = scene(nodes, links, 1.5, {}, ["gate.head"], **more)
    case["output"] |= {"fields": 5}
    return case


@pytest.fixture(scope="module")
def main(tmp_path_factory):
    limits = {
        "class": {"on": "line", "quantity": "gauge_pressure", "maximum": "10 bar"},
        "surge": {"on": "last", "quantity": "pressure_head", "maximum": 400.0},
    }
    case = over_a_hill(routes={"line": {"pipes": ["hill", "last"], "start": "2 km"}}, limits=limits)
    return fvsolve.run(case, out=tmp_path_factory.mktemp("runs") / "main", pictures=False)


def test_a_route_is_the_section_and_its_chainage_continues_through_parts_between_its_pipes(main):
    (way,) = section_paths(main)
    assert (way.name, way.begin, way.end) == ("line", 2000.0, 2800.0)
    assert way.places == [("lake", 2000.0), ("a", 2500.0), ("b", 2500.0), ("gate", 2800.0)]
    one = section_of(main, way)
    assert (np.diff(one.chainage) >= 0.0).all() and set(2000.0 + np.array(CHAINAGE)) <= set(
        one.chainage
    )
    line = np.interp(one.chainage, [*(2000.0 + np.array(CHAINAGE)), 2800.0], [*ELEVATION, 30.0])
    assert one.along["elevation"] == pytest.approx(line)
    assert [name for _, name, _ in one.labels()] == ["lake", "valve", "gate"]


def test_without_a_route_a_section_runs_through_a_link_between_junctions(main, tmp_path):
    (way,) = section_paths(fvsolve.run(over_a_hill(), out=tmp_path / "run", pictures=False))
    assert (way.name, way.begin, way.end) == ("hill \u2013 last", 0.0, 800.0)
    assert [(leg.pipe, leg.backwards) for leg in way.legs] == [("hill", False), ("last", True)]


def test_a_pipe_that_is_cut_has_a_section_where_no_route_has_all_of_it(tmp_path):
    tap = {"type": "junction", "on": "hill", "at": "200 m"}
    for routes, named in (
        ({}, ["hill", "last"]),
        ({"line": {"pipes": ["hill", "last"]}}, ["line"]),
    ):
        case = over_a_hill(routes=routes)
        case["nodes"]["tap"] = tap
        found = section_paths(fvsolve.run(case, out=tmp_path / named[0], pictures=False))
        assert [way.name for way in found] == named


def test_limits_are_lines_and_exceedances_are_marked_at_their_worst_place(main):
    one = section_of(main, section_paths(main)[0])
    bar = 1e6 / (RHO * GRAVITY)
    assert one.lines["class, maximum"] == pytest.approx(one.along["elevation"] + bar, rel=1e-9)
    surge = one.lines["surge, maximum"]
    assert np.isnan(surge[one.pipe == "hill"]).all()
    assert surge[one.pipe == "last"] == pytest.approx(
        one.along["elevation"][one.pipe == "last"] + 400.0
    )
    verdict = next(found for found in main.verdicts if found.name == "class")
    assert not verdict.ok and (verdict.chainage, verdict.name) in [
        (at, name) for at, _, name in one.violations
    ]
    for at, head, name in one.violations:
        assert name == "class" and head > np.interp(at, one.chainage, one.lines["class, maximum"])


def test_the_axis_follows_heads_profile_and_vapour_line_and_names_limits_far_from_them(main):
    """Limits within half the range of heads are drawn; others have an arrow with a name and do not extend the axis."""
    one = section_of(main, section_paths(main)[0])
    heads = np.concatenate([one.along[name] for name in ("initial_head", "min_head", "max_head")])
    followed = np.concatenate([heads, one.along["elevation"], one.lines["vapour line"]])
    top, bottom, reach = followed.max(), followed.min(), 0.5 * np.ptp(heads)
    flat = {
        name: np.full_like(one.chainage, at)
        for name, at in (
            ("near, maximum", top + 0.9 * reach),
            ("far, maximum", top + 1.1 * reach),
            ("deep, minimum", bottom - 1.1 * reach),
        )
    }
    planted = replace(one, lines={"vapour line": one.lines["vapour line"]} | flat)
    figure = section_figure(planted, None, "m", "m", 150)
    low, high = figure["layout"]["yaxis"]["range"]
    assert (
        low < bottom
        and high > top + 0.9 * reach
        and high - low < 1.3 * (top + 0.9 * reach - bottom)
    )
    arrows = [note for note in figure["layout"]["annotations"] if note["showarrow"]]
    assert [(note["text"].partition(",")[0], note["y"], note["ay"] > 0) for note in arrows] == [
        ("far", 1, True),
        ("deep", 0, False),
    ]
    assert f"{top + 1.1 * reach:.4g} m" in arrows[0]["text"]
    calm = replace(
        planted,
        lines={"vapour line": one.lines["vapour line"], "far, maximum": flat["far, maximum"]},
    )
    assert head_window([calm], "m").high < top + 0.13 * (top - bottom)


def test_upper_and_lower_limits_and_the_class_have_dashes_of_their_own(main):
    one = section_of(main, section_paths(main)[0])
    names = ("vapour line", "class line", "a, maximum", "a, minimum")
    planted = replace(one, lines=dict.fromkeys(names, one.along["elevation"]))
    figure = section_figure(planted, None, "m", "m", 150)
    dashes = {line["name"]: line["line"]["dash"] for line in figure["data"] if "line" in line}
    assert len({dashes[name] for name in (*names, "initial head", "pipe")}) == 6
    drawn = [look["linestyle"] for look in (*LINE_LOOKS.values(), *LIMIT_LOOKS.values())]
    assert len(drawn) == len(set(drawn)) == 4


def test_the_moving_line_has_the_cells_of_a_frame_and_not_the_points_of_the_profile(main):
    (line,) = head_animations(main, section_paths(main))
    assert line.chainage == pytest.approx(2012.5 + 25.0 * np.arange(32)) and line.heads.shape == (
        6,
        32,
    )
    one = section_of(main, section_paths(main)[0])
    assert line.heads[0] == pytest.approx(
        np.interp(line.chainage, one.chainage, one.along["initial_head"]), abs=0.01
    )


@pytest.fixture(scope="module")
def closure(tmp_path_factory):
    nodes = {"top": lake("45 m"), "gate": junction(), "outfall": lake("0 m")}
    links = {
        "main": pipe("top", "gate", 900.0, 0.3, 1200.0, 40),
        "valve": valve("gate", "outfall", 1e-3, ramp(0.5, 0.05, 1.0, 0.0)),
    }
    case = scene(
        nodes, links, 1.0, {}, ["gate.head", "main.head@0.5", "valve.flow"], title="A main for $5"
    )
    return fvsolve.run(case, out=tmp_path_factory.mktemp("runs") / "closure", pictures=False)


def test_requested_items_are_drawn(closure, tmp_path):
    from matplotlib.image import imread

    def drawn(**asked):
        return [path.name for path in write_pictures(closure.directory, out=tmp_path, **asked)]

    assert drawn() == drawn(route="main") == ["section.png"]
    assert drawn(probes="gate.head,valve.flow", phases=["valve.flow:gate.head"]) == [
        "probes.png",
        "phase.png",
    ]
    for name in ("section.png", "probes.png", "phase.png"):
        assert np.ptp(imread(tmp_path / name)[..., :3], axis=(0, 1)).min() > 0.5


def test_unknown_names_are_reported_at_once_with_the_nearest_names(closure, fvs):
    code, _, said = fvs(
        "plot",
        closure.directory,
        "--probes",
        "gate.had,valve.flow",
        "--phase",
        "valve.flow",
        "--route",
        "mian",
    )
    assert code == 2 and said.splitlines() == [
        '"gate.had": unknown probe; did you mean "gate.head"?',
        '--phase "valve.flow": expected two probes, X:Y',
        '"mian": unknown route; did you mean "main"?',
    ]


def test_names_of_probes_may_have_commas():
    class Run:
        units = dict.fromkeys(["pool.depth@10,2.5", "a.head", "pool.depth@10"], "m")

    faults = []
    assert (
        parse_probes(Run, "pool.depth@10,2.5,a.head, pool.depth@10", faults) == [*Run.units]
        and not faults
    )

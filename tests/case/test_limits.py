"""Limits find known exceedances in any unit, direction and order, with place and time.

A limit at vapour pressure fails where a cavity opens, though no pressure is lower; NaN satisfies no limit. Limits and
claims have a common rule: a result that the run cannot confirm is open, and open does not hold.
"""

import json
import math
import zipfile

import numpy as np
import pytest
from reference.refusals import refused
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    RHO,
    SHARP,
    area,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    step,
    tank,
    valve,
)

import fvsolve
from fvsolve.case.text import write
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.run import model_of
from fvsolve.core.run.verdicts import nearest, part_extremes, verdict
from fvsolve.core.solve import initial_state, solve
from fvsolve.errors import FvsolveError
from fvsolve.report.cycles import cycles
from fvsolve.report.figures import section_figure
from fvsolve.report.long_section import head_window, section_of, section_paths
from fvsolve.report.report_files import write_report
from fvsolve.studies.calibrate import calibrate
from fvsolve.studies.closure_optimisation import optimise
from fvsolve.studies.sizing import size

LENGTH, DIAMETER, SPEED = 1000.0, 0.3, 1000.0
SHUT, VELOCITY, HEAD = 0.1, 0.5, 100.0
JUMP = RHO * SPEED * VELOCITY


def shut(turned: bool = False, **more) -> dict:
    """Case of a lake and a frictionless pipe in two halves, shut at once: pressure +- JUMP, exact at Courant 1."""
    q = VELOCITY * area(DIAMETER)
    nodes = {
        "lake": lake(HEAD, elevation=0.0),
        "middle": junction(elevation=10.0),
        "gate": junction(step(SHUT, q, 0.0), elevation=20.0),
    }
    ends = [("lake", "middle"), ("middle", "gate")]
    pipes = [
        pipe(*(pair[::-1] if turned else pair), LENGTH / 2, DIAMETER, SPEED, 10) for pair in ends
    ]
    links = dict(zip(("low", "high"), pipes, strict=True))
    for one in links.values():
        one["initial_flow"] = -q if turned else q
    numerics = more.pop("numerics", {"scheme": "upwind", "method": "euler", "courant": 1.0})
    return scene(nodes, links, 4.0, numerics, ["gate.pressure"], **more)


def judged(case: dict) -> dict:
    return {one.name: one for one in fvsolve.run(case).verdicts}


@pytest.mark.parametrize("turned", [False, True])
def test_a_planted_exceedance_is_located_at_its_chainage_and_time(turned: bool) -> None:
    routes = {"line": {"pipes": ["low", "high"], "start": "5 km"}}
    limits = {
        "top": {"on": "line", "maximum": "14 bar"},
        "vacuum": {"on": "pipes", "minimum": "vacuum"},
    }
    found = judged(shut(turned, routes=routes, limits=limits))
    top = found["top"]
    # at the bottom, except the end at the lake, which has no rise
    highest = AMBIENT + RHO * GRAVITY * HEAD + JUMP
    assert not top.ok and top.place == "low" and top.unit == "Pa" and top.bound == "maximum"
    assert top.chainage == pytest.approx(5025.0)  # the first cell
    z = 20.0 * 25.0 / LENGTH
    assert top.value == pytest.approx(highest - RHO * GRAVITY * z, rel=1e-12)
    assert top.margin == pytest.approx(14e5 - top.value, rel=1e-9) and top.limit == pytest.approx(
        14e5
    )
    assert top.time == pytest.approx(SHUT + (LENGTH - 25.0) / SPEED, abs=0.051)
    assert found["vacuum"].ok and found["vacuum"].place == "high"
    least = AMBIENT + RHO * GRAVITY * (HEAD - 20.0) - JUMP
    assert found["vacuum"].value == pytest.approx(least, rel=1e-12)
    # end of the pipe, not the middle of a cell
    assert found["vacuum"].chainage == pytest.approx(6000.0)
    assert found["vacuum"].elevation == pytest.approx(20.0)


@pytest.mark.parametrize("turned", [False, True])
def test_a_picture_has_it_where_it_stands_whatever_the_unit_and_however_the_pipe_is_cut(
    turned: bool,
) -> None:
    """Chainages of verdict and picture agree with lengths in feet, a pipe cut by a part, and a limit on pipes."""
    found = []
    for more in ({}, {"tap": {"type": "junction", "on": "low", "at": "250 m"}}):
        case = shut(
            turned,
            limits={"top": {"on": ["low", "high"], "maximum": "14 bar"}},
            routes={"line": {"pipes": ["low", "high"], "start": "5 km"}},
        )
        case["nodes"] |= more
        case["output"]["units"] = {"length": "ft"}
        result = fvsolve.run(case)
        one = section_of(result, section_paths(result)[0])
        (top,) = result.verdicts
        assert top.chainage == pytest.approx(5025.0) and one.ends == pytest.approx(
            (5000 / 0.3048, 6000 / 0.3048)
        )
        assert min(abs(at - 5025.0 / 0.3048) for at, _, name in one.violations) < 1e-6
        assert {device.place: device.chainage for device in one.devices}["gate"] == pytest.approx(
            6000 / 0.3048
        )
        found.append(top)
    assert found[0].value == found[1].value


def test_among_the_nodes_a_reservoir_is_not_judged() -> None:
    """The pressure of a reservoir is given; here its elevation equals its head, so that its pressure head is 0."""
    case = shut(limits={"low": {"on": "nodes", "quantity": "pressure_head", "minimum": "5 m"}})
    case["nodes"]["lake"] = lake(HEAD, elevation=HEAD)
    assert {one["place"] for one in judged(case)["low"].worst} == {"middle", "gate"}
    case["limits"]["low"]["on"] = "lake"
    assert judged(case)["low"].value == pytest.approx(0.0, abs=1e-9)


def test_the_same_limit_in_other_words_has_the_same_verdict() -> None:
    # 1 m below the greatest pressure head at the gate
    level = HEAD + JUMP / (RHO * GRAVITY) - 20.0 - 1.0
    gauge = RHO * GRAVITY * level
    limits = {
        "absolute": {"on": "gate", "maximum": gauge + AMBIENT},
        "gauge": {"on": ["gate"], "quantity": "gauge_pressure", "maximum": f"{gauge / 1e5!r} bar"},
        "barg": {"on": "nodes.gate", "quantity": "pressure", "maximum": f"{gauge / 1e5!r} barg"},
        "above the pipe": {
            "on": "gate",
            "quantity": "pressure_head",
            "maximum": f"{level / 0.3048!r} ft",
        },
        "head": {"on": "gate", "quantity": "head", "maximum": level + 20.0},
        "nodes": {"on": ["middle", "gate", "gate"], "quantity": "head", "maximum": level + 20.0},
        "pipe": {"on": "high", "quantity": "pressure_head", "maximum": level},
    }
    named = {name.replace(" ", "-"): one for name, one in limits.items()}
    found = judged(shut(limits=named))
    for name, one in found.items():
        assert not one.ok, name
        metres = one.margin if one.unit == "m" else one.margin / (RHO * GRAVITY)
        if name not in ("pipe", "nodes"):
            assert metres == pytest.approx(-1.0, rel=1e-9), name
    shown = judged(
        shut(
            limits=named,
            output={"units": {"pressure": "barg", "head": "ft", "gauge_pressure": "psi"}},
        )
    )
    assert shown["absolute"].unit == "barg" and shown["absolute"].limit == pytest.approx(
        gauge / 1e5
    )
    assert shown["above-the-pipe"].margin == pytest.approx(-1.0 / 0.3048)
    assert shown["gauge"].value == pytest.approx(found["gauge"].value / 6894.757293168)


def test_velocity_is_limited_in_both_directions_and_flow_in_a_single_direction() -> None:
    limits = {
        "fast": {"on": "pipes", "quantity": "velocity", "maximum": 0.49},
        "slow": {"on": "pipes", "quantity": "velocity", "maximum": 0.51},
        "back": {"on": "low", "quantity": "flow", "minimum": -0.3 * area(DIAMETER)},
    }
    ahead, back = judged(shut(limits=limits)), judged(shut(turned=True, limits=limits))
    for found in (ahead, back):
        assert (found["fast"].ok, found["slow"].ok) == (False, True)
        assert found["fast"].value == pytest.approx(0.5)
    assert ahead["back"].value == pytest.approx(-0.5 * area(DIAMETER))
    assert not ahead["back"].ok and not back["back"].ok


def test_a_limit_that_is_just_reached_holds_and_both_bounds_count() -> None:
    top = AMBIENT + RHO * GRAVITY * (HEAD - 20.0) + JUMP
    low = AMBIENT + RHO * GRAVITY * (HEAD - 20.0) - JUMP
    for least, greatest, ok, bound in (
        (low, top, True, None),
        (low + 1.0, top + 9.0, False, "minimum"),
        (low - 9.0, top - 1.0, False, "maximum"),
        (low + 1.0, top - 2.0, False, "maximum"),
    ):
        one = judged(shut(limits={"gate": {"on": "gate", "minimum": least, "maximum": greatest}}))[
            "gate"
        ]
        assert one.ok == ok
        assert bound in (None, one.bound)


@pytest.mark.in_turn
@pytest.mark.parametrize("method", ["rk4", "gauss-4", "rodas-4"])
@pytest.mark.parametrize("law", ["linear", "log"])
def test_no_row_is_needed_to_find_it(method: str, law: str) -> None:
    """Limits use every step, so the verdict with one output row is nearly that with a thousand rows."""
    limits = {
        "top": {"on": "high", "maximum": 1.0e6},
        "valve": {"on": "gate", "quantity": "head", "minimum": 30.0},
    }
    verdicts = []
    for every in (4.0, 0.004):
        case = shut(limits=limits)
        case["output"]["every"] = every
        case["fluid"]["law"] = law
        case["numerics"] = {"end": 4.0, "scheme": "muscl", "method": method, "step": 0.02}
        verdicts.append(judged(case))
    one, other = verdicts
    assert other["top"].value >= one["top"].value == pytest.approx(other["top"].value, rel=5e-4)
    assert (
        other["valve"].value <= one["valve"].value == pytest.approx(other["valve"].value, rel=5e-4)
    )


@pytest.mark.parametrize("method", ["rodas-5p", "dormand-prince", "radau-iia-9", "auto"])
def test_extremes_between_long_steps_are_judged_by_rows(method: str) -> None:
    """Two tanks oscillate about 2.5 m through a column at rtol 1e-3, in few steps per period, up to a level of 3 m."""
    column = {"type": "rigid-column", "from": "a", "to": "b", "length": 100.0, "diameter": 0.5}
    tanks = {
        name: {"type": "tank", "area": 2.0, "level": level}
        for name, level in (("a", 3.0), ("b", 2.0))
    }
    found = fvsolve.run(
        {
            "fluid": {"name": "Water"},
            "nodes": tanks,
            "links": {"c": column},
            "output": {"probes": ["b.level"]},
            "numerics": {"end": 60.0, "rtol": 1e-3, "method": method},
            "limits": {"b": {"on": "b", "quantity": "level", "maximum": 2.99}},
        }
    )
    (verdict,) = found.verdicts
    assert not verdict.ok and verdict.value == found.extremes["b.level"].maximum == pytest.approx(
        3.0, abs=2e-4
    )


def test_delay_lines_are_limited_at_the_same_places() -> None:
    limits = {
        "top": {"on": "pipes", "maximum": 14e5},
        "fast": {"on": "pipes", "quantity": "velocity", "maximum": 0.49},
    }
    exact = {"scheme": "upwind", "method": "euler", "step": 0.05}
    cells, lines = (
        judged(shut(limits=limits, numerics={"pipe_model": one, **exact}))
        for one in ("finite-volume", "delay-line")
    )
    for name in limits:
        assert cells[name].value == pytest.approx(lines[name].value, rel=1e-9)
        assert cells[name].ok == lines[name].ok is False


def test_a_run_that_stops_passes_no_limit(fvs, tmp_path) -> None:
    case = shut(limits={"top": {"on": "pipes", "maximum": "100 bar"}})
    case["numerics"]["below_vapor"] = "stop"
    case["nodes"]["lake"] = lake(30.0, elevation=0.0)
    found = fvsolve.run(case)
    assert not found.ok and not found.verdicts[0].ok
    assert found.verdicts[0].until < 4.0


def test_where_numbers_are_not_to_be_trusted_no_limit_holds(fvs, tmp_path, monkeypatch) -> None:
    """Pressure below vapour pressure everywhere: one message with the first place, and limits that are open or fail."""
    monkeypatch.chdir(tmp_path)
    limits = {
        "top": {"on": "pipes", "maximum": "100 bar"},
        "low": {"on": "pipes", "maximum": "5 bar"},
    }
    case = shut(limits=limits)
    case["nodes"]["lake"] = lake(30.0, elevation=0.0)
    (tmp_path / "scene.toml").write_text(fvsolve.load(case).resolved())
    status, text, _ = fvs("run", "scene.toml", "--no-pictures")
    assert status == 1 and text.count("pressure falls below vapour pressure") == 1
    assert "high, gate, low and 1 more: pressure falls" in text
    assert (
        "OPEN, because results from" in text
        and "on are not to be trusted: top: " in text
        and "FAILS: low: " in text
    )
    found = fvsolve.open_run("runs/scene")
    assert (
        found.ok
        and [one.ok for one in found.verdicts] == [False, False]
        and found.verdicts[0].margin > 0.0
    )


def test_events_after_the_end_are_noted_and_size_nothing(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    case = shut(limits={"top": {"on": "pipes", "maximum": "14 bar"}})
    flow = VELOCITY * area(DIAMETER)
    case["nodes"]["gate"]["demand"] = {"start": SHUT, "duration": 1.0, "value": [flow, 0.0]}
    (tmp_path / "scene.toml").write_text(fvsolve.load(case).resolved())
    late = {"nodes.gate.demand.duration": 30.0}
    (note,) = [one for one in fvsolve.run(case, set=late).warnings if one.kind == "end"]
    assert note.text == "nodes.gate.demand: continues to 30.1 s, after the end of the run at 4 s"
    assert (
        not fvsolve.run(case, set=late).verdicts[0].ok
        and fvsolve.run(case, set=late).verdicts[0].margin > 0.0
    )
    status, text, _ = fvs(
        "run", "scene.toml", "--no-pictures", "--set", "nodes.gate.demand.duration=30"
    )
    assert (
        status == 1
        and "OPEN, because nodes.gate.demand: continues to 30.1 s, after the end of the run at 4 s: "
        in text
    )
    # continues without change
    held = {"nodes.gate.demand": {"time": [0.0, 30.0], "value": [flow, flow]}}
    assert [one for one in fvsolve.run(case, set=held).warnings if one.kind == "end"] == []
    status, text, _ = fvs(
        "size", "scene.toml", "--vary", "nodes.gate.demand.duration=0.1 s,30 s", "--goal", "minimum"
    )
    assert status == 0 and "open: nodes.gate.demand: continues to 30.1 s" in text
    value = float(text.split("satisfies all limits: ")[1].split(" s;")[0])
    assert 1.0 < value < 4.0 - SHUT and "open" in text


def test_the_command_line_fails_where_a_limit_does(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    case = fvsolve.load(shut(limits={"top": {"on": "pipes", "maximum": "14 bar"}}))
    (tmp_path / "scene.toml").write_text(case.resolved())
    status, text, _ = fvs("run", "scene.toml", "--out", "out")
    assert status == 1 and "FAILS: top" in text
    said = json.loads((tmp_path / "out" / "summary.json").read_text())
    keys = {
        "name",
        "ok",
        "place",
        "chainage",
        "elevation",
        "time",
        "value",
        "limit",
        "margin",
        "unit",
    }
    assert keys <= set(said["verdicts"][0])
    assert said["ok"] and not said["verdicts"][0]["ok"]
    assert fvs("run", "scene.toml", "--out", "out2", "--set", "limits.top.maximum='16 bar'")[0] == 0
    assert fvsolve.open_run("out2").verdicts[0].ok


def test_expect_reaches_whole_pipes_and_routes() -> None:
    top = AMBIENT + RHO * GRAVITY * HEAD + JUMP
    low = AMBIENT + RHO * GRAVITY * (HEAD - 20.0) - JUMP
    tight = {"rtol": 1e-9}
    expect = {
        "max(low.pressure)": {"value": top, "rtol": 1e-2},
        "min(pipes.pressure)": {"value": low, **tight},
        "min(line.pressure)": {"value": low, **tight},
        "max(gate.pressure)": {"value": 1.5e6, "rtol": 1.0},
        "max(high.velocity)": {"value": 0.5, "rtol": 1e-9},
        "max(high.pressure@0.5)": {"value": top, "rtol": 0.1},
    }
    found = fvsolve.run(shut(expect=expect, routes={"line": {"pipes": ["low", "high"]}}))
    assert all(one.ok for one in found.expectations), found.expectations


@pytest.mark.parametrize(
    ("limit", "place", "told"),
    [
        ({"on": "hihg", "maximum": 1e6}, "on", 'did you mean "high"'),
        ({"on": "high"}, "", "bound is missing; expected at least one of minimum, maximum, class_fraction"),
        ({"maximum": 1e6}, "", "on is missing"),
        ({"on": "high", "maximum": "3 m/s"}, "maximum", "is a velocity; expected a pressure"),
        ({"on": "high", "quantity": "gas_volume", "maximum": 1.0}, "quantity", "high has no"),
        ({"on": "high", "minimum": 2e6, "maximum": 1e6}, "minimum", "is not below maximum"),
        ({"on": "high", "quantity": "velocity", "minimum": "vacuum"}, "minimum", "is a pressure; expected a velocity"),
        ({"on": "high", "minimum": "vaccum"}, "minimum", 'did you mean "vacuum"'),
        ({"on": "high", "class_fraction": 1.0}, "class_fraction", "no pressure class is given for"),
        ({"on": [], "maximum": 1e6}, "on", "is not a name"),
        ({"on": "nodes", "quantity": "level", "maximum": 2.0}, "quantity", "no node has"),
        ({"on": "high", "top": 2.0, "maximum": 1e6}, "top", "unknown key"),
        (3.0, "", "is not a table"),
    ],
)  # fmt: skip
def test_faults_are_named(limit, place: str, told: str) -> None:
    error = refused(shut(limits={"one": limit}))
    assert told in str(error)
    assert f"limits.one{'.' if place else ''}{place}" in str(error)


DEEP = {"on": "high", "quantity": "pressure_head", "minimum": 1}


def test_a_fluid_that_does_not_boil_limits_nothing_at_its_vapour() -> None:
    case = shut(limits={"dry": {"on": "high", "minimum": "vapour"}})
    case["fluid"] = case["fluid"] | {"vapor_pressure": 0.0}
    refused(case, "limits.dry.minimum: the fluid has no vapour pressure")


def test_where_nothing_weighs_there_is_no_head() -> None:
    weightless = shut(limits={"deep": DEEP}) | {"gravity": 0.0}
    weightless["nodes"]["lake"] = reservoir(1.1e6, elevation=0.0)
    refused(weightless, "limits.deep.quantity: pressure_head does not exist where gravity is 0")


@pytest.mark.parametrize(
    ("route", "told"),
    [
        ({"pipes": ["low", "hihg"]}, 'did you mean "high"'),
        ({"pipes": ["low", "low"]}, "is given twice"),
        ({"pipes": []}, "is not a list"),
        (
            {"pipes": ["low", "far"]},
            "far does not join the previous pipe: low joins lake and middle and far joins gate and end",
        ),
        ({"pipes": ["low"], "start": "3 s"}, "is a time; expected a length"),
        ({"pipes": ["tap"]}, '"tap" is a valve, not a pipe'),
    ],
)
def test_routes_that_do_not_hang_together_are_named(route: dict, told: str) -> None:
    case = shut()
    case["nodes"] |= {"end": junction(elevation=20.0), "sea": reservoir(2e5, elevation=20.0)}
    case["links"] |= {
        "far": pipe("gate", "end", 10.0, DIAMETER, SPEED, 1),
        "tap": valve("end", "sea", 1e-3),
    }
    error = refused(case | {"routes": {"line": route}})
    assert told in str(error)
    assert "routes.line" in str(error)


def test_a_route_runs_through_pumps_and_valves_and_against_its_pipes() -> None:
    case = shut()
    case["nodes"] |= {"far": junction(elevation=20.0), "end": junction(elevation=25.0)}
    case["links"] |= {
        "tap": valve("gate", "far", 1.0),
        "last": pipe("end", "far", 40.0, DIAMETER, SPEED, 2),
    }
    case["routes"] = {
        "line": {"pipes": ["low", "high", "last"]},
        "home": {"pipes": ["last", "high", "low"]},
    }
    case["limits"] = {"end": {"on": "line", "quantity": "head", "maximum": 0.0}}
    from fvsolve.case.pipe_routes import legs

    found = fvsolve.load(case)
    assert [
        (leg.begin, leg.end, leg.backwards) for leg in legs(found.routes["line"], found.links)
    ] == [(0.0, 500.0, False), (500.0, 1000.0, False), (1000.0, 1040.0, True)]
    assert [leg.backwards for leg in legs(found.routes["home"], found.links)] == [False, True, True]
    assert np.isfinite(judged(case)["end"].chainage)
    assert fvsolve.load(found.table()) == found


def test_a_route_is_a_single_table_with_a_continuous_chainage(tmp_path) -> None:
    case = shut(
        turned=True,
        routes={"line": {"pipes": ["low", "high"], "start": "5 km"}},
        output={"units": {"head": "ft"}},
    )
    found = fvsolve.run(case, out=tmp_path / "out", pictures=False)
    one = found.routes["line"]
    assert np.array_equal(one["chainage"], 5000.0 + 25.0 + 50.0 * np.arange(20))
    assert list(one["pipe"]) == ["low"] * 10 + ["high"] * 10
    assert np.array_equal(one["min_head"][:10], found.envelope["low"]["min_head"][::-1])
    with open(tmp_path / "out" / "routes.csv", encoding="utf-8") as file:
        header, *rows = [line.strip().split(",") for line in file]
    assert (
        header[:4] == ["route", "chainage [m]", "pipe", "distance [m]"]
        and "min_head [ft]" in header
    )
    assert [float(row[1]) for row in rows] == one["chainage"].tolist() and rows[0][:1] == ["line"]
    assert "routes.csv" in found.summary["files"]
    assert np.array_equal(
        fvsolve.open_run(tmp_path / "out").routes["line"]["chainage"], one["chainage"]
    )


BOILS = 2300.0  # [Pa], vapour pressure of the water in reference/scenes.py
BELOW = (BOILS - AMBIENT) / (RHO * GRAVITY)  # [m], head of the vapour pressure
LEAST = {
    "pressure": BOILS,
    "gauge_pressure": BOILS - AMBIENT,
    "head": -12.0,
    "pressure_head": -12.0,
}  # no head is as low as -12 m


def parting(limits: dict, turned: bool = False, opening: float = 0.1, **more) -> dict:
    """Case of a pipe shut in 0.1 s: 5 m/s times a / g is 510 m, and the column separates at the gate after 2 L / a."""
    nodes = {
        "lake": lake(20.0, elevation=0.0),
        "gate": junction(elevation=0.0),
        "air": reservoir(1e5, elevation=0.0),
    }
    ends = ("gate", "lake") if turned else ("lake", "gate")
    links = {
        "main": pipe(*ends, 300.0, 0.2, 1000.0, 30),
        "tap": valve("gate", "air", opening * area(0.2), ramp(0.1, 0.1, 1.0, 0.0)),
    }
    case = scene(nodes, links, 1.2, {}, ["gate.head", "gate.pressure"], limits=limits, **more)
    return case | {
        "fluid": {**case["fluid"], "law": "mixture", "air_fraction": 1e-7, "cavitation": True}
    }


@pytest.mark.in_turn
@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("quantity", [*LEAST])
def test_a_limit_at_vapour_pressure_fails_where_a_cavity_opens(quantity: str, turned: bool) -> None:
    limits = {
        f"{on} {k}": {"on": on, "quantity": quantity, "minimum": least}
        for on in ("main", "gate")
        for k, least in enumerate(("vapor", LEAST[quantity]))
    }
    result = fvsolve.run(parting(limits, turned))
    (cavity,) = result.summary["cavities"]
    assert result.ok and not result.marks and len(result.verdicts) == 4
    for one in result.verdicts:
        assert one.state == "fails" and not one.ok and one.margin < 0.0, one.name
        assert one.place == one.name.partition(" ")[0]
        assert one.chainage == (pytest.approx(cavity["distance"]) if one.place == "main" else None)


@pytest.mark.parametrize("quantity", [*LEAST])
def test_it_holds_where_none_opens(quantity: str) -> None:
    quiet = fvsolve.run(
        parting({"a": {"on": "main", "quantity": quantity, "minimum": "vapor"}}, opening=1e-3)
    )
    assert not quiet.summary["cavities"] and quiet.verdicts[0].state == "holds"
    above = {
        "on": "gate",
        "quantity": "pressure",
        "minimum": 1.5 * BOILS,
    }  # above vapour pressure, numbers are compared
    (found,) = fvsolve.run(parting({"a": above})).verdicts
    assert found.limit == 1.5 * BOILS and found.state == "fails"


def test_the_vapour_line_is_drawn_where_cavities_are_followed(tmp_path) -> None:
    result = fvsolve.run(parting({}), out=tmp_path / "run", pictures=False)
    one = section_of(result, section_paths(result)[0])
    assert one.lines["vapour line"] == pytest.approx(one.along["elevation"] + BELOW, abs=1e-3)
    assert "vapour line" in [
        line["name"] for line in section_figure(one, None, "m", "m", 50)["data"]
    ]
    assert one.cavity_spans and not head_window([one], "m").below
    book = write_report(result.directory, tmp_path / "page.html", xlsx=True)[1]
    with zipfile.ZipFile(book) as parts:
        sheets = [
            parts.read(name).decode() for name in parts.namelist() if "worksheets/sheet" in name
        ]
    assert any(f"<v>{one.lines['vapour line'][0]:.6g}"[:10] in text for text in sheets)


# values that are not numbers ----------------------------------------------------------------------------------------


def weightless(**more) -> dict:
    """Case without gravity, in which heads are not numbers but pressures are."""
    nodes = {"lake": reservoir(3e5), "gate": junction(), "air": reservoir(1e5)}
    links = {
        "main": pipe("lake", "gate", 300.0, 0.2, 1000.0, 6),
        "tap": valve("gate", "air", 0.02 * area(0.2), ramp(0.1, 0.5, 1.0, 0.0)),
    }
    return scene(nodes, links, 0.8, SHARP, ["gate.head", "gate.pressure"], **more) | {
        "gravity": 0.0
    }


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    "bounds", [{"minimum": 1e4}, {"maximum": 1e6}, {"minimum": 1e4, "maximum": 1e6}]
)
def test_a_value_that_is_no_number_never_holds(wrong: float, bounds: dict) -> None:
    """Both extremes of a single place are not numbers; all other places satisfy the limit."""
    model = model_of(weightless(limits={"a": {"on": "main", **bounds}}))
    summary = solve(model, initial_state(model), MemorySink(model))
    limit = model.case.limits["a"]
    (part,) = part_extremes(model, summary, limit.extent)
    spoilt = {
        side: np.where(np.arange(part.minimum.size) == 2, wrong, getattr(part, side))
        for side in ("minimum", "maximum")
    }
    states = {one.state for one in nearest(model, summary, limit, part._replace(**spoilt), True)}
    assert "holds" not in states and {
        one.state for one in nearest(model, summary, limit, part, True)
    } == {"holds"}
    assert states == {"open"} or not math.isnan(wrong)


def test_a_known_exceedance_fails_also_next_to_an_unknown_place() -> None:
    rows = [
        {
            "name": "a",
            "quantity": "head",
            "until": 1.0,
            "state": state,
            "margin": margin,
            "bound": "minimum",
        }
        for state, margin in (("holds", 1.0), ("open", None), ("fails", -2.0))
    ]
    assert verdict(rows)["state"] == "fails" and verdict(rows[:2])["state"] == "open"


def test_a_claim_of_no_number_fails() -> None:
    claims = {
        text: {"value": 30.0, "atol": 1e9}
        for text in (
            "max(gate.head)",
            "max(main.head)",
            "final(gate.head)",
            "mean(gate.head)",
            "at(gate.head, 0.5 s)",
        )
    }
    result = fvsolve.run(weightless(expect=claims))
    assert [one.ok for one in result.expectations] == [False] * 5


def test_a_search_takes_no_peak_that_is_no_number() -> None:
    with pytest.raises(FvsolveError, match="finite"):
        optimise(weightless(), "links.tap.opening", "max(gate.head)", knots=1, runs=9)


def test_a_fit_takes_no_difference_that_is_no_number(tmp_path) -> None:
    (tmp_path / "head.csv").write_text("t [s],head [m]\n0.1,1\n0.2,2\n0.3,3\n")
    compare = {"gate.head": {"file": str(tmp_path / "head.csv")}}
    with pytest.raises(FvsolveError, match="not finite"):
        calibrate(weightless(compare=compare), {"links.main.wave_speed": (900.0, 1100.0)})


def test_cycles_of_no_numbers_last_no_time() -> None:
    with pytest.raises(FvsolveError, match="not finite"):
        cycles(fvsolve.run(weightless()), ["gate.head"])


def test_a_size_counts_a_cavity_as_a_failure() -> None:
    """A quicker closure gives a deeper trough; the least closing time is one without cavity."""
    case = parting({"a": {"on": "main", "minimum": "vapor"}})
    found = size(
        case, "links.tap.opening.duration", "0.1 s", "20 s", rtol=0.2, set={"numerics.end": 3.0}
    )
    assert found.value is not None and found.value > 0.1
    assert not found.runs[0].ok and not found.runs[0].open and found.runs[0].margin < 0.0


# [s], approximate return of the trough behind the closure: 0.1 s + 600 m / 1000 m/s and some steps
PARTS = 0.8


def marked(opening: float = 0.1, **more) -> dict:
    """Case of a pipe shut in 0.1 s under a law without cavities, so that pressure below vapour pressure is a mark."""
    nodes = {
        "lake": lake(20.0, elevation=0.0),
        "gate": junction(elevation=0.0),
        "air": reservoir(1e5, elevation=0.0),
    }
    links = {
        "main": pipe("lake", "gate", 300.0, 0.2, 1000.0, 30),
        "tap": valve("gate", "air", opening * area(0.2), ramp(0.1, 0.1, 1.0, 0.0)),
    }
    return scene(nodes, links, 1.2, {}, ["gate.head"], **more)


WIDE = {"value": 0.0, "atol": 1e6}  # any number is within this
CLAIMS = (
    "min(gate.head)",
    "final(gate.head)",
    "mean(gate.head)",
    "min(main.head)",
    "at(gate.head, 1 s)",
)


@pytest.mark.parametrize("text", CLAIMS)
def test_a_claim_of_values_after_a_mark_is_open(text: str) -> None:
    limit = {"top": {"on": "main", "maximum": "1000 bar"}}
    result = fvsolve.run(marked(expect={text: WIDE}, limits=limit))
    assert result.ok and result.marks
    (claim,), (verdict,) = result.expectations, result.verdicts
    assert claim.state == verdict.state == "open" and not claim.ok and not verdict.ok
    sound = fvsolve.run(marked(1e-3, expect={text: WIDE}, limits=limit))
    assert [one.state for one in (*sound.expectations, *sound.verdicts)] == [
        "holds",
        "holds",
    ] and not sound.marks


def test_a_claim_of_values_before_it_holds_or_fails() -> None:
    claims = {
        "at(gate.head, 0 s)": {"value": 20.0, "atol": 5.0},
        "at(gate.head, 0.05 s)": {"value": 90.0, "atol": 5.0},
        "max(gate.head)": WIDE,
        "max(main.head)": WIDE,
        "min(gate.head)": {"value": 0.0, "atol": 1.0},
    }
    result = fvsolve.run(marked(expect=claims))
    assert min(mark.time for mark in result.marks) > 0.1
    assert result.extremes["gate.head"].t_max < min(mark.time for mark in result.marks)
    assert [one.state for one in result.expectations] == [
        "holds",
        "fails",
        "holds",
        "holds",
        "fails",
    ]


def test_the_command_names_the_failed_limits_with_reasons(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(write(marked(expect={"final(gate.head)": WIDE})))
    status, text, _ = fvs("run", "scene.toml", "--no-pictures")
    assert status == 1 and "OPEN, because results from" in text and "final(gate.head)" in text
    said = json.loads((tmp_path / "runs" / "scene" / "summary.json").read_text())["expectations"]
    assert [(one["state"], one["ok"]) for one in said] == [("open", False)]
    assert fvs("report", "runs/scene")[0] == 0
    assert (
        "verdict of an expected value is open"
        in (tmp_path / "runs" / "scene" / "report.html").read_text()
    )


def test_a_tank_that_spills_opens_nothing() -> None:
    nodes = {"basin": tank(2.0, 1.0, height=1.5), "spring": {"type": "inflow", "flow": 0.02}}
    limits = {
        "level": {"on": "basin", "quantity": "level", "maximum": 1.6},
        "low": {"on": "basin", "quantity": "level", "maximum": 1.2},
    }
    case = scene(
        nodes,
        {"pipe": valve("spring", "basin", 0.05)},
        100.0,
        {"step": 0.1},
        ["basin.level"],
        1.0,
        limits=limits,
        expect={"final(basin.level)": {"value": 1.5, "atol": 1e-6}},
    )
    result = fvsolve.run(case)
    assert result.ok and not result.marks and "spilling" in {one.kind for one in result.warnings}
    assert [one.state for one in result.verdicts] == ["holds", "fails"] and result.expectations[
        0
    ].state == "holds"

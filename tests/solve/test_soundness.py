"""Invalid runs report themselves: steps beyond limits, growth and ledgers; valid runs give no such notices.

The growth check runs inside the compiled loop at every sixteenth step, with one thread or several. A run that blows up
states the time from which it is not valid, instead of numbers such as -2e30.
"""

import csv
import json
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference.basin_scenes import liquid
from reference.scenes import (
    area,
    chamber,
    junction,
    lake,
    pipe,
    ramp,
    reservoir,
    scene,
    tank,
    valve,
)

import fvsolve
from fvsolve.case.text import write
from fvsolve.core.model import RunData
from fvsolve.core.run import model_of
from fvsolve.core.solve.run_checks import GROWTH_LIMIT, LEDGER_TOLERANCE, RunChecks, ledger_notices
from fvsolve.core.solve.run_loop import MOST_EVENTS_IN_SPAN, SPAN, RunLoop
from fvsolve.core.step_limits.advection_limit import advection_limit
from fvsolve.core.step_limits.grid_limits import pipe_limit, plane_limit
from fvsolve.core.step_limits.step_notices import step_limits
from fvsolve.core.steppers.loop_records import GROWTH_CHECK_STEPS
from fvsolve.studies import scenarios, sweep

MAIN = "cases/valve-closure.toml"


def notices_of(result, kind: str) -> list:
    return [one for one in result.warnings if one.kind == kind]


def main_case(**numerics):
    return {f"numerics.{key}": value for key, value in numerics.items()}


def closing(cells: int = 40, beta: float = 2.2e9, **numerics) -> dict:
    """Case of a frictionless main whose outflow stops at once at 0.5 s."""
    fluid = {
        "name": "user",
        "density": 1000.0,
        "bulk_modulus": beta,
        "viscosity": 1e-3,
        "vapor_pressure": 0.0,
    }
    speed = math.sqrt(beta / 1000.0)
    nodes = {
        "lake": {"type": "reservoir", "pressure": 201325.0},
        "gate": {
            "type": "junction",
            "demand": {"time": [0.0, 0.5], "value": [1e-3, 0.0], "kind": "step"},
        },
    }
    pipe = {
        "type": "pipe",
        "from": "lake",
        "to": "gate",
        "length": speed,
        "diameter": 0.3,
        "wall": "rigid",
        "cells": cells,
        "friction": {"model": "none"},
    }
    return scene(
        nodes,
        {"main": pipe},
        3.0,
        numerics,
        ["gate.pressure"],
        0.1,
        fluid={**fluid, "law": "linear"},
    )


@pytest.mark.parametrize("setting", ["numerics.step=0.1", "numerics.courant=1.25"])
def test_the_main_case_beyond_its_limit_is_not_ok_grown_or_not(setting, fvs, tmp_path):
    code, out, *_ = fvs("run", MAIN, "--set", setting, "--out", str(tmp_path / "run"))
    slots = json.loads((tmp_path / "run" / "summary.json").read_text())
    (limit,) = [one for one in slots["warnings"] if one["kind"] == "step-limit"]
    assert code == 1 and not slots["ok"] and not limit["ok"] and limit["place"] == "links.main"
    # 200 cells: 160 bound it
    assert limit["limit"] == pytest.approx(pipe_limit("fromm", "ssp-rk3", 160), rel=1e-12)
    assert (
        0.98 * advection_limit("fromm", "ssp-rk3").limit
        < limit["limit"]
        < advection_limit("fromm", "ssp-rk3").limit
    )
    assert limit["value"] > limit["limit"] and "or less" in limit["text"]
    assert "not to be trusted" in " ".join(out.split())
    before = json.loads(fvs("check", MAIN, "--set", setting, "--json")[1])
    assert [one for one in before["warnings"] if one["kind"] == "step-limit"] == [limit]


def test_growth_without_end_stops_and_the_ledger_reports_it_too():
    found = fvsolve.run(MAIN, set={"numerics.step": 0.1, "output.fields": 0})
    assert found.reason.startswith("stopped: ") and "has grown to" in found.reason
    assert [one.ok for one in notices_of(found, "growth")] == [False]
    assert [one.ok for one in notices_of(found, "ledger")] == [False]


@pytest.mark.parametrize("pair", ["upwind euler", "upwind rk4"])
def test_exactly_at_the_limit_is_sound_and_just_beyond_it_is_not(pair):
    scheme, method = pair.split()
    limit = advection_limit(scheme, method).limit
    for factor, ok in ((1.0, True), (1.001, False)):
        result = fvsolve.run(closing(scheme=scheme, method=method, courant=factor * limit))
        assert result.ok is ok and len(notices_of(result, "step-limit")) == (not ok), (
            factor,
            result.warnings,
        )


@pytest.mark.parametrize("cells", [20, 40, 80, 200])
@pytest.mark.parametrize("pair", ["upwind5 rk4", "upwind3 ssp-rk3", "fromm ssp-rk3"])
def test_the_ends_of_a_pipe_of_any_length_reduce_the_limit_of_wide_stencils(pair, cells):
    """Between the limit of the pipe with its ends and that of a long pipe, the pressure leaves its physical range."""
    scheme, method = pair.split()
    limit, long = pipe_limit(scheme, method, min(cells, 160)), advection_limit(scheme, method).limit
    jump = 1e-3 / area(0.3) * 1000.0 * math.sqrt(2.2e6)
    within = fvsolve.run(closing(cells, scheme=scheme, method=method, courant=0.99 * limit))
    assert within.ok and np.ptp(within["gate.pressure"]) < 3.0 * jump
    case = closing(cells, scheme=scheme, method=method, courant=long)
    case["numerics"]["end"] = 20.0
    beyond = fvsolve.run(case)
    (notice,) = notices_of(beyond, "step-limit")
    assert limit < long and not beyond.ok and notice.limit == pytest.approx(limit, rel=1e-9)
    assert (
        "with reflections at the ends" in notice.text
        and np.ptp(beyond["gate.pressure"]) > 10.0 * jump
    )


def test_a_limit_stated_as_a_step_is_that_of_its_courant_number():
    case = closing(scheme="upwind", method="euler", courant=1.2)
    (by_courant,) = notices_of(fvsolve.run(case), "step-limit")
    case["numerics"].pop("courant")
    (by_step,) = notices_of(
        fvsolve.run(case | {"numerics": {**case["numerics"], "step": 1.2 / 40}}), "step-limit"
    )
    assert (by_step.key, by_courant.key) == ("step", "courant")
    assert (
        by_step.value == pytest.approx(by_courant.value, rel=1e-12)
        and by_step.limit == by_courant.limit
    )
    assert "give numerics.step = 0.025 s or less" in by_step.text


def test_an_estimate_that_is_hardly_passed_is_doubtful_and_beyond_five_percent_wrong():
    limit = pipe_limit("fromm", "ssp-rk3", 40)  # that of `closing`, with its ends
    for factor, ok in ((1.02, True), (1.06, False)):
        (one,) = step_limits(
            model_of(closing(scheme="muscl", method="ssp-rk3", courant=factor * limit))
        )
        assert one.ok is ok and "an estimate" in one.text


def test_implicit_methods_and_error_control_have_no_limit():
    assert not step_limits(
        model_of(closing(scheme="upwind", method="implicit-euler", courant=20.0))
    )
    assert not step_limits(model_of(closing(scheme="upwind5", method="dormand-prince", rtol=1e-4)))


def test_slow_growth_that_no_run_of_this_length_shows_is_left_in_peace():
    """Slow growth within the length of a run gives no notice; upwind5 with ssp-rk2 grows by few 1e-5 per step."""
    assert advection_limit("upwind5", "ssp-rk2").limit == 0.0
    assert not step_limits(model_of(closing(scheme="upwind5", method="ssp-rk2", courant=0.1)))
    (one,) = step_limits(model_of(closing(scheme="upwind5", method="euler", courant=0.5)))
    assert not one.ok and "waves grow at every Courant number" in one.text


@pytest.mark.parametrize("beta", [1e5, 1e6, 1e7])
def test_soft_fluids_pass(beta):
    result = fvsolve.run(closing(beta=beta, scheme="upwind", method="euler", courant=1.0))
    assert result.ok and not notices_of(result, "growth")
    jump = 1e-3 / (math.pi / 4 * 0.3**2) * 1000.0 * math.sqrt(beta / 1000.0)
    assert result.extremes["gate.pressure"].maximum == pytest.approx(201325.0 + jump, rel=1e-9)


def test_water_at_a_step_beyond_its_limit_is_reported_by_check_and_run(fvs):
    found = json.loads(fvs("check", "sloshing-tank", "--set", "numerics.courant=2.2", "--json")[1])
    (one,) = [w for w in found["warnings"] if w["kind"] == "step-limit"]
    assert (
        one["place"] == "nodes.tank"
        and one["value"] == 2.2
        and one["limit"] == pytest.approx(2.0, rel=1e-6)
    )
    result = fvsolve.run(
        "cases/sloshing-tank.toml", set={"numerics.courant": 2.2, "numerics.end": 2.5, "expect": {}}
    )
    assert not result.ok and notices_of(result, "step-limit")
    assert fvsolve.run(
        "cases/sloshing-tank.toml", set={"numerics.courant": 1.9, "numerics.end": 2.5, "expect": {}}
    ).ok


def test_water_that_gets_deeper_in_a_run_is_watched_at_fixed_steps():
    """A step within the limit of the initial depth gives a notice when an incoming wave is deeper."""
    pool = {
        "type": "basin",
        "size": [10.0, 1.0],
        "cells": [40, 4],
        "level": 0.1,
        "patches": {"in": {"side": "west"}},
    }
    flow = {"time": [0.0, 1.0], "value": [0.0, 2.0], "kind": "linear"}
    nodes = {"pool": pool, "feed": {"type": "inflow", "flow": flow}}
    link = {"type": "valve", "from": "feed", "to": "pool.in", "area": 1.0}
    case = scene(
        nodes,
        {"tap": link},
        3.0,
        {"scheme": "upwind", "method": "euler", "step": 0.1},
        ["pool.depth@5,0.5"],
        0.1,
    )
    model = model_of(case)
    assert not step_limits(model)
    result = fvsolve.run(case)
    assert not result.ok and notices_of(result, "step-limit") + notices_of(result, "growth")


@pytest.mark.parametrize(
    "scheme, method", [("upwind", "euler"), ("upwind5", "rk4"), ("fromm", "ssp-rk3")]
)
def test_limits_in_the_plane_are_those_along_a_line_where_all_goes_along_it(scheme, method):
    """Limits in the plane for waves along an axis equal those on a line, to a few 1e-3 for 33 sampled phases."""
    line = advection_limit(scheme, method).limit
    assert plane_limit(scheme, method, 1.0) == pytest.approx(line, rel=2e-3)
    assert plane_limit(scheme, method, 1.0, waves=False) == pytest.approx(line, rel=2e-3)
    assert plane_limit(scheme, method, 0.5) >= line * (1 - 1e-6)


@pytest.mark.parametrize("scheme, method", [("upwind", "euler"), ("upwind5", "rk4")])
def test_a_liquid_in_the_plane_holds_below_its_predicted_limit_and_grows_beyond_it(scheme, method):
    limit = plane_limit(scheme, method, 0.5)
    rng = np.random.default_rng(3)
    box = {
        "type": "basin",
        "physics": "liquid",
        "size": [1.0, 1.0],
        "cells": [16, 16],
        "pressure": 3e5,
        "thickness": 0.1,
    }
    for factor, grows in ((0.98, False), (1.05, True)):
        case = scene(
            {"box": box},
            {},
            1.0,
            {"scheme": scheme, "method": method, "step": 1.0},
            ["box.pressure@0.5,0.5"],
        )
        rate = model_of(case).meshed[0].max_rate(model_of(case).start)[0]
        case["numerics"] |= {"step": factor * limit / rate, "end": 300 * limit / rate}
        case["output"]["every"] = 100 * limit / rate
        model = model_of(case)
        noise = replace(model, start=model.scale * rng.standard_normal(model.y_size))
        y, h = noise.start, case["numerics"]["step"]
        stages = {"euler": 1, "rk4": 4}[method]
        for _ in range(300):
            y = stepped(model, y, h, stages)
        assert bool(np.abs(y).max() > 1e3 * np.abs(noise.start).max()) is grows
        assert bool(step_limits(model)) is grows


def stepped(model, y, h, stages):
    """State after one step of Euler's method or of rk4, in NumPy."""
    k1 = model.rhs(0.0, y)
    if stages == 1:
        return y + h * k1
    k2 = model.rhs(0.0, y + 0.5 * h * k1)
    k3 = model.rhs(0.0, y + 0.5 * h * k2)
    k4 = model.rhs(0.0, y + h * k3)
    return y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def test_a_planted_leak_is_not_ok():
    ledger = {"initial": 1.0, "final": 1.0, "remainder": 1e-7, "relative": 1e-7}
    (one,) = ledger_notices("mass", ledger)
    assert not one.ok and one.kind == "ledger" and one.limit == LEDGER_TOLERANCE
    assert ledger_notices("mass", ledger | {"relative": float("nan")}) and not ledger_notices(
        "mass", ledger | {"relative": 1e-9}
    )


def test_the_relative_remainder_is_over_the_inflow_where_a_scene_starts_empty():
    tank = {"type": "tank", "area": 1.0, "level": 0.0, "elevation": 0.0}
    nodes = {"feed": {"type": "inflow", "flow": 0.01, "elevation": 0.0}, "tank": tank}
    link = {"type": "valve", "from": "feed", "to": "tank", "area": 0.1}
    ledger = fvsolve.run(scene(nodes, {"tap": link}, 10.0, {}, ["tank.level"], 1.0)).ledger["mass"]
    assert ledger["initial"] == 0.0 and ledger["inflow"] == pytest.approx(100.0, rel=1e-9)
    assert ledger["relative"] == abs(ledger["remainder"]) / ledger["inflow"]


def test_rows_of_a_sweep_hold_the_warnings(tmp_path):
    found = sweep(
        closing(scheme="upwind", method="euler"), {"numerics.courant": [1.0, 1.1]}, out=tmp_path
    )
    sound, beyond = found.rows
    assert sound["ok"] and sound["warnings"] == [] and not beyond["ok"]
    assert [one["kind"] for one in beyond["warnings"]][0] == "step-limit"
    rows = list(csv.DictReader(Path(tmp_path / "sweep.csv").open(encoding="utf-8")))
    assert rows[0]["warnings"] == "" and "Courant number 1.1" in rows[1]["warnings"]


def test_the_bound_of_growth_follows_the_start_and_the_given_values():
    """The growth check stops a run above its threshold, which is at least 1e6 kg/s for an initial flow of 1 kg/s."""
    watch = RunChecks(RunData(model_of(closing(scheme="upwind", method="euler", courant=1.0))))
    assert (
        watch.largest == pytest.approx(np.full(watch.largest.size, watch.largest[0]))
        and watch.largest[0] >= 1e6
    )
    assert not watch.check(0.0, 0.99 * watch.largest) and watch.check(
        0.0, 1.01 * watch.largest
    ).startswith("stopped: ")


def test_growth_without_pipes_is_stopped_too():
    """Steps beyond the limit of a mass on a spring, or of a chamber at a rigid column, stop the run."""
    fixed = {"method": "rk4", "step": 0.03}
    body = {"type": "mass", "mass": 10.0, "initial_position": 0.01}
    spring = {"type": "spring", "from": "wall", "to": "load", "stiffness": 1e5}
    swings = scene(
        {"wall": {"type": "frame"}, "load": body}, {"s": spring}, 6.0, fixed, ["load.position"], 0.1
    )
    vessel = {"type": "chamber", "volume": 0.01, "initial_pressure": 3e5}
    nodes = {
        "high": {"type": "reservoir", "pressure": 5e5},
        "v": vessel,
        "low": {"type": "reservoir", "pressure": 2e5},
    }
    column = {
        "type": "rigid-column",
        "length": 5.0,
        "diameter": 0.02,
        "friction": {"model": "none"},
    }
    hole = {"type": "valve", "from": "v", "to": "low", "diameter": 0.002}
    links = {"c": {**column, "from": "high", "to": "v", "initial_flow": 0.0}, "hole": hole}
    squeezed = scene(nodes, links, 100.0, {"method": "euler", "step": 0.5}, ["v.pressure"], 1.0)
    for case in (swings, squeezed):
        result = fvsolve.run(case)
        assert not result.ok and (notices_of(result, "growth") or "not finite" in result.reason), (
            result.summary["warnings"]
        )


def chattering(step: float) -> dict:
    """Case of a check valve before a wide tank, which 1500 pressure cycles per second open and shut."""
    swings = 1500
    pressure = {
        "time": [i / (2 * swings) for i in range(2 * swings + 1)],
        "value": [1.2e5, 3e5] * swings + [1.2e5],
    }
    nodes = {
        "source": {"type": "reservoir", "pressure": pressure},
        "wide": {"type": "tank", "area": 100.0, "level": 10.0},
    }
    link = {"type": "check-valve", "from": "source", "to": "wide", "diameter": 0.1}
    return scene(nodes, {"check": link}, 3.0, {"method": "rk4", "step": step}, ["check.flow"], 0.1)


def test_events_that_crowd_within_a_step_are_bounded_where_nothing_grows():
    """A run with 3000 events in a step of 1 s stops with the name of the valve; steps of 0.1 s finish."""
    result = fvsolve.run(chattering(1.0))
    model = model_of(chattering(1.0))
    assert (
        "check changes its state without end" in result.reason
        and not result.ok
        and not notices_of(result, "growth")
    )
    times = [event["time"] for event in result.summary["events"]]
    assert len(times) == MOST_EVENTS_IN_SPAN + 4 * model.shapes.armed and times[-1] - times[0] < 1.0
    finer = fvsolve.run(chattering(0.1))
    assert finer.ok and len(finer.summary["events"]) == 3000


def test_events_that_crowd_within_a_millionth_of_a_run_are_bounded_under_error_control_too():
    case = chattering(1.0)
    case["numerics"] = {"end": 3.0, "method": "rodas-5p", "rtol": 1e-4}
    for apart, crowds in ((0.9, True), (1.1, False)):
        loop = RunLoop(model_of(case))
        count = loop.recent_events.maxlen
        for k in range(count):
            loop.state["t"] = 1.0 + apart * SPAN * 3.0 * k / (count - 1)
            goes_on = loop.handle_events(loop.armed.copy())
            assert goes_on or k == count - 1
        assert goes_on is not crowds


@pytest.mark.parametrize("opens", [0.0, 2.0])
@pytest.mark.parametrize("step", [0.05, 1.0])
def test_a_store_that_fills_within_a_linearised_step_is_reported(step, opens):
    """A Rosenbrock step much longer than the filling time of a chamber gives a notice, also after an opening."""
    nodes = {"pump": reservoir(8e6), "pot": chamber(1e-4, 1e6)}
    opening = {"time": [0.0, opens], "value": [0.0, 1.0], "kind": "step"} if opens else 1.0
    case = scene(
        nodes,
        {"in": valve("pump", "pot", 1e-5, opening)},
        opens + 200 * step,
        {"method": "rodas-5p", "step": step},
        ["pot.pressure"],
    )
    found = {one.kind: one for one in fvsolve.run(case).warnings}
    assert "pot.mass" in found["step-error"].place and found["step-error"].value > 0.005
    case["numerics"]["method"] = "radau-iia-5"
    assert "step-error" not in {one.kind for one in fvsolve.run(case).warnings}


@pytest.mark.parametrize(
    "level, area", [(2.0, 1e-4), (11.0, 3e-4), (11.9, 1e-3), (12.08, 2e-4), (60.0, 3e-5)]
)
def test_a_tank_that_fills_within_a_few_linearised_steps_is_reported(level, area):
    """A tank whose level stays wrong by more than 0.5 % of its range, up to 1.1 m, gives a notice."""
    case = scene(
        {"lake": lake(12.0), "pot": tank(area, level)},
        {"in": valve("lake", "pot", 1e-3)},
        10.0,
        {"method": "rodas-5p", "step": 0.05},
        ["pot.level"],
    )
    found = fvsolve.run(case)
    wrong = np.mean(np.abs(found["pot.level"][-50:] - 12.0)) / np.ptp(found["pot.level"])
    (told,) = [one for one in found.warnings if one.kind == "step-error"]
    assert told.place == "pot.mass" and wrong > 0.005 and told.value > 0.5 * wrong
    case["numerics"]["method"] = "radau-iia-5"
    assert "step-error" not in {one.kind for one in fvsolve.run(case).warnings}


@pytest.fixture
def returns(monkeypatch):
    """Counter of the returns of the time loop to Python."""
    count, steps = Counter(), RunLoop.steps

    def counted(loop, budget):
        count["returns"] += 1
        return steps(loop, budget)

    monkeypatch.setattr(RunLoop, "steps", counted)
    return count


def test_growth_is_seen_within_sixteen_steps():
    """Growth by 2 c - 1 = 1.04 per step, of upwind and Euler at Courant number c, is reported within sixteen steps."""
    case = closing(scheme="upwind", method="euler", courant=1.02)
    case["numerics"]["end"] = 100.0
    result = fvsolve.run(case)
    (grown,) = notices_of(result, "growth")
    assert result.summary["steps"] % GROWTH_CHECK_STEPS == 0
    assert 1.0 < grown.value / grown.limit <= 1.04**GROWTH_CHECK_STEPS
    assert f"{GROWTH_LIMIT * grown.value / grown.limit:.3g}" in grown.text


def test_a_run_beyond_a_limit_that_does_not_grow_stays_in_the_loop(returns):
    case = closing(scheme="upwind", method="euler", courant=1.0 + 1e-8)
    case["numerics"]["end"] = 100.0
    result = fvsolve.run(case)
    assert notices_of(result, "step-limit") and not notices_of(result, "growth")
    assert returns["returns"] < result.summary["steps"] / (4 * GROWTH_CHECK_STEPS)


def test_threads_stop_at_the_same_step(returns):
    case = liquid()
    case["numerics"] |= {"courant": 2.0, "end": 1.0}
    one, three = (fvsolve.run(case, threads=many) for many in (1, 3))
    assert [one.summary["threads"], three.summary["threads"]] == [1, 3] and returns["returns"] < 10
    assert (
        one.summary["steps"] % GROWTH_CHECK_STEPS == 0
        and one.summary["steps"] == three.summary["steps"]
    )
    assert notices_of(one, "growth") == notices_of(three, "growth") != []


LARGEST = 1e4  # [m], far above true heads: a closure from 2 m/s gives 200 m by Joukowsky


def blown(step: float = 0.02, scheme: str = "muscl", **more) -> dict:
    """Case of a pipe in steady flow at Courant number 4 by default, with a valve that shuts from 0.5 s on."""
    nodes = {
        "lake": lake(50.0, elevation=0.0),
        "gate": junction(elevation=0.0),
        "air": reservoir(1e5, elevation=0.0),
    }
    links = {
        "main": pipe("lake", "gate", 300.0, 0.2, 1000.0, 60),
        "tap": valve("gate", "air", 0.02 * area(0.2), ramp(0.5, 0.1, 1.0, 0.0)),
    }
    limits = {
        "top": {"on": "main", "maximum": "200 bar"},
        "low": {"on": "main", "quantity": "head", "minimum": -1e3},
        "start": {"on": "main", "quantity": "head", "maximum": 40.0},
    }
    claims = {
        text: {"value": 0.0, "atol": 1e29}
        for text in ("max(gate.head)", "final(gate.head)", "max(main.head)", "mean(gate.head)")
    }
    numerics = {"scheme": scheme, "method": "ssp-rk2", "step": step}
    return scene(
        nodes,
        links,
        5.0,
        numerics,
        ["gate.head", "lake.pressure"],
        limits=limits,
        expect=claims,
        **more,
    )


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
    summary = result.summary
    assert (
        not result.ok
        and summary["invalid_from"] is not None
        and summary["invalid_from"] <= summary["t"]
    )
    heads = [
        one for key in ("extremes", "verdicts", "expectations") for one in numbers(summary[key])
    ]
    assert max(map(abs, heads)) <= 1e29  # tolerance of the expectations
    assert (
        max(
            map(
                abs,
                numbers({name: one for name, one in summary["extremes"].items() if "head" in name}),
            )
        )
        < LARGEST
    )
    assert {one.state for one in result.expectations} == {"open"}
    states = {one.name: one.state for one in result.verdicts}
    assert states["top"] == states["low"] == "open"
    assert all(one.margin is None for one in result.verdicts if one.state == "open")
    assert result.extremes["lake.pressure"].maximum is not None  # constant pressure


def test_all_printed_notices_state_their_first_time(fvs, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(write(blown()))
    status, text, _ = fvs("run", "scene.toml", "--no-pictures", "--out", "run")
    assert status == 1 and text.count("not valid from t = ") >= 6
    assert "e+1" not in text.replace("1e+60", "").partition("note:")[0]
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert fvs("report", "run", "--xlsx")[0] == 0
    assert (
        f"not valid from t = {summary['invalid_from']:.6g} s on"
        in (tmp_path / "run" / "report.html").read_text()
    )
    (tmp_path / "two.toml").write_text('case = "scene.toml"\n[events.close]\n')
    found = scenarios.study(tmp_path / "two.toml", tmp_path / "out")
    assert (
        not found.ok
        and found.holds == []
        and "not valid from t = " in fvs("study", "two.toml", "--out", "out")[1]
    )
    assert fvs("report", "out")[0] == 0
    assert "not valid from t = " in (tmp_path / "out" / "report.html").read_text()


def test_a_sound_run_is_valid_to_its_end() -> None:
    result = fvsolve.run(blown(0.004))
    assert (
        result.ok
        and result.summary["invalid_from"] is None
        and result.extremes["gate.head"].maximum < LARGEST
    )

"""Models: pure right-hand side, state names, Jacobian, advances with inputs, and compiled against plain Python.

Probes along a pipe are independent of the direction of the pipe, and exact for polynomials. The work of reading and
building a network is linear in its pipes, counted in executed lines of Python.
"""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from reference.scenes import WATER, junction, lake, pipe, reservoir, scene, valve

import fvsolve
from fvsolve.core.assembly.scheme_codes import cells_around
from fvsolve.core.schemes import SCHEMES
from fvsolve.errors import FvsolveError


def every_kind(law: str = "linear", scheme: str = "muscl", **numerics) -> dict:
    """Case of a lake, a pipe, a chamber, two valves in series, a tank and a rigid column, with states of each kind."""
    return {
        "fluid": {**WATER, "vapor_pressure": 2000.0, "law": law},
        "nodes": {
            "lake": {"type": "reservoir", "head": 60.0},
            "gate": {"type": "junction", "demand": 0.002},
            "pot": {"type": "chamber", "volume": 0.3},
            "mid": {"type": "junction"},
            "pond": {"type": "tank", "area": 3.0, "level": 2.0},
            "sea": {"type": "reservoir", "pressure": 101325.0},
        },
        "links": {
            "main": {
                "type": "pipe",
                "from": "lake",
                "to": "gate",
                "length": 200.0,
                "diameter": 0.2,
                "cells": 9,
                "friction": {"model": "quasi-steady", "roughness": 1e-4},
            },
            "v1": {
                "type": "valve",
                "from": "gate",
                "to": "pot",
                "area": 2e-3,
                "opening": {"time": [0.1, 0.3], "value": [1.0, 0.2]},
            },
            "v2": {"type": "valve", "from": "pot", "to": "mid", "area": 2e-3},
            "v3": {"type": "orifice", "from": "mid", "to": "pond", "area": 2e-3},
            "drain": {
                "type": "rigid-column",
                "from": "pond",
                "to": "sea",
                "length": 20.0,
                "diameter": 0.1,
                "friction": {"model": "steady", "factor": 0.02},
            },
        },
        "numerics": {
            "end": 0.6,
            "scheme": scheme,
            "method": "ssp-rk3",
            **(numerics or {"courant": 0.8}),
        },
        "output": {"every": 0.05, "fields": 0},
    }


@pytest.mark.parametrize("law", ["linear", "log"])
def test_the_rhs_is_pure(law):
    model = fvsolve.build(fvsolve.load(every_kind(law)))
    rng = np.random.default_rng(0)
    states = [model.scale * rng.normal(scale=0.1, size=model.y_size) for _ in range(3)]
    first = [model.rhs(0.2, y) for y in states]
    again = [model.rhs(0.2, y) for y in reversed(states)][::-1]
    assert all(np.array_equal(a, b) for a, b in zip(first, again, strict=True))
    assert all(np.any(a != 0) for a in first)


def test_states_have_names_and_the_jacobian_is_the_slope_of_the_rhs():
    # a limiter is not differentiable at rest
    model = fvsolve.build(fvsolve.load(every_kind(scheme="upwind5")))
    assert len(model.state_names) == model.y_size == 2 * 9 + 3
    assert {"main.forward[0]", "main.backward[8]", "pot.mass", "pond.mass", "drain.flow"} <= set(
        model.state_names
    )
    y = np.zeros(model.y_size)
    direction = model.scale * np.random.default_rng(1).normal(size=model.y_size)
    slope = (model.rhs(0.0, y + 1e-5 * direction) - model.rhs(0.0, y - 1e-5 * direction)) / 2e-5
    assert model.jacobian(0.0, y) @ direction == pytest.approx(
        slope, rel=1e-4, abs=1e-6 * np.max(np.abs(slope))
    )


def test_check_shows_the_computed_balance():
    checks = fvsolve.build(fvsolve.load(every_kind())).checks
    assert checks["nodes"]["lake"]["head"] == pytest.approx(60.0)
    assert checks["pipes"]["main"]["cells"] == 9
    assert 0.015 < checks["pipes"]["main"]["friction_factor"] < 0.03
    assert checks["step_set_by"]
    assert any("tank pond" in text for text in checks["moving"])
    json.dumps(checks)


def test_a_loop_of_advances_is_the_run_with_the_schedule():
    held = every_kind(step=0.001)
    held["links"]["v1"]["opening"] = {"time": [0.2], "value": [1.0]}
    model = fvsolve.build(fvsolve.load(held))
    state = fvsolve.initial_state(model)
    for k in range(20):
        opening = 1.0 if k < 10 else 0.3
        state = fvsolve.advance(model, state, 0.02 * (k + 1), {"v1.opening": opening})
    held["links"]["v1"]["opening"] = {"time": [-1.0, 0.2], "value": [1.0, 0.3], "kind": "step"}
    whole = fvsolve.build(fvsolve.load(held))
    once = fvsolve.advance(whole, fvsolve.initial_state(whole), 0.4)
    assert once.t == state.t == 0.4
    assert state.y == pytest.approx(once.y, rel=1e-9, abs=1e-9 * np.max(np.abs(once.y)))


def test_advance_refuses_inputs_that_name_nothing_and_times_gone_by():
    model = fvsolve.build(fvsolve.load(every_kind()))
    state = fvsolve.initial_state(model)
    with pytest.raises(
        FvsolveError, match='no input named "v1.openning"; did you mean "v1.opening"'
    ):
        fvsolve.advance(model, state, 0.1, {"v1.openning": 0.3})
    with pytest.raises(FvsolveError, match="is before the time of the state"):
        fvsolve.advance(model, state, -1.0)
    with pytest.raises(FvsolveError, match="until = inf is not a time"):
        fvsolve.advance(model, state, np.inf)


def test_advance_stops_for_the_same_reason_as_a_run():
    case = every_kind("log")
    case["nodes"]["gate"]["demand"] = {"time": [0.0, 0.1], "value": [0.002, 0.2]}
    case["numerics"]["below_vapor"] = "stop"
    model = fvsolve.build(fvsolve.load(case))
    result = fvsolve.run(model)
    assert result.reason.startswith("stopped: pressure fell below vapour pressure at t = ")
    with pytest.raises(FvsolveError, match=re.escape(f"advance {result.reason}")):
        fvsolve.advance(model, fvsolve.initial_state(model), 0.6)


@pytest.mark.parametrize(
    "name, value, said",
    [
        (
            "v1.opening",
            2,
            "v1.opening = 2 is out of range; expected a number from 0, shut, to 1, open",
        ),
        ("v1.opening", -1, "v1.opening = -1 is out of range"),
        ("v1.opening", np.nan, "v1.opening = nan is not finite; expected a number from 0"),
        ("v1.opening", "50 %", 'v1.opening = "50 %" is not a number; expected a number from 0'),
        (
            "sea.pressure",
            -5e5,
            "sea.pressure = -500000 is a vacuum; expected an absolute pressure above 0",
        ),
        ("lake.head", -20.0, "lake.head = -20 is -9.481e+04 Pa absolute; expected a head"),
        ("gate.demand", np.inf, "gate.demand = inf is not finite; expected a finite number"),
        ("gate.demand", None, "gate.demand = None is not a number"),
    ],
)
def test_advance_refuses_inputs_out_of_range(name, value, said):
    model = fvsolve.build(fvsolve.load(every_kind()))
    with pytest.raises(FvsolveError, match=re.escape(said)):
        fvsolve.advance(model, fvsolve.initial_state(model), 0.1, {name: value})


@pytest.mark.parametrize("law", ["linear", "log"])
def test_a_reservoir_of_equal_head_or_pressure_is_stated_as_a_reservoir(law):
    """A reservoir held at a head or pressure by an input equals a reservoir with this head as its schedule."""
    given = every_kind(law)
    held = fvsolve.build(fvsolve.load(given))
    start = fvsolve.initial_state(held)
    by_head = fvsolve.advance(held, start, 0.1, {"lake.head": np.float64(70.0), "sea.head": 0.0})
    given["nodes"]["lake"]["head"] = {"time": [-1.0, 0.0], "value": [60.0, 70.0], "kind": "step"}
    stepped = fvsolve.build(fvsolve.load(given))
    whole = fvsolve.advance(stepped, fvsolve.initial_state(stepped), 0.1)
    assert by_head.y == pytest.approx(whole.y, rel=1e-9, abs=1e-9 * np.max(np.abs(whole.y)))
    same = fvsolve.advance(held, start, 0.1, {"lake.pressure": lake_pressure(law, 70.0)})
    assert same.y == pytest.approx(whole.y, rel=1e-6, abs=1e-6 * np.max(np.abs(whole.y)))


def lake_pressure(law: str, head: float) -> float:
    """Pressure at datum of a reservoir with a given head [Pa]."""
    beta, ambient, weight = 2.2e9, 101325.0, 1000.0 * 9.80665
    if law == "linear":
        return ambient + weight * head
    return -beta * np.log(1.0 - weight * head / beta) + ambient  # g head = h(p) - h(ambient)


PLAIN = """
import json, sys
import fvsolve
scene = json.loads(sys.stdin.read())
result = fvsolve.run(scene)
print(json.dumps({"reason": result.reason, "t": list(result.t),
                  "values": {str(p): list(result[str(p)]) for p in result.probes}}))
"""


@pytest.mark.parametrize(
    "law, scheme", [("linear", "muscl"), ("linear", "upwind5"), ("log", "weno5")]
)
def test_compiled_and_plain_python_agree(law, scheme):
    case = every_kind(law, scheme)
    case["numerics"]["end"] = 0.35  # the valve is constant from 0.3 s on
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(
        [sys.executable, "-c", PLAIN],
        input=json.dumps(case),
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    plain, compiled = json.loads(done.stdout), fvsolve.run(case)
    assert plain["reason"] == compiled.reason == "finished"
    assert plain["t"] == pytest.approx(list(compiled.t), abs=1e-12)
    for name, values in plain["values"].items():
        here = compiled[name]
        assert np.asarray(values) == pytest.approx(
            here, rel=1e-9, abs=1e-9 * np.max(np.abs(here))
        ), name


def test_a_restriction_is_laminar_below_the_mass_flow_of_its_reynolds_number():
    """Re = 4 M / (pi d mu), with the stated diameter, or that of the flow area Cd A."""
    case = every_kind()
    case["links"]["v1"] |= {"laminar_reynolds": 40.0, "discharge_coefficient": 0.6}
    case["links"]["v2"] = {
        "type": "valve",
        "from": "pot",
        "to": "mid",
        "diameter": 0.05,
        "laminar_reynolds": 30.0,
    }
    model = fvsolve.build(fvsolve.load(case))
    flows = dict(zip(model.valve_names, model.tables.valves["transition"], strict=True))
    for name, reynolds, diameter in (("v1", 40.0, np.sqrt(4 * 2e-3 / np.pi)), ("v2", 30.0, 0.05)):
        assert 4.0 * flows[name] / (np.pi * diameter * 1e-3) == pytest.approx(reynolds, rel=1e-12)


CELLS = 10
PLACES = (0.05, 0.1, 0.15, 0.3, 0.37, 0.45, 0.5, 0.6, 0.65, 0.7, 0.9, 0.95)


@pytest.mark.parametrize("degree", [1, 2, 3, 4])
@pytest.mark.parametrize("n", [7, 8, 10, 30])
def test_a_place_is_read_with_the_same_weights_from_either_end(degree, n):
    """The weights of a place are equal from both ends and exact for polynomials.

    They do not depend on rounding of n times the fraction at a face or a centre.
    """
    for k in range(1, 4 * n):
        there, back = (
            cells_around(k / (4 * n) * n, degree, n),
            cells_around((1.0 - k / (4 * n)) * n, degree, n),
        )
        assert there[0] == n - back[0] - back[1].size
        assert there[1] == pytest.approx(back[1][::-1], abs=1e-11)
        cells = there[0] + np.arange(there[1].size)
        power = np.arange(degree + 1)[:, None]
        averages = ((cells + 1.0) ** (power + 1) - cells ** (power + 1.0)) / (power + 1) / n**power
        assert averages @ there[1] == pytest.approx((k / (4 * n)) ** power[:, 0], rel=1e-9)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_pipe_drawn_the_other_way_reads_the_same(scheme, law):
    """A reversed pipe gives the same pressures and opposite flows, to rounding, at faces, centres and between."""
    nodes = {"lake": reservoir(6e5), "gate": junction(), "sink": reservoir(2e5)}
    shuts = {"start": 0.0, "duration": 0.02, "value": [1.0, 0.3]}
    friction = {"model": "quasi-steady", "roughness": 1e-4}
    numerics = {"scheme": scheme, "method": "rk4", "step": 1e-3, "start": 0.0}
    found = []
    for start, end, side in (("lake", "gate", 1), ("gate", "lake", -1)):
        links = {
            "line": pipe(start, end, 100.0, 0.1, 1000.0, CELLS, friction=friction),
            "valve": valve("gate", "sink", 1e-3, opening=shuts),
        }
        at = PLACES if side > 0 else [1.0 - x for x in PLACES]
        probes = [f"line.{what}@{x!r}" for what in ("pressure", "flow") for x in at]
        result = fvsolve.run(
            scene(nodes, links, 0.15, numerics, probes, fluid=WATER | {"law": law})
        )
        flow = ["flow" in probe for probe in probes]
        found.append(
            np.array([result[probe] for probe in probes]) * np.where(flow, side, 1)[:, None]
        )
    one, other = found
    for rows in (slice(0, len(PLACES)), slice(len(PLACES), None)):
        assert np.abs(one[rows] - other[rows]).max() < 1e-9 * np.abs(one[rows]).max()


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("law", ["linear", "log"])
def test_where_nothing_weighs_there_is_no_head_and_all_else(law):
    nodes = {
        "lake": reservoir(1.5e5),
        "end": {"type": "chamber", "volume": 1.0, "initial_pressure": 1e5},
    }
    case = scene(
        nodes,
        {"gate": valve("lake", "end", 1e-3)},
        0.1,
        {"rtol": 1e-6},
        ["end.head", "end.pressure"],
        0.01,
    )
    result = fvsolve.run({**case, "gravity": 0.0, "fluid": {**WATER, "law": law}})
    assert (
        result.ok and np.all(np.isnan(result["end.head"])) and np.ptp(result["end.pressure"]) > 1e3
    )


PACKAGE = str(Path(fvsolve.__file__).parent)
HAZEN = {"model": "hazen-williams", "coefficient": 110.0}


def ladder(rungs: int, line: str) -> dict:
    """Case of two rows of junctions, each behind a lake, with cross connections: three pipes per rung."""
    nodes = {f"{side}{k}": junction(1e-4, elevation=0.0) for k in range(rungs) for side in "ab"}
    nodes |= {"lake-a": lake(60.0), "lake-b": lake(60.0)}
    links = {}
    for k in range(rungs):
        for side in "ab":
            before = f"{side}{k - 1}" if k else f"lake-{side}"
            links[f"{side}{k}"] = pipe(before, f"{side}{k}", 60.0, 0.3, 1200.0, 4, friction=HAZEN)
        links[f"r{k}"] = pipe(f"a{k}", f"b{k}", 60.0, 0.2, 1200.0, 4, friction=HAZEN)
    return scene(nodes, links, 1.0, {"pipe_model": line}, ["a0.head"])


def effort(rungs: int, line: str) -> int:
    """Number of lines of the package that are executed to read and build a network."""
    count = 0

    def watch(frame, event, _):
        nonlocal count
        if not frame.f_code.co_filename.startswith(PACKAGE):
            return None
        count += event == "line"
        return watch

    given = ladder(rungs, line)
    before = sys.gettrace()
    sys.settrace(watch)
    try:
        assert fvsolve.build(fvsolve.load(given)).checks["pipes"]
    finally:
        sys.settrace(before)
    return count


@pytest.mark.parametrize("line", ["finite-volume", "delay-line"])
def test_four_times_the_pipes_take_less_than_four_times_the_work(line):
    effort(5, line)  # caches
    few, many = effort(12, line), effort(48, line)
    assert many < 3.8 * few  # work proportional to pairs of pipes gives 3.95 and more


def test_a_ladder_of_two_like_branches_flows_alike_in_both():
    """A symmetric ladder with a large sparse system has no cross flow."""
    model = fvsolve.build(fvsolve.load(ladder(120, "finite-volume")))
    flow = dict(zip([p.name for p in model.pipes], model.tables.pipes["flow"], strict=True))
    rho = model.case.properties.density
    drawn = rho * 1e-4 * np.arange(120, 0, -1)
    assert [flow[f"a{k}"] for k in range(120)] == pytest.approx(drawn, rel=1e-9)
    assert [flow[f"b{k}"] for k in range(120)] == pytest.approx(drawn, rel=1e-9)
    assert max(abs(flow[f"r{k}"]) for k in range(120)) < 1e-9 * drawn[0]

"""Jumps in delay lines against characteristics at Courant number 1: short lines, devices, pulses and friction.

Jumps that arrive within a step at a junction with a valve or a rigid column are computed to second order.
"""

import numpy as np
import pytest
from reference.delays import turned
from reference.lines_with_jumps import EXACT, SPEED, line
from reference.scenes import (
    AMBIENT,
    GRAVITY,
    RHO,
    WATER,
    area,
    chamber,
    junction,
    lake,
    pipe,
    scene,
    step,
    valve,
)
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.core.solve import initial_state
from fvsolve.core.solve.solve import Run
from fvsolve.features.delay_lines.feature import history_of, lines_of
from fvsolve.features.delay_lines.kernels import wave_bounds
from fvsolve.features.delay_lines.kernels import wave_history as history
from fvsolve.features.delay_lines.kernels.history_update import earliest_arrival, write_arrival
from fvsolve.features.delay_lines.kernels.line_rates import smooth_wave_linear
from fvsolve.studies.outcome import RowSink

METHODS = {
    "euler": {"courant": 0.9},
    "rk4": {"step": 0.0137},
    "gauss-4": {"step": 0.05},
    "rodas-5p": {"rtol": 1e-4},
}


def in_cells(case: dict, size: float) -> dict:
    """Case with characteristics at Courant number 1 in cells of length `size` [m]."""
    links = {
        name: link | {"cells": round(link["length"] / size)} if link["type"] == "pipe" else link
        for name, link in case["links"].items()
    }
    kept = {key: value for key, value in case["numerics"].items() if key in ("end", "start")}
    return {**case, "links": links, "numerics": kept | EXACT}


def same_extremes(found: fvsolve.Result, truth: fvsolve.Result, share: float) -> None:
    for name, one in truth.extremes.items():
        span = one.maximum - one.minimum
        assert found.extremes[name].minimum == pytest.approx(one.minimum, abs=share * span), name
        assert found.extremes[name].maximum == pytest.approx(one.maximum, abs=share * span), name


def stub(length: float, numerics: dict, end: float = 4.0) -> dict:
    """Case of a valve that shuts at once at the end of a short narrow pipe behind a long pipe."""
    nodes = {
        "lake": lake(50.0),
        "j": junction(),
        "gate": junction(),
        "out": {"type": "reservoir", "pressure": AMBIENT},
    }
    links = {
        "main": line("lake", "j", 1000.0),
        "short": line("j", "gate", length, 0.15),
        "v": valve(
            "gate", "out", 0.00061, {"time": [0.0, 0.5], "value": [1.0, 0.0], "kind": "step"}
        ),
    }
    return scene(
        nodes,
        links,
        end,
        {"pipe_model": "delay-line", **numerics},
        ["gate.head", "j.head", "v.flow"],
        0.05,
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("length", [2.0, 8.0])
def test_a_jump_takes_its_time_in_a_line_shorter_than_a_step(method, length):
    """A jump in a line shorter than a step reaches the exact head of 160.23 m, and all extremes of characteristics."""
    case = stub(length, {"method": method, **METHODS[method]})
    found, truth = fvsolve.run(case), fvsolve.run(in_cells(case, length))
    assert found.extremes["gate.head"].maximum == pytest.approx(160.229, abs=0.01)
    same_extremes(found, truth, 2e-3)
    assert found.ledger["mass"]["relative"] < 1e-12


def test_three_short_lines_and_a_step_longer_than_all():
    """Pipes of 2 to 4 m under steps of 0.1 s have the extremes of characteristics."""
    case = stub(2.0, {"method": "euler", "step": 0.1}, 2.0)
    case["nodes"]["k"] = junction()
    case["links"]["main"]["length"] = 4.0
    case["links"]["spur"] = line("j", "k", 2.0, 0.2)
    truth = fvsolve.run(in_cells(case, 2.0))
    for one in (case, turned(case)):
        same_extremes(fvsolve.run(one), truth, 5e-3)


DEVICES = {
    "check-valve": (
        {
            "type": "check-valve",
            "from": "side",
            "to": "n",
            "diameter": 0.3,
            "loss_coefficient": 1.0,
        },
        40.0,
    ),
    "relief-valve": (
        {
            "type": "relief-valve",
            "from": "n",
            "to": "side",
            "diameter": 0.1,
            "set_pressure": "6 barg",
            "overpressure": "0.5 bar",
        },
        2.0,
    ),
    "rupture-disc": (
        {
            "type": "rupture-disc",
            "from": "n",
            "to": "side",
            "diameter": 0.1,
            "burst_pressure": "6 bar",
        },
        2.0,
    ),
    "pump": (
        {
            "type": "pump",
            "from": "side",
            "to": "n",
            "check_valve": True,
            "curve": {"flow": [0.0, 0.05, 0.1], "head": [48.0, 40.0, 20.0]},
        },
        0.0,
    ),
}


def demand_near_device(device: str, numerics: dict, before: float, after: float) -> dict:
    """Case of a demand that changes at once, 100 m from an instantaneous device."""
    link, head = DEVICES[device]
    nodes = {
        "side": lake(head),
        "r": lake(50.0),
        "n": junction(),
        "m": junction(step(0.5, before, after)),
    }
    links = {"device": link, "p": line("n", "m", 100.0), "p2": line("m", "r", 370.0)}
    return scene(
        nodes,
        links,
        1.3,
        {"pipe_model": "delay-line", **numerics},
        ["n.head", "device.flow", "p.flow@0"],
        0.05,
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("method", METHODS)
def test_a_device_that_acts_before_the_arrival_of_a_jump_is_noted(device, method):
    """Devices switch at the arrival of a jump, with the events and extremes of cells of 2 m.

    Cells change the jump to a ramp, so a disc bursts there at its burst pressure; with lines it bursts at once.
    """
    demand = (0.04, 0.0) if device in ("relief-valve", "rupture-disc") else (0.0, 0.04)
    case = demand_near_device(device, {"method": method, **METHODS[method]}, *demand)
    found, truth = fvsolve.run(case), fvsolve.run(in_cells(case, 2.0))
    if device == "rupture-disc":
        assert found.extremes["n.head"].maximum == pytest.approx(50.0)
        assert found["n.head"][-1] == pytest.approx(truth["n.head"][-1], rel=1e-6)
    else:
        same_extremes(found, truth, 1e-3)
    told, right = (
        [(one["what"], one["time"]) for one in run.summary["events"]] for run in (found, truth)
    )
    assert [one for one, _ in told] == [one for one, _ in right]
    assert [t for _, t in told] == pytest.approx([t for _, t in right], abs=0.005)


def test_a_device_behind_a_short_line():
    """A jump reaches a check valve through a line shorter than a step, with the extremes of characteristics."""
    case = demand_near_device("check-valve", {"method": "euler", "step": 0.013}, 0.0, 0.04)
    case["nodes"]["q"] = junction()
    case["links"]["p"]["to"] = "q"
    case["links"]["stub"] = line("q", "m", 4.0)
    for one in (case, turned(case)):
        same_extremes(fvsolve.run(one), fvsolve.run(in_cells(one, 4.0)), 3e-3)


def pulse(numerics: dict, end: float = 1.9) -> dict:
    """Case of a demand that stops for 3 ms."""
    demand = {"time": [0.0, 0.5, 0.503], "value": [0.05, 0.0, 0.05], "kind": "step"}
    nodes = {"lake": lake(50.0), "j": junction(demand), "d": junction()}
    links = {"one": line("lake", "j", 1000.0), "two": line("j", "d", 313.7)}
    return scene(
        nodes,
        links,
        end,
        {"pipe_model": "delay-line", **numerics},
        ["j.head", "d.head", "two.head@0.31"],
        0.05,
        limits={"high": {"on": "d", "quantity": "head", "maximum": 100.0}},
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_pulse_shorter_than_a_step_is_seen_wherever_it_passes(method):
    found = fvsolve.run(pulse({"method": method, **METHODS[method]}))
    rise = SPEED * 0.05 / (2.0 * np.pi / 4 * 0.3**2) / 9.80665
    assert found.extremes["d.head"].maximum == pytest.approx(50.0 + 2.0 * rise, rel=1e-6)
    assert found.extremes["d.head"].t_max == pytest.approx(0.8137, abs=1e-6)
    assert found.extremes["two.head@0.31"].maximum == pytest.approx(50.0 + rise, rel=1e-6)
    assert not found.summary["verdicts"][0]["ok"]
    envelope = RHO * 9.80665 * 2.0 * rise
    assert np.max(found.envelope["two"]["max_pressure"]) - np.min(
        found.envelope["two"]["min_pressure"]
    ) == pytest.approx(envelope, rel=1e-6)  # the pulse overlaps its reflection at the dead end


@pytest.mark.parametrize("turn", [False, True])
def test_small_jumps_that_arrive_together_count_by_their_sum(turn):
    """Four pulses of 3 ms meet at a junction; their sum enters the main, though each part is below the least jump.

    The pressure at the junction is 2 sum(Y p) / sum(Y), with the admittances Y of the pipes.
    """
    flow, many, bore = 1e-5, 4, 0.03
    nodes = {"lake": lake(50.0), "j": junction()}
    links = {"main": line("lake", "j", 1000.0)}
    for k in range(many):
        demand = {"time": [0.0, 0.5, 0.503], "value": [0.0, flow, 0.0], "kind": "step"}
        nodes[f"d{k}"], links[f"p{k}"] = junction(demand), line("j", f"d{k}", 100.0, bore)
    numerics = {
        "pipe_model": "delay-line",
        "method": "rk4",
        "step": 0.0137,
        "delay_tolerance": 0.16,
    }
    probe = "main.head@0.1" if turn else "main.head@0.9"  # 100 m from the junction
    case = scene(nodes, links, 0.78, numerics, [probe], 0.05)
    found = fvsolve.run(turned(case) if turn else case)
    ratio = (bore / 0.3) ** 2  # of the admittances
    fall = SPEED * flow / area(bore) / GRAVITY * 2.0 * many * ratio / (many * ratio + 1.0)
    assert found.extremes[probe].minimum == pytest.approx(50.0 - fall, abs=1e-9)


@pytest.mark.parametrize("share", [0.5, 0.25, 0.3])
def test_a_probe_reads_the_same_from_both_ends_of_a_line(share):
    """At joints of stretches and between them, rows, extremes and envelopes are those of the line turned round."""
    nodes = {
        "lake": lake(50.0),
        "gate": junction({"start": 0.013, "duration": 0.21, "value": [0.05, 0.0]}),
    }
    friction = {"model": "steady", "factor": 0.2}
    found = []
    for ends, at in ((("lake", "gate"), share), (("gate", "lake"), 1.0 - share)):
        links = {"main": line(*ends, 1000.0, friction=friction)}
        numerics = {
            "pipe_model": "delay-line",
            "method": "euler",
            "step": 0.0137,
            "delay_tolerance": 0.004,
        }
        found.append(fvsolve.run(scene(nodes, links, 3.0, numerics, [f"main.head@{at}"], 0.01)))
    one, other = found
    name, turned_name = f"main.head@{share}", f"main.head@{1.0 - share}"
    assert one[name] == pytest.approx(other[turned_name], abs=1e-9)
    same = one.extremes[name], other.extremes[turned_name]
    for key in ("minimum", "maximum", "t_min", "t_max"):
        assert getattr(same[0], key) == pytest.approx(getattr(same[1], key), abs=1e-9)
    for key in ("min_pressure", "max_pressure"):
        assert one.envelope["main"][key] == pytest.approx(
            other.envelope["main"][key][::-1], abs=1e-4
        )


@pytest.mark.parametrize("numerics", METHODS.items(), ids=METHODS)
def test_extremes_along_a_line_reach_as_far_as_a_pulse_has_come(numerics):
    """A pulse of 10 ms from t = 0.1 s on has come 400 m far at 0.5 s: places beyond have not seen it."""
    method, settings = numerics
    demand = {"time": [0.0, 0.1, 0.11], "value": [0.0, -0.05, 0.0], "kind": "step"}
    found = fvsolve.run(
        scene(
            {"a": junction(demand), "lake": lake(50.0)},
            {"one": line("a", "lake", 1000.0, cells=20)},
            0.5,
            {"pipe_model": "delay-line", "method": method, **settings},
            ["one.head@0.3", "one.head@0.8"],
        )
    )
    along = found.envelope["one"]
    passed = along["distance"] < SPEED * 0.4
    rise = SPEED * 0.05 / (np.pi / 4 * 0.3**2) / GRAVITY
    assert along["max_head"] == pytest.approx(np.where(passed, 50.0 + rise, 50.0), rel=1e-9)
    times = np.where(passed, 0.1 + along["distance"] / SPEED, 0.0)
    assert along["t_max"] == pytest.approx(times, abs=1e-9)
    assert found.extremes["one.head@0.8"].maximum == pytest.approx(50.0, rel=1e-12)


def test_pulses_that_cross_between_two_places_of_a_line():
    """The envelope contains the sum of two pulses that cross inside a line with two stored places."""

    def stop(t):
        return {"time": [0.0, t, t + 0.002], "value": [0.0, -0.05, 0.0], "kind": "step"}

    nodes = {"a": junction(stop(0.5)), "b": junction(stop(0.53)), "lake": lake(50.0)}
    links = {"one": line("a", "b", 300.0, cells=2), "far": line("b", "lake", 5000.0)}
    found = fvsolve.run(
        scene(
            nodes,
            links,
            0.75,
            {"pipe_model": "delay-line", "method": "euler", "step": 0.02},
            ["a.head"],
        )
    )
    rise = RHO * SPEED * 0.05 / (np.pi / 4 * 0.3**2)
    greatest = np.max(found.envelope["one"]["max_pressure"]) - np.min(
        found.envelope["one"]["min_pressure"]
    )
    # the second pulse divides between two pipes
    assert greatest == pytest.approx(1.5 * rise, rel=1e-6)


def test_a_small_jump_leaves_its_line_though_fewer_jumps_are_on_their_way_than_before():
    """A small jump, 6e-5 of the sum of all, reaches a shut disc after forty jumps have left through the lake.

    The threshold for jumps at the end of a step is proportional to their number; the decrease must not lose a jump.
    """
    at, many = np.concatenate([[0.0], 0.5 + 1e-4 * np.arange(40)]), 0.05 * np.linspace(1.0, 0.0, 41)
    small = 6e-5 * 0.05
    nodes = {
        "lake": lake(50.0),
        "side": lake(2.0),
        "n": junction(),
        "m": junction(step(0.5, 0.0, -2.0 * small)),
        "busy": junction({"time": at.tolist(), "value": many.tolist(), "kind": "step"}),
    }
    links = {
        "disc": DEVICES["rupture-disc"][0],
        "p": line("n", "m", 1030.0),
        "p2": line("m", "lake", 5000.0),
        "main": line("lake", "busy", 1000.0),
    }
    numerics = {
        "pipe_model": "delay-line",
        "method": "euler",
        "step": 0.05,
        "delay_tolerance": 1e-9,
    }
    found = fvsolve.run(scene(nodes, links, 2.7, numerics, ["n.head", "m.head"], 0.01))
    rise, start = SPEED * small / (np.pi / 4 * 0.3**2) / 9.80665, found["n.head"][0]
    for name, first, before in (("n.head", 1.53, 0.0), ("m.head", 2.56, 1.0)):
        for t, share in ((first - 0.015, before), (first + 0.015, 2.0), (first + 0.1, 2.0)):
            assert np.interp(t, found.t, found[name]) - start == pytest.approx(
                share * rise, abs=1e-6 * rise
            ), (name, t)


@pytest.mark.parametrize("method", METHODS)
def test_nothing_arrives_before_its_jump(method):
    """With friction the flow at the lake is constant until the jump arrives at 2 s, then that of characteristics."""
    nodes = {
        "lake": lake(50.0),
        "gate": junction(),
        "out": {"type": "reservoir", "pressure": AMBIENT},
    }
    friction = {"model": "steady", "factor": 0.01}
    links = {
        "main": line("lake", "gate", 1000.0, friction=friction, minor_loss=100.0),
        "v": valve("gate", "out", 0.01, {"time": [0.0, 1.0], "value": [1.0, 0.0], "kind": "step"}),
    }
    numerics = {"pipe_model": "delay-line", "method": method, **METHODS[method]}
    found = fvsolve.run(scene(nodes, links, 2.4, numerics, ["main.flow@0"], 0.01))
    before, flow = found.t < 1.999, found["main.flow@0"]
    assert np.ptp(flow[before]) < 0.01 * flow[0]
    truth = fvsolve.run(in_cells(scene(nodes, links, 2.4, numerics, ["main.flow@0"], 0.01), 2.0))
    after = np.searchsorted(found.t, 2.3)
    right = np.interp(2.3, truth.t, truth["main.flow@0"])
    assert flow[after] == pytest.approx(right, abs=0.02 * flow[0])


@pytest.mark.parametrize("method", METHODS)
def test_an_air_valve_lets_air_in_as_a_jump_arrives(method):
    """An air valve opens as a jump arrives and keeps ambient pressure, where the wave alone would give -123 m."""
    nodes = {
        "lake": lake(20.0),
        "n": {"type": "air-valve", "inlet": 0.1, "outlet": 0.05},
        "m": junction(step(0.5, 0.0, 0.1)),
    }
    links = {"p": line("n", "m", 100.0), "p2": line("lake", "n", 400.0)}
    numerics = {
        "pipe_model": "delay-line",
        "method": method,
        **({"step": 0.002} if method == "euler" else METHODS[method]),
    }
    case = scene(nodes, links, 0.75, numerics, ["n.head", "p2.flow@1"], 0.01)
    found, truth = fvsolve.run(case), fvsolve.run(in_cells(case, 2.0))
    assert found.extremes["n.head"].minimum > -1.0
    assert found.summary["events"][0]["time"] == pytest.approx(0.6, abs=1e-9)
    same_extremes(found, truth, 2e-2)


def test_auto_takes_cells_where_a_force_is_requested():
    case = stub(8.0, {"method": "euler", "courant": 0.9}, 1.0)
    case["numerics"] |= {"pipe_model": "auto", "scheme": "muscl", "method": "ssp-rk3"}
    case["output"]["probes"] = ["main.force"]
    found = fvsolve.build(fvsolve.load(case)).checks["pipes"]
    assert found["main"]["line"] == "finite-volume" and "force" in found["main"]["line_why"]
    assert found["short"]["line"] == "delay-line"


@pytest.mark.parametrize(("length", "ramp", "step"), [(9.0, 0.02, 0.01), (901.3, 0.005, 0.002)])
def test_a_ramp_too_quick_for_the_steps_is_reported(length, ramp, step):
    """A ramp too fast for the steps gives a notice of kind `lines`, and `auto` selects cells."""
    case = stub(2.0, {"method": "euler", "step": step}, 2.5)
    del case["links"]["short"], case["nodes"]["j"]
    case["links"]["main"] |= {"to": "gate", "length": length}
    case["links"]["v"]["opening"] = {"start": 0.5, "duration": ramp, "value": [1.0, 0.0]}
    case["output"]["probes"] = ["gate.head"]
    found, truth = fvsolve.run(case), fvsolve.run(in_cells(case, length / round(length / 0.25)))
    told = [one for one in found.summary["warnings"] if one["kind"] == "lines"]
    one, other = found.extremes["gate.head"].maximum, truth.extremes["gate.head"].maximum
    assert len(told) == 1 and told[0]["value"] > 0.01
    assert abs(one - other) > 0.01 * (other - 50.0)
    case["numerics"] |= {"pipe_model": "auto", "scheme": "muscl"}
    assert fvsolve.build(fvsolve.load(case)).checks["pipes"]["main"]["line"] == "finite-volume"


LENGTH, BORE, FLOW, HEAD = 300.0, 0.3, 0.05, 50.0
AFTER = 0.55  # time since the arrival of the jump, before any other wave [s]
# admittance [kg/(s Pa)], Joukowsky jump [Pa]
Y, JUMP = area(BORE) / SPEED, RHO * SPEED * FLOW / area(BORE)
NARROW, VOLUME = 4e-3, 30.0  # effective area of the valve [m2], volume of the chamber [m3]
COLUMN = 40.0 / area(0.2)  # length over area of the column [1/m]
COLUMN_LINK = {"type": "rigid-column", "from": "j", "to": "behind", "length": 40.0, "diameter": 0.2}


def ran(behind: dict, gap: dict, method: str, h: float) -> fvsolve.Result:
    """Run of a demand that stops at a dead end, 0.3 s from a junction and 0.9 s from a lake.

    The link `gap` joins the junction to the node `behind`.
    """
    nodes = {
        "lake": lake(HEAD),
        "j": junction(),
        "gate": junction(step(0.1, FLOW, 0.0)),
        "behind": behind,
    }
    links = {
        "far": pipe("lake", "j", 2 * LENGTH, BORE, SPEED, 4),
        "near": pipe("j", "gate", LENGTH, BORE, SPEED, 4),
    }
    numerics, end = (
        {"pipe_model": "delay-line", "method": method, "step": h},
        0.1 + LENGTH / SPEED + AFTER,
    )
    found = fvsolve.run(
        scene(nodes, {**links, "gap": gap}, end, numerics, ["behind.pressure", "gap.flow"], end)
    )
    assert found.reason == "finished"
    assert abs(found.ledger["mass"]["relative"]) < 1e-14
    return found


@pytest.mark.parametrize("method", ["rk4", "trapezoid"])
def test_a_chamber_behind_a_valve(method):
    """A chamber behind a valve follows V rho / beta dp/dt = M with M^2 = 2 rho (Cd A)^2 (jump - M / 2Y - p)."""
    k = 2.0 * RHO * NARROW**2

    def rate(t, p):
        half = k / (4.0 * Y)
        flow = np.sqrt(half**2 + k * max(JUMP - p[0], 0.0)) - half
        return [WATER["bulk_modulus"] / (RHO * VOLUME) * flow]

    exact = (
        AMBIENT
        + RHO * GRAVITY * HEAD
        + solve_ivp(rate, (0.0, AFTER), [0.0], rtol=1e-11, atol=1e-3).y[0, -1]
    )
    for h in (0.037, 0.017, 0.0041):
        found = ran(chamber(VOLUME), valve("j", "behind", NARROW), method, h)
        assert abs(found["behind.pressure"][-1] / exact - 1.0) < 0.6 * h**2


@pytest.mark.parametrize("method", ["rk4", "trapezoid"])
def test_a_column_at_a_junction(method):
    """A rigid column follows L / A dM/dt = jump - M / 2Y.

    The solution is M = 2 Y jump (1 - exp(-t / T)) with T = 2 Y L / A.
    """
    exact = 2.0 * Y * JUMP * (1.0 - np.exp(-AFTER / (2.0 * Y * COLUMN))) / RHO
    for h in (0.037, 0.017, 0.0041):
        found = ran(lake(HEAD), COLUMN_LINK | {"friction": {"model": "none"}}, method, h)
        assert abs((found["gap.flow"][-1] - found["gap.flow"][0]) / exact - 1.0) < 0.6 * h**2


@pytest.mark.parametrize("h", [0.02, 0.057, 0.095])
def test_a_store_that_fills_in_less_than_a_step_takes_no_more_than_there_is(h):
    """A small chamber next to a lake never stores more energy than the kinetic energy of the stopped flow."""
    flow, long, volume = 0.03, 317.0, 0.15
    nodes = {"lake": lake(600.0), "a": junction(step(0.0503, flow, 0.0)), "v": chamber(volume)}
    links = {
        "up": pipe("lake", "a", long, BORE, 1200.0, 2),
        "neck": pipe("a", "v", 123.0, 0.1, 1200.0, 2),
    }
    numerics = {"pipe_model": "delay-line", "method": "trapezoid", "step": h}
    found = fvsolve.run(scene(nodes, links, 30.0, numerics, ["v.pressure"], 0.05))
    risen = np.max(np.abs(found["v.pressure"] - found["v.pressure"][0]))
    assert volume * risen**2 / (2.0 * WATER["bulk_modulus"]) < RHO * flow**2 * long / (
        2.0 * area(BORE)
    )


def closing(start: float, numerics: dict) -> dict:
    """Case of half a second, in which a valve shuts within 0.3 s from the start on."""
    case = stub(130.0, {**numerics, "start": start}, start + 0.5)
    case["links"]["v"]["opening"] = {"time": [start, start + 0.3], "value": [1.0, 0.0]}
    return case


BOUNDED = [
    (stub(130.0, METHODS["euler"]), 100),
    (stub(130.0, METHODS["rodas-5p"]), 100),
    (closing(-64.0, METHODS["euler"]), 0),
    (closing(0.0, METHODS["rk4"]), 0),
]


@pytest.mark.parametrize("case, jumps_seen", BOUNDED)
def test_bounds_by_the_selection_of_cells_contain_all_waves(case, jumps_seen):
    """The bounds of the entries around a time contain each wave at any moment of it, beside its jumps too.

    In the short cases many of these times are before the first entry.
    """
    model = fvsolve.build(fvsolve.load(case))
    run = Run(model, initial_state(model), RowSink(), None)
    assert run.go().finished
    past, random, checked, varied = history_of(run.run_data), np.random.default_rng(7), 0, 0.0
    places, clock = (
        history.offsets_of(past),
        history.reading_data(past, int(past[history.COUNT]) - 1),
    )
    wrap = int(past[history.CAPACITY]) - 1
    longest = max(
        np.diff(
            [
                history.time_of(past, k)
                for k in range(history.PROFILE_ENTRIES, int(past[history.COUNT]))
            ]
        )
    )
    for row, wave in ((lines_of(model)[k].copy(), wave) for k in range(2) for wave in range(2)):
        bounds = history.bounds_of(places, row, 0)
        # anew, because those of the last entry are there
        wave_bounds.write_bounds(past, places, clock, row, 0, wave)
        (ring, mask), head = (
            history.ring_of(places, row, 0),
            history.jump_head(places, int(row["stretch"]), wave),
        )

        def sent_wave(t, ring=ring, mask=mask, head=head, wave=wave):
            jumps = history.jumps_until(past, places, head, t + clock[4])
            return smooth_wave_linear(past, clock, ring, mask, wave, t) + jumps

        for _ in range(50):
            begin, end = np.sort(clock[1] - row["tau"] * random.uniform(0.0, 1.0, 2))
            listed = range(int(past[head + history.JUMP_COUNT]))
            first = history.first_after(past, places, head, begin - clock[4])
            assert history.count_until(past, places, head, first // 2, begin - clock[4]) == first
            assert history.count_back(past, places, head, len(listed), begin - clock[4]) == first
            entries = [wave_bounds.entry_back(past, wrap, clock[0], at) for at in (begin, end)]
            assert entries[1] == wave_bounds.entry_ahead(past, wrap, entries[0], clock[0], end)
            least, greatest = wave_bounds.bounds_between(past, bounds, mask, wave, *entries)
            sent = [past[history.jump_place(past, places, head, i)] for i in listed]
            sent = [t for t in sent if begin <= t <= end]
            times = np.array([*np.linspace(begin, end, 20), *sent, *(np.array(sent) - 1e-6)])
            found = [sent_wave(t) for t in times[times >= begin]]
            assert least <= min(found) and max(found) <= greatest
            # with the entries on both sides
            near = np.linspace(begin - longest, min(end + longest, clock[1]), 40)
            around = [sent_wave(t) for t in near]
            assert greatest - least <= 2.0 * np.ptp([*found, *around]) + 1.0
            checked, varied = checked + len(sent), max(varied, np.ptp(found))
    assert checked >= jumps_seen and varied > 5.0


def test_jumps_arrive_in_the_order_of_their_times():
    """The tree of arrival times gives the least of them after each change, the last one of equal times."""
    random, tree = np.random.default_rng(3), np.full(32, history.INFINITE)
    for k in random.integers(0, 16, 400):
        write_arrival(tree, int(k), float(random.integers(0, 9)))
        assert earliest_arrival(tree) == np.flatnonzero(tree[16:] == tree[16:].min())[-1]

"""Blocks of `controls`, and formulas of time, against hand-written equations in SciPy and against restatements."""

import functools
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
from reference import governor
from reference.folders import CASES
from reference.level_control import METHODS, SECTION, SUPPLY, final, orifice_flow, pi, tower
from reference.resumed_runs import killed_and_resumed, same_files
from reference.scenes import GRAVITY, WATER, junction, lake, pipe, reservoir, scene, valve
from scipy.integrate import solve_ivp
from scipy.interpolate import PchipInterpolator
from scipy.optimize import brentq

import fvsolve
from fvsolve.core.assembly.schedule_tables import period_of
from fvsolve.core.model.jacobian_pattern import jacobian_pattern
from fvsolve.errors import CaseError
from fvsolve.features.controls.balance import Balance
from fvsolve.features.controls.feature import blocks_of
from fvsolve.parts.formula_program import Program
from fvsolve.studies.linearise import linearise

CLOSE = 1e-9
REAL = {"name": "Water", "temperature": 293.15, "law": "table"}
LAWS = [WATER, {**WATER, "law": "log"}, REAL]


def solved(rates, y, times):
    """Solution of dy/dt = rates(t, y, k) over intervals number k between given times, by SciPy."""
    for k, (start, end) in enumerate(zip(times, times[1:], strict=False)):
        found = solve_ivp(
            lambda t, y, k=k: rates(t, y, k), (start, end), y, "DOP853", rtol=1e-12, atol=1e-13
        )
        y = found.y[:, -1]
    return y


@pytest.mark.parametrize("method", METHODS)
def test_a_level_controlled_by_pi_follows_the_explicit_equations(method):
    outlet = {"time": [10.0, 11.0], "value": [0.5, 0.7]}

    def rates(t, y, k):
        level, integral = y
        u = min(max(0.8 * (4.0 - level) + integral, 0.0), 1.0)
        leaving = orifice_flow(np.interp(t, outlet["time"], outlet["value"]), level)
        return [(orifice_flow(u, SUPPLY - level) - leaving) / SECTION, 0.8 * (4.0 - level) / 120.0]

    level, integral = solved(rates, [4.0, 0.25], [0.0, 10.0, 11.0, 300.0])
    found = final(tower({"control": "hold"}, outlet, controls={"hold": pi(4.0)}), method)
    assert found == pytest.approx([level, 0.8 * (4.0 - level) + integral], abs=CLOSE)


@pytest.mark.parametrize("method", METHODS)
def test_pid_with_limits_and_tracking_follows_the_explicit_equations(method):
    gain, ti, td, n, b, c, tt = 1.5, 60.0, 8.0, 6.0, 0.7, 0.3, 25.0
    steps = {"time": [0.0, 20.0, 120.0], "value": [4.0, 4.6, 4.2], "kind": "step"}
    control = pi(
        steps,
        gain,
        ti,
        derivative_time=td,
        derivative_filter=n,
        setpoint_weight=b,
        derivative_weight=c,
        tracking_time=tt,
        limits=[0.1, 0.6],
    ) | {"type": "pid"}

    def rates(t, y, k):
        level, integral, lagged = y
        setpoint = (4.0, 4.6, 4.2)[k]
        z = c * setpoint - level
        v = gain * (b * setpoint - level) + integral + gain * n * (z - lagged)
        u = min(max(v, 0.1), 0.6)
        flow = orifice_flow(u, SUPPLY - level) - orifice_flow(0.5, level)
        return [
            flow / SECTION,
            gain * (setpoint - level) / ti + (u - v) / tt,
            (z - lagged) * n / td,
        ]

    start = [4.0, 0.25 - gain * (b * 4.0 - 4.0), (c - 1.0) * 4.0]
    level = solved(rates, start, [0.0, 20.0, 120.0, 300.0])[0]
    found = final(tower({"control": "hold"}, 0.5, controls={"hold": control}), method)
    assert found[0] == pytest.approx(level, abs=10 * CLOSE)


@pytest.mark.parametrize("method", METHODS)
def test_pi_on_two_lags_without_any_fluid_is_the_step_response_of_its_equations(method):
    step = {"time": [0.0, 1.0], "value": [0.0, 1.0], "kind": "step"}
    controls = {
        "plant": {
            "type": "transfer-function",
            "input": "controls.loop",
            "numerator": [1.0],
            "denominator": [0.05, 0.6, 1.0],
        },
        "loop": {
            "type": "pi",
            "input": "controls.plant",
            "setpoint": step,
            "gain": 5.0,
            "integral_time": 0.4,
        },
    }
    case = {
        "schema": 1,
        "controls": controls,
        "numerics": {"end": 5.0},
        "output": {"probes": ["controls.plant.output", "controls.loop.error"]},
    }
    found = final(case, method)
    assert list(final({**case, "fluid": {"name": "ISO VG 46"}}, method)) == list(found)

    def rates(t, y, k):
        x, speed, integral = y
        return [speed, (5.0 * (k - x) + integral - x - 0.6 * speed) / 0.05, 5.0 * (k - x) / 0.4]

    x = solved(rates, [0.0, 0.0, 0.0], [0.0, 1.0, 5.0])[0]
    assert found == pytest.approx([x, 1.0 - x], abs=CLOSE)


@functools.cache
def lagged() -> list[float]:
    """Level of the tower [m] and state of the lag after 200 s by SciPy, for a formula of both."""

    def rates(t, y, k):
        level, lag = y  # G = (2 s + 1) / (20 s + 1) = 0.1 + 0.9 / (20 s + 1)
        e = 0.1 * level + lag
        u = min(0.6, max(0.1, 0.25 + 1.5 * (4.0 - level) + 0.2 * e)) + (
            0.02 * np.sin(t / 7.0) if k == 0 else 0.0
        )
        return [
            (orifice_flow(u, SUPPLY - level) - orifice_flow(0.5, level)) / SECTION,
            (0.9 * level - lag) / 20.0,
        ]

    fine = {"rtol": 1e-11, "atol": 1e-13, "max_step": 0.05}
    y = [3.5, 0.9 * 3.5]
    for k, span in enumerate([(0.0, 50.0), (50.0, 200.0)]):
        y = solve_ivp(lambda t, y, k=k: rates(t, y, k), span, y, "Radau", **fine).y[:, -1]
    return [*y]


@pytest.mark.parametrize("method", METHODS)
def test_a_formula_of_level_and_lagged_level_follows_the_explicit_equations(method):
    formula = "min(0.6, max(0.1, 0.25 + 1.5*(4 - h) + 0.2*e)) + 0.02*sin(t/7)*where(t < 50, 1, 0)"
    controls = {
        "act": {
            "type": "function",
            "inputs": {"h": "tower.level", "e": "controls.lag"},
            "formula": formula,
        },
        "lag": {
            "type": "transfer-function",
            "input": "tower.level",
            "numerator": [2.0, 1.0],
            "denominator": [20.0, 1.0],
        },
    }
    y = lagged()
    found = final(tower({"control": "act"}, 0.5, 3.5, 200.0, controls=controls), method)
    assert found[0] == pytest.approx(y[0], abs=CLOSE) and found[2] == pytest.approx(
        0.1 * y[0] + y[1], abs=CLOSE
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_table_is_a_monotone_cubic_held_beyond_its_ends(method):
    inputs, outputs = [3.6, 3.8, 4.0, 4.05], [0.6, 0.5, 0.2, 0.1]
    curve = PchipInterpolator(inputs, outputs)

    def rates(t, y):
        u = float(curve(np.clip(y[0], 3.6, 4.05)))
        return [(orifice_flow(u, SUPPLY - y[0]) - orifice_flow(0.5, y[0])) / SECTION]

    level = solve_ivp(rates, (0.0, 100.0), [3.5], "Radau", rtol=1e-11, atol=1e-13, max_step=0.05).y[
        0, -1
    ]
    control = {
        "type": "table",
        "input": "tower.level",
        "table": {"input": inputs, "output": outputs},
    }
    found = final(tower({"control": "act"}, 0.5, 3.5, 100.0, controls={"act": control}), method)
    assert found == pytest.approx([level, float(curve(level))], abs=CLOSE)


@pytest.mark.parametrize("method", METHODS)
def test_a_force_that_holds_a_mass_is_decided_after_the_nodes(method):
    """PD control of a mass on a damper: x'' = (K (r - x) - K Td x' filtered - b x') / m, here with a filtered D."""
    nodes = {
        "wall": {"type": "frame", "initial_position": 0.0},
        "body": {"type": "mass", "mass": 3.0, "initial_position": 0.5},
    }
    links = {
        "drive": {"type": "force", "from": "wall", "to": "body", "force": {"control": "hold"}},
        "drag": {"type": "damper", "from": "wall", "to": "body", "damping": 2.0},
    }
    setpoint = {"time": [0.0, 1.0], "value": [0.5, 0.8], "kind": "step"}
    control = {
        "type": "pid",
        "input": "body.position",
        "setpoint": setpoint,
        "gain": "40 N/m",
        "derivative_time": 0.5,
    }
    case = scene(nodes, links, 4.0, {}, ["body.position"], 0.1, controls={"hold": control})

    def rates(t, y, k):
        x, speed, lagged = y
        force = 40.0 * ((0.5, 0.8)[k] - x) + 400.0 * (-x - lagged)
        return [speed, (force - 2.0 * speed) / 3.0, (-x - lagged) * 20.0]

    x = solved(rates, [0.5, 0.0, -0.5], [0.0, 1.0, 4.0])[0]
    assert final(case, method)[0] == pytest.approx(x, abs=CLOSE)


def moving_case(law):
    """Case of a pump whose speed holds the filtered pressure behind a pipe, and a demand that follows a formula."""
    nodes = {
        "lake": lake(5.0, elevation=0.0),
        "a": {"type": "junction", "elevation": 0.0},
        "b": {"type": "chamber", "volume": 0.2, "elevation": 0.0},
        "out": reservoir({"control": "back"}, elevation=0.0),
    }
    links = {
        "pump": {
            "type": "pump",
            "from": "lake",
            "to": "a",
            "speed": {"control": "hold"},
            "curve": {"flow": [0.0, 0.02, 0.04], "head": [40.0, 34.0, 16.0]},
        },
        "main": pipe("a", "b", 60.0, 0.1, 1000.0, 6),
        "gate": valve("b", "out", 8e-4),
    }
    hold = {
        "type": "pi",
        "input": "b.pressure",
        "setpoint": "2.2 bar",
        "gain": "0.02 1/bar",
        "integral_time": 0.5,
        "filter": 0.05,
        "limits": [0.2, 1.5],
    }
    back = {
        "type": "function",
        "formula": "1.2 + 0.3*where(t > 1, sin(t - 1), 0)",
        "unit": "bar",
        "limits": [1e5, 2e5],
    }
    controls = {"hold": hold, "back": back}
    return scene(
        nodes,
        links,
        3.0,
        {},
        ["b.pressure", "controls.hold.output"],
        0.01,
        fluid=law,
        controls=controls,
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("law", LAWS, ids=["linear", "log", "table"])
@pytest.mark.parametrize("method", ["ssp-rk3", *METHODS])
def test_a_loop_at_rest_does_not_change_any_bit(method, law):
    case = fvsolve.load(moving_case(law), {"numerics.method": method})
    case = fvsolve.load(case, {"controls.back.formula": "1.2 + 0*t", "output.every": 0.1})
    assert fvsolve.build(case).steady["moving"] == []
    run = fvsolve.run(case)
    assert run.ok, run.warnings
    # without controls this scene moves by as much by `radau-iia-5` under these laws
    rounding = 1e-11 if method == "radau-iia-5" and law is not WATER else 0.0
    for probe in run.probes:
        assert np.ptp(run[probe]) <= rounding * run[probe][0]


NO_NUMBERS = [
    "0.1 + 0.1*log(h - 3.5)",
    "min(0.6, max(0.05, log(h - 3.5)))",
    "where(log(h - 3.5) < 5, 0.05, 0.6)",
]


@pytest.mark.parametrize("numerics", [{"method": method, "rtol": 1e-8} for method in METHODS]
                         + [{"method": "rk4", "step": 0.5}], ids=lambda numerics: numerics["method"])  # fmt: skip
@pytest.mark.parametrize("formula", NO_NUMBERS)
def test_an_output_that_is_no_number_ends_the_run_there_within_limits_too(formula, numerics):
    act = {"type": "function", "inputs": {"h": "tower.level"}, "formula": formula}
    run = fvsolve.run(tower({"control": "act"}, 0.9, numerics=numerics, controls={"act": act}))
    assert not run.ok and "the output of controls.act is not a finite number at t = " in run.reason
    assert run["tower.level"][-1] > 3.5 - 1e-9 and run.t[-1] > 50.0


@pytest.mark.parametrize("driven", ["pump", "spool", "push", "nothing"])
def test_an_output_that_is_no_number_ends_the_run_whatever_it_drives(driven, monkeypatch):
    monkeypatch.chdir(CASES)
    act = {"type": "function", "inputs": {}, "formula": "0.3 + 0*sqrt(2.5 - t)"}
    case, control = {"schema": 1, "controls": {"act": act}}, {"control": "act"}
    if driven == "pump":
        case |= tomllib.loads(Path("tank-relay.toml").read_text()) | {"controls": {"act": act}}
        case["links"]["pump"]["speed"] = control
    elif driven != "nothing":
        case |= tomllib.loads(Path("cylinder-servo.toml").read_text())
        act["formula"] = "0*sqrt(0.025 - t)"
        case["links"]["push"] = {"type": "force", "from": "ground", "to": "load", "force": 0.0}
        case["links"][driven][{"spool": "position", "push": "force"}[driven]] = control
    case = {key: case[key] for key in case if key not in ("expect", "compare", "limits", "output")}
    end = 0.05 if "push" in case.get("links", ()) else 5.0
    case |= {"numerics": {"end": end, "method": "dormand-prince", "rtol": 1e-7}}
    with pytest.raises(
        CaseError, match=r"controls.act.formula: .* at t = (2.5|0.025)\d* s is not a finite number"
    ):
        fvsolve.run(case)
    # a block with inputs is not searched before the run: without the search this block ends the run as one with inputs
    monkeypatch.setattr(Program, "pole_fault", lambda *_: "")
    run = fvsolve.run(case)
    assert not run.ok and "the output of controls.act is not a finite number at t = " in run.reason
    assert run.t[-1] <= end / 2 or driven == "nothing"


def test_a_balanced_start_finds_the_opening_that_the_flow_needs():
    model = fvsolve.build(fvsolve.load(tower({"control": "hold"}, 0.5, controls={"hold": pi(4.0)})))
    assert blocks_of(model)[0]["start"] == pytest.approx(0.25, rel=1e-14)  # sqrt(4 / 16) / 2
    assert model.steady["moving"] == []


RELIEF = {
    "inside": ("(p - 3e5) / 5e5", {}),
    "shut": ("(p - 6e5) / 5e5", {}),
    "shut, steep": ("(p - 6e5) / 5e4", {"links.relief.area": 0.02}),
    "open": ("(p - 1e5) / 5e4", {}),
    "filtered": ("(p - 6e5) / 5e5", {"controls.copy.filter": 0.1}),
}


@pytest.mark.parametrize("reversed_order", [False, True])
@pytest.mark.parametrize("relief", RELIEF)
def test_a_block_before_a_limited_block_starts_with_the_input(relief, reversed_order):
    """Valves in series and a relief valve, whose opening in [0, 1] follows a copy of a pressure by a formula.

    The pressure is the root of the balance of flows. The step beyond the limit had moved the copy too, for the whole
    run and without a note.
    """
    formula, changes = RELIEF[relief]
    links = {
        "main": valve("high", "gate", 1e-3),
        "outlet": valve("gate", "low", 1e-3),
        "relief": valve("gate", "low", 5e-4, {"control": "command"}),
    }
    nodes = {"high": reservoir(1.0e6), "low": reservoir(1e5), "gate": junction()}
    probes = ["gate.pressure", "controls.copy.output", "controls.command.output"]
    case = scene(nodes, links, 1.0, {"step": 0.05, "method": "rk4"}, probes, 0.1)
    case["controls"] = {
        "copy": {"type": "function", "inputs": {"x": "gate.pressure"}, "formula": "x"},
        "command": {
            "type": "function",
            "inputs": {"p": "controls.copy"},
            "formula": formula,
            "limits": [0, 1],
            "period": 0.1,
        },
    }
    if reversed_order:
        case["controls"] = dict(reversed(case["controls"].items()))
    result = fvsolve.run(case, changes)
    opened = changes.get("links.relief.area", 5e-4)

    def opening(p):
        return min(max(eval(formula, {"p": p}), 0.0), 1.0)

    def surplus(p):
        return 1e-3 * math.sqrt(1.0e6 - p) - (1e-3 + opened * opening(p)) * math.sqrt(p - 1e5)

    pressure = brentq(surplus, 1.0001e5, 0.9999e6, xtol=1e-9)
    for row in (0, -1):
        assert result["gate.pressure"][row] == pytest.approx(pressure, rel=1e-9)
        assert result["controls.copy.output"][row] == pytest.approx(pressure, rel=1e-9)
        assert result["controls.command.output"][row] == pytest.approx(opening(pressure), abs=1e-8)


def test_outputs_that_follow_from_levels_and_setpoints_need_no_search(monkeypatch):
    """A search solves the steady start once for each block: it took 20 s for 24 blocks of a network of 400 nodes."""
    step = {"time": [0.0, 60.0], "value": [3.0, 3.5], "kind": "step"}
    case = tower(0.3, {"control": "loop"}, controls={"loop": pi(step, -0.5, None)})
    monkeypatch.setattr(Balance, "iterate", lambda *given: pytest.fail("a search"))
    result = fvsolve.run(case)
    level, setpoint = result["tower.level"], np.where(result.t < 60.0, 3.0, 3.5)
    output = result["controls.loop.output"]
    assert output[0] == pytest.approx(0.5, abs=1e-12)
    away = np.abs(result.t - 60.0) > 1e-6  # a jump has two rows
    assert output[away] == pytest.approx(
        np.clip(0.5 * (level - setpoint), 0.0, 1.0)[away], abs=1e-9
    )


def test_a_stated_initial_output_is_that_at_the_start():
    case = tower({"control": "hold"}, 0.5, controls={"hold": pi(4.3, initial=0.4)})
    model = fvsolve.build(fvsolve.load(case))
    assert model.observe(fvsolve.initial_state(model)).tolist() == [4.0, 0.4]


PROPORTIONAL = {  # u = 2 (4 - x): 2 at the start, where the limit is 1
    "pi": pi(4.0, 2.0, None),
    "function": {"type": "function", "inputs": {"x": "tower.level"}, "formula": "2*(4 - x)"},
    "table": {
        "type": "table",
        "input": "tower.level",
        "table": {"input": [2.0, 6.0], "output": [4.0, -4.0]},
    },
    "transfer-function": {
        "type": "transfer-function",
        "input": "controls.error",
        "numerator": [2.0],
        "denominator": [1e-9, 1.0],
    },
}


@pytest.mark.parametrize(
    ("kind", "method"),
    [
        *((kind, "radau-iia-5") for kind in PROPORTIONAL),
        ("pi", "rodas-5p"),
        ("pi", "dormand-prince"),
    ],
)
def test_a_law_that_begins_beyond_its_limits_is_followed_when_it_comes_back(kind, method):
    error = {"type": "function", "inputs": {"x": "tower.level"}, "formula": "4 - x"}
    controls = {"hold": PROPORTIONAL[kind]} | (
        {"error": error} if kind == "transfer-function" else {}
    )
    limits = {} if kind != "table" else {"limits": [0.0, 1.0]}
    case = tower(
        {"control": "hold"}, 0.3, 3.0, controls=controls | {"hold": controls["hold"] | limits}
    )

    def rates(t, y, k):
        u = min(max(2.0 * (4.0 - y[0]), 0.0), 1.0)
        return [(orifice_flow(u, SUPPLY - y[0]) - orifice_flow(0.3, y[0])) / SECTION]

    (level,) = solved(rates, [3.0], [0.0, 300.0])
    assert final(case, method)[0] == pytest.approx(level, abs=1e-8) and 3.5 < level < 4.0


@pytest.mark.parametrize("period", [None, 0.5])
def test_initial_of_a_function_leaves_no_offset(period):
    act = {"type": "function", "inputs": {}, "formula": "0.1 + 0.01*t", "initial": 0.5}
    act |= {} if period is None else {"period": period, "offset": 0.25}
    run = fvsolve.run(tower({"control": "act"}, 0.3, end=10.0, controls={"act": act}))
    found = dict(zip(run.t.round(6).tolist(), run["controls.act.output"].tolist(), strict=True))
    assert found[0.1] == pytest.approx(0.101 if period is None else 0.5, abs=1e-12)
    assert found[9.7] == pytest.approx(0.197 if period is None else 0.1 + 0.01 * 9.25, abs=1e-12)


@pytest.mark.parametrize(
    ("formula", "end", "period"),
    [
        ("sin(2*pi*t/11)", 120.0, 11.0), ("sin(2*pi*t/11)", 11.0, 11.0),
        ("sin(1e4*t)", 100.0, 2e-4 * math.pi), ("sin(2*pi*100*t)", 20.0, 0.01),
        ("sin(2*pi*t*50) > -0.3", 0.1, 0.02), ("t > 0.02", 0.1, math.inf), ("exp(-t)*(t > 0.03)", 0.1, math.inf),
        ("max(0, min(1, (t - 3600)/60))", 86400.0, math.inf), ("t^2", 3.0, math.inf),
    ],
)  # fmt: skip
def test_the_period_of_a_formula_is_that_of_its_waves_not_of_jumps_or_plateaus(
    formula, end, period
):
    assert period_of(Program(formula), 0.0, end) == pytest.approx(period, rel=0.02)


def test_explicit_and_implicit_methods_agree_on_a_pump_a_pipe_and_a_filter_under_all_laws():
    for law in LAWS:
        found = [
            final(moving_case(law), method, **{"numerics.rtol": 1e-8})[0]
            for method in ("dormand-prince", "radau-iia-5")
        ]
        assert found[0] == pytest.approx(found[1], rel=1e-7)


@pytest.mark.parametrize("law", LAWS, ids=["linear", "log", "table"])
def test_the_pattern_of_the_jacobian_contains_inputs_and_targets_of_blocks(law):
    for case in (
        moving_case(law),
        tower({"control": "hold"}, 0.5, controls={"hold": pi(4.0, filter=3.0)}),
    ):
        model = fvsolve.build(fvsolve.load(case))
        pattern = jacobian_pattern(model).toarray()[: model.y_size].astype(bool)
        y = model.start + 1e-3 * model.scale * np.random.default_rng(1).standard_normal(
            model.y_size
        )
        jacobian = model.jacobian(0.1, y)
        small = 1e-9 * np.abs(jacobian).max(axis=1, keepdims=True)
        assert not (np.abs(jacobian) > small)[~pattern].any()


@pytest.mark.parametrize("method", METHODS)
def test_restated_loops_have_the_same_result(method):
    """The order of blocks and parts; PI as a transfer function, and as a gain beside an integrator; a moved gain."""
    steps = {"time": [0.0, 20.0], "value": [4.0, 4.1], "kind": "step"}
    plain = tower({"control": "hold"}, 0.5, controls={"hold": pi(steps)})
    found = final(plain, method)[0]
    turned = {
        **plain,
        "nodes": dict(reversed(plain["nodes"].items())),
        "links": dict(reversed(plain["links"].items())),
    }
    assert final(turned, method)[0] == pytest.approx(found, abs=1e-12)
    error = {
        "type": "function",
        "inputs": {"h": "tower.level"},
        "formula": "where(t < 20, 4.0, 4.1) - h",
    }
    as_transfer = {
        "error": error,
        "hold": {
            "type": "transfer-function",
            "input": "controls.error",
            "numerator": [0.8, 0.8 / 120.0],
            "denominator": [1.0, 0.0],
        },
    }
    assert final(tower({"control": "hold"}, 0.5, controls=as_transfer), method)[0] == pytest.approx(
        found, abs=CLOSE
    )
    summed = {
        "hold": {
            "type": "function",
            "inputs": {"e": "controls.error", "i": "controls.integral"},
            "formula": "0.8*e + i",
        },
        "integral": {
            "type": "transfer-function",
            "input": "controls.error",
            "numerator": [0.8 / 120.0],
            "denominator": [1.0, 0.0],
        },
        "error": error,
    }
    assert final(tower({"control": "hold"}, 0.5, controls=summed), method)[0] == pytest.approx(
        found, abs=CLOSE
    )
    centimetres = pi(
        {"time": [0.0, 20.0], "value": ["400 cm", "410 cm"], "kind": "step"}, "0.008 1/cm", "2 min"
    )
    assert (
        final(tower({"control": "hold"}, 0.5, controls={"hold": centimetres}), method)[0] == found
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    "formula, schedule",
    [
        ("0.5 + 0.2*sin(2*pi*t/11 + 0.3)", {"mean": 0.5, "amplitude": 0.2, "period": 11.0, "phase": 0.3}),
        ("min(0.7, max(0.3, 0.3 + 0.4*(t - 5)/20))", {"start": 5.0, "duration": 20.0, "value": [0.3, 0.7]}),
        ("where(t < 15, 0.5, 0.2)", {"time": [0.0, 15.0], "value": [0.5, 0.2], "kind": "step"}),
        ("0.5 + 0.02*abs(t - 20)*(t < 30)", {"time": [0.0, 20.0, 29.999999999999996, 30.0],
                                             "value": [0.9, 0.5, 0.7, 0.5]}),
    ],
    ids=["wave", "ramp", "jump", "kink"],
)  # fmt: skip
def test_a_formula_is_the_schedule_that_it_states(method, formula, schedule):
    by_formula, by_schedule = (
        final(tower(0.25, outlet, end=60.0), method)[0] for outlet in (formula, schedule)
    )
    assert by_formula == pytest.approx(by_schedule, abs=CLOSE)


def test_a_formula_with_a_unit_is_that_of_its_si_value():
    case = tower(0.25, 0.3)
    case["nodes"]["town"] = {
        "type": "inflow",
        "flow": {"formula": "-2 - sin(t/30)", "unit": "l/s"},
        "elevation": 0.0,
    }
    si = {
        **case,
        "nodes": {
            **case["nodes"],
            "town": {"type": "inflow", "flow": "-2e-3 - 1e-3*sin(t/30)", "elevation": 0.0},
        },
    }
    assert final(case, "dormand-prince")[0] == pytest.approx(
        final(si, "dormand-prince")[0], abs=1e-12
    )


def test_a_formula_drives_a_joint_with_its_slopes():
    """Angle a t^2 / 2 of an arm with a mass at 2 m: the torque of the joint is (m r^2 + J) a + m g r cos(angle)."""
    joint = {"kind": "revolute", "axis": [0, 1, 0], "angle": "0.1*t^2"}
    nodes = {
        "arm": {
            "type": "body",
            "mass": 3.0,
            "inertia": [1.0, 2.0, 2.0],
            "centre_of_mass": [2.0, 0.0, 0.0],
            "joint": joint,
        }
    }
    wave = {**nodes["arm"], "joint": {**joint, "angle": "0.4*sin(t)"}}
    for body, angle, rate in (
        (nodes["arm"], lambda t: 0.1 * t * t, 0.2),
        (wave, lambda t: 0.4 * math.sin(t), None),
    ):
        case = scene({"arm": body}, {}, 1.3, {"rtol": 1e-10}, ["arm.angle", "arm.joint_ty"], 0.1)
        run = fvsolve.run(case)
        change = rate if rate is not None else -0.4 * math.sin(1.3)
        torque = (3.0 * 4.0 + 2.0) * change - 3.0 * GRAVITY * 2.0 * math.cos(angle(1.3))
        assert run["arm.angle"][-1] == pytest.approx(angle(1.3), abs=1e-12)
        assert run["arm.joint_ty"][-1] == pytest.approx(torque, rel=1e-9)


def test_linearise_knows_the_slopes_of_formulas():
    act = {
        "type": "function",
        "inputs": {"h": "tower.level"},
        "formula": "0.02*h^2 + where(t < 1, 0, 0.3)",
        "filter": 9.0,
    }
    system = linearise(
        tower({"control": "act"}, 0.9, controls={"act": act}), inputs=["outlet.opening"], at=0.0
    )
    mass_flow = WATER["density"] * orifice_flow(1.0, SUPPLY - 4.0)
    assert system.a[0, 1] == pytest.approx(0.16 * mass_flow, rel=1e-7)


def test_linearise_cuts_a_loop_at_its_output():
    """Return ratio of a PI on a tank: its output over its output, L = -K (1 + 1 / (Ti s)) B / (s - a)."""
    case = tower({"control": "hold"}, 0.5, controls={"hold": pi(4.0)})
    system = linearise(
        case,
        ["controls.hold.output", "controls.hold.setpoint"],
        ["tower.level", "controls.hold.output"],
    )
    slope = orifice_flow(1.0, 16.0)  # d flow / d opening
    loss = -(orifice_flow(0.25, 16.0) / 32.0 + orifice_flow(0.5, 4.0) / 8.0) / SECTION
    s = 0.3j
    transfer = system.c @ np.linalg.solve(s * np.eye(2) - system.a, system.b) + system.d
    plant = slope / SECTION / (s - loss)
    assert transfer[0, 0] == pytest.approx(plant, rel=1e-6)
    assert transfer[1, 0] == pytest.approx(-0.8 * (1.0 + 1.0 / (120.0 * s)) * plant, rel=1e-6)
    assert transfer[:, 1] == pytest.approx([0.0, 0.8 * (1.0 + 1.0 / (120.0 * s))], rel=1e-6)
    assert system.input_values == pytest.approx((0.25, 4.0)) and system.input_units == ("-", "m")


def test_advance_knows_outputs_and_setpoints_as_inputs():
    case = tower({"control": "hold"}, 0.5, controls={"hold": pi(4.0)})
    model = fvsolve.build(fvsolve.load(case))
    start = fvsolve.initial_state(model)
    held = fvsolve.advance(model, start, 50.0, {"controls.hold.output": 0.4})
    open_loop = fvsolve.build(fvsolve.load(tower(0.4, 0.5)))
    free = fvsolve.advance(open_loop, fvsolve.initial_state(open_loop), 50.0)
    assert held.y[0] == pytest.approx(free.y[0], rel=1e-9)
    moved = fvsolve.advance(model, start, 50.0, {"controls.hold.setpoint": 4.2})
    step = {"time": [-1.0, 0.0], "value": [4.0, 4.2], "kind": "step"}
    stepped = fvsolve.build(
        fvsolve.load(tower({"control": "hold"}, 0.5, controls={"hold": pi(step)}))
    )
    bumped = fvsolve.advance(stepped, fvsolve.initial_state(stepped), 50.0)
    assert moved.y == pytest.approx(bumped.y, rel=1e-9)


@pytest.mark.parametrize("method", ["ssp-rk3", "rodas-5p", "auto"])
def test_a_killed_and_resumed_loop_is_the_unbroken_run(tmp_path, method):
    case = fvsolve.load(
        moving_case(WATER), {"numerics.method": method, "numerics.end": 60.0, "output.every": 1.0}
    )
    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    assert whole.ok
    same_files(tmp_path / "whole", killed_and_resumed(tmp_path / "whole", 20.0))


def test_the_governor_follows_its_plant_by_characteristics():
    t, head, turns, opening, level = governor.plant(60, 40.0)
    run = fvsolve.run("governor", {"numerics.end": 40.0, "output.every": 1.0, "expect": {}})
    assert run.ok and max(run["unit.speed"]) < 360.0
    for at in (7.0, 10.0, 20.0, 40.0):
        k, row = round(at / (t[1] - t[0])), round(at)
        assert run["unit.speed"][row] == pytest.approx(turns[k], abs=0.01)
        assert run["spiral.head"][row] == pytest.approx(head[k], abs=0.02)
        assert run["controls.servomotor.output"][row] == pytest.approx(opening[k], abs=2e-4)
        assert run["shaft.level"][row] == pytest.approx(level[k], abs=3e-3)

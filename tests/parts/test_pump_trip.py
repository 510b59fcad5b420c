"""Pump trips: run-down of the shaft, rigid columns, pipes, four quadrants and energy, against SciPy at 1e-12."""

import math

import numpy as np
import pytest
from pytest import approx
from reference.pump_columns import (
    BORE,
    EFFICIENCY,
    INERTIA,
    OMEGA,
    SECTION,
    TIGHT,
    TORQUE,
    column,
    column_truth,
    head,
    operating_flow,
    torque,
)
from reference.scenes import GRAVITY, NO_FRICTION, SHARP, junction, lake, pipe, pump, scene, step
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import fvsolve
from fvsolve.parts.pump.head_curve import suter_tables
from fvsolve.studies.energy_balance import energy
from fvsolve.studies.linearise import linearise

ONE = {"flow": [0.1], "head": [50.0]}
SHAFT = {
    "curve": ONE,
    "curve_extrapolation": "parabola",
    "rated_speed": OMEGA,
    "inertia": INERTIA,
    "efficiency": EFFICIENCY,
}
SUTER = {"suter": {"rated_flow": 0.1, "rated_head": 50.0, "table": "radial-35"}}
FOUR = {**SUTER, "rated_speed": OMEGA, "inertia": INERTIA, "efficiency": EFFICIENCY}
WH, WB = (np.array(row) for row in suter_tables()["radial-35"])


def suter(table, n, q):
    v = q / 0.1
    return (n * n + v * v) * np.interp(
        math.pi + math.atan2(v, n), np.linspace(0, 2 * math.pi, len(table)), table
    )


def test_an_isolated_shaft_runs_down_as_1_over_time():
    """At no flow the torque is T0 n^2, so 1 / n = 1 + T0 (t - trip) / (J omega)."""
    nodes = {"sump": lake(0.0), "top": lake(100.0)}
    keys = {**SHAFT, "trip": 1.0, "check_valve": True}
    result = fvsolve.run(
        scene(
            nodes, {"pump": pump("sump", "top", **keys)}, 10.0, TIGHT, ["pump.speed", "pump.flow"]
        )
    )
    exact = 1.0 / (1.0 + 2.0 / 3.0 * TORQUE / (INERTIA * OMEGA) * np.maximum(result.t - 1.0, 0.0))
    assert result["pump.speed"] == approx(exact, rel=1e-9)
    assert not result["pump.flow"].any() and not result.summary["events"]


@pytest.mark.parametrize("check", [False, True])
def test_pump_column_and_lakes_follow_scipy(check):
    lift, end = 30.0, 6.0
    case = column(
        lift, end, ["pump.speed", "pump.flow", "pump.torque"], **SHAFT, trip=1.0, check_valve=check
    )
    result = fvsolve.run(case)
    q0 = operating_flow(lift)
    truth = column_truth(lift, 1.0, q0, 1.0, end, check=check)
    before, after = result.t <= 1.0, (result.t > 1.0) & (result.t <= truth.t[-1])
    assert (
        result["pump.flow"][before] == approx(q0, rel=1e-12)
        and np.ptp(result["pump.flow"][before]) == 0.0
    )
    n, q = truth.sol(result.t[after])
    assert result["pump.speed"][after] == approx(n, rel=1e-8)
    # the curve is straight below 1e-5 of its last flow
    assert result["pump.flow"][after] == approx(q, abs=2e-8)
    assert result["pump.torque"][after] == approx(
        [torque(*one) for one in zip(n, q, strict=True)], rel=1e-7
    )
    if check:
        events = result.summary["events"]
        assert [event["what"] for event in events] == ["check valve shuts"]
        assert events[0]["time"] == approx(truth.t_events[0][0], abs=1e-8)
        assert not result["pump.flow"][result.t > truth.t[-1]].any()
    else:
        assert result["pump.flow"][-1] < -0.05
        assert [mark["what"] for mark in result.summary["marks"]] == ["outside its curve"]


def test_four_quadrants_follow_scipy_into_turbining():
    """Kinks of the table, which is linear between its values, limit the accuracy of all methods."""
    lift, end = 30.0, 12.0
    result = fvsolve.run(
        column(lift, end, ["pump.speed", "pump.flow", "pump.head"], **FOUR, trip=1.0)
    )
    heads = lambda n, q: 50.0 * suter(WH, n, q)  # noqa: E731
    q0 = operating_flow(lift, lambda q: heads(1.0, q))
    assert result["pump.flow"][0] == approx(q0, rel=1e-11)
    truth = column_truth(lift, 1.0, q0, 1.0, end, heads, lambda n, q: TORQUE * suter(WB, n, q))
    after = result.t > 1.0
    n, q = truth.sol(result.t[after])
    assert n[-1] < -0.8 and q[-1] < -0.04  # reverse speed and flow
    assert result["pump.speed"][after] == approx(n, abs=1e-7)
    assert result["pump.flow"][after] == approx(q, abs=1e-8)
    assert not result.summary["marks"]


def test_the_published_table_is_the_rated_point_where_it_should_be():
    assert len(WH) == len(WB) == 89 and WH[0] == WH[-1] and WB[0] == WB[-1]
    assert suter(WH, 1.0, 0.1) == approx(1.0) and suter(WB, 1.0, 0.1) == approx(1.0)


SPEED, FAR = 1000.0, 1000.0  # wave speed [m/s] and length of the main [m]


def line(lift: float, end: float, numerics, probes, cells: int = 100, **keys) -> dict:
    nodes = {"sump": lake(0.0), "out": junction(), "top": lake(lift)}
    main = pipe("out", "top", FAR, BORE, SPEED, cells, friction=NO_FRICTION)
    return scene(
        nodes, {"pump": pump("sump", "out", **keys), "main": main}, end, numerics, probes, 0.02
    )


def test_a_pump_that_stops_at_once_makes_the_joukowsky_drop():
    """At Courant number 1 exactly -b q |q| = lift + (a / g A) (q - q0), the characteristic from the lake."""
    lift, rise = 40.0, SPEED / (GRAVITY * SECTION)
    case = line(lift, 2.9, SHARP, ["out.head", "pump.flow"], curve=ONE, speed=step(1.0, 1.0, 0.0))
    result = fvsolve.run(case)
    q0 = math.sqrt((200.0 / 3.0 - lift) / (50.0 / 3.0 / 0.01))
    q = brentq(lambda q: head(0.0, q) - lift - rise * (q - q0), -1.0, 1.0, xtol=1e-15)
    during = (result.t > 1.001) & (result.t < 2.9)
    assert result["pump.flow"][during] == approx(q, rel=1e-10)
    assert result["out.head"][during] == approx(head(0.0, q), rel=1e-10)
    shut = fvsolve.run(
        line(lift, 2.9, SHARP, ["out.head"], curve=ONE, speed=step(1.0, 1.0, 0.0), check_valve=True)
    )
    # q > 0: it stays open
    assert shut["out.head"][during] == approx(result["out.head"][during], rel=1e-10)


def test_trip_against_a_pipe_follows_its_characteristic():
    """H = lift + (a / g A) (q - q0) until the reflection returns from the lake, so one equation gives the speed."""
    lift, rise = 40.0, SPEED / (GRAVITY * SECTION)
    numerics = {"scheme": "upwind5", "method": "rk4", "courant": 0.8}
    result = fvsolve.run(
        line(lift, 2.9, numerics, ["pump.speed", "out.head"], 200, **SHAFT, trip=1.0)
    )
    q0 = math.sqrt((200.0 / 3.0 - lift) / (50.0 / 3.0 / 0.01))
    flow = lambda n: brentq(lambda q: head(n, q) - lift - rise * (q - q0), -1.0, 1.0, xtol=1e-15)  # noqa: E731
    rate = lambda t, y: [-torque(y[0], flow(y[0])) / (INERTIA * OMEGA)]  # noqa: E731
    truth = solve_ivp(
        rate, (1.0, 2.9), [1.0], method="DOP853", rtol=1e-12, atol=1e-14, dense_output=True
    )
    after = (result.t > 1.0) & (result.t < 2.8)  # later, precursors of the reflection
    n = truth.sol(result.t[after])[0]
    # kink of the torque at four times the rated flow
    assert result["pump.speed"][after] == approx(n, rel=1e-7)
    assert result["out.head"][after] == approx([head(one, flow(one)) for one in n], abs=1e-6)


def test_order_of_a_method_is_retained_across_the_trip():
    probes = ["pump.flow", "pump.speed"]
    final = []
    for size in (0.1, 0.05, 0.025):
        case = column(30.0, 3.0, probes, {"method": "rk4", "step": size}, **SHAFT, trip=1.0)
        result = fvsolve.run(case)
        final.append(np.array([result[name][-1] for name in probes]))
    truth = column_truth(30.0, 1.0, operating_flow(30.0), 1.0, 3.0).y[::-1, -1]
    errors = [float(np.abs(one - truth).max()) for one in final]
    assert math.log2(errors[0] / errors[1]) == approx(4.0, abs=0.4)
    assert math.log2(errors[1] / errors[2]) == approx(4.0, abs=0.3)


def test_given_torques_turn_the_shaft():
    """The balancing torque keeps the speed to the bit; without torque the speed falls as after a trip."""
    q0 = operating_flow(30.0)
    balance = torque(1.0, q0)
    case = column(30.0, 3.0, ["pump.speed", "pump.flow"], **SHAFT)
    case["links"]["motor"] = {
        "type": "torque",
        "to": "pump.shaft",
        "torque": step(1.0, balance, 0.0),
    }
    result = fvsolve.run(case)
    assert np.ptp(result["pump.speed"][result.t <= 1.0]) == 0.0
    truth = column_truth(30.0, 1.0, q0, 1.0, 3.0)
    after = result.t > 1.0
    assert result["pump.speed"][after] == approx(truth.sol(result.t[after])[0], rel=1e-8)


@pytest.mark.in_turn
@pytest.mark.parametrize("law", ["linear", "log"])
@pytest.mark.parametrize("check", [False, True])
def test_energy_ledger_of_a_trip_closes(law, check):
    """The energy balance closes; work of the motor and kinetic energy of the shaft equal their formulas."""
    numerics = {"scheme": "upwind5", "method": "rk4", "courant": 0.8}
    case = line(40.0, 6.0, numerics, ["pump.flow"], 40, **SHAFT, trip=1.0, check_valve=check)
    case["fluid"] = {**case["fluid"], "law": law}
    found = energy(case)
    assert found.ok and found.relative < 3e-4
    q0 = math.sqrt((200.0 / 3.0 - 40.0) / (50.0 / 3.0 / 0.01))
    if law == "linear":
        assert found.supplied["pump"][-1] == approx(torque(1.0, q0) * OMEGA * 1.0, rel=1e-9)
    speed = fvsolve.run({**case, "output": {"probes": ["pump.speed"]}})["pump.speed"][-1]
    kinetic = 0.5 * INERTIA * OMEGA**2
    assert found.at_start["pump"] == approx(kinetic)
    assert found.stored["pump"][-1] == approx(kinetic * (speed**2 - 1.0), rel=1e-6)


def test_energy_ledger_without_pipes_closes_with_the_step():
    found = energy(column(30.0, 6.0, ["pump.flow"], **SHAFT, trip=1.0))
    assert found.relative < 1e-8
    assert min(np.diff(found.dissipated["pump"])) > 0.0


def test_a_study_holds_the_motor_as_it_is():
    """A later trip is no part of the linearised system: the shaft has rate 0, after the trip that of its torque."""
    case = column(30.0, 3.0, ["pump.speed"], **SHAFT, trip=1.0)
    start, found = linearise(case), linearise(case, at=2.0)
    k = start.states.index("pump.speed")
    assert not start.a[k].any()
    n, q = column_truth(30.0, 1.0, operating_flow(30.0), 1.0, 2.0).y[:, -1]
    slope = (torque(n + 1e-6, q) - torque(n - 1e-6, q)) / 2e-6 / (INERTIA * OMEGA)
    assert found.a[k, k] == approx(-slope, rel=1e-5)


def test_torque_is_an_input():
    case = column(30.0, 3.0, ["pump.speed"], **SHAFT)
    case["links"]["motor"] = {
        "type": "torque",
        "to": "pump.shaft",
        "torque": torque(1.0, operating_flow(30.0)),
    }
    model = fvsolve.build(fvsolve.load(case))
    state = fvsolve.advance(model, fvsolve.initial_state(model), 1.0)
    assert np.abs(state.y).max() < 1e-9
    tripped = fvsolve.advance(model, fvsolve.initial_state(model), 1.0, {"motor.torque": 0.0})
    truth = column_truth(30.0, 1.0, operating_flow(30.0), 0.0, 1.0)
    assert tripped.y[model.state_names.index("pump.speed")] == approx(
        truth.y[0, -1] - 1.0, rel=1e-8
    )


def test_every_dependence_of_a_tripped_pump_is_in_the_pattern():
    """Differences of the rates after the trip are zero outside the Jacobian pattern."""
    from fvsolve.core.model.jacobian_pattern import jacobian_pattern

    model = fvsolve.build(fvsolve.load(line(40.0, 3.0, {}, ["pump.flow"], 6, **SHAFT, trip=0.0)))
    rng = np.random.default_rng(1)
    y = 1e-2 * model.scale * rng.standard_normal(model.y_size)
    pattern = jacobian_pattern(model).toarray()[: model.y_size]
    for k in range(model.y_size):
        step_y = np.zeros(model.y_size)
        step_y[k] = 1e-3 * model.scale[k]
        moved = model.rhs(0.5, y + step_y) != model.rhs(0.5, y - step_y)
        assert not np.any(moved & ~pattern[:, k])


def test_implicit_steps_follow_scipy_too():
    case = column(
        30.0,
        6.0,
        ["pump.speed", "pump.flow"],
        {"method": "rodas-5p", "rtol": 1e-9},
        **SHAFT,
        trip=1.0,
    )
    result = fvsolve.run(case)
    truth = column_truth(30.0, 1.0, operating_flow(30.0), 1.0, 6.0)
    assert result.ok and result["pump.speed"][-1] == approx(truth.y[0, -1], rel=1e-7)
    assert result["pump.flow"][-1] == approx(truth.y[1, -1], rel=1e-6)


def test_a_pump_that_runs_down_forward_until_its_check_valve_shuts_is_a_note_and_no_mark():
    """Forward flow beyond the curve until the check valve shuts gives a notice; without a check valve, a mark."""
    result = fvsolve.run(column(30.0, 6.0, ["pump.flow"], **SHAFT, trip=1.0, check_valve=True))
    assert [event["what"] for event in result.summary["events"]] == ["check valve shuts"]
    assert result.marks == [] and result.ok
    (said,) = [one for one in result.warnings if one.kind == "range"]
    assert (
        said.place == "links.pump"
        and said.ok
        and "from 1.37" in said.text
        and "beyond the last flow of its curve" in said.text
        and "Suter" in said.text
    )
    open_ended = fvsolve.run(column(30.0, 6.0, ["pump.flow"], **SHAFT, trip=1.0))
    assert [mark.what for mark in open_ended.marks] == ["outside its curve"]
    assert "suter = { rated_flow, rated_head, table }" in open_ended.marks[0].text


def test_a_pump_driven_beyond_its_curve_at_its_own_speed_is_marked_though_it_has_a_check_valve():
    case = column(30.0, 3.0, ["pump.flow"], curve=ONE, check_valve=True)
    case["nodes"]["sump"] = lake({"time": [0.0, 1.0], "value": [0.0, 90.0]})
    assert [mark.what for mark in fvsolve.run(case).marks] == ["outside its curve"]

"""Blocks that delay their input, against closed forms, method of steps in SciPy, and restatements."""

from math import factorial, pi

import numpy as np
import pytest
from reference.delay_blocks import TAU, blocks, delayed_loop
from reference.level_control import METHODS, SECTION, final, orifice_flow, tower
from reference.level_control import pi as pi_control
from reference.resumed_runs import killed_and_resumed, same_files
from reference.sampled_control import sampled_plant, two_lags, value_at
from scipy.integrate import solve_ivp

import fvsolve
from fvsolve.errors import CaseError, FvsolveError
from fvsolve.studies import stability
from fvsolve.studies.linearise import linearise

EXACT = 1e-9


def by_steps(t, gain=1.0, tau=TAU):
    """Closed form of `delayed_loop`: a polynomial in each interval of length tau."""
    terms = range(int(t / tau + 1.0 + 1e-12) + 1)
    return sum((-gain) ** k * (t - (k - 1) * tau) ** k / factorial(k) for k in terms)


@pytest.mark.parametrize("method", METHODS)
def test_an_integrator_behind_a_delay_is_the_polynomials_of_the_method_of_steps(method):
    for end in (0.5, 1.3, 5.0):
        found = final(delayed_loop(end=end), method)
        assert found[0] == pytest.approx(by_steps(end), abs=EXACT)
        assert found[2] == pytest.approx(by_steps(end - TAU) if end > TAU else 1.0, abs=EXACT)


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5", "rodas-5p"])
def test_the_loop_grows_from_1_percent_above_its_limit(method):
    """K = pi / (2 tau), by the roots of s + K exp(-s tau)."""
    for factor, grows in ((0.99, False), (1.01, True)):
        run = fvsolve.run(
            delayed_loop(factor * pi / (2 * TAU), end=100.0, method=method, rtol=1e-8)
        )
        x, t = np.abs(np.array(run["controls.plant.output"])), np.array(run.t)
        assert (x[t > 90.0].max() > x[(t > 20.0) & (t < 30.0)].max()) == grows


@pytest.mark.parametrize("method", METHODS)
def test_jumps_and_polynomials_arrive_exactly(method):
    """Square waves and a polynomial of degree 5 through delays, and their integrals."""
    controls = {
        "square": {
            "type": "function",
            "inputs": {},
            "formula": "where(t < 0.3, 0, where(t < 0.9, 2, -1))",
        },
        "late": {"type": "delay", "input": "controls.square", "delay": 0.35},
        "later": {"type": "delay", "input": "controls.late", "delay": 1.1},
        "integral": {
            "type": "transfer-function",
            "input": "controls.later",
            "numerator": [1.0],
            "denominator": [1.0, 0.0],
            "initial": 0.0,
        },
        "power": {"type": "function", "inputs": {}, "formula": "where(t < 0.5, 0, (t - 0.5)^5)"},
        "lagging": {"type": "delay", "input": "controls.power", "delay": 0.8},
    }
    run = fvsolve.run(blocks(controls, 4.0, method=method, rtol=1e-6))
    for k, t in enumerate(run.t):
        for name, since in (("late", 0.35), ("later", 1.45)):
            moment = t - since
            if min(abs(moment - 0.3), abs(moment - 0.9)) > 1e-9:
                assert run[f"controls.{name}.output"][k] == (
                    0.0 if moment < 0.3 else 2.0 if moment < 0.9 else -1.0
                )
        assert run["controls.lagging.output"][k] == pytest.approx(max(t - 1.3, 0.0) ** 5, abs=1e-10)
    end = final(blocks(controls, 4.0), method)
    assert end[3] == pytest.approx(2.0 * 0.6 - (4.0 - 2.35), abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_a_relay_behind_a_delay_swings_with_the_period_of_the_closed_form(method):
    """x' = u(t - tau), u = -1 from x = a on, 1 from x = -a on: period 4 (a + tau), amplitude a + tau."""
    a, tau = 0.4, 0.25
    controls = {
        "place": {
            "type": "transfer-function",
            "input": "controls.late",
            "numerator": [1.0],
            "denominator": [1.0, 0.0],
            "initial": 0.0,
        },
        "relay": {
            "type": "relay",
            "input": "controls.place",
            "on": -a,
            "off": a,
            "output": [-1.0, 1.0],
            "initial": 1,
        },
        "late": {"type": "delay", "input": "controls.relay", "delay": tau},
    }
    period = 4.0 * (a + tau)
    run = fvsolve.run(blocks(controls, 4.0 * period, method=method, rtol=1e-6))
    assert run.ok and run.summary["extremes"]["controls.place.output"]["maximum"] == pytest.approx(
        a + tau, abs=1e-12
    )
    whole = np.interp(np.arange(1, 5) * period, run.t, run["controls.place.output"])
    assert whole == pytest.approx(np.zeros(4), abs=1e-11)


@pytest.mark.parametrize("method", METHODS)
def test_a_level_held_through_a_delay_is_that_of_the_method_of_steps(method):
    tau, gain, ti, end = 7.0, 0.8, 60.0, 60.0
    controls = {
        "late": {"type": "delay", "input": "tower.level", "delay": tau},
        "hold": pi_control(4.2, gain, ti, initial=0.25) | {"input": "controls.late"},
    }
    parts, y = [lambda t: np.array([4.0, 0.0])], [4.0, 0.25 - gain * 0.2]
    for k in range(9):
        begin, stop = k * tau, min((k + 1) * tau, end)

        def rates(t, y, before=parts[-1]):
            error = 4.2 - before(t - tau)[0]
            u = min(max(gain * error + y[1], 0.0), 1.0)
            return [
                (orifice_flow(u, 20.0 - y[0]) - orifice_flow(0.5, y[0])) / SECTION,
                gain * error / ti,
            ]

        found = solve_ivp(
            rates, (begin, stop), y, "DOP853", rtol=1e-12, atol=1e-13, dense_output=True
        )
        y, parts = found.y[:, -1], [*parts, found.sol]
    assert final(tower({"control": "hold"}, 0.5, end=end, controls=controls), method)[
        0
    ] == pytest.approx(y[0], abs=EXACT)


@pytest.mark.parametrize("method", METHODS)
def test_a_sampled_controller_with_a_computing_time_is_its_difference_equation(method):
    """PI at 0.1 s on two lags, its output 0.04 s late: each period has two parts with constant inputs."""
    case = two_lags(3.0, 3.0, method=method)
    case["controls"]["late"] = {"type": "delay", "input": "controls.loop", "delay": 0.04}
    case["controls"]["plant"]["input"] = "controls.late"
    run = fvsolve.run(case)
    (first, b_first), (second, b_second) = sampled_plant(0.04), sampled_plant(0.06)
    x, integral, before = np.zeros(2), 0.0, 0.0
    for k in range(29):
        error = (0.0 if k == 0 else 1.0) - x[0]
        integral += 3.0 * 0.1 / 0.4 * error
        x = first @ x + b_first * before
        before = 3.0 * error + integral
        x = second @ x + b_second * before
        assert value_at(run, "controls.plant.output", 0.1 * (k + 1)) == pytest.approx(
            x[0], abs=EXACT
        )


def test_a_delay_that_acts_at_samples_holds_the_input_of_a_delay_before_each():
    ramp = {"type": "function", "inputs": {}, "formula": "where(t < 1, t, 3)"}
    late = {"type": "delay", "input": "controls.ramp", "delay": 0.25, "period": 0.1, "offset": 0.03}
    run = fvsolve.run(blocks({"ramp": ramp, "late": late}, 2.0))
    for t, value in zip(run.t, run["controls.late.output"], strict=True):
        sample = np.floor((t - 0.03) / 0.1 + 1e-9) * 0.1 + 0.03 - 0.25
        if abs((t - 0.03) / 0.1 - round((t - 0.03) / 0.1)) > 1e-6:
            assert value == pytest.approx(max(sample, 0.0) if sample < 1.0 else 3.0, abs=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_two_delays_in_series_equal_a_delay_of_their_sum_in_any_order_of_blocks(method):
    whole = delayed_loop(2.0)
    controls = whole["controls"]
    halves = controls | {
        "half": {"type": "delay", "input": "controls.plant", "delay": 0.3, "initial": 1.0},
        "late": controls["late"] | {"input": "controls.half", "delay": 0.4},
    }
    split = final(whole | {"controls": halves}, method)
    assert split == pytest.approx(final(whole, method), abs=10 * EXACT)  # the steps differ
    assert list(final(whole | {"controls": dict(reversed(halves.items()))}, method)) == list(split)


def test_a_loop_at_rest_does_not_move():
    controls = {
        "late": {"type": "delay", "input": "tower.level", "delay": 3.0},
        "hold": pi_control(4.0, 0.8, 60.0) | {"input": "controls.late"},
    }
    for method in METHODS:
        case = tower(
            {"control": "hold"},
            0.5,
            end=50.0,
            controls=controls,
            numerics={"method": method, "rtol": 1e-6},
        )
        assert set(fvsolve.run(case)["tower.level"]) == {4.0}


def test_an_initial_output_jumps_to_the_input_after_the_delay_and_limits_and_filter_act():
    late = {
        "type": "delay",
        "input": "controls.x",
        "delay": 0.5,
        "initial": 5.0,
        "limits": [0.0, 6.0],
        "filter": 0.2,
    }
    run = fvsolve.run(
        blocks({"x": {"type": "function", "inputs": {}, "formula": "8*t"}, "late": late}, 2.0)
    )
    lagged = 8.0 * (np.array(run.t) - 0.5 - 0.2 + 0.2 * np.exp(-(np.array(run.t) - 0.5) / 0.2))
    expected = np.where(np.array(run.t) < 0.5, 5.0, np.minimum(lagged, 6.0))
    assert np.array(run["controls.late.output"])[
        np.abs(np.array(run.t) - 0.5) > 1e-6
    ] == pytest.approx(expected[np.abs(np.array(run.t) - 0.5) > 1e-6], abs=EXACT)


@pytest.mark.parametrize("method", ["rk4", "radau-iia-5", "rodas-5p"])
def test_given_steps_end_where_breaks_arrive(method):
    errors = [
        abs(
            final_of(delayed_loop(2.0, end=6.33, method=method, step=step))[0] - by_steps(6.33, 2.0)
        )
        for step in (0.1, 0.05)
    ]
    assert errors[0] < 1e-3 and errors[1] < errors[0] / 7.0


def final_of(case):
    run = fvsolve.run(case)
    assert run.ok
    return [run[str(probe)][-1] for probe in run.probes]


def test_advance_in_parts_carries_the_inputs_on():
    model = fvsolve.build(fvsolve.load(delayed_loop(2.0)))
    state = fvsolve.initial_state(model)
    for t in (0.3, 0.7, 1.9, 3.2):
        state = fvsolve.advance(model, state, t)
        assert model.observe(state)[0] == pytest.approx(by_steps(t, 2.0), abs=EXACT)
        rate = model.rhs(state)
        assert rate == pytest.approx(
            [-2.0 * (by_steps(t - TAU, 2.0) if t > TAU else 1.0)], abs=1e-8
        )


def test_a_killed_and_resumed_run_with_delays_is_the_unbroken_run(tmp_path):
    case = delayed_loop(0.52, tau=3.0, end=2000.0, rtol=1e-9)
    controls = case["controls"]
    controls["swing"] = {
        "type": "relay",
        "input": "controls.plant",
        "on": 0.1,
        "off": -0.1,
        "initial": 1,
    }
    controls["follow"] = {"type": "delay", "input": "controls.swing", "delay": 40.0}
    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    assert whole.ok and whole.summary["steps"] > 2000
    same_files(tmp_path / "whole", killed_and_resumed(tmp_path / "whole", 1100.0))


def test_features_that_need_all_inputs_in_the_state_are_refused():
    model = fvsolve.build(fvsolve.load(delayed_loop()))
    with pytest.raises(FvsolveError, match="control of type delay"):
        model.rhs(0.0, model.start)
    with pytest.raises(FvsolveError, match="controls.late of type delay needs earlier inputs"):
        linearise(delayed_loop(), inputs=["controls.gain.output"])
    cut = linearise(
        delayed_loop(2.0), inputs=["controls.late.output"], outputs=["controls.plant.output"]
    )
    assert cut.a == pytest.approx(np.zeros((1, 1))) and cut.b * cut.c == pytest.approx(
        -2.0 * np.ones((1, 1))
    )


def test_step_limits_hold_delays():
    """A delay acts no quicker than its delay, so the limit of the main is that without it."""
    late = {"controls.pressure.gain": 1e-9}
    rows = [
        stability("digital-pressure", ["upwind5"], ["rk4"], steps=100, set=late | more).rows[0]
        for more in ({}, {"controls.radio.delay": 5.0})
    ]
    assert rows[0].predicted == pytest.approx(rows[1].predicted, rel=1e-12)
    assert rows[0].measured == pytest.approx(rows[0].predicted, rel=0.05)


@pytest.mark.parametrize(
    ("change", "numerics", "place", "text"),
    [
        ({"delay": 0.0}, {}, "controls.late.delay", "above 0"),
        ({"delay": None}, {}, "controls.late", "delay"),
        ({"delay": "1 m"}, {}, "controls.late.delay", "time"),
        (
            {"delay": 0.1},
            {"method": "rk4", "step": 0.2},
            "controls.late.delay",
            "expected at least 0.2 s",
        ),
        ({"delay": 1e-12}, {"rtol": 1e-6}, "controls.late.delay", "at most 1e+09"),
        ({"setpoint": 1.0}, {}, "controls.late.setpoint", "unknown key"),
    ],
)
def test_faults_of_delays_are_named(change, numerics, place, text):
    case = delayed_loop(**numerics)
    late = case["controls"]["late"] | change
    case["controls"]["late"] = {key: value for key, value in late.items() if value is not None}
    with pytest.raises(CaseError) as caught:
        fvsolve.load(case)
    assert place in str(caught.value) and text in str(caught.value)


@pytest.mark.parametrize("start", [0.0, 1e-9])
def test_a_tiny_motion_takes_no_more_steps_than_rest(start):
    case = delayed_loop(end=20.0, method="dormand-prince", rtol=1e-6)
    for block in ("plant", "late"):
        case["controls"][block]["initial"] = start
    assert fvsolve.run(case).summary["steps"] < 300

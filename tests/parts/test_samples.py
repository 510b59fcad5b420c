"""Blocks that act at samples against difference equations, and the cases of relays and of sampled controllers."""

import numpy as np
import pytest
from reference import digital_pressure
from reference.level_control import FINE, METHODS, SECTION, SUPPLY, final, orifice_flow, pi, tower
from reference.resumed_runs import killed_and_resumed, same_files
from reference.sampled_control import LIMIT, sampled_plant, two_lags, value_at
from scipy.integrate import solve_ivp

import fvsolve

EXACT = 1e-9


@pytest.mark.parametrize("method", METHODS)
def test_a_sampled_pi_on_two_lags_is_its_difference_equation(method):
    run, (ad, bd) = fvsolve.run(two_lags(5.0, 3.0, method=method)), sampled_plant(0.1)
    x, integral = np.zeros(2), 0.0
    for k in range(29):
        error = (0.0 if k == 0 else 1.0) - x[0]
        integral += 5.0 * 0.1 / 0.4 * error
        u = 5.0 * error + integral
        assert (
            value_at(run, "controls.loop.output", 0.1 * k + 0.05) == pytest.approx(u, abs=EXACT)
            or k == 0
        )
        x = ad @ x + bd * u
        assert value_at(run, "controls.plant.output", 0.1 * (k + 1)) == pytest.approx(
            x[0], abs=EXACT
        )


def test_a_sampled_loop_grows_from_1_percent_above_its_limit():
    for factor, grows in ((0.99, False), (1.01, True)):
        run = fvsolve.run(two_lags(factor * LIMIT, 40.0))
        deviation, t = np.abs(np.array(run["controls.plant.output"]) - 1.0), np.array(run.t)
        assert (deviation[t > 30.0].max() > deviation[(t > 10.0) & (t < 20.0)].max()) == grows


@pytest.mark.parametrize("method", METHODS)
def test_a_sampled_pid_with_limits_and_an_offset_is_its_difference_equation(method):
    gain, ti, td, n, b, c, tt, h = 1.5, 60.0, 8.0, 6.0, 0.7, 0.3, 25.0, 3.0
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
        period=h,
        offset=1.0,
    ) | {"type": "pid"}
    level, t, u, integral, lagged = 4.0, 0.0, 0.25, 0.25 - gain * (b - 1.0) * 4.0, (c - 1.0) * 4.0
    for moment in [*np.arange(1.0, 200.0, h), 200.0]:
        found = solve_ivp(
            lambda t, y, u=u: [
                (orifice_flow(u, SUPPLY - y[0]) - orifice_flow(0.5, y[0])) / SECTION
            ],
            (t, moment),
            [level],
            "DOP853",
            **FINE,
        )
        level, t = found.y[0, -1], moment
        setpoint = 4.0 if t < 20.0 else 4.6 if t < 120.0 else 4.2
        z = c * setpoint - level
        integral += gain * h * (setpoint - level) / ti
        lagged = (lagged + h * n / td * z) / (1.0 + h * n / td)
        v = gain * (b * setpoint - level) + integral + gain * n * (z - lagged)
        u = min(max(v, 0.1), 0.6)
        integral += h * (u - v) / tt
    case = tower({"control": "valve"}, 0.5, end=200.0, controls={"valve": control})
    assert final(case, method)[0] == pytest.approx(level, abs=10 * EXACT)


@pytest.mark.parametrize("method", METHODS)
def test_a_sampled_transfer_function_follows_tustin_s_rule(method):
    """(2 s + 1) / (5 s + 1) by s = 2 (z - 1) / (h (z + 1)), of the level of a tank that drains."""
    h = 1.5
    lead = {
        "type": "transfer-function",
        "input": "tower.level",
        "numerator": [2.0, 1.0],
        "denominator": [5.0, 1.0],
        "period": h,
    }
    case = tower(
        0.1, 0.5, end=30.1, controls={"lead": lead}, numerics={"rtol": 1e-11, "method": method}
    )
    run = fvsolve.run(case, {"output.every": 0.1})
    before = output = 4.0
    for k in range(20):
        x = value_at(run, "tower.level", 1.5 * k)
        output = ((10.0 - h) * output + (4.0 + h) * x + (h - 4.0) * before) / (10.0 + h)
        before = x
        assert value_at(run, "controls.lead.output", 1.5 * k + 0.1) == pytest.approx(
            output, abs=1e-9
        )


def test_a_sampled_block_tends_to_its_continuous_twin_with_first_order():
    twin = fvsolve.run(two_lags(1.0, 4.0, period=None))
    errors = []
    for period in (0.1, 0.05, 0.025, 0.0125):
        run = fvsolve.run(two_lags(1.0, 4.0, period))
        errors.append(
            max(
                abs(
                    value_at(run, "controls.plant.output", t)
                    - value_at(twin, "controls.plant.output", t)
                )
                for t in np.arange(0.5, 4.0, 0.5)
            )
        )
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders[-1] == pytest.approx(1.0, abs=0.1)


def test_a_sample_that_is_no_number_ends_the_run():
    act = {
        "type": "function",
        "inputs": {"h": "tower.level"},
        "formula": "0.1 + sqrt(h - 3.99)",
        "period": 1.0,
        "initial": 0.2,
    }
    run = fvsolve.run(tower({"control": "act"}, 0.9, controls={"act": act}))
    assert (
        not run.ok and "the output of controls.act is not a finite number at t = 3 s" in run.reason
    )


def test_a_loop_in_python_by_advance_is_the_sampled_block():
    period, gain, ti = 2.0, 1.2, 40.0
    control = pi(
        {"time": [0.0, 10.0], "value": [4.0, 4.3], "kind": "step"}, gain, ti, period=period
    )
    by_block = final(
        tower({"control": "valve"}, 0.5, end=60.0, controls={"valve": control}), "dormand-prince"
    )[0]
    model = fvsolve.build(
        fvsolve.load(
            tower(0.25, 0.5, end=60.0, numerics={"method": "dormand-prince", "rtol": 1e-10})
        )
    )
    state, integral = fvsolve.initial_state(model), 0.25
    for k in range(30):
        error = (4.0 if k < 5 else 4.3) - model.observe(state)[0]
        integral += gain * period * error / ti
        state = fvsolve.advance(
            model, state, period * (k + 1), {"inlet.opening": gain * error + integral}
        )
    assert model.observe(state)[0] == pytest.approx(by_block, abs=EXACT)


@pytest.mark.parametrize("method", ["rk4", "radau-iia-5", "rodas-5p"])
def test_given_steps_end_at_samples(method):
    numerics = {"method": method, "step": 0.7}
    control = pi({"time": [0.0, 10.0], "value": [4.0, 4.3], "kind": "step"}, 1.2, 40.0, period=2.0)
    case = tower(
        {"control": "valve"}, 0.5, end=60.0, numerics=numerics, controls={"valve": control}
    )
    run = fvsolve.run(case)
    close = final(case | {"numerics": {"end": 60.0}}, "dormand-prince")[0]
    assert run.ok and run["tower.level"][-1] == pytest.approx(close, abs=1e-7)


@pytest.mark.in_turn
@pytest.mark.parametrize("kink", [0.7, 0.3], ids=["beside", "at a sample"])
@pytest.mark.parametrize("every", [0.1, 0.05, 0.02])
@pytest.mark.parametrize(
    "numerics",
    [
        {"method": "ssp-rk3", "step": 0.01},
        {"method": "radau-iia-5", "step": 0.01},
        {"method": "rodas-5p", "step": 0.02},
        {"method": "dormand-prince", "rtol": 1e-7},
    ],
    ids=["ssp-rk3", "radau-iia-5", "rodas-5p", "dormand-prince"],
)
def test_a_row_at_the_time_of_a_sample_shows_the_output_before_it(numerics, every, kink):
    """The sample at 3 h and the row at 3 h may differ by rounding: 0.3 is 30 steps of 0.01, but not 3 times 0.1.

    The output at a row is the time of the last sample; the schedule has a kink at a row of this kind, where a segment
    of the run ends.
    """
    case = {
        "controls": {
            "clock": {"type": "function", "inputs": {"x": "controls.ramp"}, "formula": "x + t"},
            "ramp": {"type": "function", "inputs": {}, "formula": f"0.0*max(t, {kink})"},
        },
        "numerics": {"end": 2.0} | numerics,
        "output": {"every": every, "probes": ["controls.clock.output"]},
    }
    case["controls"]["clock"]["period"] = 0.1
    result = fvsolve.run(case)
    rows = np.arange(round(0.1 / every), len(result.t), round(0.1 / every))
    assert len(rows) == 20
    assert result["controls.clock.output"][rows] == pytest.approx(result.t[rows] - 0.1, abs=1e-12)


def test_a_killed_and_resumed_run_with_samples_and_relays_is_the_unbroken_run(tmp_path):
    relay = {
        "type": "relay",
        "input": "tower.level",
        "on": 3.9,
        "off": 4.1,
        "output": [0.2, 0.6],
        "initial": 0,
    }
    outlet = {
        "type": "pi",
        "input": "tower.level",
        "setpoint": 4.0,
        "gain": -0.3,
        "integral_time": 20.0,
        "period": 0.7,
        "initial": 0.5,
    }
    controls = {"fill": relay, "drain": outlet}
    case = tower({"control": "fill"}, {"control": "drain"}, end=3000.0, controls=controls)
    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    assert whole.ok
    same_files(tmp_path / "whole", killed_and_resumed(tmp_path / "whole", 800.0))


def test_the_digital_controller_of_the_long_main_is_that_by_characteristics():
    t, town, _, speed = digital_pressure.main(80, 100.0)
    run = fvsolve.run("digital-pressure", {"numerics.end": 100.0, "output.every": 0.25})
    for at in (19.0, 25.25, 40.75, 60.75, 98.75):
        k = round(at / (t[1] - t[0]))
        assert value_at(run, "town.head", at) == pytest.approx(town[k], abs=0.15)
        assert value_at(run, "controls.pressure.output", at) == pytest.approx(speed[k], abs=5e-4)

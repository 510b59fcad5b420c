"""Loops of controls: margins, ranges of gains and poles against closed expressions, hand-made maps and runs."""

import json
import tomllib
from math import pi
from pathlib import Path

import numpy as np
import pytest
from reference import sampled_control
from reference.delay_blocks import TAU, blocks, delayed_loop
from reference.folders import CASES
from reference.level_control import pi as pi_control
from reference.level_control import tower
from reference.sampled_control import LIMIT, sampled_plant
from reference.scenes import WATER
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.special import lambertw

import fvsolve
from fvsolve.errors import FvsolveError
from fvsolve.studies import work_limit
from fvsolve.studies.loops.delay_system import DelaySystem
from fvsolve.studies.loops.input_response import input_response
from fvsolve.studies.loops.loop import ReturnRatio, loop, step_response
from fvsolve.studies.loops.margins import roots
from fvsolve.studies.work_limit import TIME_LIMIT

CLOSE = 1e-9


def lag(names, numerator, denominator, **more):
    return {
        "type": "transfer-function",
        "input": f"controls.{names}",
        "numerator": numerator,
        "denominator": denominator,
        **more,
    }


def two_lags(gain=5.0, delay=None, **more):
    """Case of a PI with Ti 0.4 s on 1 / ((0.5 s + 1)(0.1 s + 1)), with a delay at its output."""
    controls = {
        "plant": lag("late" if delay else "hold", [1.0], [0.05, 0.6, 1.0]),
        "hold": {
            "type": "pi",
            "input": "controls.plant",
            "setpoint": 0.0,
            "gain": gain,
            "integral_time": 0.4,
            **more,
        },
    }
    if delay:
        controls["late"] = {"type": "delay", "input": "controls.hold", "delay": delay}
    return blocks(controls, 5.0)


def expression(w, gain=5.0, delay=0.0):
    """Return ratio of `two_lags`, by hand."""
    s = 1j * w
    return gain * (1.0 + 1.0 / (0.4 * s)) * np.exp(-s * delay) / ((0.5 * s + 1.0) * (0.1 * s + 1.0))


def test_an_integrator_with_a_delay_is_unstable_from_the_gain_of_the_closed_form_on():
    for cut in ("gain", "plant", "late"):
        found = loop(delayed_loop(), cut)
        assert found.stable and found.gain_range == (
            None,
            pytest.approx(pi / (2.0 * TAU), rel=CLOSE),
        )
        assert found.margins.gain_margin == pytest.approx(pi / (2.0 * TAU), rel=CLOSE)
        assert found.margins.phase_margin == pytest.approx(90.0 - np.degrees(TAU), rel=CLOSE)
        assert found.delays == (TAU,)


def test_margins_of_a_pi_on_two_lags_are_those_of_python_control():
    margins = loop(two_lags(), "hold").margins
    assert margins.phase_margin == pytest.approx(48.16261330577572, rel=CLOSE)
    assert margins.gain_crossover == pytest.approx(7.955433249, rel=CLOSE)
    assert margins.stability_margin == pytest.approx(0.6568243170, rel=CLOSE)
    assert (
        margins.gain_margin is None
        and margins.gain_margin_db is None
        and margins.phase_crossover is None
    )


def test_margins_with_a_delay_are_roots_of_the_closed_expression():
    margins = loop(two_lags(delay=0.05), "hold").margins
    assert margins.gain_margin == pytest.approx(2.0202718515, abs=1e-10)
    assert margins.phase_crossover == pytest.approx(12.6280569120, abs=1e-10)
    assert margins.phase_margin == pytest.approx(25.3719758372, abs=1e-10)
    assert margins.delay_margin == pytest.approx(0.0556631553, abs=1e-10)
    crossing = brentq(lambda w: abs(expression(w, delay=0.05)) - 1.0, 5.0, 12.0, xtol=1e-14)
    assert margins.gain_crossover == pytest.approx(crossing, rel=CLOSE)


@pytest.mark.parametrize("delay", [None, 0.05, 0.3])
def test_the_return_ratio_is_the_closed_expression_whatever_the_order_of_blocks(delay):
    case = two_lags(2.0, delay)
    for controls in (case["controls"], dict(reversed(case["controls"].items()))):
        found = loop(case | {"controls": controls}, "hold")
        assert found.ratio == pytest.approx(
            expression(found.frequency, 2.0, delay or 0.0), rel=1e-8, abs=1e-9
        )


@pytest.mark.parametrize("delay", [0.0, 0.05, 0.3])
def test_poles_solve_the_characteristic_equation(delay):
    poles = loop(two_lags(2.0, delay or None), "hold").poles
    for s in poles[:8]:
        assert (
            abs(1.0 + expression(-1j * s, 2.0, delay))
            < 1e-6 * abs(expression(-1j * s, 2.0, delay)) + 1e-8
        )
    assert len(poles) == 3 if delay == 0.0 else len(poles) > 8


@pytest.mark.parametrize(
    ("gain", "stable"), [(5.0, True), (10.0, True), (10.2, False), (50.0, False)]
)
def test_stability_with_a_delay_is_that_of_the_margins(gain, stable):
    """The gain margin of 5 with 0.05 s is 2.0202718515, so the limit is a gain of 10.1013592575."""
    found = loop(two_lags(gain, 0.05), "hold")
    assert found.stable == stable
    assert found.gain_range == (None, pytest.approx(10.1013592575 / gain, rel=CLOSE))
    assert (found.poles[0].real < 0.0) == stable


@pytest.mark.parametrize("delay", [None, 0.1])
def test_an_unstable_plant_needs_a_least_gain(delay):
    """1 / (s - 1) with the gain 2: stable from a factor of 1/2 on, and with a delay up to a greatest factor."""
    controls = {
        "plant": lag("late" if delay else "hold", [1.0], [1.0, -1.0], initial=0.0),
        "hold": {"type": "function", "inputs": {"x": "controls.plant"}, "formula": "-2*x"},
    }
    high = None
    if delay:
        controls["late"] = {"type": "delay", "input": "controls.hold", "delay": delay}
        # j w - 1 + 2 k exp(-j w d) = 0: tan(w d) = w, and 2 k = sqrt(1 + w^2)
        w = brentq(lambda w: np.tan(w * delay) - w, 1.0, 0.5 * pi / delay - 1e-6, xtol=1e-14)
        high = pytest.approx(0.5 * np.sqrt(1.0 + w * w), rel=CLOSE)
    found = loop(blocks(controls, 1.0), "hold")
    assert found.stable and found.gain_range == (pytest.approx(0.5, rel=CLOSE), high)


def test_a_loop_that_no_gain_stabilises_is_reported():
    controls = {
        "plant": lag("hold", [1.0], [1.0, 0.0, 0.0]),
        "hold": {"type": "function", "inputs": {"x": "controls.plant"}, "formula": "2*x"},
    }
    found = loop(blocks(controls, 1.0), "hold")
    assert not found.stable and found.gain_range == (None, None)


def test_two_delays_in_nested_loops_are_exact():
    """x' = -x(t - 0.3) - 0.5 z, z = x(t - 0.8): poles solve s + exp(-0.3 s) + 0.5 exp(-0.8 s) = 0."""
    controls = {
        "state": lag("sum", [1.0], [1.0, 0.0], initial=0.0),
        "sum": {
            "type": "function",
            "inputs": {"a": "controls.near", "b": "controls.far"},
            "formula": "-a - 0.5*b",
        },
        "near": {"type": "delay", "input": "controls.state", "delay": 0.3},
        "far": {"type": "delay", "input": "controls.state", "delay": 0.8},
    }
    found = loop(blocks(controls, 1.0), "far")
    for s in found.poles[:6]:
        assert abs(s + np.exp(-0.3 * s) + 0.5 * np.exp(-0.8 * s)) < 1e-8 * abs(s)
    s = 1j * found.frequency
    assert found.ratio == pytest.approx(
        0.5 * np.exp(-0.8 * s) / (s + np.exp(-0.3 * s)), rel=1e-8, abs=1e-9
    )
    assert found.stable and loop(blocks(controls, 1.0), "sum").stable


def test_the_loop_of_a_level_is_that_of_its_tank_and_valves():
    """k K (1 + 1 / (Ti s)) / (s + c), with k and c the slopes of the flows over the opening and over the level."""
    case = tower({"control": "hold"}, 0.5, controls={"hold": pi_control(4.0, 0.8, 120.0)})
    found = loop(case, "hold")
    area, section, root = 20e-4, 2.0, np.sqrt(2.0 * 9.80665)
    k = area * root * 4.0 / section  # at a drop of 16 m
    c = area * root * (0.25 / (2.0 * 4.0) + 0.5 / (2.0 * 2.0)) / section
    s = 1j * found.frequency
    assert found.ratio == pytest.approx(k * 0.8 * (1.0 + 1.0 / (120.0 * s)) / (s + c), rel=1e-6)


# sampled ------------------------------------------------------------------------------------------------------


def test_a_sampled_pi_on_two_lags_is_unstable_from_the_known_gain_on():
    found = loop(two_lags(1.0, period=0.1), "hold")
    assert found.stable and found.period == 0.1
    assert found.gain_range == (None, pytest.approx(LIMIT, rel=CLOSE))
    assert found.margins.gain_margin == pytest.approx(LIMIT, rel=CLOSE)


def explicit_radius(gain, parts):
    """Spectral radius of a sampled PI on two lags, over parts of a period: (length [s], True if the new output acts).

    z: states of the plant, integral, new output, last output; the controller reads the plant at the end of a period.
    """
    step = np.eye(5)
    for length, is_new in parts:
        a, b = sampled_plant(length)
        part = np.eye(5)
        part[:2, :2], part[:2, 3 if is_new else 4] = a, b
        step = part @ step
    control = np.zeros((5, 5))
    control[:2, :2] = np.eye(2)
    control[2] = [-gain * 0.1 / 0.4, 0.0, 1.0, 0.0, 0.0]
    control[3] = control[2] + [-gain, 0.0, 0.0, 0.0, 0.0]
    control[4, 3] = 1.0
    return np.abs(np.linalg.eigvals(control @ step)).max()


def test_a_sampled_pi_with_a_computing_time_has_the_limit_of_an_explicit_map():
    limit = brentq(
        lambda gain: explicit_radius(gain, [(0.04, False), (0.06, True)]) - 1.0,
        1.0,
        9.0,
        xtol=1e-13,
    )
    found = loop(two_lags(1.0, 0.04, period=0.1), "hold")
    assert found.gain_range == (None, pytest.approx(limit, rel=CLOSE))
    assert found.margins.gain_margin == pytest.approx(limit, rel=CLOSE)


@pytest.mark.parametrize("delay", [0.1, 0.2])
def test_a_delay_of_whole_periods_is_a_shift(delay):
    """L(z) of the loop without a delay over z^k; found where the phase of L is -180 degrees."""
    plain, late = (
        loop(two_lags(1.0, period=0.1), "hold"),
        loop(two_lags(1.0, delay, period=0.1), "hold"),
    )
    # below, L exceeds 1e4
    shifted, high = plain.ratio * np.exp(-1j * plain.frequency * delay), plain.frequency > 1e-3
    assert late.ratio[high] == pytest.approx(shifted[high], rel=1e-8, abs=1e-10)


def test_a_delay_that_only_samples_read_has_the_map_of_an_earlier_sample():
    """The controller reads the plant 0.04 s before each sample, so the same map in another order."""
    case = two_lags(1.0, period=0.1)
    case["controls"]["radio"] = {"type": "delay", "input": "controls.plant", "delay": 0.04}
    case["controls"]["hold"]["input"] = "controls.radio"
    computing = loop(two_lags(1.0, 0.04, period=0.1), "hold")
    found = loop(case, "hold")
    assert found.gain_range[1] == pytest.approx(computing.gain_range[1], rel=1e-8)
    high = found.frequency > 1e-3
    assert found.ratio[high] == pytest.approx(computing.ratio[high], rel=1e-7, abs=1e-10)


def test_two_periods_have_the_map_of_both():
    """P control at 0.1 s of an integrator, whose setpoint another P control sets at 0.2 s from a second integrator."""
    controls = {
        "speed": lag("inner", [1.0], [1.0, 0.0], initial=0.0),
        "place": lag("speed", [1.0], [1.0, 0.0], initial=0.0),
        "outer": {
            "type": "pi",
            "input": "controls.place",
            "setpoint": 0.0,
            "gain": 1.0,
            "period": 0.2,
            "limits": [-9, 9],
        },
        "inner": {
            "type": "pi",
            "input": "controls.speed",
            "setpoint": {"control": "outer"},
            "gain": 4.0,
            "period": 0.1,
            "limits": [-9, 9],
        },
    }
    found = loop(blocks(controls, 2.0), "outer")

    def radius(gain):
        # place, speed, force
        step = expm(0.1 * np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0]]))
        inner = lambda z: z - np.array([0.0, 0.0, z[2] - 4.0 * (z[3] - z[1]), 0.0])  # noqa: E731
        z = np.eye(4)
        for k in range(2):
            if k == 0:
                z[3] = -gain * z[0]
            z = np.apply_along_axis(inner, 0, z)
            z[:3] = step @ z[:3]
        return np.abs(np.linalg.eigvals(z)).max()

    limit = brentq(lambda gain: radius(gain) - 1.0, 1.0, 20.0, xtol=1e-13)
    assert found.period == 0.2 and found.gain_range == (None, pytest.approx(limit, rel=CLOSE))


def test_the_sampled_loop_of_the_long_main_grows_in_runs_from_1_percent_above_its_range():
    case = tomllib.loads((CASES / "digital-pressure.toml").read_text(encoding="utf-8"))
    found = loop(case, "pressure")
    assert found.stable and found.margins.gain_margin == pytest.approx(
        found.gain_range[1], rel=1e-8
    )
    case.pop("expect")
    case["nodes"]["town"]["demand"]["value"] = ["30 l/s", "30.001 l/s"]
    for factor, grows in ((0.99, False), (1.01, True)):
        gain = 0.001 * factor * found.gain_range[1]
        run = fvsolve.run(case, {"controls.pressure.gain": gain, "numerics.end": 1200.0})
        swing, t = np.abs(np.array(run["town.head"]) - 50.0), np.array(run.t)
        assert (swing[t > 1000.0].max() > swing[(t > 300.0) & (t < 500.0)].max()) == grows


def proportional(plant, gain, **more):
    """Case of a plant with a proportional control."""
    control = {"type": "function", "inputs": {"x": "controls.plant"}, "formula": f"{-gain!r}*x"}
    return blocks({"plant": plant | {"input": "controls.hold"}, "hold": control | more}, 1.0)


@pytest.mark.parametrize(("gain", "period"), [(1.0, 0.5), (1e-6, 1.0), (1e5, 1.0), (1.0, 1e-5)])
def test_a_sampled_integrator_has_its_gain_margin_at_half_the_sampling_frequency(gain, period):
    """L(z) = k h / (z - 1), so L(-1) = -k h / 2."""
    found = loop(proportional(lag("", [1.0], [1.0, 0.0], initial=0.0), gain, period=period), "hold")
    high = 2.0 / (gain * period)
    assert found.gain_range == (None, pytest.approx(high, rel=1e-8)) and found.stable == (
        high > 1.0
    )
    assert found.margins.gain_margin == pytest.approx(high, rel=1e-8)
    assert found.margins.phase_crossover == pytest.approx(pi / period)
    if gain == 1.0 and period == 0.5:
        assert found.margins.stability_margin == pytest.approx(0.75, rel=1e-8)
    if gain * period < 0.1:
        assert found.margins.phase_margin == pytest.approx(
            90.0 - np.degrees(0.5 * gain * period), abs=1e-4
        )


def test_a_narrow_range_of_a_sampled_loop_is_located():
    """1 / (s - 1) at 6 s: 1 < k < (1 + exp(6)) / (exp(6) - 1)."""
    found = loop(proportional(lag("", [1.0], [1.0, -1.0], initial=0.0), 1.02, period=6.0), "hold")
    assert not found.stable
    limits = np.array([1.0, (1.0 + np.exp(6.0)) / (np.exp(6.0) - 1.0)]) / 1.02
    assert found.gain_range == pytest.approx(limits, rel=1e-8)


@pytest.mark.parametrize(("denominator", "gain"), [([1.0, 1.0], 1e5), ([1.0, 1.0, 0.0], 1e-5)])
def test_crossovers_far_from_all_rates_are_located(denominator, gain):
    margins = loop(proportional(lag("", [1.0], denominator, initial=0.0), gain), "hold").margins
    w = brentq(
        lambda x: abs(gain / np.polyval(denominator, 1j * x)) - 1.0,
        1e-6,
        1e6,
        xtol=1e-18,
        rtol=1e-14,
    )
    assert margins.gain_crossover == pytest.approx(w, rel=1e-8)
    phase = np.degrees(np.angle(-gain / np.polyval(denominator, 1j * w)))
    assert margins.phase_margin == pytest.approx(phase, rel=1e-8)


def test_positive_feedback_has_its_margin_at_rest():
    found = loop(proportional(lag("", [1.0], [1.0, 1.0], initial=0.0), -0.5), "hold")
    assert found.gain_range == (
        None,
        pytest.approx(2.0),
    ) and found.margins.gain_margin == pytest.approx(2.0)
    assert found.margins.phase_crossover == 0.0 and found.margins.stability_margin == pytest.approx(
        0.5
    )


def test_poles_with_a_delay_have_no_gap():
    """L = 3 exp(-0.3 s) / s: s = W_k(-0.9) / 0.3 in all branches of Lambert's function."""
    case = proportional(lag("", [1.0], [1.0, 0.0], initial=0.0), 3.0)
    case["controls"]["late"] = {"type": "delay", "input": "controls.hold", "delay": 0.3}
    case["controls"]["plant"]["input"] = "controls.late"
    poles = loop(case, "hold").poles
    exact = sorted((lambertw(-0.9, k) / 0.3 for k in range(-30, 30)), key=lambda s: -s.real)
    assert len(poles) >= 20 and poles.real == pytest.approx(np.real(exact[: len(poles)]), rel=1e-9)


def test_a_delay_that_passes_more_than_it_gets_at_all_frequencies_is_not_stable():
    case = proportional(lag("", [0.5, 1.0], [1.0, 1.0], initial=0.0), 3.0)
    case["controls"]["late"] = {"type": "delay", "input": "controls.hold", "delay": 0.3}
    case["controls"]["plant"]["input"] = "controls.late"
    found = loop(case, "hold")
    assert (
        found.stable is False and found.gain_range[0] is None and 0.65 < found.gain_range[1] < 0.67
    )


def test_a_sampled_loop_at_its_stated_rest_balances():
    controls = {
        "plant": lag("late", [1.0], [1.0, 1.0], initial=0.0),
        "late": {"type": "delay", "input": "controls.hold", "delay": 0.2},
        "hold": {
            "type": "pi",
            "input": "controls.plant",
            "setpoint": 0.0,
            "gain": 2.0,
            "integral_time": 1.0,
            "period": 0.3,
        },
    }
    assert loop(blocks(controls, 1.0), "hold").stable
    controls["hold"] |= {"filter": 0.2}
    assert loop(blocks(controls, 1.0), "hold").stable


# steps, faults and the command ------------------------------------------------------------------------------------


def test_the_step_response_is_that_of_the_closed_loop():
    times, values = step_response(loop(two_lags(), "hold"))
    run = fvsolve.run(
        two_lags()
        | {
            "numerics": {"end": 3.0},
            "output": {"every": 0.02, "probes": ["controls.plant.output"]},
        },
        {"controls.hold.setpoint": {"time": [0.0], "value": [0.0]}},
    )
    assert run.ok
    # x, x', integral
    closed = np.array([[0.0, 1.0, 0.0], [-20.0 * 6.0, -12.0, 20.0], [-12.5, 0.0, 0.0]])
    exact = [
        np.linalg.solve(closed, (expm(closed * t) - np.eye(3)) @ [0.0, 100.0, 12.5])[0]
        for t in times[:200:20]
    ]
    assert values[:200:20] == pytest.approx(exact, abs=1e-6)


def test_the_step_response_of_a_sampled_loop_is_that_of_its_difference_equation():
    times, values = step_response(loop(two_lags(2.0, period=0.1), "hold"))
    (ad, bd), x, integral, expected = sampled_plant(0.1), np.zeros(2), 0.0, [0.0]
    for _ in range(30):
        x = ad @ x + bd * (1.0 - expected[-1])
        integral += 2.0 * 0.1 / 0.4 * x[0]
        expected.append(2.0 * x[0] + integral)
    assert times[:31] == pytest.approx(0.1 * np.arange(31)) and values[:31] == pytest.approx(
        expected, abs=1e-9
    )


def test_faults_of_loops_are_named():
    relay = {"type": "relay", "input": "tower.level", "on": 3.9, "off": 4.1, "initial": 0}
    level = pi_control(4.0, 0.8, 120.0)
    case = tower(
        {"control": "fill"},
        {"control": "hold"},
        controls={"fill": relay, "hold": level | {"initial": 1.0}},
    )
    with pytest.raises(FvsolveError, match="is a relay"):
        loop(case, "fill")
    with pytest.raises(FvsolveError, match='no control named "hol"; did you mean "hold"'):
        loop(case, "hol")
    with pytest.raises(FvsolveError, match="no .controls"):
        loop("two-tanks", "hold")
    for period in ({}, {"period": 1.0}):
        case["controls"]["hold"] = (
            level | {"initial": 1.0, "setpoint": 4.5, "limits": [0.0, 1.0]} | period
        )
        with pytest.raises(FvsolveError, match="controls.hold is at a limit"):
            loop(case, "hold", at=5.0)
    sampled = delayed_loop()
    sampled["controls"]["gain"]["period"] = 0.1
    sampled["controls"]["inner"] = {"type": "delay", "input": "controls.plant", "delay": 0.2}
    sampled["controls"]["other"] = lag("inner", [1.0], [1.0, 1.0])
    with pytest.raises(FvsolveError, match="controls.inner delays what changes between samples"):
        loop(sampled, "gain")


KINDS = {
    "pi": {
        "type": "pi",
        "input": "controls.plant",
        "setpoint": 0.0,
        "gain": 2.0,
        "integral_time": 1.0,
    },
    "pid": {
        "type": "pid",
        "input": "controls.plant",
        "setpoint": 0.0,
        "gain": 2.0,
        "derivative_time": 0.1,
    },
    "function": {"type": "function", "inputs": {"u": "controls.plant"}, "formula": "-u"},
    "table": {
        "type": "table",
        "input": "controls.plant",
        "table": {"input": [-10.0, 10.0], "output": [10.0, -10.0]},
    },
    "transfer-function": lag("plant", [-1.0], [1.0, 1.0], initial=0.0),
    "rate-limit": {
        "type": "rate-limit",
        "input": "controls.plant",
        "rising": 1.0,
        "falling": 1.0,
        "time_constant": 0.5,
        "initial": 0.0,
    },
    "delay": {"type": "delay", "input": "controls.plant", "delay": 0.3},
}


@pytest.mark.parametrize("limits", [[0.0, 1.0], [-1.0, 0.0], [-1e-13, 1.0], [-1.0, 1e-13]])
@pytest.mark.parametrize("kind", KINDS)
def test_a_control_at_a_limit_is_refused_by_name(kind, limits):
    """The output at the start is 0, at the lower or the upper limit, exactly or up to rounding."""
    for period in (None, 0.1):
        if period is None or kind not in ("rate-limit", "delay"):
            own = KINDS[kind] | {"limits": limits} | ({} if period is None else {"period": period})
            case = blocks({"plant": lag("hold", [1.0], [0.5, 1.0], initial=0.0), "hold": own}, 5.0)
            with pytest.raises(FvsolveError, match="controls.hold is at a limit.*its loop is open"):
                loop(case, "hold")
            own["limits"] = [-1.0, 1.0]
            assert loop(case, "hold").frequency.size


def through_another(formula, hold_period=None, **inner):
    """Case of a proportional control of a lag through another block, whose output is at its limit 0."""
    hold = KINDS["function"] | ({} if hold_period is None else {"period": hold_period})
    second = {
        "type": "function",
        "inputs": {"u": "controls.hold"},
        "formula": formula,
        "limits": [0.0, 1.0],
    }
    return blocks(
        {
            "plant": lag("inner", [1.0], [0.5, 1.0], initial=0.0),
            "hold": hold,
            "inner": second | inner,
        },
        5.0,
    )


@pytest.mark.parametrize(
    ("formula", "reason"), [("u", "slopes.*differ"), ("u - 2", "does not affect its input")]
)
def test_a_loop_through_another_control_at_a_limit_names_it(formula, reason):
    for hold_period, inner in (
        (None, {}),
        (0.1, {}),
        (None, {"period": 0.1}),
        (0.1, {"period": 0.1}),
    ):
        with pytest.raises(FvsolveError, match=rf"{reason}.*at a limit: controls.inner \(0\)"):
            loop(through_another(formula, hold_period, **inner), "hold")
    with pytest.raises(
        FvsolveError, match="controls.inner is at a limit, 0, .*passes only a rise or only a fall"
    ):
        late = through_another(formula)
        late["controls"]["inner"] = {
            "type": "delay",
            "input": "controls.hold",
            "delay": 0.3,
            "limits": [0.0, 1.0],
        }
        loop(late, "hold")


@pytest.mark.parametrize("opening", [0.0, 1.0])
def test_a_control_of_a_valve_at_the_end_of_its_range_is_refused_by_name(opening):
    """The range of the opening is the limit of its control."""
    level = pi_control(4.0, 0.8, 120.0) | {"initial": opening}
    level.pop("limits", None)
    for period in ({}, {"period": 1.0}):
        case = tower({"control": "hold"}, 0.5, controls={"hold": level | period})
        with pytest.raises(
            FvsolveError, match=f"controls.hold is at a limit, {opening:g}, at the start"
        ):
            loop(case, "hold")


AT_ITS_LIMIT = """
[nodes]
a = {type = "reservoir", head = 10.0}
b = {type = "tank", area = 10.0, level = 1.0}
[links]
v = {type = "valve", from = "a", to = "b", area = 1e-6, opening = {control = "p"}}
[controls]
q = {type = "function", inputs = {u = "controls.p"}, formula = "u - 0.5"}
p = {type = "pid", input = "controls.plant", setpoint = 0, gain = 1, period = 0.05}
[controls.plant]
type = "transfer-function"
input = "controls.q"
initial = 0
numerator = [43.42624]
denominator = [1, 2.513274, 39.47842]
[numerics]
end = 1.0
method = "rodas-5p"
rtol = 1e-6
"""


def test_an_output_that_is_its_limit_up_to_rounding_is_refused():
    """The balanced output is 8.6e-42, at the lower end of the opening; with another start the margins are known."""
    case = tomllib.loads(AT_ITS_LIMIT) | {"fluid": WATER}
    with pytest.raises(
        FvsolveError, match="controls.p is at a limit, 0, at the start, so its loop is open"
    ):
        loop(case, "p")
    del case["controls"]["plant"]["initial"]
    margins = loop(case, "p").margins
    # of python-control, for the sampled plant
    assert margins.gain_margin == pytest.approx(2.3842, abs=1e-4)
    assert margins.phase_margin == pytest.approx(18.161, abs=1e-3)


# work -------------------------------------------------------------------------------------------------------------

AXIS = Path(__file__).parents[1] / "reference" / "press-axis.toml"


def test_a_loop_through_dozens_of_stretches_of_delay_lines_ends():
    """Two hoses of 8 m as delay lines of 6 stretches each: gain and poles are those of cells."""
    labels = []
    lines = loop(
        AXIS,
        "pos",
        set={"numerics.pipe_model": "delay-line"},
        progress=lambda *now: labels.append(now),
    )
    assert lines.system.delays.size > 20 and 0.0 < lines.system.work.spent < TIME_LIMIT
    cells = loop(AXIS, "pos")
    assert lines.gain_range == (None, pytest.approx(cells.gain_range[1], rel=2e-3))
    assert lines.poles[0] == pytest.approx(cells.poles[0], rel=1e-3)
    done = [now[0] for now in labels]
    assert done == sorted(done) and {now[1] for now in labels} == {4} and "delays" in labels[1][2]


def test_a_loop_that_takes_too_long_is_refused_with_a_remedy(monkeypatch):
    monkeypatch.setattr(work_limit, "TIME_LIMIT", 1e-6)
    with pytest.raises(FvsolveError, match="loop with delays take longer than .*fewer delays"):
        loop(two_lags(delay=0.3), "hold")
    sampled = two_lags(2.0, period=0.1)
    sampled["controls"]["other"] = KINDS["function"] | {"period": 0.07}
    with pytest.raises(
        FvsolveError, match="maps of .* numbers with .* events take longer than .*common period"
    ):
        loop(sampled, "hold")


def test_the_frequencies_of_a_winding_number_end_where_delays_cannot_matter():
    """From the last frequency on no eigenvalue of P E reaches the unit circle."""
    system = loop(two_lags(delay=0.3), "hold").system.closed()
    last = system.last_frequency(0.0)
    w = np.geomspace(last, 1e3 * last, 400)
    # the search without it ends at a thousand times the fastest rate
    assert last < 2.0 * system.fastest
    assert np.all(np.abs(np.linalg.eigvals(system.loop_matrices(1j * w))) < 1.0)


def test_responses_separate_and_together_are_those_of_the_inverse():
    rng = np.random.default_rng(3)
    a = rng.standard_normal((130, 130))
    system = DelaySystem(
        a, rng.standard_normal((130, 2)), rng.standard_normal((2, 130)), np.eye(2), 1, 1, np.ones(1)
    )
    s = 1j * np.geomspace(0.1, 100.0, 9)
    exact = [system.d + system.c @ np.linalg.solve(x * np.eye(130) - a, system.b) for x in s]
    assert system.cut_response(s) == pytest.approx(np.array(exact), rel=1e-9, abs=1e-9)
    assert system.cut_response(s[:2]) == pytest.approx(np.array(exact[:2]), rel=1e-9, abs=1e-9)


def test_the_roots_of_several_brackets_are_located_together():
    centres = np.geomspace(1e-6, 1e6, 40)
    found = roots(
        lambda w: (
            np.tanh(w / centres[np.argmin(np.abs(np.log(w[:, None] / centres)), axis=1)] - 1.0) ** 3
        ),
        0.9 * centres,
        1.2 * centres,
    )
    assert found == pytest.approx(centres, rel=1e-5)
    found = roots(lambda w: np.cos(w), np.array([1.0, 4.0, 7.0]), np.array([2.0, 5.0, 8.0]))
    assert found == pytest.approx(np.array([0.5, 1.5, 2.5]) * pi, rel=1e-15)


def test_the_command_writes_margins_and_pictures(fvs, tmp_path):
    code, out, _ = fvs("loop", "digital-pressure", "pressure", "--out", tmp_path)
    assert code == 0 and "closed loop: stable" in out and "below 1.78" in out
    for kind in ("bode", "nyquist", "step", "locus"):
        assert (tmp_path / f"pressure.loop.{kind}.png").stat().st_size > 5000
    code, out, _ = fvs("loop", "tank-level-pi", "level", "--json", "--out", tmp_path / "level")
    found = json.loads(out)
    names = [
        "case",
        "control",
        "when",
        "stable",
        "gain_margin",
        "gain_margin_db",
        "phase_margin",
        "delay_margin",
        "stability_margin",
        "gain_crossover",
        "phase_crossover",
        "stability_crossover",
        "gain_range",
        "delays",
        "period",
        "poles",
        "frequency",
        "real",
        "imaginary",
    ]
    assert code == 0 and names == [name for name in found if name not in ("moving", "directory")]
    assert (
        found["gain_range"] == [None, None]
        and found["period"] is None
        and found["gain_margin"] is None
    )


# delay lines and responses ----------------------------------------------------------------------------------------


def matched_pipe(gain=0.5, **main):
    """Integral control of the pressure behind a frictionless pipe by that of its reservoir; the valve matches the pipe.

    2 dp / q = rho a / A, so p(L) = exp(-s tau) p(0).
    """
    area, flow = np.pi / 4.0 * 0.3**2, 0.05
    drop, base = 0.5 * flow * 1000.0 * 1000.0 / area, 2e5
    nodes = {
        "lake": {"type": "reservoir", "pressure": {"control": "hold"}, "elevation": 0.0},
        "end": {"type": "junction", "elevation": 0.0},
        "outlet": {"type": "reservoir", "pressure": base, "elevation": 0.0},
    }
    links = {
        "main": {
            "type": "pipe",
            "from": "lake",
            "to": "end",
            "length": 1000.0,
            "diameter": 0.3,
            "wave_speed": 1000.0,
            "friction": {"model": "none"},
            "cells": 20,
            "pipe_model": "delay-line",
        }
        | main,
        "valve": {
            "type": "valve",
            "from": "end",
            "to": "outlet",
            "discharge_coefficient": 1.0,
            "opening": 1.0,
            "area": flow / np.sqrt(2.0 * drop / 1000.0),
        },
    }
    controls = {
        "hold": {
            "type": "transfer-function",
            "input": "controls.error",
            "numerator": [gain],
            "denominator": [1.0, 0.0],
            "initial": base + drop,
            "limits": [5e4, 1e7],
        },
        "error": {
            "type": "function",
            "inputs": {"p": "nodes.end.pressure"},
            "formula": f"where(t < 1, 0, 100) + {base + drop!r} - p",
        },
    }
    return {
        "schema": 1,
        "fluid": WATER,
        "nodes": nodes,
        "links": links,
        "controls": controls,
        "numerics": {"end": 60.0, "rtol": 1e-7},
        "output": {"every": 0.05, "probes": ["nodes.end.pressure"]},
    }


def test_integral_control_through_a_matched_pipe_is_unstable_from_the_gain_of_the_closed_form_on():
    found = loop(matched_pipe(), "hold")
    # times the gain of 1/2
    assert found.stable and found.gain_range == (None, pytest.approx(pi, rel=CLOSE))
    assert found.delays == (1.0, 1.0) and found.when == "the start"
    for factor, grows in ((0.99, False), (1.01, True)):
        run = fvsolve.run(matched_pipe(factor * pi / 2.0))
        swing, t = (
            np.abs(np.array(run["nodes.end.pressure"]) - run["nodes.end.pressure"][0] - 100.0),
            np.array(run.t),
        )
        assert run.ok and (swing[t > 50.0].max() > swing[(t > 20.0) & (t < 30.0)].max()) == grows


def test_a_delay_line_with_friction_is_close_to_thousands_of_cells():
    friction = {"friction": {"model": "steady", "factor": 0.03}}
    line = loop(matched_pipe(**friction), "hold")
    cells = loop(matched_pipe(**friction, pipe_model="finite-volume", cells=24), "hold")
    assert line.gain_range[1] == pytest.approx(cells.gain_range[1], rel=2e-3)
    assert line.margins.phase_margin == pytest.approx(cells.margins.phase_margin, rel=1e-3)


def test_a_response_is_the_transfer_function_from_input_to_probe():
    """Setpoint to level under PI: T = L / (1 + L); and through a delay: times exp(-s tau)."""
    case = tower(
        {"control": "hold"},
        0.5,
        controls={
            "hold": pi_control(4.0, 0.8, 120.0),
            "late": {"type": "delay", "input": "tower.level", "delay": 3.0},
        },
    )
    found = input_response(case, "controls.hold.setpoint", "tower.level")
    ratio = ReturnRatio(loop(case, "hold").system)(found.w)
    assert found.h == pytest.approx(ratio / (1.0 + ratio), rel=1e-6, abs=1e-9)
    late = input_response(case, "controls.hold.setpoint", "controls.late.output")
    own = ReturnRatio(loop(case, "hold").system)(late.w)
    assert late.h == pytest.approx(np.exp(-3j * late.w) * own / (1.0 + own), rel=1e-6, abs=1e-9)


def test_the_response_command_names_input_and_output(fvs, tmp_path):
    code, out, _ = fvs(
        "response",
        "tank-level-pi",
        "--input",
        "controls.level.setpoint",
        "--output",
        "tower.level",
        "--json",
        "--out",
        tmp_path,
    )
    found = json.loads(out)
    assert code == 0 and found["port"] is None and found["verdict"] is None
    assert (found["input"], found["output"]) == ("controls.level.setpoint", "tower.level")
    assert (
        found["real"][0] == pytest.approx(1.0, abs=1e-4) and len(list(tmp_path.glob("*.png"))) == 1
    )
    assert fvs("response", "tank-level-pi", "--input", "inlet.opening")[0] == 2


def test_a_kink_before_a_sampled_block_is_named_with_the_block_before_it():
    """The sample reads the magnitude of the output of the plant, which has a kink at rest."""
    case = sampled_control.two_lags(2.0, 3.0)
    case["controls"]["bend"] = {
        "type": "function",
        "inputs": {"x": "controls.plant"},
        "formula": "abs(x)",
    }
    case["controls"]["loop"]["input"] = "controls.bend"
    text = "controls.loop cannot be linearised at the start: the slopes of its sample .* or those of bend"
    with pytest.raises(FvsolveError, match=text):
        loop(case, "loop")

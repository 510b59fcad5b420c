"""Relays, latches, timers, rate limits and limited outputs against hand-written equations with events in SciPy."""

import functools

import numpy as np
import pytest
from reference.level_control import FINE, METHODS, SECTION, SUPPLY, final, orifice_flow, pi, tower
from scipy.integrate import solve_ivp

import fvsolve

NEAR = 1e-8  # of levels and of times of switches [m, s]


def switched(rates, y, end, events):
    """(final y, times of switches) of dy/dt = rates(t, y, mode).

    events : mode -> (event function of t and y, next mode); a function may be None
    """
    t, mode, times = 0.0, next(iter(events)), []
    while t < end:
        test, following = events[mode]
        options = dict(FINE)
        if test is not None:
            test.terminal = True
            options["events"] = test
        found = solve_ivp(
            lambda t, y, mode=mode: rates(t, y, mode), (t, end), y, "DOP853", **options
        )
        t, y = found.t[-1], found.y[:, -1]
        if test is not None and found.t_events[0].size:
            times.append(t)
            mode = following
    return y, times


def level_rate(inlet, level, outlet=0.5):
    return (orifice_flow(inlet, SUPPLY - level) - orifice_flow(outlet, level)) / SECTION


def events_of(run, name):
    return [event["time"] for event in run.summary["events"] if event["name"] == f"controls.{name}"]


@pytest.mark.parametrize("method", METHODS)
def test_a_relay_switches_when_the_equations_do(method):
    outputs = {"on": 0.6, "off": 0.0}
    events = {"off": (lambda t, y: y[0] - 3.5, "on"), "on": (lambda t, y: y[0] - 4.5, "off")}
    y, times = switched(lambda t, y, mode: [level_rate(outputs[mode], y[0])], [4.0], 900.0, events)
    control = {
        "type": "relay",
        "input": "tower.level",
        "on": 3.5,
        "off": 4.5,
        "output": [0.0, 0.6],
        "initial": 0,
    }
    case = tower({"control": "valve"}, 0.5, end=900.0, controls={"valve": control})
    run = fvsolve.run(case, {"numerics.method": method})
    assert run.ok and events_of(run, "valve") == pytest.approx(times, abs=NEAR)
    assert run["tower.level"][-1] == pytest.approx(y[0], abs=NEAR)


@pytest.mark.parametrize("method", METHODS)
def test_a_reversed_relay_is_the_relay_of_the_negative_input(method):
    plain = {
        "type": "relay",
        "input": "tower.level",
        "on": 3.5,
        "off": 4.5,
        "output": [0.0, 0.6],
        "initial": 0,
    }
    below = {"type": "function", "inputs": {"h": "tower.level"}, "formula": "-h"}
    turned = plain | {"input": "controls.below", "on": -3.5, "off": -4.5}
    swapped = plain | {"on": 4.5, "off": 3.5, "output": [0.6, 0.0], "initial": 1}
    found = [
        final(tower({"control": "valve"}, 0.5, end=400.0, controls=controls), method)[0]
        for controls in ({"valve": plain}, {"valve": turned, "below": below}, {"valve": swapped})
    ]
    assert found[1:] == pytest.approx(found[:1] * 2, abs=NEAR)


@pytest.mark.parametrize("method", METHODS)
def test_timers_and_latches_switch_when_the_equations_do(method):
    """A latch opens the inlet below 3.6 m, 12 s later by a timer, and shuts it above 4.4 m, 5 s later."""
    controls = {
        "low": {"type": "relay", "input": "tower.level", "on": 3.6, "off": 3.7, "initial": 0},
        "high": {"type": "relay", "input": "tower.level", "on": 4.4, "off": 4.3, "initial": 0},
        "fill": {"type": "latch", "set": "controls.low", "reset": "controls.high", "initial": 0},
        "valve": {
            "type": "timer",
            "input": "controls.fill",
            "on_delay": 12.0,
            "off_delay": "5 s",
            "output": [0, 0.6],
        },
    }
    outputs = {"empty": 0.0, "waits": 0.0, "fills": 0.6, "waits to shut": 0.6}
    times, y, t = [], [4.0], 0.0
    for mode, test, delay in [
        ("empty", lambda t, y: y[0] - 3.6, None),
        ("waits", None, 12.0),
        ("fills", lambda t, y: y[0] - 4.4, None),
        ("waits to shut", None, 5.0),
        ("empty", lambda t, y: y[0] - 3.6, None),
        ("waits", None, 12.0),
    ]:
        end = 2000.0 if delay is None else t + delay
        options = dict(FINE)
        if test is not None:
            test.terminal = True
            options["events"] = test
        found = solve_ivp(
            lambda t, y, mode=mode: [level_rate(outputs[mode], y[0])],
            (t, end),
            y,
            "DOP853",
            **options,
        )
        t, y = found.t[-1], found.y[:, -1]
        times += [t] if delay is not None else []
    case = tower({"control": "valve"}, 0.5, end=float(t) + 1.0, controls=controls)
    run = fvsolve.run(case, {"numerics.method": method})
    assert run.ok and events_of(run, "valve") == pytest.approx(times, abs=NEAR)


@pytest.mark.parametrize("method", METHODS)
def test_a_timer_forgets_a_short_input(method):
    """Pulses of 3 s and 8 s through an on-delay of 5 s: only the second passes, for its rest and the off-delay."""
    pulses = {"type": "function", "formula": "(1 < t)*(t < 4) + (10 < t < 18)"}
    timer = {
        "type": "timer",
        "input": "controls.pulses",
        "on_delay": 5.0,
        "off_delay": 2.0,
        "output": [0.1, 0.9],
    }
    case = tower({"control": "valve"}, 0.5, end=30.0, controls={"pulses": pulses, "valve": timer})
    run = fvsolve.run(case, {"numerics.method": method})
    assert run.ok and events_of(run, "valve") == pytest.approx([15.0, 20.0], abs=1e-9)
    spans = [(0.0, 15.0, 0.1), (15.0, 20.0, 0.9), (20.0, 30.0, 0.1)]
    y = [4.0]
    for start, end, u in spans:
        y = solve_ivp(lambda t, y, u=u: [level_rate(u, y[0])], (start, end), y, "DOP853", **FINE).y[
            :, -1
        ]
    assert run["tower.level"][-1] == pytest.approx(y[0], abs=NEAR)


@functools.cache
def limited() -> list[float]:
    """Level of the tower [m] and opening of its valve after 150 s by SciPy, with a limited rate of the opening."""

    def rates(t, y, k):
        x = (0.3, 0.8, 0.2)[k]
        return [level_rate(y[1], y[0]), min(max((x - y[1]) / 2.0, -0.01), 0.02)]

    y = [4.0, 0.3]
    for k, span in enumerate([(0.0, 5.0), (5.0, 60.0), (60.0, 150.0)]):
        found = solve_ivp(
            lambda t, y, k=k: rates(t, y, k),
            span,
            y,
            "Radau",
            rtol=1e-11,
            atol=1e-13,
            max_step=0.02,
        )
        y = found.y[:, -1]
    return [*y]


@pytest.mark.parametrize("method", METHODS)
def test_a_rate_limit_follows_explicit_equations(method):
    demand = {"type": "function", "formula": "0.3 + where(t < 5, 0, 0.5) - where(t < 60, 0, 0.6)"}
    limit = {
        "type": "rate-limit",
        "input": "controls.demand",
        "rising": "0.02 1/s",
        "falling": 0.01,
        "time_constant": 2.0,
    }
    case = tower({"control": "valve"}, 0.5, end=150.0, controls={"valve": limit, "demand": demand})
    assert final(case, method)[:2] == pytest.approx(limited(), abs=NEAR)


@pytest.mark.parametrize("method", METHODS)
def test_a_limited_pi_reaches_and_leaves_its_limits_when_the_equations_do(method):
    gain, ti = 2.0, 30.0
    setpoint = {"time": [0.0, 10.0], "value": [4.0, 4.6], "kind": "step"}

    def rates(t, y, mode):
        level, integral = y
        r = 4.0 if mode == "before" else 4.6
        v = gain * (r - level) + integral
        u = {"before": v, "above": 0.7, "after": v}[mode]
        return [level_rate(u, level), gain * (r - level) / ti + (u - v) / ti]

    events = {
        "before": (lambda t, y: t - 10.0, "above"),
        "above": (lambda t, y: gain * (4.6 - y[0]) + y[1] - 0.7, "after"),
        "after": (None, ""),
    }
    y, times = switched(rates, [4.0, 0.25], 200.0, events)
    control = pi(setpoint, gain, ti, limits=[0.0, 0.7])
    case = tower({"control": "valve"}, 0.5, end=200.0, controls={"valve": control})
    run = fvsolve.run(case, {"numerics.method": method})
    assert run.ok and events_of(run, "valve") == pytest.approx(times, abs=1e-6)
    assert run["tower.level"][-1] == pytest.approx(y[0], abs=NEAR)


def test_a_relay_that_starts_between_its_thresholds_needs_its_state():
    control = {"type": "relay", "input": "tower.level", "on": 3.5, "off": 4.5}
    with pytest.raises(fvsolve.CaseError, match="between `on` and `off`; give the key `initial`"):
        fvsolve.build(fvsolve.load(tower({"control": "valve"}, 0.5, controls={"valve": control})))


def test_events_name_their_blocks_and_states_survive_advance():
    control = {
        "type": "relay",
        "input": "tower.level",
        "on": 3.5,
        "off": 4.5,
        "output": [0.0, 0.6],
        "initial": 0,
    }
    case = tower({"control": "valve"}, 0.5, end=600.0, controls={"valve": control})
    model = fvsolve.build(fvsolve.load(case))
    whole = fvsolve.advance(model, fvsolve.initial_state(model), 600.0)
    state = fvsolve.initial_state(model)
    for until in np.arange(50.0, 601.0, 50.0):
        state = fvsolve.advance(model, state, float(until))
    assert model.observe(state) == pytest.approx(model.observe(whole), abs=1e-7)
    run = fvsolve.run(case)
    assert [event["what"] for event in run.summary["events"]][:2] == ["turns on", "turns off"]


def test_a_relay_that_would_switch_a_billion_times_is_refused_soon():
    place = {
        "type": "transfer-function",
        "input": "controls.act",
        "numerator": [1.0],
        "denominator": [1.0, 0.0],
        "initial": 0.0,
    }
    act = {
        "type": "relay",
        "input": "controls.place",
        "on": 0.0,
        "off": 1e-9,
        "output": [-1.0, 1.0],
        "initial": 1,
    }
    run = fvsolve.run(tower(0.5, 0.5, end=1.0, controls={"place": place, "act": act}))
    assert (
        not run.ok
        and "controls.act changes its state without end" in run.reason
        and run.t[-1] < 1e-4
    )


def test_a_relay_without_hysteresis_is_refused_with_its_remedy():
    act = {
        "type": "relay",
        "input": "tower.level",
        "on": 4.0 - 1e-13,
        "off": 4.0,
        "output": [0.1, 0.9],
        "initial": 0,
    }
    run = fvsolve.run(tower({"control": "act"}, 0.5, controls={"act": act}))
    assert not run.ok and "controls.act changes its state without end" in run.reason
    assert run.reason.endswith(
        "set the thresholds of the block farther apart, or give it a `filter`"
    )


def test_a_latch_retains_its_state_at_the_start_with_comparisons_of_levels():
    """Its inputs are comparisons that are false at the start: nothing is reset before the level passes 4.5 m."""
    controls = {
        "full": {"type": "function", "inputs": {"h": "tower.level"}, "formula": "(h > 4.5)"},
        "low": {
            "type": "function",
            "inputs": {"h": "tower.level"},
            "formula": "(h < 3.5)*(t > 10)",
        },
        "valve": {
            "type": "latch",
            "set": "controls.low",
            "reset": "controls.full",
            "output": [0.0, 0.6],
            "initial": 1,
        },
    }
    run = fvsolve.run(tower({"control": "valve"}, 0.5, end=900.0, controls=controls))
    events = {"on": (lambda t, y: y[0] - 4.5, "off"), "off": (lambda t, y: y[0] - 3.5, "on")}
    outputs = {"on": 0.6, "off": 0.0}
    y, times = switched(lambda t, y, mode: [level_rate(outputs[mode], y[0])], [4.0], 900.0, events)
    assert run.ok and events_of(run, "valve") == pytest.approx(times, abs=NEAR)
    assert run["tower.level"][-1] == pytest.approx(y[0], abs=NEAR)

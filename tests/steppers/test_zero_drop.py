"""Implicit steps to a drop of zero: requested number of steps, the parabola of Torricelli, and rest afterwards."""

import numpy as np
import pytest
from numba import njit
from reference import scenes
from reference.scenes import chamber, lake, reservoir, scene, tank, valve

import fvsolve
from fvsolve.core.steppers import integrate

FULL = ["radau-iia-5", "radau-iia-9", "radau-iia-3", "lobatto-iiic-4"]
DAMPING = ["implicit-euler", "alexander-3", "tr-bdf2", "esdirk-4", *FULL]  # L-stable methods


def dead_end(**numerics) -> dict:
    """Case of a lake that fills a chamber within 0.2 ms."""
    nodes = {"lake": lake(50.0), "pot": chamber(0.01, 2e5)}
    return scene(nodes, {"tap": valve("lake", "pot", 1e-3)}, 1.0, numerics, ["pot.pressure"], 0.05)


def two_tanks(**numerics) -> dict:
    """Case of two tanks that reach a common level after 15 s; the steps of `radau-iia-9` end at rows."""
    every = 10.0 if numerics["method"] == "radau-iia-9" else 1.0
    nodes = {"a": tank(1.0, 2.0), "b": tank(0.5, 1.0)}
    links = {"pipe": valve("a", "b", 0.01)}
    return scene(nodes, links, 200.0, numerics, ["a.level"], every, exact={"name": "levelling"})


@pytest.mark.parametrize("name", DAMPING)
@pytest.mark.parametrize("build, step", [(dead_end, 0.01), (two_tanks, 10.0)])
def test_a_given_step_is_taken_whole_and_ends_in_rest(name, build, step):
    result = fvsolve.run(build(method=name, step=step))
    assert result.ok, result.reason
    assert (
        result.summary["steps"] == round(result.t[-1] / step)
        and result.summary["newton_failures"] == 0
    )
    probe = str(result.probes[0])
    assert result[probe][-1] == pytest.approx(
        101325.0 + 9806.65 * 50.0 if build is dead_end else 5.0 / 3.0, rel=1e-6
    )
    assert abs(result.ledger["mass"]["relative"]) < 1e-13


@pytest.mark.parametrize("name", ["trapezoid", "implicit-midpoint", "gauss-4"])
def test_a_method_without_l_stability_oscillates_at_the_given_steps_with_a_notice(name):
    result = fvsolve.run(dead_end(method=name, step=0.01))
    assert result.reason == "finished" and result.summary["steps"] == 100
    wrong = np.mean(np.abs(result["pot.pressure"] - 101325.0 - 9806.65 * 50.0)) / (9806.65 * 50.0)
    assert wrong > 0.1 and not result.ok and [one.kind for one in result.warnings] == ["step-error"]


@pytest.mark.parametrize("name", ["tr-bdf2", "esdirk-4", "radau-iia-5", "radau-iia-9"])
def test_error_control_follows_the_parabola_in_few_steps(name):
    result = fvsolve.run(two_tanks(method=name, rtol=1e-6))
    assert result.ok, result.reason
    slope = 0.01 * np.sqrt(2.0 * 9.80665) * (1.0 + 1.0 / 0.5)
    drop = np.maximum(1.0 - 0.5 * slope * result.t, 0.0) ** 2
    assert result["a.level"] == pytest.approx(5.0 / 3.0 + drop / 3.0, abs=2e-5)
    assert result.summary["steps"] < 100


@njit
def chained(t, y):
    """Rates of six drops in series that become zero at one time, each by a root that is linear below 1e-8."""
    rates = np.zeros(y.size)
    for i in range(y.size):
        drop = (y[i - 1] if i > 0 else 1.0) - y[i]
        q = 1e3 * drop / np.sqrt(abs(drop) + 1e-8)
        rates[i] += q
        if i > 0:
            rates[i - 1] -= q
    return rates


@pytest.mark.parametrize("name", ["implicit-euler", "esdirk-4", "radau-iia-5"])
def test_several_drops_may_vanish_at_once(name):
    counts: dict = {}
    start = np.array([0.3, 0.9, 0.1, 0.5, 0.0, 0.7])
    found = integrate(chained, start, [0.0, 1.0], name, step=0.1, counts=counts)[-1]
    assert counts["steps"] == 10 and counts["newton_failures"] == 0
    assert found == pytest.approx(np.ones(6), abs=1e-6)


@njit
def rooted(t, y):
    return -50.0 * np.sign(y) * np.sqrt(np.abs(y))


@pytest.mark.parametrize(
    "name, own, known", [("implicit-euler", 5.0, 0.0), ("trapezoid", 2.5, 2.5)]
)
def test_a_long_step_over_a_bare_root_ends_by_its_quadratic(name, own, known):
    """A step solves y+ + own sign(y+) sqrt|y+| = 1 - known, a quadratic equation in sqrt|y+|."""
    right = 1.0 - known
    z = (np.sqrt(own**2 + 4.0 * abs(right)) - own) / 2.0
    found = integrate(rooted, [1.0], [0.0, 0.1], name, step=0.1)[-1, 0]
    assert found == pytest.approx(np.sign(right) * z**2, abs=1e-9)


@pytest.mark.parametrize("name", ["auto", "rodas-4", "rodas-5p", "radau-iia-5", "dormand-prince"])
@pytest.mark.parametrize(
    "volume, area, opening",
    [(0.01, 1e-4, 1.0), (0.1, 1e-3, 1.0), (1.0, 1e-5, 1.0), (0.1, 2e-3, 0.5)],
)
def test_a_chamber_that_fills_is_at_rest_after_few_steps_under_error_control(
    name, volume, area, opening
):
    """A chamber fills along a parabola and is at rest after less than 200 steps.

    The root of the drop decreases by beta A sqrt(2 / rho) / (2 V) per second, with A the effective area. Earlier,
    linearly implicit steps did not come to rest in two million steps.
    """
    low, high = 1e5, 5e5
    rho, beta = scenes.WATER["density"], scenes.WATER["bulk_modulus"]
    pace = beta * opening * area * np.sqrt(2.0 / rho) / (2.0 * volume)
    whole = np.sqrt(high - low) / pace
    nodes = {"lake": reservoir(high), "pot": chamber(volume, low)}
    links = {"tap": {**valve("lake", "pot", area), "opening": opening}}
    numerics = {"method": name, "rtol": 1e-6}
    result = fvsolve.run(
        scene(nodes, links, 100.0 * whole, numerics, ["pot.pressure"], 0.1 * whole)
    )
    truth = high - np.maximum(np.sqrt(high - low) - pace * result.t, 0.0) ** 2
    # sum of the errors of steps
    assert result["pot.pressure"] == pytest.approx(truth, abs=2e-6 * high)
    assert abs(result["pot.pressure"][-1] - high) < 1e-2
    if name != "dormand-prince":  # its steps are limited by stability
        assert result.summary["steps"] < 200


@pytest.mark.parametrize("name", ["auto", "rodas-4", "rodas-5p", "radau-iia-5"])
@pytest.mark.parametrize("kind", ["valve", "relief-valve", "check-valve", "spool-valve"])
def test_a_node_filled_through_a_moving_valve_comes_to_rest_in_few_steps(name, kind):
    """A chamber that fills through a moving valve, spool or disc is at rest after less than 300 steps."""
    area = {"area": 1e-3, "discharge_coefficient": 1.0}
    slow = {"time": [0.0, 1.0, 4.0], "value": [0.3, 0.8, 0.5]}
    nodes = {"lake": reservoir(5e5), "pot": chamber(0.1, 1e5)}
    ends = {"type": kind, "from": "lake", "to": "pot"}
    if kind == "valve":
        links = {"tap": {**ends, **area, "opening": slow}}
    elif kind == "relief-valve":
        links = {
            "tap": {**ends, **area, "set_pressure": 1e4, "overpressure": 1e4, "time_constant": 0.1}
        }
    elif kind == "check-valve":
        links = {
            "tap": {
                **ends,
                **area,
                "cracking_pressure": 0.0,
                "overpressure": 1e3,
                "time_constant": 0.1,
            }
        }
    else:
        nodes |= {"other": chamber(0.1, 1e5), "sump": reservoir(1e5)}
        ports = {"P": "lake", "T": "sump", "A": "pot", "B": "other"}
        links = {"tap": {"type": kind, "ports": ports, **area, "position": slow}}
    result = fvsolve.run(
        scene(nodes, links, 4.0, {"method": name, "rtol": 1e-6}, ["pot.pressure"], 0.5)
    )
    assert result.ok and result["pot.pressure"][-1] == pytest.approx(
        5e5, abs=1e-2 if kind != "check-valve" else 10.0
    )
    assert result.summary["steps"] < 300


def test_the_error_outside_of_error_control_shrinks_with_the_frozen_opening():
    """A valve held at opening 0.1 by an input passes the flow of a valve with opening 0.1, at drops above 1 Pa."""
    low, high, area = 1e5, 1e5 + 40.0, 1e-4
    nodes = {"lake": reservoir(high), "pot": chamber(1e-3, low)}
    found = []
    for opening, inputs in ((1.0, {"tap.opening": 0.1}), (0.1, {})):
        links = {"tap": {**valve("lake", "pot", area), "opening": opening}}
        numerics = {"method": "radau-iia-5", "rtol": 1e-6}
        model = fvsolve.build(fvsolve.load(scene(nodes, links, 1.0, numerics, ["tap.flow"], 0.1)))
        held = fvsolve.advance(model, fvsolve.initial_state(model), 1e-7, inputs)
        found.append(held.y[0])
    assert found[0] == pytest.approx(found[1], rel=1e-6)

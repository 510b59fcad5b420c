"""Energy norm of states: springs between bodies, idle motions, and moving chambers."""

import math

import numpy as np
import pytest
from reference.scenes import scene

from fvsolve.core.model.energy_norm import energy_form, form_of
from fvsolve.core.steppers import method_named, stability_function
from fvsolve.studies.linearise import linearise_at
from fvsolve.studies.operating_point import operating_point
from fvsolve.studies.stability.growth import DenseGrowth, predicted_limit
from fvsolve.studies.stability.stability import stability

MASS, DAMPING = 10.0, 1000.0


def pair(stiffness, hold=0.0):
    """Case of two masses with a spring and a damper between them, and an optional spring from a frame to the first."""
    nodes = {name: {"type": "mass", "mass": MASS} for name in "ab"}
    links = {
        "spring": {"type": "spring", "from": "a", "to": "b", "stiffness": stiffness},
        "damper": {"type": "damper", "from": "a", "to": "b", "damping": DAMPING},
    }
    if hold:
        nodes["wall"] = {"type": "frame"}
        links["hold"] = {"type": "spring", "from": "wall", "to": "a", "stiffness": hold}
    return scene(nodes, links, 1.0, {"method": "rk4", "step": 1e-3})


def greatest_stable_step(stiffness, method, steps=1000):
    """Greatest step of the relative motion at which no power of the step matrix exceeds 1000 in the energy norm [s]."""
    omega, rate = math.sqrt(2 * stiffness / MASS), 2 * DAMPING / MASS
    # states sqrt(k / 2) (x_b - x_a), sqrt(m / 4) (v_b - v_a)
    j = np.array([[0.0, omega], [-omega, -rate]])
    coefficients = [
        float(x) for x in stability_function(method_named(method)).numerator.coefficients
    ]
    low, high = 0.0, 10.0 / omega
    while high - low > 1e-6 * high:
        middle, power, fails = (low + high) / 2, np.eye(2), False
        one = sum(c * np.linalg.matrix_power(middle * j, k) for k, c in enumerate(coefficients))
        for _ in range(steps):
            power = power @ one
            fails = fails or np.linalg.norm(power, 2) > 1e3
            if fails:
                break
        low, high = (low, middle) if fails else (middle, high)
    return low


def system_of(case, method, at=None, steps=1000):
    """Growth of the linearised system of a case in its energy norm."""
    state = operating_point(case, at=at)
    return DenseGrowth(
        method_named(method), energy_form(state.model, state.y).seen(linearise_at(state).a), steps
    )


@pytest.mark.in_turn
@pytest.mark.parametrize("stiffness, hold", [(1e6, 0.0), (1e7, 0.1)])
@pytest.mark.parametrize("method", ["rk4", "ssp-rk3"])
def test_two_masses_on_a_spring_fail_where_their_relative_motion_does(stiffness, hold, method):
    found = predicted_limit(system_of(pair(stiffness, hold), method)).step
    assert found == pytest.approx(greatest_stable_step(stiffness, method), rel=2e-4)


def test_two_free_masses_are_measured_as_predicted_and_no_implicit_step_of_theirs_fails():
    (row,) = stability(pair(1e6), methods=["rk4"], steps=300).rows
    assert abs(row.difference) < 0.005 and row.field_of_values <= row.predicted * (1 + 1e-4)
    assert row.field_of_values > 0.0 and row.predicted == pytest.approx(
        greatest_stable_step(1e6, "rk4", 300), rel=2e-4
    )
    for name in ("implicit-euler", "gauss-4"):
        assert math.isinf(predicted_limit(system_of(pair(1e6), name)).step)
        assert math.isinf(predicted_limit(system_of(pair(1e7, 0.1), name)).step)


@pytest.mark.parametrize("push", [0.0, 30.0])
def test_energy_changes_by_its_slope_along_the_flow_1(push):
    """dV/dt = dV/dx f(x, u) is the power of the force minus that of the damper, at any state of two sprung masses."""
    case = pair(1e4, 2e3)
    case["links"]["push"] = {"type": "force", "to": "b", "force": push}
    model = operating_point(case).model
    form, names = energy_form(model), list(model.state_names)
    for seed in range(5):
        y = np.random.default_rng(seed).normal(size=len(names))
        v = {name: y[names.index(f"{name}.velocity")] for name in "ab"}
        slope = 2.0 * (form.rows.T @ (form.rows @ y))
        power = push * v["b"] - DAMPING * (v["a"] - v["b"]) ** 2
        assert slope @ model.rhs(0.0, y) == pytest.approx(power, rel=1e-9, abs=1e-9)


def test_free_masses_are_idle_together_and_a_supported_mass_is_not():
    free, held = (operating_point(pair(1e6, hold)).model for hold in (0.0, 0.1))
    form = energy_form(free)
    together = np.array([1.0, 0.0, 1.0, 0.0])
    assert form.size == 3 and form.forward @ together == pytest.approx(np.zeros(3), abs=1e-9)
    assert form.idle[:, 0] / form.idle[0, 0] == pytest.approx(together)
    assert energy_form(held).size == 4
    y = np.array([1e-3, 0.2, -2e-3, 0.1])
    energy = 0.5 * 1e6 * 3e-3**2 + 0.5 * MASS * (0.2**2 + 0.1**2)
    assert np.sum((form.forward @ y) ** 2) == pytest.approx(energy, rel=1e-12)
    assert np.sum((form.rows @ y) ** 2) == pytest.approx(energy, rel=1e-12)


@pytest.mark.parametrize("at", [None, 1e-3])
def test_a_closed_cylinder_neither_gains_nor_loses_energy_at_rest_or_moving(at):
    e = system_of("cases/closed-cylinder.toml", "rk4", at).e
    assert (
        np.max(np.abs(e + e.T)) < 1e-6 * np.max(np.abs(e))
        and np.linalg.eigvalsh(0.5 * (e + e.T))[-1] < 1e-4
    )


def test_an_idle_state_that_moves_an_energy_gets_the_least_weight():
    from scipy.sparse import csr_array

    form = form_of(csr_array(np.array([[0.0, 2.0]])), ("load",), np.array([0.1, 0.5]))
    assert form.closed(np.array([[0.0, 1.0], [0.0, -3.0]]))
    driven = np.array([[0.0, 1.0], [5.0, -3.0]])
    assert not form.closed(driven)
    whole = form.suited_to(driven)
    assert np.sum((whole.forward @ [0.1, 0.0]) ** 2) == pytest.approx((2.0 * 0.5) ** 2)
    assert np.sort(np.linalg.eigvals(whole.seen(driven))) == pytest.approx(
        np.sort(np.linalg.eigvals(driven))
    )


def test_the_greatest_growth_is_located_at_every_power_of_a_small_system():
    """The predicted limit covers all powers of a step, also in a norm in which the growth oscillates."""
    e, steps = np.array([[0.0, 1.0], [-40.0, 0.0]]), 300
    found = predicted_limit(DenseGrowth(method_named("euler"), e, steps)).step

    def most(h):
        power, size = np.eye(2), 0.0
        for _ in range(steps):
            power = power @ (np.eye(2) + h * e)
            size = max(size, np.linalg.norm(power, 2))
        return size

    assert most(found * (1 - 1e-4)) < 1e3 < most(found * (1 + 1.2e-4))

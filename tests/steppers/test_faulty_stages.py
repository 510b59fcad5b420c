"""A stage whose rates are not valid rejects a step under error control, and ends a run with given steps."""

from math import exp

import numba
import numpy as np
import pytest
from reference.scenes import junction, lake, scene, tank, valve

import fvsolve
from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers import ode
from fvsolve.core.steppers.coefficients import nodes_of
from fvsolve.core.steppers.integrator import Integrator
from fvsolve.core.steppers.run_handle import RHS
from fvsolve.core.steppers.tableau import method_named

# time at which rates are not valid, their status and its place
FAULT_AT, FAULT, PLACE = 0.1, 2.0, 5.0
EXPLICIT = ["bogacki-shampine", "dormand-prince", "tsitouras", "verner-7"]
IMPLICIT = ["esdirk-4", "tr-bdf2", "radau-iia-5", "rodas-4", "rodas-5p"]


def decay(t, y, dydt, out, handle):
    """y' = -y, with a fault at the time FAULT_AT."""
    out[0], out[1], out[2], out[3] = 0.0, FAULT if abs(t - FAULT_AT) < 1e-9 else 0.0, PLACE, 0.0
    for i in range(dydt.size):
        dydt[i] = -y[i]


@pytest.fixture(scope="module")
def functions():
    observers = (
        ode.observers()
        if ode.COMPILING
        else (ode._no_fused_step, ode._row, ode._nothing, ode._no_events)
    )
    return *observers, ode._compile(numba.njit(decay), RHS) if ode.COMPILING else decay


@pytest.mark.parametrize("name", EXPLICIT + IMPLICIT)
def test_error_control_rejects_a_step_with_a_faulty_stage(name, functions):
    stepper = Integrator(method_named(name), 1, 0, lambda: ode._full(1), np.ones(1))
    nodes = getattr(nodes_of, "py_func", nodes_of)(stepper.coefficients, stepper.k.shape[0])
    inner = [c for c in nodes if 0.12 < c < 0.999]
    first = FAULT_AT / inner[0]
    stepper.y[0], stepper.state["step"] = 1.0, first
    stepper.times, stepper.rows = np.empty(0), np.zeros((1, 2))
    stepper.set_control(
        mode=rec.TOLERANCE, size=1e-4, step_max=1e300, stop_at=1e300, budget=1.0, end=1.0
    )
    assert stepper.call(*functions, np.array([0]), ode.WHERE, stepper.no_floats) == rec.BUDGET_SPENT
    counts = stepper.counts()
    assert counts["rejections"] + counts["newton_failures"] == 1
    assert 0.05 * first < stepper.state[0]["t"] < 0.5 * first
    stepper.set_control(budget=1e300)
    assert stepper.call(*functions, np.array([0]), ode.WHERE, stepper.no_floats) == rec.DONE
    assert stepper.y[stepper.progress[0]["now"], 0] == pytest.approx(exp(-1.0), abs=1e-3)


def pulse(method: str) -> dict:
    """Case of an inflow between two valves that are shut from t = 0.501 to 0.509 s only; steps end at 0.50 and 0.51 s.

    The opening 1 - exp(-z^160) is zero to rounding without a kink, so no step has to end there.
    """
    opening = "1 - exp(-((t - 0.505)/5e-3)**160)"
    nodes = {"A": lake(50.0), "T": tank(1.0, 2.0), "X": junction(-1e-3)}
    links = {"v0": valve("A", "X", 1e-3, opening), "v1": valve("T", "X", 1e-3, opening)}
    return scene(nodes, links, 1.0, {"method": method, "step": 0.01}, ["X.head", "T.level"], 0.1)


@pytest.mark.parametrize(
    "method", ["rk4", "ssp-rk3", "dormand-prince", "rodas-5p", "alexander-3", "gauss-4"]
)
def test_given_steps_end_at_a_faulty_stage_as_at_a_faulty_state(method):
    """Without the test of stages the run finished, and only its ledger showed the volume 5e-5 m3 that was not there."""
    result = fvsolve.run(pulse(method))
    assert not result.ok
    assert result.reason.startswith("stopped: the inflow at X finds no way out at t = 0.5")
    assert result.t[-1] <= 0.5 + 1e-9
    assert abs(result.ledger["mass"]["relative"]) < 1e-14


def test_a_method_with_stages_that_miss_the_fault_does_not_stop():
    assert fvsolve.run(pulse("ssp-rk2")).ok


def gap(t, y, dydt, out, handle):
    """y0' = -y0, without valid rates at y0 = y1 within 1e-9: with a status, or not a number where y2 is 1."""
    bad = abs(y[0] - y[1]) < 1e-9
    out[0], out[1], out[2], out[3] = 0.0, FAULT if bad and y[2] == 0.0 else 0.0, PLACE, 0.0
    dydt[0], dydt[1], dydt[2] = np.nan if bad and y[2] > 0.0 else -y[0], 0.0, 0.0


@pytest.fixture(scope="module")
def functions_with_gap(functions):
    return *functions[:-1], ode._compile(numba.njit(gap), RHS) if ode.COMPILING else gap


@pytest.mark.parametrize("silent", [False, True], ids=["status", "nan"])
@pytest.mark.parametrize("name", EXPLICIT + IMPLICIT)
def test_error_control_rejects_a_step_with_invalid_rates_at_its_end(
    name, silent, functions_with_gap
):
    """The gap is at the end of the first step; the stages of Rosenbrock methods are not there."""

    def run(at: float, budget: float):
        stepper = Integrator(method_named(name), 3, 0, lambda: ode._full(3), np.ones(3))
        stepper.y[0], stepper.state["step"] = (1.0, at, float(silent)), 0.1
        stepper.times, stepper.rows = np.empty(0), np.zeros((1, 4))
        stepper.set_control(
            mode=rec.TOLERANCE, size=1e-3, step_max=1e300, stop_at=1e300, budget=budget, end=1.0
        )
        code = stepper.call(*functions_with_gap, np.array([0]), ode.WHERE, stepper.no_floats)
        return code, stepper.y[stepper.progress[0]["now"], 0], stepper

    _, end_of_first, stepper = run(100.0, 1.0)
    assert stepper.counts()["steps"] == 1
    code, end, stepper = run(end_of_first, 1e300)
    assert code == rec.DONE and stepper.state[0]["t"] == 1.0
    assert end == pytest.approx(exp(-1.0), abs=1e-2)
    assert stepper.counts()["rejections"] + stepper.counts()["newton_failures"] > 0

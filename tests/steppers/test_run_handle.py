"""Handle of a run: checked arrays, arrays that are replaced between calls, and restart arrays by name."""

import math

import numpy as np
import pytest
from reference.folders import CASES

import fvsolve
from fvsolve.core.kernels.dtypes import RATE_UNWANTED
from fvsolve.core.steppers import METHODS, loop_records, ode
from fvsolve.core.steppers.integrator import Integrator
from fvsolve.jit import COMPILING


def decay(t, y):
    return -y


def begun(method: str = "rk4") -> Integrator:
    """Integrator of y' = -y from y = (1, 2), by steps of 0.1 s up to 1 s."""
    stepper = Integrator(METHODS[method], 2, 0, lambda: ode._full(2), np.ones(2))
    stepper.y[0] = 1.0, 2.0
    stepper.set_control(
        mode=loop_records.FIXED_STEP, size=0.1, step_max=1e308, stop_at=1e308, end=1.0
    )
    return stepper


def stepped(stepper: Integrator, steps: int) -> np.ndarray:
    functions = ode._prepare(decay, 0.0, np.ones(2))[0]
    key = next(ode._KEYS)
    ode._PYTHON[key] = lambda t, y, dydt: np.copyto(dydt, decay(t, y))
    stepper.set_control(budget=steps)
    code = stepper.call(*functions, np.array([key]), ode.WHERE, stepper.no_floats)
    assert code == loop_records.BUDGET_SPENT
    return stepper.y[stepper.progress[0]["now"]]


@pytest.mark.parametrize(
    "wrong", [np.ones(2, dtype=np.float32), np.ones(4)[::2], np.ones((2, 1)), np.arange(2)]
)
def test_an_array_of_another_type_is_refused_by_name(wrong):
    if not COMPILING:
        pytest.skip("JIT is off")
    stepper = begun()
    stepper.scale = wrong
    with pytest.raises(
        TypeError, match="^scale is not a writable C-contiguous array of float64 with 1 dimension"
    ):
        stepper.handle(True)


def test_an_array_that_is_replaced_between_calls_is_used():
    whole = stepped(begun(), 6).copy()
    stepper = begun()
    stepped(stepper, 3)
    for name in ("y", "k", "state", "out", "rows"):
        setattr(stepper, name, getattr(stepper, name).copy())
    assert np.array_equal(stepped(stepper, 3), whole)
    assert stepper.state[0]["steps"] == 6


@pytest.mark.parametrize("method", ["rk4", "radau-iia-5", "rodas-5p", "esdirk-4"])
def test_restart_arrays_by_name_continue_to_the_same_bits(method):
    whole, stepper, again = begun(method), begun(method), begun(method)
    stepped(stepper, 3)
    again.y[0] = stepper.y[stepper.progress[0]["now"]]
    for name, view in again.restart_arrays().items():
        view[...] = stepper.restart_arrays()[name]
    again.after_restore()
    assert np.array_equal(stepped(again, 3), stepped(whole, 6))
    # the rates of the first state are computed again
    assert again.counts() | {"rhs": 0} == whole.counts() | {"rhs": 0}


VALVES = (
    "air-valve",
    "check-valve-slam",
    "pressure-reducing",
    "relief-on-closed-main",
    "surge-tank",
    "two-tanks",
)


@pytest.mark.parametrize(
    "name",
    [
        *VALVES,
        "cylinder-servo",
        "anti-roll-tank",
        "four-bar",
        "hydropower",
        "pump-trip",
        "tumbling-body",
    ],
)
def test_a_stage_without_the_rate_limit_has_the_same_rates(name):
    """The limit of the step is left out at all stages of a step but the first; nothing else depends on it."""
    model = fvsolve.build(fvsolve.load(CASES / f"{name}.toml"))
    t, y = model.case.numerics.start, model.start.copy()
    with model.run_data() as run_data:
        whole, out = run_data.evaluate(t, y, math.inf)
        dydt, others = np.zeros(y.size), model.new_out()
        others[loop_records.RATE] = RATE_UNWANTED
        model.functions.rhs(t, y, dydt, others, run_data.handle)
    assert np.array_equal(dydt, whole, equal_nan=True)
    assert np.array_equal(
        np.delete(others, loop_records.RATE), np.delete(out, loop_records.RATE), equal_nan=True
    )
    assert others[loop_records.RATE] <= out[loop_records.RATE]

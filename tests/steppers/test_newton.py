"""Newton's method: counts of its work, solved stages, and errors with time and state of a failure."""

import math

import numpy as np
import pytest
from numba import njit
from reference.folders import CASES
from reference.scenes import WATER, chamber, scene, valve

import fvsolve
from fvsolve.core.solve.run_loop import RunLoop
from fvsolve.core.steppers import METHODS, integrate, loop_records
from fvsolve.errors import FvsolveError
from fvsolve.studies.validation import valve_controlled_cylinder as cylinder

NAMES = [name for name, method in METHODS.items() if name == method.name]
IMPLICIT = [name for name in NAMES if not METHODS[name].explicit]
ITERATED = [name for name in IMPLICIT if METHODS[name].kind != "linear"]
SETTINGS = [
    *((name, {"step": 0.1}) for name in NAMES),
    *((name, {"rtol": 1e-5}) for name in NAMES if METHODS[name].adaptive),
]
SLOPES = np.array([[-2.0, 1.0, 0.0], [1.0, -20.0, 1.0], [0.0, 3.0, -10.0]])
TIMES = [0.0, 0.25, 1.0, 1.7]


class Counted:
    """Function that numba cannot compile and that counts its calls."""

    def __init__(self, f) -> None:
        self.f, self.calls = f, 0

    def __call__(self, t, y):
        self.calls += 1
        return self.f(t, y)


COUNTED = Counted(lambda t, y: SLOPES @ y)


@pytest.mark.parametrize("name, settings", SETTINGS)
def test_the_count_of_rates_is_the_number_of_calls(name, settings):
    before, counts = COUNTED.calls, {}
    integrate(COUNTED, [1.0, 1.0, 1.0], TIMES, name, counts=counts, **settings)
    tried_out = 1  # call before the first step, not counted
    assert counts["rhs"] == COUNTED.calls - before - tried_out > counts["steps"] > 0


@njit
def linear(t, y):
    return SLOPES @ y + np.cos(t)


@pytest.mark.parametrize("name", IMPLICIT)
def test_a_linear_problem_needs_a_single_jacobian_for_all_fixed_steps(name):
    """Fixed steps of a linear problem need one Jacobian, and factors for two lengths, because the last step is rounded.

    Rosenbrock methods need a Jacobian and factors in every step.
    """
    counts: dict = {}
    integrate(linear, [1.0, 1.0, 1.0], [0.0, 2.05], name, step=0.1, counts=counts)
    iterated = METHODS[name].kind != "linear"
    systems = 1
    if METHODS[name].kind == "full":
        a = METHODS[name].a[METHODS[name].a.any(axis=1)]
        systems = np.count_nonzero(np.linalg.eigvals(a[:, -len(a) :]).imag >= 0.0)
    assert counts["steps"] == 21 and counts["newton_failures"] == counts["rejections"] == 0
    assert counts["jacobians"] == (1 if iterated else 21)
    assert counts["factorisations"] == (2 * systems if iterated else 21)
    assert (counts["newton"] > 0) == iterated


@pytest.mark.parametrize("name", [name for name in NAMES if METHODS[name].explicit])
def test_an_explicit_method_does_none_of_it(name):
    counts: dict = {}
    integrate(linear, [1.0, 1.0, 1.0], [0.0, 2.0], name, step=0.05, counts=counts)
    assert counts["rhs"] > 0
    assert not any(
        counts[what] for what in ("jacobians", "factorisations", "newton", "newton_failures")
    )


@njit
def lands(t, y):
    """Rates of a state that falls freely and is then caught, so that the Jacobian changes."""
    return np.array([-y[0], -1.0 + 1e3 * max(0.5 - y[1], 0.0) ** 2])


@pytest.mark.parametrize("h", [0.1, 0.03, 0.01])
def test_no_step_depends_on_the_iterations_of_newton_in_the_last_step(h):
    """Each step solves y+ = y + h f(y+) of implicit Euler, if each output is one step."""
    t, counts = h * np.arange(int(1.2 / h) + 1), {}
    y = integrate(lands, [1.0, 1.0], t, "implicit-euler", step=h, counts=counts)
    assert y[-1, 1] == pytest.approx(0.5 - math.sqrt(1e-3), abs=1e-5)
    if counts["steps"] == len(t) - 1:
        off = [y[i + 1] - y[i] - h * lands(t[i + 1], y[i + 1]) for i in range(len(t) - 1)]
        assert np.max(np.abs(off)) < 1e-7


@njit
def jumps(t, y):
    """Rates of a state that falls a hundred times faster below 0.5."""
    return np.array([-y[0], -1.0 if y[1] > 0.5 else -100.0])


JUMPED = 0.5 - 100.0 * (2.5 - 0.5)  # at 2.5 s, from 1


@pytest.mark.parametrize(
    "name", ["tr-bdf2", "esdirk-3", "esdirk-4", "esdirk-5", "rodas-4", "rodas-5p", "radau-iia-5"]
)
def test_error_control_passes_a_jump_of_the_rates(name):
    counts: dict = {}
    found = integrate(jumps, [1.0, 1.0], [0.0, 2.5], name, rtol=1e-6, counts=counts)[-1]
    assert found[1] == pytest.approx(JUMPED, abs=1e-3)
    assert counts["rejections"] > 5


@pytest.mark.parametrize("name", [name for name in ITERATED if METHODS[name].stages < 5])
def test_a_fixed_step_passes_it_within_a_single_step(name):
    found = integrate(jumps, [1.0, 1.0], [0.0, 2.5], name, step=0.01)[-1]
    assert found[1] == pytest.approx(JUMPED, abs=0.01 * 99.0 + 0.01)


@njit
def ends(t, y):
    """Rates that are NaN if the second state is below 0.5, from t = 0.5 on."""
    return np.array([-y[0], -1.0 if y[1] > 0.5 else math.nan, 1.0])


@pytest.mark.parametrize("name, settings", [row for row in SETTINGS if row[0] in ITERATED])
def test_where_no_step_is_short_enough_the_error_states_the_time_and_the_variable(name, settings):
    with pytest.raises(
        FvsolveError, match=rf"{name} stopped at t = 0\.5: Newton did not converge, worst in y\[1\]"
    ):
        integrate(ends, [1.0, 1.0, 0.0], [0.0, 1.0], name, **settings)


@pytest.mark.parametrize("name", ["rodas-4", "rodas-5p"])
def test_a_rosenbrock_method_stops_there_too(name):
    for settings in ({"step": 0.02}, {"rtol": 1e-6}):
        with pytest.raises(FvsolveError, match=rf"{name} stopped at t = 0\.\d+: .* not finite"):
            integrate(ends, [1.0, 1.0, 0.0], [0.0, 1.0], name, **settings)


def test_exceptions_of_f_reach_the_caller_from_within_newton_too():
    def broken(t, y):
        if t > 0.3:
            raise KeyError("no such valve")
        return -y

    f = Counted(broken)
    for name in ("radau-iia-5", "esdirk-4", "rodas-5p", "implicit-euler"):
        with pytest.raises(FvsolveError) as caught:
            integrate(f, [1.0], [0.0, 1.0], name, step=0.1)
        assert isinstance(caught.value.__cause__, KeyError), name


def sucked_dry(**numerics) -> dict:
    """Case of 1 l of water under the law `log` with an outflow of 10 l/s, which is empty at 0.1 s."""
    nodes = {"pot": chamber(1e-3, 5e6), "drain": {"type": "inflow", "flow": -0.01}}
    fluid = {**WATER, "law": "log"}
    return scene(
        nodes,
        {"neck": valve("pot", "drain", 1e-3)},
        0.2,
        numerics,
        ["pot.pressure"],
        0.005,
        fluid=fluid,
    )


@pytest.mark.parametrize(
    "numerics",
    [{"method": "radau-iia-5"}, {"method": "esdirk-4"}, {"method": "trapezoid", "step": 1e-3}],
    ids=lambda numerics: numerics["method"],
)
def test_a_run_states_time_and_variable_of_a_failure_of_newton_and_retains_everything_up_to_there(
    numerics, tmp_path
):
    case = sucked_dry(**numerics)
    result = fvsolve.run(case, out=tmp_path / "run")
    assert not result.ok
    assert result.reason.startswith(
        "stopped: Newton did not converge at t = 0.100223 s, however short the step"
    )
    assert "worst in pot.mass; check the parts there for jumps" in result.reason
    assert result.summary["newton_failures"] > 10
    stored = fvsolve.open_run(tmp_path / "run")
    assert stored.reason == result.reason and stored.t == pytest.approx(0.005 * np.arange(21))
    assert np.all(np.isfinite(stored["pot.pressure"]))


@njit
def cylinder_rates(t, y):
    rates = np.empty_like(y)
    cylinder.rhs(t, y, rates)
    return rates


@pytest.mark.parametrize(
    ("name", "ratio", "error"), [("radau-iia-5", 1.0, 2e-3), ("radau-iia-9", 1.6, 1e-2)]
)
def test_loose_tolerances_of_radau_do_not_cost_more_calls_than_tight_ones(name, ratio, error):
    t, calls, found = np.linspace(0.0, cylinder.END, 21), {}, {}
    for rtol in (1e-3, 1e-4, 1e-5, 1e-7):
        counts: dict = {}
        found[rtol] = integrate(cylinder_rates, cylinder.start(), t, name, rtol=rtol, counts=counts)
        calls[rtol] = counts["rhs"]
    assert all(calls[rtol] <= ratio * calls[1e-7] for rtol in calls)
    sizes = np.abs(found[1e-7]).max(axis=0)
    assert np.abs((found[1e-3] - found[1e-7]) / sizes).max() < error


def test_a_summary_counts_the_work_of_newton():
    case = sucked_dry(method="radau-iia-5", rtol=1e-6) | {
        "numerics": {"end": 0.05, "method": "radau-iia-5"}
    }
    said = fvsolve.run(case).summary
    assert said["methods"] == [
        {"time": 0.0, "method": "radau-iia-5", "why": "given by numerics.method"}
    ]
    assert said["steps"] > 0 and said["jacobians"] > 0 and said["newton"] >= said["steps"]
    assert said["factorisations"] >= 2 * said["jacobians"]  # real and complex factors
    assert said["rhs"] >= said["steps"] + 3 * said["newton"] + said["jacobians"]
    explicit = fvsolve.run({**case, "numerics": {"end": 0.05, "method": "dormand-prince"}}).summary
    assert [
        explicit[what] for what in ("jacobians", "factorisations", "newton", "newton_failures")
    ] == [0, 0, 0, 0]


@pytest.mark.parametrize("name", ["radau-iia-5", "esdirk-4"])
def test_a_state_remembered_twice_has_no_factors_either(name):
    """A resumed state that is stored again before a step gives the same steps as the original state."""
    model = fvsolve.build(
        fvsolve.load(CASES / "cylinder-servo.toml", set={"numerics.method": name})
    )
    loop = RunLoop(model)
    loop.begin(0.01, 1e308)
    assert loop.run(30) == loop_records.BUDGET_SPENT
    memory, states = restart_copies(loop), []
    for _ in range(2):  # stored and restored
        again = RunLoop(model)
        for name, view in again.stepper.restart_arrays().items():
            view[...] = memory[name]
        again.stepper.after_restore()
        memory = restart_copies(again)
    # negative shift: factors are missing
    assert again.stepper.newton["shift"] == -loop.stepper.newton["shift"] < 0.0
    again.now[:], again.armed[:] = loop.now, loop.armed
    for one in (loop, again):
        one.resume(0.01, 1e308)
        one.run(5)
        states.append(one.now.copy())
    assert np.array_equal(*states) and loop.stepper.counts() == again.stepper.counts()


def restart_copies(loop) -> dict[str, np.ndarray]:
    return {name: view.copy() for name, view in loop.stepper.restart_arrays().items()}

"""Compiled steps of stiff problems against theory: damping, ringing, order reduction and dense output."""

import math
import re

import numpy as np
import pytest
from numba import njit
from reference import folders

from fvsolve.core.steppers import METHODS, analyse, integrate, ode
from fvsolve.core.steppers.coefficients import coefficients, start_slope_correction
from fvsolve.errors import FvsolveError

NAMES = [name for name, method in METHODS.items() if name == method.name]
EXPLICIT = [name for name in NAMES if METHODS[name].explicit]
IMPLICIT = [name for name in NAMES if not METHODS[name].explicit]
ADAPTIVE = [name for name in IMPLICIT if METHODS[name].adaptive]

FAST = 1e6  # [1/s]
STEPS = 0.1 * np.arange(6)  # times of steps, each 1e5 times longer than the transient [s]


@njit
def relaxes(t, y):
    """Rates y' = lambda (y - cos t) - sin t with lambda = -1e6, whose solutions tend to cos t."""
    return np.array([-1e6 * (y[0] - math.cos(t)) - math.sin(t)])


@njit
def prothero_robinson(t, y):
    """Rates y' = lambda (y - sin t) + cos t with lambda = -1e6 and the slow solution sin t."""
    return np.array([-1e6 * (y[0] - math.sin(t)) + math.cos(t)])


@njit
def mild(t, y):
    """Rates y' = lambda (y - sin t) + cos t with lambda = -1."""
    return np.array([-1.0 * (y[0] - math.sin(t)) + math.cos(t)])


@njit
def pendulum(t, y):
    """Rates of a driven pendulum: nonlinear and non-autonomous, so that all order conditions contribute."""
    return np.array([y[1], -np.sin(y[0]) + 0.3 * np.cos(t)])


def departures(name: str) -> np.ndarray:
    """Deviation y - cos t at the start, where it is 1, and after each of five long steps."""
    return integrate(relaxes, [2.0], STEPS, name, step=0.1)[:, 0] - np.cos(STEPS)


@pytest.mark.parametrize("name", IMPLICIT)
def test_a_fast_transient_ends_in_a_single_long_step_of_an_l_stable_method_and_rings_in_others(
    name,
):
    """After one long step of an L-stable method only the error of the slow solution remains, at most about h^2 / 6.

    The transient of a method that is not L-stable is R(-1e5)^n, of modulus near 1 except for Crouzeix's methods.
    """
    r, found = analyse(name).stability_function(-FAST * 0.1).real, departures(name)
    if analyse(name).l_stable:
        assert np.max(np.abs(found[1:])) < (2e-4 if METHODS[name].stiffly_accurate else 2e-3)
        return
    assert abs(r) > (0.6 if name.startswith("crouzeix") else 0.999)
    assert found == pytest.approx(r ** np.arange(6), abs=5e-3)
    if r < 0:
        assert np.all(np.sign(found) == (-1.0) ** np.arange(6))


@pytest.mark.parametrize("name", EXPLICIT)
def test_an_explicit_method_blows_up(name):
    try:
        found = departures(name)
    except FvsolveError as error:
        assert "not finite" in str(error)
    else:
        assert np.all(np.abs(found[1:]) > 1e4 * np.abs(found[:-1]))


# Orders of Rosenbrock methods: Rodas satisfies no condition of Scholz, Rodas5P all conditions (Steinebach 2023).
ROSENBROCK = {"rodas-4": 1, "rodas-5p": 3}


def stiff_order(name: str) -> int:
    """Order in h in the limit of infinite lambda h (Prothero and Robinson 1974; Hairer and Wanner 1996, IV.15).

    With stage order q the error of a step is of order h^(q+1), or h^q / lambda for stiffly accurate methods. If R is 1
    at infinity, the errors of all steps add up.
    """
    method, far = METHODS[name], analyse(name).stability_function(-1e12).real
    if name in ROSENBROCK:
        return ROSENBROCK[name]
    return method.stage_order + (not method.stiffly_accurate) - (far > 0.99)


def errors(name: str, f, counts: tuple[int, int]) -> list[float]:
    """Greatest errors for both numbers of steps at common times within six seconds, without the first three times."""
    t = np.linspace(0.0, 6.0, min(counts[0], 12) + 1)
    return [
        np.max(np.abs(integrate(f, [0.0], t, name, step=6.0 / n)[3:, 0] - np.sin(t[3:])))
        for n in counts
    ]


@pytest.mark.parametrize("name", IMPLICIT)
def test_the_order_of_prothero_and_robinson_s_problem_falls_to_the_stage_order(name):
    order = stiff_order(name)
    coarse, fine = errors(
        name, prothero_robinson, {5: (12, 24), 4: (24, 48), 1: (192, 384)}.get(order, (48, 96))
    )
    assert math.log2(coarse / fine) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("name", IMPLICIT)
def test_where_it_is_not_stiff_the_order_is_whole(name):
    order = METHODS[name].order
    coarse, fine = errors(name, mild, {9: (6, 12), 6: (24, 48), 5: (36, 72)}.get(order, (192, 384)))
    assert math.log2(coarse / fine) >= order - 0.1


def test_the_page_prints_the_output_of_its_example(capsys):
    page = folders.page("choosing-a-method")
    section = page.split("## Orders that stiffness leaves")[1].split("\n## ")[0]
    code, printed = re.findall(r"```(?:python)?\n(.*?)```", section, re.DOTALL)
    exec(compile(code, "example", "exec"), {})
    assert capsys.readouterr().out == printed


def test_the_last_stage_as_the_end_of_the_step_is_worth_a_factor_of_lambda():
    """Radau IIA is stiffly accurate, and its error is smaller by lambda or more than that of Radau IA with equal R."""
    assert analyse("radau-ia-5").stability_function == analyse("radau-iia-5").stability_function
    first, second = (
        errors(name, prothero_robinson, (48, 96))[0] for name in ("radau-ia-5", "radau-iia-5")
    )
    assert first > FAST * second


BETWEEN = np.linspace(0.0, 4.0, 201)


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    return integrate(pendulum, [1.0, 0.2], BETWEEN, "verner-7", step=5e-3)


def order_between(name) -> int:
    """Power of the step in the error of rows between steps, from the degree of the dense output."""
    dense = coefficients(METHODS[name])[1]
    return (
        (dense.shape[1] if dense.size else 3) + (start_slope_correction(METHODS[name]).size > 0) + 1
    )


@pytest.mark.parametrize("name", IMPLICIT)
def test_between_given_steps_the_error_has_the_order_of_the_method(name, truth):
    """Output between given steps has the order of the method, by dense output or by separate steps."""
    coarse, fine = (
        np.max(np.abs(integrate(pendulum, [1.0, 0.2], BETWEEN, name, step=4.0 / n) - truth))
        for n in (40, 80)
    )
    assert fine < 1e-12 or math.log2(coarse / fine) == pytest.approx(METHODS[name].order, abs=0.4)


@pytest.mark.parametrize(
    "name, settings",
    [*((name, {"step": 0.1}) for name in IMPLICIT), *((name, {"rtol": 1e-6}) for name in ADAPTIVE)],
)
def test_asking_for_more_times_does_not_move_the_end(name, settings):
    """More output times change the end by no bit, or within the tolerance if error control shortens steps to them."""
    many, one = (
        integrate(pendulum, [1.0, 0.2], t, name, **settings)[-1] for t in (BETWEEN, [0.0, 4.0])
    )
    if "rtol" in settings and METHODS[name].order > order_between(name):
        assert many == pytest.approx(one, abs=1e-5)
    else:
        assert np.array_equal(many, one)


@pytest.mark.parametrize("name", ADAPTIVE)
def test_values_between_steps_are_no_worse_than_the_tolerance_of_the_steps(name, truth):
    q = METHODS[name].control_order - 1
    found = integrate(pendulum, [1.0, 0.2], BETWEEN, name, rtol=1e-6)
    assert np.max(np.abs(found - truth)) < 10.0 * 1e-6 ** (q / (q + 1))


RATE = 1.0


def test_values_read_by_a_plain_function_may_change_between_two_calls(monkeypatch):
    def f(t, y):
        return -RATE * y

    assert integrate(f, [1.0], [0.0, 1.0], rtol=1e-9)[-1, 0] == pytest.approx(
        np.exp(-1.0), rel=1e-7
    )
    monkeypatch.setitem(globals(), "RATE", 2.0)
    assert integrate(f, [1.0], [0.0, 1.0], rtol=1e-9)[-1, 0] == pytest.approx(
        np.exp(-2.0), rel=1e-7
    )


def decaying(rate):
    """Rates of the same code with another value from outside."""
    return lambda t, y: -rate * y


def faster(t, y):
    return -(RATE + 1.0) * y


def single_rate(t, y):
    return np.array([-y[0]])


FOLLOWED = {
    "number": (lambda: 1.0, lambda rate: 2.0),
    "whole number": (lambda: 1, lambda rate: 2),
    "array": (lambda: np.array([1.0]), lambda rate: np.array([2.0])),
    "array in place": (lambda: np.array([1.0]), lambda rate: np.add(rate, 1.0, out=rate)),
    "number of numpy": (lambda: np.float64(1.0), lambda rate: np.float64(2.0)),
}


@pytest.mark.parametrize("kind", FOLLOWED)
def test_functions_of_equal_code_have_their_own_values(kind):
    first, other = FOLLOWED[kind]
    rate = first()
    found = [integrate(decaying(rate), [1.0], [0.0, 1.0], rtol=1e-9)[-1, 0]]
    rate = other(rate)
    found.append(integrate(decaying(rate), [1.0], [0.0, 1.0], rtol=1e-9)[-1, 0])
    assert found == pytest.approx(np.exp([-1.0, -2.0]), rel=1e-7)


def test_a_plain_function_is_compiled_once_while_its_values_are_the_same(monkeypatch):
    y = np.ones(1)
    assert ode._prepare(faster, 0.0, y)[0] is ode._prepare(faster, 1.0, y)[0]
    assert ode._prepare(decaying(3.0), 0.0, y)[0] is ode._prepare(decaying(3.0), 0.0, y)[0]
    assert ode._prepare(decaying(3), 0.0, y)[0] is not ode._prepare(decaying(3.0), 0.0, y)[0]
    assert ode.frozen_values(lambda t, y: FOLLOWED["number"]) is None  # a dictionary may change
    # a function within, whose values are not read
    assert ode.frozen_values(lambda t, y: [v for v in y]) is None
    before = ode._prepare(faster, 0.0, y)[0]
    monkeypatch.setitem(globals(), "RATE", 5.0)
    assert ode._prepare(faster, 0.0, y)[0] is not before
    integrate(single_rate, [1.0], [0.0, 1.0], rtol=1e-3)
    with pytest.raises(FvsolveError, match="gives 1 rates for 2 states"):
        integrate(single_rate, [1.0, 2.0], [0.0, 1.0], rtol=1e-3)


def test_compiled_functions_are_stored_up_to_a_number(monkeypatch):
    monkeypatch.setattr(ode, "_COMPILED", {})
    monkeypatch.setattr(ode, "MOST_COMPILED", 2)
    for rate in (1.0, 2.0, 3.0):
        assert integrate(decaying(rate), [1.0], [0.0, 1.0], rtol=1e-9)[-1, 0] == pytest.approx(
            np.exp(-rate), rel=1e-7
        )
    assert len(ode._COMPILED) == 2


def test_a_variable_without_a_value_in_a_branch_that_is_not_taken_is_no_fault():
    def f(t, y):
        return -y if t < 10.0 else missing * y

    assert ode.frozen_values(f) is None
    assert integrate(f, [1.0], [0.0, 1.0], rtol=1e-9)[-1, 0] == pytest.approx(
        np.exp(-1.0), rel=1e-7
    )
    if f is None:
        missing = 1.0

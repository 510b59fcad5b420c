"""Accuracy of rows between steps against that of ends of steps, for every method."""

import math

import numpy as np
import pytest
from reference.scenes import GRAVITY, area, chamber, reservoir, scene, tank, valve

import fvsolve
from fvsolve.core.steppers import METHODS, loop_records, ode
from fvsolve.core.steppers.integrator import Integrator
from fvsolve.jit import njit

END, EVERY = 10.0, 0.0137  # no step divides the interval [s]
WORSE = 10.0  # allowed error of rows over that of ends of steps
ROUNDING = 1e-13


@njit
def circle(t, y, dydt):
    """Rates of a harmonic oscillator and of a state that follows it with a lag."""
    dydt[0], dydt[1], dydt[2] = y[1], -y[0], np.cos(t) - y[2]


def exact(t):
    return np.column_stack([np.cos(t), -np.sin(t), 0.5 * (np.cos(t) + np.sin(t))])


@njit
def stiff(t, y, dydt):
    """Rates of a stiff state with a transient of 1 us about cos(t), and of two states that follow it."""
    dydt[0], dydt[1], dydt[2] = -1e6 * (y[0] - np.cos(t)), y[0] - y[1], -y[2]


def tables(f, begin, method, control, size):
    """Tables [t, y] of rows and of ends of steps, computed as in a run, with rows at all times and unchanged steps."""
    stepper = Integrator(METHODS[method], 3, 0, lambda: ode._full(3), np.ones(3))
    state, progress = stepper.state[0], stepper.progress[0]
    stepper.y[0] = begin
    stepper.set_control(
        mode=control, size=size, step_max=1e308, stop_at=1e308, end=END, every=EVERY
    )
    stepper.rows = np.zeros((round(END / EVERY) + 2, 4))
    functions = ode._prepare(f, 0.0, stepper.y[0])[0]
    ends, code, state["next_output"] = [], loop_records.BUDGET_SPENT, 1.0
    while code == loop_records.BUDGET_SPENT:
        stepper.set_control(budget=1.0)
        code = stepper.call(*functions, np.array([-1]), ode.WHERE, stepper.no_floats)
        ends.append([state["t"], *stepper.y[progress["now"]]])
    assert code == loop_records.DONE
    assert progress["rows"] == int(END / EVERY)
    return stepper.rows[: progress["rows"]], np.array(ends)


def errors(method, control, size):
    """Greatest error of rows and of ends of steps for the oscillator."""
    found = tables(circle, exact(np.zeros(1))[0], method, control, size)
    return [np.abs(table[:, 1:] - exact(table[:, 0])).max() for table in found]


@pytest.mark.parametrize("method", METHODS)
def test_rows_are_as_good_as_ends_of_steps(method):
    """Rows have at most WORSE times the error of ends of steps, for given steps and under error control.

    Without the present interpolation rows of `verner-7` were worse by 1e6, of `gauss-6` by 2e3 and of `esdirk-5` by
    120.
    """
    settings = [(loop_records.FIXED_STEP, h) for h in (0.2, 0.05)]
    if METHODS[method].adaptive:
        settings += [(loop_records.TOLERANCE, rtol) for rtol in (1e-4, 1e-7, 1e-10)]
    for control, size in settings:
        rows, ends = errors(method, control, size)
        assert rows <= WORSE * ends + ROUNDING, (control, size, rows, ends)


IMPLICIT = [name for name, method in METHODS.items() if not method.explicit]


@pytest.mark.parametrize("method", IMPLICIT)
def test_rows_of_a_stiff_start_do_not_overshoot(method):
    """Rows of steps of 0.2 s over a transient of 1 us do not exceed the ends of steps by more than 1 %."""
    rows, ends = tables(stiff, np.zeros(3), method, loop_records.FIXED_STEP, 0.2)
    most = max(1.0, np.abs(ends[:, 1]).max())  # a method that is not L-stable rings at its ends too
    assert np.abs(rows[:, 1]).max() <= 1.01 * most
    assert np.abs(rows[:, 2]).max() <= 1.01 * np.abs(ends[:, 2]).max()


@pytest.mark.parametrize("method", ["tr-bdf2", "esdirk-4", "radau-iia-5"])
@pytest.mark.parametrize("size", [1.0, 0.05])
def test_a_chamber_is_not_filled_beyond_its_supply(method, size):
    """The greatest pressure of a chamber that fills within 1 ms is at most 1 % above its supply."""
    nodes = {"supply": reservoir(8e6), "store": chamber(1e-3, 1e5), "tank": reservoir(1e5)}
    links = {"in": valve("supply", "store", 1e-5), "out": valve("store", "tank", 1e-6)}
    run = fvsolve.run(
        scene(nodes, links, 5.0, {"method": method, "step": size}, ["store.pressure"], every=0.13)
    )
    assert run.ok and run.si("store.pressure")[-1] == pytest.approx(1e5 + 7.9e6 / 1.01, rel=1e-9)
    assert run.extremes["store.pressure"].maximum <= 1.01 * 8e6


def test_rows_of_a_run_are_as_good_as_its_steps():
    """Rows of a column that oscillates between two tanks follow cos(omega t) to 1e-11 m under rtol 1e-11."""
    nodes = {"a": tank(2.0, 3.1), "b": tank(1.0, 3.0)}
    column = {
        "type": "rigid-column",
        "from": "a",
        "to": "b",
        "length": 40.0,
        "diameter": 0.5,
        "friction": {"model": "none"},
    }
    numerics = {"method": "verner-7", "rtol": 1e-11}
    run = fvsolve.run(
        scene(nodes, {"c": column}, 40.0, numerics, ["a.level", "b.level"], every=0.37)
    )
    drop = run.si("a.level") - run.si("b.level")
    omega = math.sqrt(GRAVITY * area(0.5) / 40.0 * (1 / 2.0 + 1 / 1.0))
    assert drop == pytest.approx(0.1 * np.cos(omega * run.seconds), abs=1e-11)


def test_landing_leaves_given_steps_where_they_end():
    """Output times between given steps do not change the accuracy, because each step continues to its own end."""
    t = np.linspace(0.0, 1.0, 38)
    whole = ode.integrate(circle, [1.0, 0.0, 0.5], t[[0, -1]], "verner-7", step=0.1)[-1]
    cut = ode.integrate(circle, [1.0, 0.0, 0.5], t, "verner-7", step=0.1)
    assert whole == pytest.approx(exact(np.ones(1))[0], abs=1e-10)
    assert cut == pytest.approx(exact(t), abs=1e-10)


STIFF_METHODS = [name for name in IMPLICIT if METHODS[name].adaptive] + ["auto"]


def forced(rate, t):
    """Exact solution of y' = -rate (y - cos t), y(0) = 2 (Prothero and Robinson 1974)."""
    a, b = rate**2 / (rate**2 + 1), rate / (rate**2 + 1)
    return a * np.cos(t) + b * np.sin(t) + (2 - a) * np.exp(-rate * t)


@pytest.mark.parametrize("method", STIFF_METHODS)
@pytest.mark.parametrize("rate", [1e4, 1e6, 1e9])
def test_rows_of_a_stiff_problem_have_the_accuracy_of_its_steps(method, rate):
    """Many and few rows between long steps are right to a few tolerances, and do not change the steps.

    Without control of the interpolant the errors were up to 1.7 for a tolerance of 1e-6, with steps right to 1e-9.
    """
    rtol = 1e-6 if method != "tr-bdf2" else 1e-4  # of order 2: few steps
    whole, counts = {}, {}

    def rates(t, y):
        return -rate * (y - np.cos(t))

    ode.integrate(rates, [2.0], [0.0, 10.0], method, rtol=rtol, counts=whole)
    for number in (8, 400):
        t = np.linspace(0.0, 10.0, number)
        y = ode.integrate(rates, [2.0], t, method, rtol=rtol, counts=counts)[:, 0]
        assert np.abs(y - forced(rate, t)).max() <= 6 * rtol
        if method not in ("esdirk-5", "radau-iia-9"):  # their steps end at rows
            assert counts["steps"] == whole["steps"] and counts["rhs"] <= 7 * whole["rhs"]


@pytest.mark.parametrize("method", ["rodas-4", "rodas-5p", "radau-iia-5", "esdirk-4", "auto"])
def test_rows_of_a_stiff_circuit_have_the_accuracy_of_its_steps(method):
    """Rows of the voltage of a small capacitor behind a resistor: RC = 1 us under a source of 0.2 Hz.

    With rodas-4 they differed by 6.5e-3 for a tolerance of 1e-6.
    """
    source = {"mean": 0.0, "amplitude": 1.0, "period": 5.0}
    nodes = {"plus": {"type": "terminal"}, "c": {"type": "terminal"}, "earth": {"type": "ground"}}
    links = {
        "source": {"type": "voltage-source", "from": "earth", "to": "plus", "voltage": source},
        "r": {"type": "resistor", "from": "plus", "to": "c", "resistance": 1.0},
        "store": {
            "type": "capacitor",
            "from": "c",
            "to": "earth",
            "capacitance": 1e-6,
            "initial_voltage": 0.0,
        },
    }
    run = fvsolve.run(
        scene(nodes, links, 10.0, {"method": method, "rtol": 1e-6}, ["c.voltage"], every=0.013)
    )
    omega, t = 2 * np.pi / 5.0, run.seconds
    lag = omega * 1e-6  # of the slow solution; the transient has the size of the lag
    assert run.si("c.voltage") == pytest.approx(
        np.sin(omega * t) - lag * np.cos(omega * t), abs=6e-6
    )

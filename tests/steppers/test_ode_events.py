"""Events, critical times and limits of steps of `integrate`, against closed forms and SciPy."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fvsolve import integrate
from fvsolve.errors import FvsolveError

FEW = ["dormand-prince", "verner-7", "radau-iia-5", "esdirk-5", "rodas-4", "auto"]


def event(function, terminal=False, direction=0):
    function.terminal, function.direction = terminal, direction
    return function


def turn(t, y):
    return [y[1], -y[0]]


def peak(level):
    """(event function, times up to 20 s) of sin t above a level."""
    begin = np.arcsin(level)
    times = np.sort(
        np.concatenate([begin + 2 * np.pi * np.arange(4), np.pi - begin + 2 * np.pi * np.arange(4)])
    )
    return (lambda t, y: y[0] - level), times[times < 20.0]


@pytest.mark.parametrize("method", FEW)
@pytest.mark.parametrize("level", [0.0, 0.5, 0.999, 1.0 - 1e-6])
def test_events_of_a_circle_are_located_at_their_times(method, level):
    """No crossing is missed, also of peaks that rise above a level for 3 ms between steps of 0.1 to 1 s."""
    function, times = peak(level)
    times = times[times > 0.0]  # a zero at the start is not an event
    found = integrate(turn, [0.0, 1.0], [0.0, 20.0], method, rtol=1e-11, events=function)
    assert found.status == 0
    assert found.t_events[0] == pytest.approx(times, abs=1e-9 / np.sqrt(1 - level**2))
    assert found.y_events[0][:, 0] == pytest.approx(level, abs=1e-12)


@pytest.mark.parametrize("method", ["euler", "rk4", "gauss-4", "trapezoid"])
def test_events_of_given_steps_lie_on_the_rows(method):
    """The state at an event is the row that a call with this time gives."""
    found = integrate(
        turn, [0.0, 1.0], [0.0, 8.0], method, step=0.1, events=lambda t, y: y[1] + 0.3 * y[0]
    )
    again = integrate(turn, [0.0, 1.0], [0.0, *found.t_events[0], 8.0], method, step=0.1)[1:-1]
    assert len(again) in (2, 3)
    assert found.y_events[0] == pytest.approx(again, abs=1e-12)


def test_terminal_and_directed_events_are_those_of_scipy():
    """A ball with drag: apex counted, ground terminal, upward passage of 3 m; beside `solve_ivp`."""

    def ball(t, y):
        return [y[1], -9.81 - 0.05 * y[1] * abs(y[1])]

    events = [
        event(lambda t, y: y[1]),
        event(lambda t, y: y[0], True, -1),
        event(lambda t, y: y[0] - 3, False, 1),
    ]
    t = np.linspace(0.0, 10.0, 101)
    found = integrate(ball, [0.0, 20.0], t, rtol=1e-11, events=events)
    truth = solve_ivp(
        ball, (0.0, 10.0), [0.0, 20.0], "DOP853", t_eval=t, rtol=1e-12, atol=1e-12, events=events
    )
    assert found.status == truth.status == 1
    assert found.t == pytest.approx(truth.t) and found.y == pytest.approx(truth.y.T, abs=1e-8)
    for k in range(3):
        assert found.t_events[k] == pytest.approx(truth.t_events[k], abs=1e-8)
        assert found.y_events[k] == pytest.approx(truth.y_events[k], abs=1e-7)
    third = event(lambda t, y: y[0] - np.cos(t), 3)
    ended = integrate(turn, [0.0, 1.0], [0.0, 50.0], events=third)
    assert ended.status == 1 and ended.t_events[0] == pytest.approx(
        np.pi / 4 + np.pi * np.arange(3), abs=1e-5
    )
    assert ended.t.tolist() == [0.0]


@pytest.mark.parametrize("method", ["radau-iia-5", "rodas-4", "rodas-5p", "auto"])
def test_events_of_a_stiff_problem_lie_on_the_slow_solution(method):
    """Steps of more than 1 s are right at their ends only; the state at an event is right to the tolerance."""
    rate = 1e6
    found = integrate(
        lambda t, y: -rate * (y - np.cos(t)),
        [1.0],
        [0.0, 20.0],
        method,
        rtol=1e-6,
        events=lambda t, y: y[0] - 0.5,
    )
    times = np.sort(
        np.concatenate(
            [np.pi / 3 + 2 * np.pi * np.arange(4), -np.pi / 3 + 2 * np.pi * np.arange(1, 4)]
        )
    )
    assert found.t_events[0] == pytest.approx(times[times < 20], abs=1e-5)


def pulse(t, y):
    return [1.0 if 500.0 <= t < 510.0 else 0.0]


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5", "rodas-5p", "auto"])
def test_a_pulse_is_not_stepped_over(method):
    """A pulse of 10 s in 1000 s: with a limit of the step to the tolerance, with critical times to rounding."""
    limited = integrate(pulse, [0.0], [0.0, 1000.0], method, max_step=5.0)[-1, 0]
    assert limited == pytest.approx(10.0, rel=1e-3)
    counts = {}
    t = [0.0, 499.0, 500.0, 504.0, 510.0, 1000.0]
    y = integrate(pulse, [0.0], t, method, tcrit=[510.0, 500.0, 2000.0], counts=counts)[:, 0]
    assert y == pytest.approx([0.0, 0.0, 0.0, 4.0, 10.0, 10.0], abs=1e-9)
    assert counts["rejections"] < 5


@pytest.mark.parametrize("method", ["rk4", "dormand-prince", "implicit-midpoint"])
def test_given_steps_end_at_critical_times(method):
    """Steps of 7 s end at both sides of a pulse, also for f with the other value at the jump itself."""

    def other(t, y):
        return [1.0 if 500.0 < t <= 510.0 else 0.0]

    for f in (pulse, other):
        y = integrate(f, [0.0], [0.0, 505.0, 1000.0], method, step=7.0, tcrit=[500.0, 510.0])[:, 0]
        assert y == pytest.approx([0.0, 5.0, 10.0], abs=1e-9)


def test_the_first_step_is_the_given_step():
    """The rates are evaluated first within the given first step, and no step is longer than `max_step`."""
    seen = []

    def rates(t, y):
        seen.append(t)
        return [-y[0] + 0.0 * float(str(1))]

    integrate(rates, [1.0], [0.0, 10.0], first_step=1e-3, max_step=0.25)
    later = sorted(t for t in seen if t > 0.0)
    assert later[0] == pytest.approx(0.2e-3, rel=1e-9)  # the second stage of dormand-prince
    assert np.diff(later).max() <= 0.25


@pytest.mark.parametrize(
    "given, wanted",
    [
        ({"max_step": 0.0}, "max_step = 0.0 is not a positive number"),
        ({"max_step": float("nan")}, "max_step = nan is not a positive number"),
        ({"max_step": 1e-20}, "too small"),
        ({"first_step": 2.0}, "first_step = 2 is longer than the integration"),
        ({"max_step": 1.0, "step": 0.1}, "step and max_step both set the step"),
        ({"tcrit": [float("inf")]}, "expected finite times"),
        ({"tcrit": "soon"}, "tcrit = 'soon' is not valid"),
        ({"events": 3}, "events = 3 is not valid"),
        ({"events": [3]}, "expected a function g(t, y)"),
        ({"events": event(lambda t, y: y[0], "yes")}, "terminal = 'yes'"),
        ({"events": event(lambda t, y: y[0], True, "up")}, "direction = 'up'"),
        ({"events": lambda t, y: [1.0, 2.0]}, "returns 2 values"),
    ],
)
def test_invalid_settings_are_refused(given, wanted):
    with pytest.raises(FvsolveError) as caught:
        integrate(lambda t, y: -y, [1.0], [0.0, 1.0], **given)
    assert wanted in str(caught.value)


def test_the_order_of_events_and_an_empty_list_keep_their_form():
    nothing = integrate(lambda t, y: -y, [1.0], [0.0, 1.0], events=[])
    assert nothing.t_events == [] and nothing.y.shape == (2, 1)
    never = integrate(lambda t, y: -y, [1.0], [0.0, 1.0], events=lambda t, y: y[0] + 1.0)
    assert never.t_events[0].shape == (0,) and never.y_events[0].shape == (0, 1)

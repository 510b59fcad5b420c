"""Events of `integrate`: zeros of functions g(t, y) within accepted steps, with the names of SciPy's `solve_ivp`.

The signs of the functions are compared at several points of every step, on its dense output. Between two points of
equal sign, a parabola through the points next to them shows an extremum, which is then searched for a change of sign.
"""

from collections.abc import Callable, Sequence
from math import copysign
from numbers import Integral, Real
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar

from fvsolve.core.kernels.calls import compile_as
from fvsolve.core.steppers.integrator import Integrator
from fvsolve.core.steppers.output_rows import interpolate_row, needs_separate_step, separate_step
from fvsolve.core.steppers.row_substeps import needs_defect, substep_row
from fvsolve.core.steppers.run_handle import open_run
from fvsolve.core.steppers.step_operations import copy
from fvsolve.errors import FvsolveError
from fvsolve.jit import njit

POINTS = 9  # intervals of a step in which signs are compared; no divisor of common periods
# margin of an interval within which the vertex of a parabola shows an extremum, in intervals
AT_VERTEX = 0.1


class EventSolution(NamedTuple):
    """Result of `integrate` with events.

    t : float64[m]  requested times up to a terminal event; y : float64[m, n]  states at these times
    t_events, y_events : for each event function its times, float64[k], and the states there, float64[k, n]
    status : 1 if a terminal event has ended the integration, otherwise 0
    """

    t: np.ndarray
    y: np.ndarray
    t_events: list[np.ndarray]
    y_events: list[np.ndarray]
    status: int


class EventFunction(NamedTuple):
    """Event function g(t, y), the number of its zeros that ends the integration, and the direction of its zeros.

    terminal : 0 for an event that never ends it; direction : 0, or the sign of the slope of g at zeros that count
    """

    function: Callable[..., Any]
    terminal: int
    direction: float


def read_events(given: Any) -> list[EventFunction]:
    """Event functions with their attributes `terminal` and `direction`; raises FvsolveError for invalid ones."""
    functions = [given] if callable(given) else given
    if (
        not isinstance(functions, Sequence)
        or isinstance(functions, str)
        or not all(map(callable, functions))
    ):
        raise FvsolveError(
            f"events = {given!r} is not valid; expected a function g(t, y), or a list of such functions"
        )
    events = []
    for function in functions:
        terminal = getattr(function, "terminal", False)
        direction = getattr(function, "direction", 0.0)
        if not isinstance(terminal, (bool, np.bool_, Integral)) or terminal < 0:
            raise FvsolveError(
                f"terminal = {terminal!r} of an event is not valid; expected True, False, or a number"
            )
        if not isinstance(direction, Real) or direction != direction:
            raise FvsolveError(
                f"direction = {direction!r} of an event is not valid; expected a number: 1, 0 or -1"
            )
        events.append(EventFunction(function, int(terminal), float(direction)))
    return events


@njit
def state_within(handle, run, due):
    """Write the state at the time `due` within the last step to `y_out`."""
    r = open_run(run)
    t_old = r.progress[0]["t_old"]
    now = r.progress[0]["now"]
    old = r.progress[0]["old"]
    new, separate = 3 - now - old, r.control[0]["end_at_rows"] == 1 or needs_separate_step(r)
    if needs_defect(r) and substep_row(handle, r, t_old, due, now, old):
        return
    if separate and separate_step(handle, r, t_old, due - t_old, old, new):
        copy(r.y[new], r.y_out)
    else:
        interpolate_row(r, t_old, due, separate, now, old)


class EventSearch:
    """Search for the zeros of event functions in accepted steps.

    events : results of `read_events`; stepper : `Integrator` of the call; handle : argument of its functions
    """

    def __init__(
        self, events: list[EventFunction], stepper: Integrator, handle: np.ndarray
    ) -> None:
        self.events, self.stepper, self.handle = events, stepper, handle
        self.times: list[list[float]] = [[] for _ in events]
        self.states: list[list[np.ndarray]] = [[] for _ in events]
        self.end: float | None = None  # time of the terminal event
        if events:
            self.within = compile_as(state_within, "hht")
            stepper.set_control(dense_steps=1)

    def state(self, t: float) -> np.ndarray:
        """State at a time within the last step, or at one of its ends."""
        stepper, progress = self.stepper, self.stepper.progress[0]
        if t <= progress["t_old"]:
            return stepper.y[progress["old"]].copy()
        if t >= stepper.state[0]["t"]:
            return stepper.y[progress["now"]].copy()
        self.within(self.handle, stepper.handle(True), t)
        return stepper.y_out.copy()

    def value(self, event: EventFunction, t: float) -> float:
        """Value of an event function at a time within the last step."""
        value = np.asarray(event.function(t, self.state(t)), dtype=float)
        if value.size != 1:
            raise FvsolveError(
                f"an event function returns {value.size} values; expected a single number"
            )
        return float(value.reshape(()))

    def search_step(self) -> bool:
        """Find the zeros within the last step; True if a terminal event ends the integration there."""
        begin, end = float(self.stepper.progress[0]["t_old"]), float(self.stepper.state[0]["t"])
        times = np.linspace(begin, end, POINTS + 1)
        found = sorted(
            (t, number)
            for number, event in enumerate(self.events)
            for t in self.zeros(event, times.tolist(), [self.value(event, t) for t in times])
        )
        # In the order of time, because a terminal event makes all later ones void.
        for t, number in found:
            self.times[number].append(t)
            self.states[number].append(self.state(t))
            if len(self.times[number]) == self.events[number].terminal:
                self.end = t
                return True
        return False

    def zeros(self, event: EventFunction, times: list[float], g: list[float]) -> list[float]:
        """Times of the zeros of an event function between given times, where its values are g."""
        result = []
        for k in range(len(times) - 1):
            ends = [(times[k], g[k]), (times[k + 1], g[k + 1])]
            if g[k] * g[k + 1] > 0.0 and has_extremum(times, g, k):
                # Two zeros between points of equal sign lie on either side of the extremum.
                ends.insert(1, self.extremum(event, *ends))
            for (a, left), (b, right) in zip(ends, ends[1:], strict=False):
                if left == 0.0 or left * right > 0.0 or event.direction * left > 0.0:
                    # a zero at the start of an interval counts at the end of the interval before
                    continue
                result.append(b if right == 0.0 else self.zero(event, a, b))
        return result

    def extremum(self, event: EventFunction, first: tuple, last: tuple) -> tuple[float, float]:
        """(time, value) of the value nearest to zero, or beyond it, between two points of equal sign."""
        sign = copysign(1.0, first[1])
        least = minimize_scalar(
            lambda t: sign * self.value(event, t),
            bounds=(first[0], last[0]),
            method="bounded",
            options={"xatol": 1e-9 * (last[0] - first[0])},
        )
        return float(least.x), sign * float(least.fun)

    def zero(self, event: EventFunction, a: float, b: float) -> float:
        """Time of the zero of an event function that has opposite signs at times a and b."""
        small = 4.0 * np.finfo(float).eps
        return float(
            brentq(
                lambda t: self.value(event, t),
                a,
                b,
                xtol=small * max(abs(a), abs(b), 1e-300),
                rtol=small,
            )
        )

    def solution(self, t: np.ndarray, states: np.ndarray) -> EventSolution:
        """Result of `integrate` from the states at all times t that the steps reached."""
        count = t.size if self.end is None else int(np.searchsorted(t, self.end, side="right"))
        n = states.shape[1]
        events = (
            [np.array(times) for times in self.times],
            [np.array(s).reshape(-1, n) for s in self.states],
        )
        return EventSolution(t[:count], states[:count], *events, int(self.end is not None))


def has_extremum(times: list[float], g: list[float], k: int) -> bool:
    """True if a parabola through three values shows an extremum towards zero between times k and k + 1.

    times : equal distances; g : values there; the third value is that before or after the two
    """
    for i in (k - 1, k):
        if not 0 <= i <= len(g) - 3:
            continue
        # Second and first difference at point i + 1; the vertex is there minus slope / bend.
        bend, slope = g[i] - 2.0 * g[i + 1] + g[i + 2], 0.5 * (g[i + 2] - g[i])
        if bend * g[k] > 0.0 and -AT_VERTEX <= i + 1 - slope / bend - k <= 1.0 + AT_VERTEX:
            return True
    return False

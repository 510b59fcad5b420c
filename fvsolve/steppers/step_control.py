"""Step size control: the length of the next step from errors, rates and due times."""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.steppers.loop_indices import (
    CONTROL,
    COURANT,
    END,
    END_AT_ROWS,
    ERROR_OLD,
    EXPLICIT,
    KIND,
    LAST,
    N_MARK,
    NEWTON_SOLVED,
    ORDER,
    PRICE,
    RADIUS,
    SIZE,
    SPLIT_REMAINDER,
    SPLIT_STEPS,
    STEP,
    STEP_MAX,
    STEPS,
    SWITCH_COUNT,
    SWITCHES,
    T_MARK,
    TOLERANCE,
    T,
)
from fvsolve.steppers.tolerances import LEAST_STEP

STEPS_TO_SWITCH = (
    15  # net count of steps in favour of the other kind of method before a switch; doubled by every switch
)
BOUNDARY = 3.0  # h times spectral radius at the stability boundary: `dormand-prince` reaches 3.3 on the real axis
# h times spectral radius above which stability limits the step: then it varies from 1 to 3.5; limited by accuracy it
# hardly varies.
LIMITED_BY_STABILITY = 2.5
COUNT_DECREASE = 0.4  # decrease of the count by a step that stability does not limit
# Fraction of an opening that may close in one given step; for x ~ (time left)^(1/3) this is half of the time left.
CLOSING_FRACTION = 0.15
APPROACH = 0.95  # fraction of the rest of a segment that the second-last step takes
HUGE = 1e308  # a time that is never reached [s]
DEAD_BAND = 1.2  # a step solved by Newton that may grow by a smaller factor keeps its length, and so its factorisation


@njit(forceinline=True)
def shortest(controls, loop_state):
    """Least step [s] to which stability may reduce a step: the rate of a column at a closing valve is unbounded."""
    return 1e-13 * max(abs(loop_state[T]), abs(controls[END]))


@njit(forceinline=True)
def too_short(controls, loop_state, h):
    """True if a step of length h [s] is too short to change the time in floating point."""
    return not h > LEAST_STEP * max(abs(loop_state[T]), abs(controls[END]))


@njit(forceinline=True)
def first_step(k, scale, controls, loop_state):
    """Cautious first step [s], from the size of the rates k[0] relative to the scale of the states.

    controls, loop_state : arrays of the time loop, see `loop_indices`
    """
    total, tolerance, span = 0.0, controls[SIZE], controls[END] - loop_state[T]
    limit = min(span, max(1e-3 * span, shortest(controls, loop_state)))
    for i in range(scale.size):
        total += (k[0, i] / scale[i]) ** 2
    d = sqrt(total / max(scale.size, 1))
    return min(limit, 0.05 * tolerance ** (1.0 / (controls[ORDER] + 1.0)) / d) if d > 0.0 else limit


@njit(forceinline=True)
def next_step(controls, loop_state, out_rate, k, scale):
    """Length of the step to try [s], without regard to the end of the segment; out_rate : greatest wave rate [1/s].

    k, scale : rates and sizes of the states, for `first_step`
    controls, loop_state : see `loop_indices`; a first step, and a new given step with its start, are stored there
    """
    if controls[CONTROL] == TOLERANCE:
        if too_short(controls, loop_state, loop_state[STEP]):  # no step is stored, or it does not change the time
            loop_state[STEP] = first_step(k, scale, controls, loop_state)
        stable = controls[STEP_MAX]  # error control alone oscillates at the stability limit
        if out_rate > 0.0 and controls[KIND] == EXPLICIT:
            stable = 2.0 / out_rate
        return min(loop_state[STEP], controls[STEP_MAX], max(stable, shortest(controls, loop_state)))
    h = controls[SIZE]
    if controls[CONTROL] == COURANT:
        h = min(controls[SIZE] / out_rate, controls[STEP_MAX]) if out_rate > 0.0 else controls[STEP_MAX]
        h = max(h, shortest(controls, loop_state))
    if h != loop_state[STEP]:
        loop_state[STEP], loop_state[T_MARK], loop_state[N_MARK] = h, loop_state[T], 0.0
    return h


@njit(forceinline=True)
def approaches(controls, loop_state, rest):
    """True if a step under error control should end after 95 % of the rest of its segment, followed by a short step.

    A valve that closes at the end of the segment has laminar flow just before, where the equations of the stages of a
    long step have no solution.
    rest : remaining time of the segment [s]
    """
    if controls[CONTROL] != TOLERANCE or rest <= 2.0 * (1.0 - APPROACH) * loop_state[STEP]:
        return False
    return not too_short(controls, loop_state, (1.0 - APPROACH) * rest)


@njit(forceinline=True)
def row_step_end(controls, loop_state, due, h):
    """Time [s] of an output row at which a step of length h under error control has to end; 1e308 without such a row.

    due : time of the next row [s]; controls, loop_state : arrays of the time loop, see `loop_indices`
    """
    if controls[END_AT_ROWS] == 0.0 or controls[CONTROL] != TOLERANCE:  # given steps do not depend on output rows
        return HUGE
    if due >= loop_state[T] + h * (1.0 - 1e-9) or too_short(controls, loop_state, due - loop_state[T]):
        return HUGE
    return due


@njit(forceinline=True)
def end_of(controls, loop_state, h, last, due):
    """End time [s] of a step of length h.

    last : True for the last step of a segment; due : time from `row_step_end`. Full steps of given length end at a
    multiple of the step, so that rounding does not accumulate.
    controls, loop_state : arrays of the time loop, see `loop_indices`
    """
    if last:
        return controls[END]
    if h == due - loop_state[T]:
        return due
    if controls[CONTROL] != TOLERANCE and (h == loop_state[STEP] or h == loop_state[SPLIT_REMAINDER]):
        return (
            loop_state[T_MARK]
            + (loop_state[N_MARK] + (0.0 if loop_state[SPLIT_REMAINDER] > h else 1.0)) * loop_state[STEP]
        )
    return loop_state[T] + h


@njit(forceinline=True)
def closing_step(loop_state, closing, h, least):
    """Length of the next step [s]: the given step h, or a part of it if an opening closes fast within it.

    A step that is divided is stored as SPLIT_REMAINDER in `loop_state`, and counted.
    closing : relative rate -x'/x of the closing opening x [1/s]; least : least length of a part [s]
    """
    if h * closing <= CLOSING_FRACTION or h <= 2.0 * least:
        return h
    if loop_state[SPLIT_REMAINDER] == 0.0:  # the parts end together where the given step would have ended
        loop_state[SPLIT_REMAINDER] = h
        loop_state[SPLIT_STEPS] += 1.0
    return max(least, min(0.5 * h, CLOSING_FRACTION / closing))


@njit(forceinline=True)
def arriving_step(controls, loop_state, arrives, h):
    """Length of the next step [s]: h, or its part up to the time `arrives` [s] at which a jump of a wave arrives.

    A given step that is divided is stored as SPLIT_REMAINDER in `loop_state`.
    """
    rest = arrives - loop_state[T]
    if not 0.0 < rest < h * (1.0 - 1e-9):
        return h
    if controls[CONTROL] != TOLERANCE and loop_state[SPLIT_REMAINDER] == 0.0:
        loop_state[SPLIT_REMAINDER] = h
    return rest


@njit(forceinline=True)
def reduced(controls, e):
    """Factor on the length of a step whose error e, in units of the tolerance, was too large."""
    return max(0.1, 0.9 * e ** (-1.0 / controls[ORDER])) if e == e else 0.1


@njit(forceinline=True)
def grown(controls, loop_state, h, e):
    """Factor on the step length h after an accepted step with the error e, in units of the tolerance.

    Explicit methods use PI control (Gustafsson 1991), implicit methods predictive control (Gustafsson 1994).
    controls, loop_state : arrays of the time loop, see `loop_indices`
    """
    e, old, order = max(e, 1e-10), max(loop_state[ERROR_OLD], 1e-4), controls[ORDER]
    if controls[KIND] == EXPLICIT:
        return min(5.0, max(0.2, 0.9 * e ** (-0.7 / order) * old ** (0.4 / order)))
    grow = 0.9 * e ** (-1.0 / order)
    if loop_state[ERROR_OLD] > 0.0 and loop_state[STEPS] > 0.0:
        grow = min(grow, 0.9 * (h / loop_state[LAST]) * (old / (e * e)) ** (1.0 / order))
    return min(8.0, max(0.2, grow))


@njit(forceinline=True)
def watch(controls, loop_state, h, e, out_rate):
    """Count the steps for which the other kind of method (explicit or implicit) would have been cheaper.

    Returns True if there are enough such steps to change the method. An implicit method would be cheaper if stability
    limits the explicit step (Hairer and Wanner 1996, IV.2). Where the greatest wave rate is known, the error must also
    allow a step longer by more than the cost ratio of an implicit step. An explicit method would be cheaper if its
    steps within the stability boundary cost less than half. Writes SWITCH_COUNT and RADIUS in `loop_state`.
    h, e : length and error of the step; out_rate : greatest wave rate [1/s], 0 if not known
    """
    if controls[KIND] == EXPLICIT:
        growth = 0.9 * max(e, 1e-30) ** (-1.0 / controls[ORDER])
        cheaper = h * loop_state[RADIUS] > LIMITED_BY_STABILITY
        if out_rate > 0.0:  # `next_step` keeps h within stability; the error gives the possible increase
            cheaper = h * out_rate > 1.98 and growth > controls[PRICE]
            loop_state[RADIUS] = max(loop_state[RADIUS], out_rate)
    else:
        cheaper = 2.0 * max(1.0, h * loop_state[RADIUS] / BOUNDARY) < controls[PRICE]
    loop_state[SWITCH_COUNT] = (
        loop_state[SWITCH_COUNT] + 1.0 if cheaper else max(0.0, loop_state[SWITCH_COUNT] - COUNT_DECREASE)
    )
    return loop_state[SWITCH_COUNT] >= STEPS_TO_SWITCH * 2.0 ** min(loop_state[SWITCHES], 6.0)


@njit(forceinline=True)
def retains_length(controls, grow):
    """True if a step solved by Newton keeps its length, and so its factorisation: it may grow by a factor of 1 to 1.2.

    grow : factor by which the error would allow the step to grow
    """
    return controls[KIND] == NEWTON_SOLVED and 1.0 <= grow <= DEAD_BAND

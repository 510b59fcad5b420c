"""How long the next step is. Knows errors and rates; takes no step."""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.steppers.slots import (
    CASES,
    CONTROL,
    COURANT,
    END,
    ERROR_OLD,
    EXPLICIT,
    KIND,
    LANDS,
    LAST,
    LEFT,
    N_MARK,
    NEWTON_SOLVED,
    ORDER,
    PARTED,
    PRICE,
    RADIUS,
    SIZE,
    STEP,
    STEP_MAX,
    STEPS,
    SWITCHES,
    T_MARK,
    TOLERANCE,
    T,
)
from fvsolve.steppers.tolerances import LEAST_STEP

PATIENCE = 15  # steps that must agree before another kind of step is tried; doubled by every change
BOUNDARY = 3.0  # of h times the spectral radius: `dormand-prince` bears 3.3 on the real axis
HELD = 2.5  # held by stability it swings from 1 to 3.5, held by accuracy it hardly moves
CALM = 0.4  # what a step that is not held takes off the count
CLOSED = 0.15  # share of an opening that may shut in a given step; of x ~ (time left)^(1/3) that is half the time left
APPROACH = 0.95  # of the rest of a segment that the step before the last one takes
HUGE = 1e308  # for a time that never comes [s]
DEAD_BAND = 1.2  # an implicit step that may grow by less keeps its length, and with it its factors


@njit(forceinline=True)
def shortest(orders, memory):
    """A step that no rate shortens further: a column behind a valve that shuts gets infinitely quick [s]."""
    return 1e-13 * max(abs(memory[T]), abs(orders[END]))


@njit(forceinline=True)
def too_short(orders, memory, h):
    """Whether a step would not move the time."""
    return not h > LEAST_STEP * max(abs(memory[T]), abs(orders[END]))


@njit(forceinline=True)
def first_step(k, scale, orders, memory):
    """A cautious first step from the size of the rates, which may be about to start [s]."""
    total, tolerance, span = 0.0, orders[SIZE], orders[END] - memory[T]
    most = min(span, max(1e-3 * span, shortest(orders, memory)))
    for i in range(scale.size):
        total += (k[0, i] / scale[i]) ** 2
    d = sqrt(total / max(scale.size, 1))
    return min(most, 0.05 * tolerance ** (1.0 / (orders[ORDER] + 1.0)) / d) if d > 0.0 else most


@njit(forceinline=True)
def next_step(orders, memory, out_rate, k, scale):
    """Length of the step to try, before the end of the segment is looked at [s]."""
    if orders[CONTROL] == TOLERANCE:
        if too_short(orders, memory, memory[STEP]):  # none is remembered, or one that would not move the time
            memory[STEP] = first_step(k, scale, orders, memory)
        stable = orders[STEP_MAX]  # error control alone would chatter at the limit of an explicit method
        if out_rate > 0.0 and orders[KIND] == EXPLICIT:
            stable = 2.0 / out_rate
        return min(memory[STEP], orders[STEP_MAX], max(stable, shortest(orders, memory)))
    h = orders[SIZE]
    if orders[CONTROL] == COURANT:
        h = min(orders[SIZE] / out_rate, orders[STEP_MAX]) if out_rate > 0.0 else orders[STEP_MAX]
        h = max(h, shortest(orders, memory))
    if h != memory[STEP]:
        memory[STEP], memory[T_MARK], memory[N_MARK] = h, memory[T], 0.0
    return h


@njit(forceinline=True)
def approaches(orders, memory, rest):
    """True where a step by error control ends at APPROACH of the rest of its segment, and a short one follows.

    Where a valve shuts at a break, its flow is laminar for a moment before. All stages of a long step lie before that.
    rest : time that is left of the segment [s]
    """
    if orders[CONTROL] != TOLERANCE or rest <= 2.0 * (1.0 - APPROACH) * memory[STEP]:
        return False
    return not too_short(orders, memory, (1.0 - APPROACH) * rest)


@njit(forceinline=True)
def landing(orders, memory, due, h):
    """Time at which a step by error control is to end early, for a row due within it; infinity for none [s]."""
    if orders[LANDS] == 0.0 or orders[CONTROL] != TOLERANCE:  # given steps do not depend on rows
        return HUGE
    if due >= memory[T] + h * (1.0 - 1e-9) or too_short(orders, memory, due - memory[T]):
        return HUGE
    return due


@njit(forceinline=True)
def end_of(orders, memory, h, last, due):
    """Time at which a step of h ends [s]: of whole given steps a multiple, so that no rounding adds up."""
    if last:
        return orders[END]
    if h == due - memory[T]:
        return due
    if orders[CONTROL] != TOLERANCE and (h == memory[STEP] or h == memory[LEFT]):
        return memory[T_MARK] + (memory[N_MARK] + (0.0 if memory[LEFT] > h else 1.0)) * memory[STEP]
    return memory[T] + h


@njit(forceinline=True)
def closing_step(memory, closing, h, least):
    """A given step h, or a part of it where something shuts at a rate that has no bound, -x'/x = closing [1/s]."""
    if h * closing <= CLOSED or h <= 2.0 * least:
        return h
    if memory[LEFT] == 0.0:  # in parts that end where it would have
        memory[LEFT] = h
        memory[PARTED] += 1.0
    return max(least, min(0.5 * h, CLOSED / closing))


@njit(forceinline=True)
def arriving_step(orders, memory, arrives, h):
    """A step h, or the part of it up to the time [s] at which a jump arrives where something acts at once."""
    rest = arrives - memory[T]
    if not 0.0 < rest < h * (1.0 - 1e-9):
        return h
    if orders[CONTROL] != TOLERANCE and memory[LEFT] == 0.0:
        memory[LEFT] = h
    return rest


@njit(forceinline=True)
def reduced(orders, e):
    """Factor on a step whose error e was too great."""
    return max(0.1, 0.9 * e ** (-1.0 / orders[ORDER])) if e == e else 0.1


@njit(forceinline=True)
def grown(orders, memory, h, e):
    """Factor on an accepted step of error e: PI control (Gustafsson 1991); predictive for implicit methods (1994)."""
    e, old, order = max(e, 1e-10), max(memory[ERROR_OLD], 1e-4), orders[ORDER]
    if orders[KIND] == EXPLICIT:
        return min(5.0, max(0.2, 0.9 * e ** (-0.7 / order) * old ** (0.4 / order)))
    grow = 0.9 * e ** (-1.0 / order)
    if memory[ERROR_OLD] > 0.0 and memory[STEPS] > 0.0:
        grow = min(grow, 0.9 * (h / memory[LAST]) * (old / (e * e)) ** (1.0 / order))
    return min(8.0, max(0.2, grow))


@njit(forceinline=True)
def watch(orders, memory, h, e, out_rate):
    """Count the steps for which another kind of step would have been cheaper; whether they are enough to change.

    Explicit steps: held back by stability (Hairer and Wanner 1996, IV.2), by more than an implicit step costs.
    Implicit steps: explicit ones within their stability boundary would have cost less than half.
    """
    if orders[KIND] == EXPLICIT:
        could = 0.9 * max(e, 1e-30) ** (-1.0 / orders[ORDER])
        other = h * memory[RADIUS] > HELD
        if out_rate > 0.0:  # then `next_step` keeps within stability, and the error says how much longer it could be
            other = h * out_rate > 1.98 and could > orders[PRICE]
            memory[RADIUS] = max(memory[RADIUS], out_rate)
    else:
        other = 2.0 * max(1.0, h * memory[RADIUS] / BOUNDARY) < orders[PRICE]
    memory[CASES] = memory[CASES] + 1.0 if other else max(0.0, memory[CASES] - CALM)
    return memory[CASES] >= PATIENCE * 2.0 ** min(memory[SWITCHES], 6.0)


@njit(forceinline=True)
def kept(orders, grow):
    """Whether an implicit step that may grow so little keeps its length."""
    return orders[KIND] == NEWTON_SOLVED and 1.0 <= grow <= DEAD_BAND

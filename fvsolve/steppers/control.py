"""Step size control: the length of the next step from errors, rates and due times."""

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

PATIENCE = 15  # net count of steps in favour of the other kind of method before a switch; doubled by every switch
BOUNDARY = 3.0  # h times spectral radius at the stability boundary: `dormand-prince` reaches 3.3 on the real axis
# h times spectral radius above which stability limits the step: then it varies from 1 to 3.5; limited by accuracy it
# hardly varies.
HELD = 2.5
CALM = 0.4  # decrease of the count by a step that stability does not limit
# Fraction of an opening that may close in one given step; for x ~ (time left)^(1/3) this is half of the time left.
CLOSED = 0.15
APPROACH = 0.95  # fraction of the rest of a segment that the second-last step takes
HUGE = 1e308  # a time that is never reached [s]
DEAD_BAND = 1.2  # an implicit step that may grow by a smaller factor keeps its length, and so its factorisation


@njit(forceinline=True)
def shortest(orders, memory):
    """Least step that rates may demand [s]: a column behind a closing valve has an unbounded rate."""
    return 1e-13 * max(abs(memory[T]), abs(orders[END]))


@njit(forceinline=True)
def too_short(orders, memory, h):
    """True if a step of h does not change the time in floating point."""
    return not h > LEAST_STEP * max(abs(memory[T]), abs(orders[END]))


@njit(forceinline=True)
def first_step(k, scale, orders, memory):
    """Cautious first step from the size of the rates, which may be about to change [s]."""
    total, tolerance, span = 0.0, orders[SIZE], orders[END] - memory[T]
    limit = min(span, max(1e-3 * span, shortest(orders, memory)))
    for i in range(scale.size):
        total += (k[0, i] / scale[i]) ** 2
    d = sqrt(total / max(scale.size, 1))
    return min(limit, 0.05 * tolerance ** (1.0 / (orders[ORDER] + 1.0)) / d) if d > 0.0 else limit


@njit(forceinline=True)
def next_step(orders, memory, out_rate, k, scale):
    """Length of the step to try, before the end of the segment is considered [s]."""
    if orders[CONTROL] == TOLERANCE:
        if too_short(orders, memory, memory[STEP]):  # no step is stored, or it does not change the time
            memory[STEP] = first_step(k, scale, orders, memory)
        stable = orders[STEP_MAX]  # error control alone oscillates at the stability limit
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
    """True if a step by error control should end at APPROACH of the rest of its segment; a short step follows.

    Where a valve closes at a break, its flow is laminar just before. All stages of a long step lie before that moment.
    rest : remaining time of the segment [s]
    """
    if orders[CONTROL] != TOLERANCE or rest <= 2.0 * (1.0 - APPROACH) * memory[STEP]:
        return False
    return not too_short(orders, memory, (1.0 - APPROACH) * rest)


@njit(forceinline=True)
def landing(orders, memory, due, h):
    """End time of a step by error control that is shortened to end at a due row; infinity if none is due [s]."""
    if orders[LANDS] == 0.0 or orders[CONTROL] != TOLERANCE:  # given steps do not depend on output rows
        return HUGE
    if due >= memory[T] + h * (1.0 - 1e-9) or too_short(orders, memory, due - memory[T]):
        return HUGE
    return due


@njit(forceinline=True)
def end_of(orders, memory, h, last, due):
    """End time of a step of h [s].

    Full given steps end at a multiple of the step, so that rounding does not accumulate.
    """
    if last:
        return orders[END]
    if h == due - memory[T]:
        return due
    if orders[CONTROL] != TOLERANCE and (h == memory[STEP] or h == memory[LEFT]):
        return memory[T_MARK] + (memory[N_MARK] + (0.0 if memory[LEFT] > h else 1.0)) * memory[STEP]
    return memory[T] + h


@njit(forceinline=True)
def closing_step(memory, closing, h, least):
    """A given step h, or a part of it while an opening x closes at an unbounded rate, -x'/x = closing [1/s]."""
    if h * closing <= CLOSED or h <= 2.0 * least:
        return h
    if memory[LEFT] == 0.0:  # the parts end together where the given step would have ended
        memory[LEFT] = h
        memory[PARTED] += 1.0
    return max(least, min(0.5 * h, CLOSED / closing))


@njit(forceinline=True)
def arriving_step(orders, memory, arrives, h):
    """A step h, or its part up to the time `arrives` [s] at which a jump reaches a part that responds at once."""
    rest = arrives - memory[T]
    if not 0.0 < rest < h * (1.0 - 1e-9):
        return h
    if orders[CONTROL] != TOLERANCE and memory[LEFT] == 0.0:
        memory[LEFT] = h
    return rest


@njit(forceinline=True)
def reduced(orders, e):
    """Factor on the length of a step whose error e was too large."""
    return max(0.1, 0.9 * e ** (-1.0 / orders[ORDER])) if e == e else 0.1


@njit(forceinline=True)
def grown(orders, memory, h, e):
    """Factor on the length after an accepted step of error e: PI control (Gustafsson 1991).

    Implicit methods use predictive control (Gustafsson 1994).
    """
    e, old, order = max(e, 1e-10), max(memory[ERROR_OLD], 1e-4), orders[ORDER]
    if orders[KIND] == EXPLICIT:
        return min(5.0, max(0.2, 0.9 * e ** (-0.7 / order) * old ** (0.4 / order)))
    grow = 0.9 * e ** (-1.0 / order)
    if memory[ERROR_OLD] > 0.0 and memory[STEPS] > 0.0:
        grow = min(grow, 0.9 * (h / memory[LAST]) * (old / (e * e)) ** (1.0 / order))
    return min(8.0, max(0.2, grow))


@njit(forceinline=True)
def watch(orders, memory, h, e, out_rate):
    """Count the steps for which the other kind of method would have been cheaper; True if there are enough to switch.

    Explicit steps: limited by stability (Hairer and Wanner 1996, IV.2) by more than the cost ratio of an implicit step.
    Implicit steps: explicit steps within their stability boundary would have cost less than half.
    """
    if orders[KIND] == EXPLICIT:
        growth = 0.9 * max(e, 1e-30) ** (-1.0 / orders[ORDER])
        cheaper = h * memory[RADIUS] > HELD
        if out_rate > 0.0:  # `next_step` keeps h within stability; the error gives the possible increase
            cheaper = h * out_rate > 1.98 and growth > orders[PRICE]
            memory[RADIUS] = max(memory[RADIUS], out_rate)
    else:
        cheaper = 2.0 * max(1.0, h * memory[RADIUS] / BOUNDARY) < orders[PRICE]
    memory[CASES] = memory[CASES] + 1.0 if cheaper else max(0.0, memory[CASES] - CALM)
    return memory[CASES] >= PATIENCE * 2.0 ** min(memory[SWITCHES], 6.0)


@njit(forceinline=True)
def kept(orders, grow):
    """True if an implicit step keeps its length because it may only grow by a small factor."""
    return orders[KIND] == NEWTON_SOLVED and 1.0 <= grow <= DEAD_BAND

"""Step size control: the length of the next step from errors, rates and due times."""

from math import sqrt

from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers.loop_records import LEAST_STEP
from fvsolve.jit import njit

STEPS_TO_SWITCH = (
    # net count of steps in favour of the other kind of method before a switch; doubled by every switch
    15
)
# h times spectral radius at the stability boundary: `dormand-prince` reaches 3.3 on the real axis
BOUNDARY = 3.0
# h times spectral radius above which stability limits the step: then it varies from 1 to 3.5; limited by accuracy it
# hardly varies.
LIMITED_BY_STABILITY = 2.5
# h times the greatest known rate below which only other parts, such as valves, can limit the step
WAVES = 1.0
COUNT_DECREASE = 0.4  # decrease of the count by a step that stability does not limit
# Fraction of an opening that may close in one given step; for x ~ (time left)^(1/3) this is half of the time left.
CLOSING_FRACTION = 0.15
# longest part of a divided step, as fraction of the time constant of the fastest mode
DIVIDED_FRACTION = 0.5
LIMITED = 0.8  # fraction of a limit of the step, so that the limit does not act at every step
APPROACH = 0.95  # fraction of the rest of a segment that the second-last step takes
EARLY = 1e-12  # least time relative to the end, to which the least step is relative
NEVER = 1e308  # a time that is never reached [s]
# a step solved by Newton that may grow by a smaller factor keeps its length, and so its factorisation
DEAD_BAND = 1.2


@njit(forceinline=True)
def shortest(control, state):
    """Least step [s] to which stability may reduce a step: the rate of a column at a closing valve is unbounded."""
    return 1e-13 * max(abs(state["t"]), abs(control["end"]))


@njit(forceinline=True)
def too_short(control, state, h):
    """True if a step of length h [s] is too short to change the time in floating point.

    Near t = 0 steps may be much shorter than near the end: a run of 1e11 s may begin with a layer of 1e-5 s.
    """
    return not h > LEAST_STEP * max(abs(state["t"]), EARLY * abs(control["end"]))


@njit(forceinline=True)
def first_step(k, scale, control, state):
    """Cautious first step [s], from the size of the rates k[0] relative to the scale of the states.

    control, state : records of the time loop, see `loop_records`
    """
    total = 0.0
    tolerance = control["size"]
    span = control["end"] - state["t"]
    limit = min(span, max(1e-3 * span, shortest(control, state)))
    for i in range(scale.size):
        total += (k[0, i] / scale[i]) ** 2
    d = sqrt(total / max(scale.size, 1))
    # At rates of zero nothing limits the step but the span.
    return (
        min(limit, 0.05 * tolerance ** (1.0 / (control["order"] + 1.0)) / d) if d > 0.0 else limit
    )


@njit(forceinline=True)
def next_step(control, state, out_rate, longest, k, scale):
    """Length of the step to try [s], without regard to the end of the segment.

    out_rate : greatest wave rate [1/s]; longest : limit of the step under error control [s], 0 for none
    k, scale : rates and sizes of the states, for `first_step`
    control, state : see `loop_records`; a first step, and a new given step with its start, are stored there
    """
    if control["mode"] == rec.TOLERANCE:
        # no step is stored, or it does not change the time
        if too_short(control, state, state["step"]):
            state["step"] = first_step(k, scale, control, state)
        if 0.0 < longest < state["step"]:
            state["step"] = LIMITED * longest
        stable = control["step_max"]  # error control alone oscillates at the stability limit
        if out_rate > 0.0 and control["kind"] == rec.EXPLICIT:
            stable = 2.0 / out_rate
        return min(state["step"], control["step_max"], max(stable, shortest(control, state)))
    h = control["size"]
    if control["mode"] == rec.COURANT:
        h = (
            min(control["size"] / out_rate, control["step_max"])
            if out_rate > 0.0
            else control["step_max"]
        )
        # A rate without bound, as at a closing valve, must not stop the run.
        h = max(h, shortest(control, state))
    # Ends of given steps are multiples of the step, counted from this mark.
    if h != state["step"]:
        state["step"], state["t_mark"], state["n_mark"] = h, state["t"], 0.0
    return h


@njit(forceinline=True)
def approaches(control, state, rest):
    """True if a step under error control should end after 95 % of the rest of its segment, followed by a short step.

    A valve that closes at the end of the segment has laminar flow just before, where the equations of the stages of a
    long step have no solution.
    rest : remaining time of the segment [s]
    """
    if control["mode"] != rec.TOLERANCE or rest <= 2.0 * (1.0 - APPROACH) * state["step"]:
        return False
    return not too_short(control, state, (1.0 - APPROACH) * rest)


@njit(forceinline=True)
def row_step_end(control, state, due, h):
    """Time [s] of an output row at which a step of length h under error control has to end; 1e308 without such a row.

    due : time of the next row [s]; control, state : records of the time loop, see `loop_records`
    """
    # given steps do not depend on output rows
    if control["end_at_rows"] == 0.0 or control["mode"] != rec.TOLERANCE:
        return NEVER
    if due >= state["t"] + h * (1.0 - 1e-9) or too_short(control, state, due - state["t"]):
        return NEVER
    return due


@njit(forceinline=True)
def end_of(control, state, h, last, due):
    """End time [s] of a step of length h.

    last : True for the last step of a segment; due : time from `row_step_end`. Full steps of given length end at a
    multiple of the step, so that rounding does not accumulate.
    control, state : records of the time loop, see `loop_records`
    """
    if last:
        return control["end"]
    # Not t + h: the sum may miss the time of the row by rounding.
    if h == due - state["t"]:
        return due
    if control["mode"] != rec.TOLERANCE and (h == state["step"] or h == state["split_remainder"]):
        return (
            state["t_mark"]
            + (state["n_mark"] + (0.0 if state["split_remainder"] > h else 1.0)) * state["step"]
        )
    return state["t"] + h


@njit(forceinline=True)
def closing_step(state, closing, h, least):
    """Length of the next step [s]: the given step h, or a part of it if an opening closes fast within it.

    A step that is divided is stored as `split_remainder` in `state`, and counted.
    closing : relative rate -x'/x of the closing opening x [1/s]; least : least length of a part [s]
    """
    # A step of twice the least length cannot be divided.
    if h * closing <= CLOSING_FRACTION or h <= 2.0 * least:
        return h
    # the parts end together where the given step would have ended
    if state["split_remainder"] == 0.0:
        state["split_remainder"] = h
        state["split_steps"] += 1.0
    return max(least, min(0.5 * h, CLOSING_FRACTION / closing))


@njit(forceinline=True)
def divided_step(control, state, rate, h, least):
    """Length of the next step [s]: the given step h, or a part of it where an explicit method would amplify a mode.

    A step longer than the time constant of the fastest mode is divided into parts of at most half of it, so no explicit
    method amplifies the mode. The parts end together where the given step would have ended, see `closing_step`.
    rate : greatest rate at the start of the step [1/s]; least : least length of a part [s]
    """
    if not 0.0 < control["dividing_rate"] < rate or h * rate <= 1.0 or h <= 2.0 * least:
        return h
    if state["split_remainder"] == 0.0:
        state["split_remainder"] = h
        state["split_steps"] += 1.0
    return max(least, min(0.5 * h, DIVIDED_FRACTION / rate))


@njit(forceinline=True)
def arriving_step(control, state, arrives, h):
    """Length of the next step [s]: h, or its part up to the time `arrives` [s] at which a jump of a wave arrives.

    A given step that is divided is stored as `split_remainder` in `state`.
    """
    rest = arrives - state["t"]
    if not 0.0 < rest < h * (1.0 - 1e-9):
        return h
    # Given steps end where they would have ended without the jump.
    if control["mode"] != rec.TOLERANCE and state["split_remainder"] == 0.0:
        state["split_remainder"] = h
    return rest


@njit(forceinline=True)
def reduced(control, e):
    """Factor on the length of a step whose error e, in units of the tolerance, was too large."""
    # The error goes with h^order; 0.9 makes a second rejection unlikely.
    return max(0.1, 0.9 * e ** (-1.0 / control["order"])) if e == e else 0.1


@njit(forceinline=True)
def grown(control, state, h, e, shortened):
    """Factor on the step length h after an accepted step with the error e, in units of the tolerance.

    Explicit methods use PI control (Gustafsson 1991), implicit methods predictive control (Gustafsson 1994). A step
    shortened by an event or a due time may be shorter by orders of magnitude, so it shows no trend of the error.
    control, state : records of the time loop, see `loop_records`
    """
    # Errors of zero would give infinite factors.
    e = max(e, 1e-10)
    old = max(state["error_old"], 1e-4)
    order = control["order"]
    if control["kind"] == rec.EXPLICIT:
        return min(5.0, max(0.2, 0.9 * e ** (-0.7 / order) * old ** (0.4 / order)))
    grow = 0.9 * e ** (-1.0 / order)
    if state["error_old"] > 0.0 and state["steps"] > 0.0 and not shortened:
        grow = min(grow, 0.9 * (h / state["last"]) * (old / (e * e)) ** (1.0 / order))
    return min(8.0, max(0.2, grow))


@njit(forceinline=True)
def after_failure(control, state, h):
    """Length of the next attempt [s] after a step of length h whose stages could not be solved.

    A given step is taken in parts that end together where it would have ended.
    """
    state["newton_failures"] += 1.0
    # No error is known, so a fixed factor is used.
    if control["mode"] == rec.TOLERANCE:
        state["step"] = 0.25 * h
    elif state["split_remainder"] == 0.0:
        state["split_remainder"] = h
        state["split_steps"] += 1.0
    return 0.25 * h


@njit(forceinline=True)
def store_next(control, state, h, e, shortened, failed, out_rate):
    """Store the length of the next step under error control after an accepted step with the length h and the error e.

    shortened : True if the step was shortened to a due time; failed : True if an attempt could not be solved
    out_rate : as for `watch`, which may end the call after this step, to change the method
    """
    grow = grown(control, state, h, e, shortened)
    # A longer step has just failed.
    if failed:
        grow = min(grow, 1.0)
    # A shortened step keeps the stored length for full steps, unless its error requires shorter ones.
    if (not shortened or grow < 1.0) and not retains_length(control, grow):
        state["step"] = h * grow
    state["error_old"] = e
    if control["watch"] != 0 and watch(control, state, h, e, out_rate):
        state["switch_count"], control["budget"] = -1.0, 1.0


@njit(forceinline=True)
def watch(control, state, h, e, out_rate):
    """Count the steps for which the other kind of method (explicit or implicit) would have been cheaper.

    Returns True if there are enough such steps to change the method. An implicit method would be cheaper if stability
    limits the explicit step (Hairer and Wanner 1996, IV.2). Where the greatest wave rate limits it, the error must also
    allow a step longer by more than the cost ratio of an implicit step. An explicit method would be cheaper if its
    steps within the stability boundary cost less than half. Writes the count and the radius to `state`.
    h, e : length and error of the step; out_rate : greatest wave rate [1/s], 0 if not known
    """
    if control["kind"] == rec.EXPLICIT:
        growth = 0.9 * max(e, 1e-30) ** (-1.0 / control["order"])
        cheaper = h * state["radius"] > LIMITED_BY_STABILITY
        # `next_step` keeps h within stability; the error gives the possible increase
        if h * out_rate > WAVES:
            cheaper = h * out_rate > 1.98 and growth > control["price"]
        state["radius"] = max(state["radius"], out_rate)
    else:
        cheaper = 2.0 * max(1.0, h * state["radius"] / BOUNDARY) < control["price"]
    state["switch_count"] = (
        state["switch_count"] + 1.0 if cheaper else max(0.0, state["switch_count"] - COUNT_DECREASE)
    )
    return state["switch_count"] >= STEPS_TO_SWITCH * 2.0 ** min(state["switches"], 6.0)


@njit(forceinline=True)
def retains_length(control, grow):
    """True if a step solved by Newton keeps its length, and so its factorisation: it may grow by a factor of 1 to 1.2.

    grow : factor by which the error would allow the step to grow
    """
    return control["kind"] == rec.NEWTON_SOLVED and 1.0 <= grow <= DEAD_BAND

"""Time loop: steps of any method with dense output, step control and event location.

A single compiled loop is used for every method and every model: the functions for a step and for the rates have
declared types, and the coefficients of a method are data.
The functions have these arguments: handle, run : handles of the model and of the run, see `run_handle`; r : open handle
of the run; h : length of a step [s]; now, new : rows of y at its start and its end; last : True if it ends the segment;
due : time of an output row at which it has to end [s], see `step_control.row_step_end`; e : its error in units of the
tolerance.
"""

from math import inf, isfinite, nan

from fvsolve.core.kernels.calls import compile_as
from fvsolve.core.kernels.stage_sums import BAD, CHECK, MODE, OFF
from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers import run_handle, step_control
from fvsolve.core.steppers.coefficients import error_of, weights_of
from fvsolve.core.steppers.event_search import (
    NOWHERE,
    forget_pace,
    is_near,
    update_pace,
    zero_within,
)
from fvsolve.core.steppers.hidden_stiffness import WINDOW, has_returned
from fvsolve.core.steppers.ledger import book, book_error
from fvsolve.core.steppers.output_rows import emit, next_due, row_due
from fvsolve.core.steppers.row_substeps import store_start_slopes
from fvsolve.core.steppers.run_handle import (
    EVENT_FUNCTIONS,
    STEP,
    call_attempt,
    call_events,
    evaluate,
    open_run,
    store_ledger_rates,
)
from fvsolve.core.steppers.step_control import NEVER, too_short
from fvsolve.core.steppers.step_operations import (
    BEGIN,
    STOP,
    add_stored,
    all_finite,
    copy,
    exceeded,
    update_carry,
)
from fvsolve.jit import inline, njit

EVENT_TOLERANCE = 1e-13
# Of long steps: event functions have the rounding of large networks and of Newton, which hides a nearer event.
SLOW_EVENT_TOLERANCE, SLOW_EVENT_TIME = 1e-9, 1e-11
# attempts by a line through two values beyond the event; an event function that jumps needs others
MOST_SECANTS = 3
# value beyond the event at which such a line aims, in tolerances: an event acts from zero on
LANDING = 0.25
MOST_SEARCHES = 8  # for events before an event within the same step
# attempts of an implicit step by Newton alone at tolerances above LOOSE: shorter steps cost less than sweeps
UNSWEPT, LOOSE = 5, 3e-6
# time for which a step goes on after an event function has jumped, as fraction of the step and of the time
SAME_TIMES, SAME_ROUNDING = 1e-8, 1e-14
# fraction of an event function, and of a given step; smaller changes do not count as a jump
JUMP = 1e-6


@njit(forceinline=True)
def set_flags(g, armed):
    """Set the flag of every event function to 1 if the function is zero or negative, otherwise to 0.

    The flags select the equations in the rhs. They are set for accepted states only, so the equations do not change
    within a step.
    g : float64[events]  values of the event functions; armed : float64[events]  flags
    """
    for i in range(g.size):
        armed[i] = 1.0 if g[i] <= 0.0 else 0.0


@njit(forceinline=True)
def has_switched(g, armed):
    """True if an event function has crossed zero since its flag was set."""
    for i in range(g.size):
        if (g[i] <= 0.0) != (armed[i] > 0.0):
            return True
    return False


@njit(forceinline=True)
def crossed(g, g_new):
    """True if an event function went from above zero to zero or below."""
    for i in range(g.size):
        if g[i] > 0.0 and g_new[i] <= 0.0:
            return True
    return False


@njit(forceinline=True)
def event_ratio(g, g_new):
    """Least ratio of new to old value of the positive event functions: 1 at the start of the step, 0 at an event."""
    share = 1.0
    for i in range(g.size):
        if g[i] > 0.0:
            share = min(share, g_new[i] / g[i])
    return share


@njit(forceinline=True)
def is_on_line(value, line):
    """True if a negative value of event functions differs from that of a line by a factor of two at most."""
    return 2.0 * line <= value <= 0.5 * line


@njit(forceinline=True)
def secant(high, past, farther, at_farther, tolerance):
    """Length at which the line through two values beyond the event is just beyond it; -inf if it does not fall.

    high, farther : lengths beyond the event, the nearer first, infinite for none; past, at_farther : ratios there
    """
    fall = (past - at_farther) / (farther - high) if high < farther < inf else 0.0
    return high + (past + LANDING * tolerance) / fall if fall > 0.0 else -inf


@njit
def locate(handle, run, r, h, now, new, e):
    """Shorten a step so that it ends just past the first event, by the Illinois rule; returns its length and error.

    Where that rule is slow, because an event function jumps beyond its zero, a line through the last two values before
    the zero is extrapolated, then twice as far, in turn with bisection; not where it is near the value beyond the zero.
    handle, run, r : handles of the model and of the run, and the open handle of the run; now, new : rows of y
    h, e : length and error of the full step; y[new] and g_new receive the values at the end of the shortened step
    The error is NEWTON_FAILED if a stage could not be solved, or if an event function jumps over zero in an implicit
    step (Newton) of given length: then the stages of the step have several solutions, those of a shorter step only one.
    """
    g, g_new = r.g, r.g_new
    t = r.state[0]["t"]
    low = 0.0
    high = h
    at_low = 1.0
    past = event_ratio(g, g_new)
    guess = h
    at_high = past
    side = 0
    earlier, at_earlier, at_last = 0.0, 1.0, 1.0  # length before `low`; ratios there and at `low`
    width, wider = inf, inf  # of the bracket in the last turn, and in the one before
    is_slow = False
    extrapolations = 0
    farther = inf
    at_farther = past
    r.progress[0]["no_sweeps"] = 0
    is_long = r.control[0]["keeps_step"] == 1
    tolerance, narrow = (
        (SLOW_EVENT_TOLERANCE, SLOW_EVENT_TIME * h) if is_long else (EVENT_TOLERANCE, 0.0)
    )
    beyond = 1e-3 * tolerance * h
    for turn in range(101):
        done = (
            turn == 100
            or past >= -tolerance
            or high - low <= max(narrow, 4e-16 * max(abs(t), high))
        )
        if done and guess == high:
            break
        is_slow = is_slow or high - low > 0.5 * wider
        guess = -inf
        fall = (at_earlier - at_last) / (low - earlier) if low > earlier else 0.0
        if not is_slow or is_on_line(past, at_last - fall * (high - low)):
            guess = high - at_high * (high - low) / (at_high - at_low)
            extrapolations = 0
        elif fall > 0.0 and (extrapolations < 2 or high - low <= 0.5 * width):
            farther = 2.0 if extrapolations == 1 and side < 0 else 1.0
            guess, extrapolations = low + farther * at_last / fall, extrapolations % 2 + 1
        guess += -beyond if side > 0 else beyond  # to the other side of the event
        if not low < guess < high:
            guess, extrapolations = 0.5 * (low + high), 0
        line = (
            secant(high, past, farther, at_farther, tolerance)
            if is_long and turn <= MOST_SECANTS
            else -inf
        )
        if side > 0 and low < line < high:
            guess = line
        wider, width = width, high - low
        if done:
            guess = high
        r.progress[0]["stage_status"] = 0
        e = call_attempt(r.calls[STEP], handle, run, t, guess, now, new)
        if e == rec.NEWTON_FAILED:
            break
        # `accept` does it too: rounding must not move the state back before the event
        add_stored(r, guess, now, new)
        call_events(r.calls[EVENT_FUNCTIONS], t + guess, r.y[new], handle, g_new)
        if done:
            break
        here = event_ratio(g, g_new)
        if here <= 0.0:
            farther, at_farther = high, past
            high = guess
            at_high = here
            past = here
            at_low, side = 0.5 * at_low if side > 0 else at_last, 1
        else:
            earlier = low
            at_earlier = at_last
            at_last = here
            low, at_low = guess, here
            at_high, side = 0.5 * at_high if side < 0 else past, -1
    if past < -JUMP and e != rec.NEWTON_FAILED:
        return after_jump(handle, run, r, h, high, now, new, e)
    return high, e


@njit
def after_jump(handle, run, r, h, length, now, new, e):
    """Length and error of a step that ends where an event function jumps over zero: failed, or extended, or as it was.

    Waves that arrive together make it jump at times that differ by rounding, within which the step has ended. Which of
    them have arrived must not depend on rounding, so it ends after all of them.
    h, e : length of the full step, and error of the step up to the event; length : of the step up to the event
    """
    control = r.control[0]
    fixed = control["kind"] == rec.NEWTON_SOLVED and control["mode"] != rec.TOLERANCE
    # The stages of this step may have several solutions, those of a shorter step a single one.
    if fixed and length > JUMP * r.state[0]["step"]:
        return length, rec.NEWTON_FAILED
    if not control["has_jumps"]:
        return length, e
    t, later = r.state[0]["t"], 0.0
    # First behind all these times; if no event function is at or below zero there, at the event.
    for extension in (SAME_TIMES * h + SAME_ROUNDING * abs(r.state[0]["t"]), 0.0):
        later = min(h, length + extension)
        r.progress[0]["stage_status"] = 0
        e = call_attempt(r.calls[STEP], handle, run, t, later, now, new)
        if e != rec.NEWTON_FAILED:
            add_stored(r, later, now, new)
            call_events(r.calls[EVENT_FUNCTIONS], t + later, r.y[new], handle, r.g_new)
            if event_ratio(r.g, r.g_new) <= 0.0:
                break
    return later, e


@njit
def run_steps(handle, run):
    """Step from the present time to the end of the segment; returns the reason for the return, see `loop_records`.

    The caller handles the reason and calls the function again with the same arrays.
    """
    r = open_run(run)
    progress = r.progress[0]
    progress["reuse"], progress["event_known"] = 0, 0
    for _ in range(1 << 62):
        if progress["phase"] == rec.FRESH and switches_at_start(handle, r):
            return rec.SWITCHED
        if progress["phase"] == rec.FRESH and not evaluate_state(handle, r):
            continue
        status = check_state(r) if progress["phase"] <= rec.EMIT else rec.DONE
        if status == rec.DONE and progress["phase"] == rec.EMIT:
            status = finish_last_step(handle, r)
        if status == rec.REPEAT:
            continue
        if status == rec.DONE and has_ended(r):
            return rec.DONE
        # After rows, events and jumps, so that the watched state is the one from which the next step starts.
        if status == rec.DONE and 0.0 < r.control[0]["watch_at"] <= r.state[0]["steps"]:
            watch_present_state(handle, r)
        if status == rec.DONE:
            status = reason_to_stop(r)
        if status == rec.DONE:
            status = take_step(handle, run, r)
        if status > rec.DONE:
            return status
    return rec.DONE


@inline
def switches_at_start(handle, r):
    """True if the equations switch at the present state, without a step before; compute the event functions there.

    After a step the equations switch when its rows are written, because these still use the previous equations.
    """
    progress, g = r.progress[0], r.g
    # The last step has already evaluated the event functions at its end.
    if progress["event_known"] == 1:
        update_pace(r)
        copy(r.g_new, g)
    elif g.size > 0:
        run_handle.call_events(
            r.calls[run_handle.EVENT_FUNCTIONS], r.state[0]["t"], r.y[progress["now"]], handle, g
        )
    progress["event_known"] = 0
    if not has_switched(g, r.armed):
        return False
    progress["switch_pending"] = progress["has_last_step"]
    if progress["has_last_step"] == 1:
        return False
    set_flags(g, r.armed)
    forget_pace(r)
    return True


@inline
def evaluate_state(handle, r):
    """Compute the rates k[0] and the results `out` of the present state, record it and check that it is finite.

    Returns False if the last step is rejected because of these rates, see `reject_end`.
    """
    progress = r.progress[0]
    t = r.state[0]["t"]
    k = r.k
    out = r.out
    structure = r.structure
    y = r.y[progress["now"]]
    row_blocks = r.row_blocks
    last_stage = k[k.shape[0] - 1]
    # Where the rhs forms the stages, it also searches for NaN: a further pass over memory is saved.
    checked = r.control[0]["kind"] == rec.EXPLICIT and structure.size > 0 and progress["reuse"] == 0
    if progress["reuse"] == 1:
        # First same as last: the last stage has the rates at the end of the step.
        for m in range(row_blocks.shape[0]):
            begin, end = row_blocks[m, BEGIN], row_blocks[m, STOP]
            copy(last_stage[begin:end], k[0, begin:end])
    else:
        if checked:
            structure[MODE], structure[BAD] = CHECK, 0
        evaluate(handle, r, t, y, k[0])
        if checked:
            structure[MODE] = OFF
        if reject_end(handle, r):
            return False
    progress["reuse"], progress["phase"] = 0, rec.EMIT
    run_handle.call_observer(r.calls[run_handle.RECORDER], t, y, out, handle, r.values)
    # The record has changed the state, so that its rates and recorded values are out of date.
    if out[rec.STATUS] == rec.CORRECTED:
        evaluate(handle, r, t, y, k[0])
        run_handle.call_observer(r.calls[run_handle.RECORDER], t, y, out, handle, r.values)
    if not all_finite(handle, r, y, checked):
        out[rec.STATUS] = rec.NOT_FINITE
    return True


@inline
def reject_end(handle, r):
    """Reject the last step if the rates at its end are not valid, and a shorter one is possible (error control).

    Returns True if the state at the start of that step is the present state again. The rates are not recorded.
    """
    state = r.state[0]
    progress = r.progress[0]
    control = r.control[0]
    out = r.out
    if (
        control["mode"] != rec.TOLERANCE
        or progress["has_last_step"] == 0
        or not state["unbooked"] > 0.0
    ):
        return False
    # NaN in place of an error gives the greatest reduction.
    h = state["last"] * step_control.reduced(control, nan)
    faults = 0 if out[rec.STATUS] == 0.0 and isfinite(out[rec.RATE]) else 1
    if too_short(control, state, h) or all_finite(handle, r, r.k[0], False, faults):
        return False
    state["t"], state["step"], state["unbooked"] = progress["t_old"], h, 0.0
    # The step had been accepted and counted.
    state["steps"] -= 1.0
    state["rejections"] += 1.0
    progress["now"], progress["old"] = progress["old"], progress["now"]
    progress["has_last_step"], progress["switch_pending"] = 0, 0
    discard_stages(r)
    return True


@inline
def check_state(r):
    """Book the last step in the ledger if its stages and its end are valid; returns DONE, BAD_VALUE or BAD_STATUS."""
    out = r.out
    state = r.state[0]
    control = r.control[0]
    if out[rec.STATUS] == rec.NOT_FINITE or not isfinite(out[rec.RATE]):
        return rec.BAD_VALUE
    if r.progress[0]["stage_status"] != 0:
        report_stage(r)
    if out[rec.STATUS] != 0.0:
        return rec.BAD_STATUS
    if state["unbooked"] > 0.0:
        use_slope, b = control["stage_slope"] == 1, weights_of(r.coefficients, r.k.shape[0])
        known = use_slope and r.newton[0]["known_steps"] > 0.0
        book(
            state["unbooked"],
            b,
            r.ledger_rates,
            r.dense,
            use_slope,
            known,
            out[control["ledger_offset"] :],
            r.ledger,
        )
        state["unbooked"] = 0.0
    return rec.DONE


@inline
def report_stage(r):
    """Write the status of the faulty stage of the last step, and its place, to `out`."""
    r.out[rec.STATUS], r.out[rec.PLACE] = (
        float(r.progress[0]["stage_status"]),
        float(r.progress[0]["stage_where"]),
    )


@inline
def finish_last_step(handle, r):
    """Write the rows due within the last step, then let events and jumps act at its end.

    Returns DONE to take the next step, REPEAT where the state has changed, or a reason to return.
    """
    state = r.state[0]
    progress = r.progress[0]
    control = r.control[0]
    out = r.out
    # Rows within the step belong to the equations before the switch.
    # The times of a row and of a jump may differ by rounding: a row at the time of a jump is that before it.
    last_row = max(state["t"], out[rec.LAST_ROW])
    if progress["has_last_step"] == 1 and next_due(r) <= last_row:
        status = emit(handle, r, last_row)
        if status != rec.DONE:
            return status
    # the rhs has switched: discard the step size and the Jacobian
    if progress["switch_pending"] == 1:
        set_flags(r.g, r.armed)
        forget_pace(r)
        progress["switch_pending"], progress["phase"] = 0, rec.FRESH
        if control["mode"] == rec.TOLERANCE and control["keeps_step"] == 0:
            state["step"] = 0.0
        discard_stages(r)
        return rec.SWITCHED
    # a jump arrives now, after events have acted: the next record is of the state after it
    if out[rec.JUMP_TIME] == state["t"]:
        out[rec.STATUS] = rec.ARRIVED
        run_handle.call_observer(
            r.calls[run_handle.RECORDER], state["t"], r.y[progress["now"]], out, handle, r.values
        )
        progress["has_last_step"], progress["phase"] = 0, rec.FRESH
        discard_stages(r)
        return rec.REPEAT
    progress["phase"] = rec.READY
    return rec.DONE


@inline
def discard_stages(r):
    """Discard the Jacobian and the stages of the last step, because the equations change."""
    if r.control[0]["kind"] != rec.EXPLICIT:
        r.newton[0]["has_jacobian"], r.newton[0]["stages_step"] = 0.0, -1.0


@inline
def has_ended(r):
    """Store the ledger rates of the first stage; True if the segment has ended: the rest of it is rounding."""
    store_ledger_rates(r, 0)
    state, control = r.state[0], r.control[0]
    if not too_short(control, state, control["end"] - state["t"]):
        return False
    state["t"] = control["end"]
    return True


@njit
def watch_present_state(handle, r):
    """Pass the present state to the function that watches some states."""
    state, y = r.state[0], r.y[r.progress[0]["now"]]
    r.control[0]["watch_at"] = run_handle.call_watch(
        r.calls[run_handle.WATCHER], state["t"], state["steps"], y, r.ledger, handle, r.watch, False
    )


@inline
def reason_to_stop(r):
    """Reason to return before the next step: STOPPED or BUDGET_SPENT; DONE without a reason."""
    if r.out[rec.PLACE] == rec.STOP_HERE:
        return rec.STOPPED
    return rec.BUDGET_SPENT if r.control[0]["budget"] <= 0.0 else rec.DONE


@inline
def take_step(handle, run, r):
    """Take the next step; returns DONE, REPEAT if the rates at its start are missing, or a reason to return."""
    state = r.state[0]
    control = r.control[0]
    progress = r.progress[0]
    # Rows 0, 1 and 2 of y hold the present, the last and the new state in turn; row 3 is a stage.
    new, full = 3 - progress["now"] - progress["old"], state["split_remainder"]
    if not full > 0.0:
        # No rest of a divided step is left.
        full = step_control.next_step(
            control, state, r.out[rec.RATE], r.out[rec.LONGEST_STEP], r.k, r.scale
        )
    if control["mode"] != rec.TOLERANCE:
        # Error control shortens steps by itself; given steps have to be divided.
        least = step_control.shortest(control, state)
        full = step_control.closing_step(state, r.out[rec.CLOSING_RATE], full, least)
        full = step_control.divided_step(control, state, r.out[rec.RATE], full, least)
    h = step_control.arriving_step(control, state, r.out[rec.JUMP_TIME], full)
    if can_use_fused_step(r, h):
        take_fused_steps(handle, r, h)
        return rec.DONE
    if progress["phase"] == rec.FUSED:  # fused steps do not compute k[0], which the next step needs
        progress["phase"] = rec.FRESH
        state["calls"] -= 1.0
        return rec.REPEAT
    due = step_control.row_step_end(control, state, row_due(r), h)
    status, h, last = find_step(handle, run, r, min(h, due - state["t"]), full, due, new)
    if status == rec.DONE:
        accept(handle, r, h, last, due)
        progress["phase"] = rec.FRESH
    return status


@inline
def take_fused_steps(handle, r, h):
    """Take fused steps of length h until something is due, or the length of the next step may change."""
    state = r.state[0]
    control = r.control[0]
    progress = r.progress[0]
    out = r.out
    address = r.calls[run_handle.FUSED_CALL]
    due = next_due(r)
    full = 1.0 - 1e-9
    rate = out[rec.RATE]
    closing = out[rec.CLOSING_RATE]
    jump = out[rec.JUMP_TIME]
    progress["phase"] = rec.FUSED
    while True:
        now, new = progress["now"], 3 - progress["now"] - progress["old"]
        state["calls"] += 1.0
        # As a multiple of the step, so that rounding does not add up.
        t_new = state["t_mark"] + (state["n_mark"] + 1.0) * h
        run_handle.call_fused_step(address, t_new, h, r.y[now], r.y[new], out, handle, r.values)
        accept(handle, r, h, False, NEVER)
        # Only these values change the length of the next step.
        same = (
            out[rec.RATE] == rate
            and out[rec.CLOSING_RATE] == closing
            and out[rec.JUMP_TIME] == jump
        )
        due_soon = due <= state["t_mark"] + (state["n_mark"] + 1.0) * h
        if (
            not same
            or due_soon
            or h >= (control["end"] - t_new) * full
            or check_state(r) != rec.DONE
        ):
            return
        store_ledger_rates(r, 0)
        if reason_to_stop(r) != rec.DONE or 0.0 < control["watch_at"] <= state["steps"]:
            return


@inline
def can_use_fused_step(r, h):
    """True if fused steps are allowed, and a step of length h ends before the next row, field or end of the segment."""
    control, state = r.control[0], r.state[0]
    if (
        control["allow_fused"] == 0
        or too_short(control, state, h)
        or h >= (control["end"] - state["t"]) * (1.0 - 1e-9)
    ):
        return False
    return next_due(r) > state["t_mark"] + (state["n_mark"] + 1.0) * h


@inline
def find_step(handle, run, r, h, full, due, new):
    """Repeat a step with other lengths until it is accepted; returns (DONE or a failure, its length, `last`).

    full : length of the step without regard to due times and jumps [s]
    """
    state = r.state[0]
    control = r.control[0]
    now = r.progress[0]["now"]
    failure = rec.TINY_STEP
    rate = r.out[rec.RATE]
    last = False
    failures = 0
    unswept = UNSWEPT if control["mode"] == rec.TOLERANCE and control["size"] > LOOSE else 0
    for _ in range(1 << 62):
        rest = control["end"] - state["t"]
        # A rest of 1e-9 of a step would be a step of its own: this step takes it.
        last = h >= rest * (1.0 - 1e-9)
        if last and step_control.approaches(control, state, rest):
            h, last = step_control.APPROACH * rest, False
        elif last:
            h = rest
        # The rest of a segment may be very short, except after a failed attempt.
        if too_short(control, state, h) and (not last or failure != rec.TINY_STEP):
            return failure, h, last
        near_kink = rest <= 1e3 * step_control.shortest(control, state)
        r.progress[0]["no_sweeps"] = (
            1 if state["last"] > 0.0 and failures < unswept and not near_kink else 0
        )
        e, length, last = try_step(handle, run, r, h, last, due, now, new, near_kink)
        if e == rec.NEWTON_FAILED:
            # If shorter steps fail too, the last reason is the one to report.
            failure = rec.NEWTON_STUCK if r.out[rec.STATUS] == 0.0 else rec.BAD_STATUS
            failures += 1
            h = full = step_control.after_failure(control, state, h)
        elif acceptable(e, near_kink):
            if control["mode"] == rec.TOLERANCE:
                shortened = last or length == due - state["t"] or length < full
                is_tested = (
                    control["watch"] != 0
                    and control["keeps_step"] == 1
                    and control["kind"] == rec.EXPLICIT
                )
                if is_tested and has_returned(r, length, now, new):
                    state["switch_count"] += WINDOW
                step_control.store_next(control, state, length, e, shortened, failures > 0, rate)
            return rec.DONE, length, last
        else:
            if r.progress[0]["stage_status"] != 0:
                failure = rec.BAD_STATUS
                report_stage(r)
            state["rejections"] += 1.0
            h = full = length * step_control.reduced(control, e)
            state["step"] = h
    return failure, h, last


@inline
def try_step(handle, run, r, h, last, due, now, new, near_kink):
    """Attempt a step, and shorten it to the first event within it; returns (its error, its length, `last`).

    The error is NaN under error control if the rates of a stage are not valid.
    near_kink : True if the segment ends so soon that rounding dominates
    """
    state = r.state[0]
    progress = r.progress[0]
    g = r.g
    progress["stage_status"] = 0
    e = error_with_ledger(
        r,
        h,
        run_handle.call_attempt(r.calls[run_handle.STEP], handle, run, state["t"], h, now, new),
    )
    if e == rec.NEWTON_FAILED or not acceptable(e, near_kink):
        return e, h, last
    progress["event_known"] = 1
    # Event functions must see the states with compensated sums, as the next step does.
    end_step(r, h, last, due, now, new)
    if g.size > 0:
        run_handle.call_events(
            r.calls[run_handle.EVENT_FUNCTIONS], progress["t_new"], r.y[new], handle, r.g_new
        )
    found, length = crossed(g, r.g_new), h
    if found:
        length, e = locate(handle, run, r, h, now, new, e)
    if e != rec.NEWTON_FAILED and (found or is_near(r, h)):
        length, e, found = shorten_to_first(handle, run, r, length, e, found, now, new)
    if e == rec.NEWTON_FAILED:
        progress["event_known"] = 0
        return e, h, last
    if found:
        progress["event_known"] = 0
        # The equations may change at the event: a step of 0 makes the next one cautious.
        state["step"], state["split_remainder"] = state["step"] * r.control[0]["keeps_step"], 0.0
        last = last and state["t"] + length >= r.control[0]["end"]
        e = error_with_ledger(r, length, e)
    return nan if has_faulty_stage(r) else e, length, last


@njit
def shorten_to_first(handle, run, r, h, e, found, now, new):
    """Shorten a step to an event within it that its end does not show; returns its length, its error and `found`.

    h : length of the step, which ends just past an event if `found` is True
    """
    progress, t = r.progress[0], r.state[0]["t"]
    no_sweeps = progress["no_sweeps"]
    for _ in range(MOST_SEARCHES):
        t_end = t + h if found else progress["t_new"]
        store_start_slopes(r)
        # Each event found may hide an earlier one, so the shortened step is searched again.
        theta, stepped = zero_within(handle, run, r, h, t_end, now, new)
        if theta < NOWHERE:
            progress["stage_status"] = 0
            shorter = call_attempt(r.calls[STEP], handle, run, t, theta * h, now, new)
            call_events(r.calls[EVENT_FUNCTIONS], t + theta * h, r.y[new], handle, r.g_new)
            if shorter != rec.NEWTON_FAILED and crossed(r.g, r.g_new):
                h, e = locate(handle, run, r, theta * h, now, new, shorter)
                found = True
                if e == rec.NEWTON_FAILED:
                    return h, e, found
                continue
        # no event, or only in the dense output: repeat the step as it was
        if theta < NOWHERE or stepped:
            progress["no_sweeps"], progress["stage_status"] = no_sweeps, 0
            if call_attempt(r.calls[STEP], handle, run, t, h, now, new) == rec.NEWTON_FAILED:
                return h, rec.NEWTON_FAILED, found
            if not found:
                progress["changed"] = 1 if add_stored(r, h, now, new) else 0
        # The search has evaluated them at other times.
        call_events(r.calls[EVENT_FUNCTIONS], t_end, r.y[new], handle, r.g_new)
        break
    return h, e, found


@inline
def has_faulty_stage(r):
    """True if a stage of a step under error control has rates that are not valid: a shorter step may avoid it."""
    return r.control[0]["mode"] == rec.TOLERANCE and r.progress[0]["stage_status"] != 0


@inline
def error_with_ledger(r, h, e):
    """Error of a step: the error e of its states, or that of its ledger amounts if it is greater (error control)."""
    control = r.control[0]
    if control["mode"] != rec.TOLERANCE or e == rec.NEWTON_FAILED:
        return e
    error = error_of(r.coefficients, r.k.shape[0])
    return max(e, book_error(h, error, r.k, r.stored, r.ledger_rates, control["size"], r.ledger))


@inline
def acceptable(e, near_kink):
    """True if a step with the error e, in units of the tolerance, is accepted.

    near_kink : True if the segment ends so soon that rounding dominates; then every error except NaN is accepted
    """
    return e <= 1.0 or (e == e and near_kink)


@inline
def end_step(r, h, last, due, now, new):
    """Compute the end of a step [s], and its states with compensated sums."""
    progress = r.progress[0]
    progress["t_new"] = step_control.end_of(r.control[0], r.state[0], h, last, due)
    progress["changed"] = 1 if add_stored(r, h, now, new) else 0


@inline
def accept(handle, r, h, last, due):
    """Make the end of an accepted step the present state."""
    state = r.state[0]
    progress = r.progress[0]
    control = r.control[0]
    now, new = progress["now"], 3 - progress["now"] - progress["old"]
    if progress["event_known"] == 0:
        end_step(r, h, last, due, now, new)
    update_carry(r, h, now)
    state["unbooked"] = h
    # `n_mark` counts full given steps, at whose multiples steps end.
    is_part = state["split_remainder"] > h
    state["split_remainder"] = state["split_remainder"] - h if is_part else 0.0
    state["n_mark"] += 0.0 if is_part else 1.0
    state["last"], progress["t_old"] = progress["t_new"] - state["t"], state["t"]
    state["t"] = progress["t_new"]
    state["steps"] += 1.0
    control["budget"] -= 1.0
    if (
        r.largest.size > 0
        and state["steps"] % rec.GROWTH_CHECK_STEPS == 0.0
        and exceeded(handle, r, r.y[new])
    ):
        control["budget"] = rec.GROWTH_FOUND
    # The next evaluation overwrites the slopes at the start of the step, which rows within it need.
    if next_due(r) <= state["t"] or control["dense_steps"] == 1:
        store_start_slopes(r)
    # At the end of a segment schedules pass to their right limits, so the last stage is no longer valid.
    reuses = (
        control["fsal"] == 1
        and control["mode"] == rec.TOLERANCE
        and not last
        and progress["changed"] == 0
    )
    progress["reuse"] = 1 if reuses else 0
    progress["old"], progress["now"], progress["has_last_step"] = now, new, 1


def compiled():
    """Time loop `run_steps`, compiled for calls from Python."""
    return compile_as(run_steps, "hh")

"""Search for events within a step, where an event function reaches zero and is above zero again at the end of the step.

The values at both ends of a step do not show such an event. A step is searched only if an event function is as near to
zero as it could go and return at its pace, so the search costs nothing elsewhere. The state at an inner time comes from
the dense output, or from a shorter step where the dense output is less accurate than the steps.
The functions have the arguments of `time_loop`; theta : fraction of the step; g : event functions at its start.
"""

from fvsolve.core.steppers import loop_records as rec
from fvsolve.core.steppers import run_handle
from fvsolve.core.steppers.coefficients import start_slope_of
from fvsolve.core.steppers.output_rows import limit_to_bounds
from fvsolve.core.steppers.step_operations import BEGIN, STOP, copy, interpolate
from fvsolve.jit import njit

# distance to zero at which a step is searched, in changes at the pace
NEAR, NEAR_AFTER_BREAK = 2.0, 20.0
FADING = 0.8  # of the pace per step, where an event function changes more slowly than before
# least bound, in changes within the step; least change within the step, in those at the pace
MARGIN, MOVED = 0.1, 0.25
# Greatest bend of a function that ends at zero, in its fall; a parabola with a bend above 0.25 has an earlier zero.
STRAIGHT = 0.1
MOST_TURNS = 10  # of the search in an interval
# rows of the array `inner`: event functions at the start, the quarters and the end of the step, and at another time
INNER_ROWS, MIDDLE, END, OTHER = 6, 2, 4, 5
NOWHERE = 1.0  # in place of a fraction: no event


@njit
def update_pace(r):
    """Update the pace of all event functions [1/s], their greatest rate of change in the last steps, after a step."""
    pace = r.pace
    g = r.g
    g_new = r.g_new
    h = r.state[0]["last"]
    for i in range(g.size):
        # a time that never comes is infinite
        if abs(g[i]) < rec.UNKNOWN_PACE and abs(g_new[i]) < rec.UNKNOWN_PACE:
            rate = abs(g_new[i] - g[i]) / h
            pace[i] = max(rate, FADING * pace[i]) if pace[i] < rec.UNKNOWN_PACE else rate


@njit
def forget_pace(r):
    """Set the pace of all event functions to unknown, because their meaning or their slope has changed."""
    for i in range(r.pace.size):
        r.pace[i] = rec.UNKNOWN_PACE


@njit(forceinline=True)
def reach(r):
    """Distance to zero at which a step is searched, in changes of an event function at its pace."""
    mode, state = r.control[0]["mode"], r.state[0]
    is_first = (mode == rec.TOLERANCE and state["error_old"] == 0.0) or (
        mode == rec.FIXED_STEP and state["n_mark"] == 0.0
    )
    return NEAR_AFTER_BREAK if is_first else NEAR


@njit(forceinline=True)
def is_function_near(r, i, h, far):
    """True if event function i could reach zero and return within a step of length h; far : result of `reach`."""
    g, g_new = r.g[i], r.g_new[i]
    # A function at or below zero has no event ahead; infinite values stand for times that never come.
    if not 0.0 < g < rec.UNKNOWN_PACE or not abs(g_new) < rec.UNKNOWN_PACE:
        return False
    return min(g, g_new) < far * max(h * r.pace[i], abs(g_new - g))


@njit
def is_near(r, h):
    """True if an event function could reach zero and return within a step of length h."""
    far = reach(r)
    for i in range(r.g.size):
        if is_function_near(r, i, h, far):
            return True
    return False


@njit(forceinline=True)
def uses_steps(r):
    """True if states at inner times come from shorter steps: the dense output is too inaccurate, or stiff."""
    control = r.control[0]
    return control["kind"] != rec.EXPLICIT or control["separate_rows"] != rec.NEVER_SEPARATE


@njit
def needs_end_rates(r):
    """True if the cubic through both ends of the step needs the rates at its end, which no stage has."""
    control = r.control[0]
    return r.dense.shape[0] == 0 and control["stage_slope"] == 0 and control["fsal"] == 0


@njit
def interpolated_events(handle, r, h, theta, f_new, now, new, values):
    """Write the event functions at an inner time to `values`, from the dense output; f_new : rates at the end."""
    y = r.y[now]
    y_new = r.y[new]
    out = r.y_out
    row_blocks = r.row_blocks
    s = r.k.shape[0]
    start_slope = start_slope_of(r.coefficients, s)
    for m in range(row_blocks.shape[0]):
        begin, end = row_blocks[m, BEGIN], row_blocks[m, STOP]
        interpolate(begin, end, theta, h, y, r.f_old, y_new, f_new, r.k, r.dense, start_slope, out)
    limit_to_bounds(r.bounded_states, r.bounds, y, y_new, out, False)
    run_handle.call_events(
        r.calls[run_handle.EVENT_FUNCTIONS], r.state[0]["t"] + theta * h, out, handle, values
    )


@njit
def events_at(handle, run, r, h, theta, f_new, now, new, values):
    """Write the event functions at an inner time to `values`; returns False if the state there cannot be computed.

    A shorter step uses the row of the state before the last step, which is not needed any more, and changes `k`.
    """
    if not uses_steps(r):
        interpolated_events(handle, r, h, theta, f_new, now, new, values)
        return True
    t, at = r.state[0]["t"], r.progress[0]["old"]
    e = run_handle.call_attempt(r.calls[run_handle.STEP], handle, run, t, theta * h, now, at)
    if e == rec.NEWTON_FAILED:
        return False
    run_handle.call_events(
        r.calls[run_handle.EVENT_FUNCTIONS], t + theta * h, r.y[at], handle, values
    )
    return True


@njit(forceinline=True)
def reaches_zero(g, values):
    """True if an event function above zero at the start of the step is zero or below in `values`."""
    for i in range(g.size):
        if g[i] > 0.0 and values[i] <= 0.0:
            return True
    return False


@njit
def is_excluded(r, h, middle, far):
    """True if the values `middle` of event functions in the middle of the step, and those at its ends, exclude a zero.

    A convex function is above the line through two of its values, outside of the interval between them. The values must
    also move as much as the pace predicts. A function that is zero at the end of the step, which is the event found so
    far, must be nearly straight.
    """
    g, g_new = r.g, r.g_new
    for i in range(g.size):
        if is_function_near(r, i, h, far):
            moved = abs(middle[i] - g[i]) + abs(g_new[i] - middle[i])
            # The line through one end and the middle, extended to the other end, bounds the function there.
            least = min(middle[i], 2.0 * middle[i] - g[i], 2.0 * middle[i] - g_new[i])
            ends_there = (
                g_new[i] <= 0.0 and abs(middle[i] - 0.5 * (g[i] + g_new[i])) <= STRAIGHT * g[i]
            )
            if not (least > MARGIN * moved or ends_there):
                return False
            if r.pace[i] < rec.UNKNOWN_PACE and moved < MOVED * h * r.pace[i]:
                return False
    return True


@njit(forceinline=True)
def lower_bound(a, at_a, fall, b, at_b, rise):
    """(place, value) of the greatest lower bound of a convex function between a and b.

    at_a, at_b : its values; fall, rise : slopes of the lines from a and to b, below the function. The value is that at
    an end if the function has no minimum between them.
    """
    if fall >= 0.0:
        return a, at_a
    if rise <= 0.0:
        return b, at_b
    # Both lines meet at the least value that a convex function can have.
    x = (at_b - at_a + fall * a - rise * b) / (fall - rise)
    return (x, at_a + fall * (x - a)) if a < x < b else (a, min(at_a, at_b))


@njit
def search_interval(handle, run, r, h, i, j, f_new, now, new):
    """Fraction of the step between its quarters j and j + 1 at which an event function is zero or below, or NOWHERE.

    Event function i is taken as convex: lines through neighbouring values give the lower bound of its minimum, where
    the next value is computed, until a bound is above zero.
    """
    inner = r.inner
    a = 0.25 * j
    b = 0.25 * (j + 1)
    at_a, at_b = inner[j, i], inner[j + 1, i]
    own = 4.0 * (at_b - at_a)
    # at the ends of the step, slopes of a parabola with twice the bend
    fall = 4.0 * (at_a - inner[j - 1, i]) if j > 0 else 2.0 * own - 4.0 * (inner[2, i] - at_b)
    rise = (
        4.0 * (inner[j + 2, i] - at_b)
        if j < END - 1
        else 2.0 * own - 4.0 * (at_a - inner[END - 2, i])
    )
    for _ in range(MOST_TURNS):
        x, bound = lower_bound(a, at_a, fall, b, at_b, rise)
        if (
            bound > 0.0
            or not a < x < b
            or not events_at(handle, run, r, h, x, f_new, now, new, inner[OTHER])
        ):
            return NOWHERE
        if reaches_zero(r.g, inner[OTHER]):
            return x
        value = inner[OTHER, i]
        before, after = (value - at_a) / (x - a), (at_b - value) / (b - x)
        # Continue in the part that may contain the lower value.
        if (
            lower_bound(a, at_a, fall, x, value, after)[1]
            < lower_bound(x, value, before, b, at_b, rise)[1]
        ):
            b = x
            at_b = value
            rise = after
        else:
            a = x
            at_a = value
            fall = before
    return NOWHERE


@njit
def zero_within(handle, run, r, h, t_new, now, new):
    """Find an event function within a step that is zero or below there and above zero at the start of the step.

    t_new : end of the step [s]; the slopes at its start are in `f_old`
    Returns its fraction of the step, or NOWHERE, and True if shorter steps were taken, which have changed `k`. The data
    that event functions write belong to another time afterwards.
    """
    g = r.g
    inner = r.inner
    far = reach(r)
    if needs_end_rates(r):
        run_handle.evaluate(handle, r, t_new, r.y[new], r.y[3])
    f_new = r.y[3] if needs_end_rates(r) else r.k[r.k.shape[0] - 1]
    # A value in the middle excludes most steps, at the cost of a single evaluation.
    interpolated_events(handle, r, h, 0.5, f_new, now, new, inner[MIDDLE])
    if is_excluded(r, h, inner[MIDDLE], far) and not reaches_zero(g, inner[MIDDLE]):
        return NOWHERE, False
    stepped = uses_steps(r)
    copy(g, inner[0])
    copy(r.g_new, inner[END])
    for j in range(1, END):
        if not events_at(handle, run, r, h, 0.25 * j, f_new, now, new, inner[j]):
            return NOWHERE, stepped
        if reaches_zero(g, inner[j]):
            return 0.25 * j, stepped
    for i in range(g.size):
        if is_function_near(r, i, h, far):
            for j in range(END):
                theta = search_interval(handle, run, r, h, i, j, f_new, now, new)
                if theta < NOWHERE:
                    return theta, stepped
    return NOWHERE, stepped

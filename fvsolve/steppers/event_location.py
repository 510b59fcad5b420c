"""Event functions, which are zero at an event, and the search for the length of the step that ends at an event."""

from fvsolve.jit import njit
from fvsolve.steppers import loop_records as rec
from fvsolve.steppers.run_handle import EVENT_FUNCTIONS, STEP, call_attempt, call_events

EVENT_TOLERANCE = 1e-13
JUMP = 1e-6  # fraction of an event function, and of a given step; smaller changes do not count as a jump


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


@njit
def locate(handle, run, r, h, now, new, e):
    """Shorten a step so that it ends just past the first event, by the Illinois rule; returns its length and error.

    handle, run, r : handles of the model and of the run, and the open handle of the run; now, new : rows of y
    h, e : length and error of the full step; y[new] and g_new receive the values at the end of the shortened step
    The error is NEWTON_FAILED if a stage could not be solved, or if an event function jumps over zero in an implicit
    step (Newton) of given length: then the stages of the step have several solutions, those of a shorter step only one.
    """
    g, g_new = r.g, r.g_new
    t, low, high, at_low, past = r.state[0]["t"], 0.0, h, 1.0, event_ratio(g, g_new)
    guess, at_high, side = h, past, 0
    for turn in range(101):
        done = turn == 100 or past >= -EVENT_TOLERANCE or high - low <= 4e-16 * max(abs(t), high)
        if done and guess == high:
            break
        guess = high - at_high * (high - low) / (at_high - at_low)
        guess += 1e-3 * EVENT_TOLERANCE * h
        if not low < guess < high:
            guess = 0.5 * (low + high)
        if done:
            guess = high
        e = call_attempt(r.calls[STEP], handle, run, t, guess, now, new)
        if e == rec.NEWTON_FAILED:
            break
        call_events(r.calls[EVENT_FUNCTIONS], t + guess, r.y[new], handle, g_new)
        if done:
            break
        here = event_ratio(g, g_new)
        if here <= 0.0:
            high, at_high, past = guess, here, here
            at_low, side = 0.5 * at_low if side > 0 else at_low, 1
        else:
            low, at_low = guess, here
            at_high, side = 0.5 * at_high if side < 0 else at_high, -1
    control = r.control[0]
    fixed = control["kind"] == rec.NEWTON_SOLVED and control["mode"] != rec.TOLERANCE
    if fixed and past < -JUMP and high > JUMP * r.state[0]["step"]:
        e = rec.NEWTON_FAILED
    return high, e

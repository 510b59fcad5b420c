"""Events: functions that fall through zero, and the step that ends there. Knows no model."""

from fvsolve.jit import njit
from fvsolve.steppers.step import stages

EVENT_TOLERANCE = 1e-13


@njit
def arm(g, armed):
    """Note which event functions are at or below zero, where the rhs follows another rule; whether any changed.

    Only accepted states are asked, so no step, not even its stages beyond an event, meets the change of rule.
    """
    changed = False
    for i in range(g.size):
        now = 1.0 if g[i] <= 0.0 else 0.0
        changed = changed or now != armed[i]
        armed[i] = now
    return changed


@njit(forceinline=True)
def fallen(g, g_new):
    """Whether an event function went from above to zero or below."""
    for i in range(g.size):
        if g[i] > 0.0 and g_new[i] <= 0.0:
            return True
    return False


@njit
def nearness(g, g_new):
    """Least share of its value that an event function has kept over the step: 1 at its start, 0 at an event."""
    share = 1.0
    for i in range(g.size):
        if g[i] > 0.0:
            share = min(share, g_new[i] / g[i])
    return share


@njit
def locate(rhs, events, handle, a, b, c, last_is_new, t, h, y, k, supply, where, out, y_stage, y_new, g, g_new):
    """The step that ends just past the first event, by the Illinois rule on its length; y_new belongs to it."""
    low, high, at_low, at_high = 0.0, h, 1.0, nearness(g, g_new)
    for _ in range(100):
        if at_high >= -EVENT_TOLERANCE or high - low <= 4e-16 * max(abs(t), high):
            break
        guess = high - at_high * (high - low) / (at_high - at_low)
        guess += 1e-3 * EVENT_TOLERANCE * h
        if not low < guess < high:
            guess = 0.5 * (low + high)
        stages(rhs, handle, a, b, c, last_is_new, t, guess, y, k, supply, where, out, y_stage, y_new)
        events(t + guess, y_new, handle, g_new)
        here = nearness(g, g_new)
        if here <= 0.0:
            high, at_high, at_low = guess, here, 0.5 * at_low
        else:
            low, at_low, at_high = guess, here, 0.5 * at_high
    stages(rhs, handle, a, b, c, last_is_new, t, high, y, k, supply, where, out, y_stage, y_new)
    events(t + high, y_new, handle, g_new)
    return high

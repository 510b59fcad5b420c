"""Stiffness that explicit steps hide: steps that return to the state from which they began, though it moves.

Where a rate bends, as the flow between two tanks near equal levels does, an explicit method has fixed points that the
equations do not have: the stages of a step cancel each other. Its error is constant and the slopes of its last stages
are small, so neither shows that stability limits the step. But the lengths of the steps times the rates at their starts
then do not add up to the change of the state. For steps that follow a solution both sums differ by about one product,
because the errors of the rectangle rule cancel over many steps.
"""

from fvsolve.core.steppers.step_operations import error_scale
from fvsolve.jit import njit

WINDOW = 20  # steps after which both sums are compared
# difference of both sums, in the greatest products of the window, above which steps return
PRODUCTS = 10.0
TOLERANCES = 10.0  # the same in tolerances of the state: smaller differences are rounding
SUM, GREATEST = 0, 1  # rows of the array `returns`


@njit
def has_returned(r, h, now, new):
    """Add an accepted step to the sums of the window; True at its end if the steps have returned.

    r : open handle of the run; h : length of the step; now, new : rows of y at its start and end
    """
    returns = r.returns
    state = r.state[0]
    size = r.control[0]["size"]
    k = r.k
    y = r.y[now]
    y_new = r.y[new]
    scale = r.scale
    for e in range(scale.size):
        product = h * k[0, e]
        returns[SUM, e] += product - (y_new[e] - y[e])
        returns[GREATEST, e] = max(returns[GREATEST, e], abs(product))
    state["window"] += 1.0
    if state["window"] < WINDOW:
        return False
    found = False
    for e in range(scale.size):
        rest = abs(returns[SUM, e])
        tolerance = size * error_scale(scale[e], y_new[e])
        found = found or (rest > PRODUCTS * returns[GREATEST, e] and rest > TOLERANCES * tolerance)
        # The next window starts anew: a long step of this one would raise its threshold.
        returns[SUM, e] = returns[GREATEST, e] = 0.0
    state["window"] = 0.0
    return found

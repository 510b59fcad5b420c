"""Time integrals of inflows and outflows (ledger), accumulated separately with the weights of the method.

ledger : float64[5 m]  for m rates: sums of positive parts [0:m], sums of negative parts [m:2m], rounding errors of both
sums [2m:4m], rates at the last stage of the last step [4m:5m]
A step in which a rate changes its sign adds to both sums. It is divided at the extremum of the dense output of the
amount, computed with the coefficients of the dense output of the state.
"""

from fvsolve.core.steppers.step_operations import add_up
from fvsolve.jit import njit

LEDGER_ROWS = 5
# The smaller of the two sides of a step counts as rounding below this fraction of the gross amount so far.
NOISE = 1e-12
# Likewise below this fraction of the sum of the larger side, where the rates at both ends have the same sign: a
# negative weight or the Newton residual causes it.
WRONG_SIGN = 1e-6
# tolerance of the time of zero rate, in steps; the error of the amount goes with its square
NEAR = 1e-5
TURNS = 40
# Fraction of the step's tolerance, relative to all amounts so far: then the sum over all steps is within tolerance.
SHARE = 0.03
LEAST = 1e-3  # amount added to the reference amount, so that it is never zero [kg]


@njit(forceinline=True)
def weight(theta, dense, j):
    """(weight of stage j in the dense output at the fraction theta of a step, slope of the weight over theta).

    The weight is the sum of dense[j, m] theta^(m + 1).
    """
    w, slope = 0.0, 0.0
    for m in range(dense.shape[1] - 1, -1, -1):
        w, slope = (w + dense[j, m]) * theta, slope * theta + (m + 1) * dense[j, m]
    return w, slope


@njit
def amount_and_rate(theta, total, r0, r1, m, ledger_rates, dense):
    """(amount of rate number m from the start to the fraction theta of a step, divided by the step; rate there).

    They follow from the dense output of the method, or from the cubic through both ends of the step.
    total : amount of the whole step, divided by the step; r0, r1 : rates at its start and its end
    ledger_rates : float64[s, m]  rates at the stages; dense : float64[s, d]  coefficients of the dense output, or empty
    """
    if dense.shape[0] == 0:
        s, r = theta, 1.0 - theta
        amount = s * s * (1.0 + 2.0 * r) * total + s * r * (r * r0 - s * r1)
        return amount, 6.0 * s * r * total + r * (1.0 - 3.0 * s) * r0 - s * (2.0 - 3.0 * s) * r1
    amount, rate = 0.0, 0.0
    for j in range(dense.shape[0]):
        w, slope = weight(theta, dense, j)
        amount += w * ledger_rates[j, m]
        rate += slope * ledger_rates[j, m]
    return amount, rate


@njit
def smaller_side(total, r0, r1, m, ledger_rates, dense):
    """Size of the smaller of inflow and outflow in a step in which rate number m changes its sign, divided by the step.

    It is 0 if the rate of the dense output has the same sign at both ends.
    Arguments as for `amount_and_rate`.
    """
    low, high = 0.0, 1.0
    at_low = amount_and_rate(0.0, total, r0, r1, m, ledger_rates, dense)[1]
    at_high = amount_and_rate(1.0, total, r0, r1, m, ledger_rates, dense)[1]
    if at_low * at_high >= 0.0:
        return 0.0
    for _ in range(TURNS):
        # Regula falsi with the Illinois rule, which never leaves the step.
        middle = high - at_high * (high - low) / (at_high - at_low)
        rate, before = amount_and_rate(middle, total, r0, r1, m, ledger_rates, dense)[1], high
        if rate * at_high < 0.0:
            low, at_low = high, at_high
        else:
            at_low *= 0.5
        high, at_high = middle, rate
        if abs(high - before) <= NEAR or abs(high - low) <= NEAR:
            break
    # The amount has its extremum where the rate is zero: one side up to there, the other side after it.
    first = amount_and_rate(high, total, r0, r1, m, ledger_rates, dense)[0]
    return max(0.0, min(abs(first), abs(total - first)))


@njit
def book_error(h, error, k, stored, ledger_rates, tolerance, ledger):
    """Greatest error of the ledger amounts of a step, relative to the tolerance for the sum of all amounts so far.

    The part of the error that equals the errors of stored masses is left out, because the error of the states contains
    it already.
    h : step; error : weights of the error estimate; k, ledger_rates : rates of states and ledger at the stages
    stored : int64[q]  numbers of the states that are stored masses; ledger : sums of all amounts so far
    """
    s, count = ledger_rates.shape
    worst = 0.0
    reference = LEAST
    covered = 0.0
    for i in stored:
        covered += abs(combined(error, k, i))
    for m in range(count):
        peak = 0.0
        for i in range(s):
            peak = max(peak, abs(ledger_rates[i, m]))
        worst = max(worst, abs(combined(error, ledger_rates, m)))
        reference += ledger[m] - ledger[count + m] + h * peak
    return h * max(0.0, worst - covered) / (SHARE * tolerance * reference)


@njit(forceinline=True)
def combined(weights, rates, m):
    """Sum over the stages i of weights[i] rates[i, m]."""
    total = 0.0
    for i in range(weights.size):
        total += weights[i] * rates[i, m]
    return total


@njit(forceinline=True)
def add(ledger, m, at, part):
    """Add `part` to the positive (at = 0) or negative (at = 1) sum of rate number m, with compensated rounding.

    ledger : array of the sums, see the top of this file
    """
    count = ledger.size // LEDGER_ROWS
    ledger[at * count + m], ledger[(2 + at) * count + m] = add_up(
        ledger[at * count + m], part, ledger[(2 + at) * count + m]
    )


@njit
def book(h, b, ledger_rates, dense, use_stage_rates, known, end, ledger):
    """Add an accepted step of length h, whose end state is valid, to the ledger.

    b : weights of the stages; ledger_rates : float64[s, m]  rates at the stages; end : float64[m]  rates at the end
    dense : coefficients of the dense output; ledger : array of the sums, see the top of this file
    use_stage_rates : True to use the rates of the last stage at the end of the step, because f amplifies the Newton
    residual; known : True to do so at the start of the step too, where the last step is available
    """
    s, count = ledger_rates.shape
    for m in range(count):
        total = combined(b, ledger_rates, m)
        r0 = ledger_rates[0, m]
        r1 = end[m]
        part = 0.0
        gross = ledger[m] - ledger[count + m]
        side = 0 if total > 0.0 else 1
        threshold = NOISE * gross
        direction = r0 + r1
        # Without a rate at either end, the sign of all amounts so far decides.
        if direction == 0.0:
            direction = ledger[m] + ledger[count + m]
        if r0 * r1 >= 0.0 and direction != 0.0:
            side = 0 if direction > 0.0 else 1
            threshold = max(threshold, WRONG_SIGN * abs(ledger[side * count + m]))
        if use_stage_rates:
            r0, r1 = ledger[4 * count + m] if known else r0, ledger_rates[s - 1, m]
        ledger[4 * count + m] = ledger_rates[s - 1, m]
        # The smaller side adds to both sums, the rest to one of them: the net amount stays exact.
        if r0 * r1 < 0.0:
            part = smaller_side(total, r0, r1, m, ledger_rates, dense)
        up, down = part + max(total, 0.0), part - min(total, 0.0)
        if h * (down if side == 0 else up) <= threshold:
            add(ledger, m, side, h * total)
        else:
            add(ledger, m, 0, h * up)
            add(ledger, m, 1, -h * down)

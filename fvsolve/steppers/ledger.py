"""What came in and what went out, each a sum of its own, by the step's own weights. Knows rates; knows no names.

ledger : float64[5 m]  of m rates: sums of what was above zero [0:m] and below it [m:2m], their carries [2m:4m], and the
rates at the last stage of the step before [4m:5m].
A step in which a rate changes sign counts on both sides: it is divided where its dense output turns, which for the
amounts is what it is for states.
"""

from fvsolve.jit import njit
from fvsolve.steppers.step import add_up

SUMS = 5
NOISE = 1e-12  # of all that a rate has brought: what a step has less of on one side is rounding
STRAY = 1e-6  # of the other side, where neither end of a step has any: a negative weight, or what Newton left
NEAR = 1e-5  # share of a step within which its turn is found; the amount feels the square of that
TURNS = 40
SHARE = 0.03  # of the tolerance of a step, in all that has passed: the sum over steps is then within it
LEAST = 1e-3  # amount that counts as none [kg]


@njit(forceinline=True)
def weight(theta, dense, j):
    """(weight, its slope) of stage j in the dense output at theta: sum of dense[j, m] theta^(m + 1)."""
    w, slope = 0.0, 0.0
    for m in range(dense.shape[1] - 1, -1, -1):
        w, slope = (w + dense[j, m]) * theta, slope * theta + (m + 1) * dense[j, m]
    return w, slope


@njit
def brought(theta, whole, r0, r1, m, supply, dense):
    """(amount of rate m up to theta, rate there) over h: by the method's polynomial, else the cubic through both ends.

    whole : amount of the step over h; r0, r1 : rates at its ends
    """
    if dense.shape[0] == 0:
        s, r = theta, 1.0 - theta
        amount = s * s * (1.0 + 2.0 * r) * whole + s * r * (r * r0 - s * r1)
        return amount, 6.0 * s * r * whole + r * (1.0 - 3.0 * s) * r0 - s * (2.0 - 3.0 * s) * r1
    amount, rate = 0.0, 0.0
    for j in range(dense.shape[0]):
        w, slope = weight(theta, dense, j)
        amount += w * supply[j, m]
        rate += slope * supply[j, m]
    return amount, rate


@njit
def lesser(whole, r0, r1, m, supply, dense):
    """Size of what a step whose rate m goes from r0 to r1, of other sign, has on the side where it has less, over h."""
    low, high = 0.0, 1.0
    at_low, at_high = brought(0.0, whole, r0, r1, m, supply, dense)[1], brought(1.0, whole, r0, r1, m, supply, dense)[1]
    if at_low * at_high >= 0.0:
        return 0.0
    for _ in range(TURNS):
        middle = high - at_high * (high - low) / (at_high - at_low)
        rate, before = brought(middle, whole, r0, r1, m, supply, dense)[1], high
        if rate * at_high < 0.0:
            low, at_low = high, at_high
        else:
            at_low *= 0.5
        high, at_high = middle, rate
        if abs(high - before) <= NEAR or abs(high - low) <= NEAR:
            break
    first = brought(high, whole, r0, r1, m, supply, dense)[0]
    return max(0.0, min(abs(first), abs(whole - first)))


@njit
def book_error(h, error, k, stored, supply, tolerance, ledger):
    """Greatest error of a step's amounts over the tolerance of all that has passed.

    What goes into states that store it errs as they do, and their errors are judged already: what passes them by, or
    comes where they are held, is not. stored : int64[q]  where those are in k : float64[s, n]
    """
    s, count = supply.shape
    worst, passed, judged = 0.0, LEAST, 0.0
    for i in stored:
        judged += abs(combined(error, k, i))
    for m in range(count):
        moved = 0.0
        for i in range(s):
            moved = max(moved, abs(supply[i, m]))
        worst = max(worst, abs(combined(error, supply, m)))
        passed += ledger[m] - ledger[count + m] + h * moved
    return h * max(0.0, worst - judged) / (SHARE * tolerance * passed)


@njit(forceinline=True)
def combined(weights, rates, m):
    """Sum of weights[i] rates[i, m]."""
    total = 0.0
    for i in range(weights.size):
        total += weights[i] * rates[i, m]
    return total


@njit(forceinline=True)
def add(ledger, m, at, part):
    """Add to sum `at` of rate m."""
    count = ledger.size // SUMS
    ledger[at * count + m], ledger[(2 + at) * count + m] = add_up(ledger[at * count + m], part,
                                                                  ledger[(2 + at) * count + m])  # fmt: skip


@njit
def book(h, b, supply, dense, steep, known, end, ledger):
    """Add a step of length h to the ledger; only once its end is known to be sound.

    end : rates at its end; steep : those of the last stage count there, and `known` those at its start, for rates
    magnify what Newton left
    """
    s, count = supply.shape
    for m in range(count):
        whole = combined(b, supply, m)
        r0, r1, part, gross = supply[0, m], end[m], 0.0, ledger[m] - ledger[count + m]
        side, trace, toward = 0 if whole > 0.0 else 1, NOISE * gross, r0 + r1
        if toward == 0.0:
            toward = ledger[m] + ledger[count + m]
        if r0 * r1 >= 0.0 and toward != 0.0:
            side = 0 if toward > 0.0 else 1
            trace = max(trace, STRAY * abs(ledger[side * count + m]))
        if steep:
            r0, r1 = ledger[4 * count + m] if known else r0, supply[s - 1, m]
        ledger[4 * count + m] = supply[s - 1, m]
        if r0 * r1 < 0.0:
            part = lesser(whole, r0, r1, m, supply, dense)
        up, down = part + max(whole, 0.0), part - min(whole, 0.0)
        if h * (down if side == 0 else up) <= trace:
            add(ledger, m, side, h * whole)
        else:
            add(ledger, m, 0, h * up)
            add(ledger, m, 1, -h * down)

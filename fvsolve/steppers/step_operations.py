"""Operations common to steps of all kinds: stage sums, error norm, dense output, compensated sums."""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.stage_sums import BAD, BASINS, HEAD, HUGE, OTHERS, combine, copy, count_not_finite

__all__ = ["HUGE", "combine", "copy"]

# Columns of `row_blocks`, int64[q, 4], the states of a band: first, one beyond the last, number of the first partial
# sum, number of partial sums. Errors are summed by rows, and the rows are added in the order of their numbers, so that
# the result does not depend on the bands.
BEGIN, STOP, FIRST, SUMS = range(4)


@njit(forceinline=True)
def error_scale(scale, y):
    """Reference size of the error of a state with value y: scale + |y|, or -scale for a negative scale."""
    return scale + abs(y) if scale >= 0.0 else -scale


@njit
def squares(begin, end, h, error, k, y, y_new, scale, tolerance):
    """Sum of the squared errors of the states from `begin` to `end` - 1, in units of the tolerance.

    The error of a state is h sum e_j k_j with the weights e_j in `error`, the rates k_j of the stages and the step h.
    Its
    unit is `tolerance` times `error_scale` at the greater of |y| and |y_new|, the sizes at the start and the end.
    scale : see `error_scale`
    """
    first, last = 0, error.size
    while last > 0 and error[last - 1] == 0.0:
        last -= 1
    while first < last and error[first] == 0.0:
        first += 1
    total = 0.0
    for i in range(begin, end):
        e = 0.0
        for j in range(first, last):
            e += error[j] * k[j, i]
        w = h * e / (tolerance * error_scale(scale[i], max(abs(y[i]), abs(y_new[i]))))
        total += w * w
    return total


@njit
def error_norm(h, error, k, y, y_new, scale, tolerance):
    """Root mean square of the errors of all states in units of the tolerance; arguments as for `squares`."""
    return sqrt(squares(0, y.size, h, error, k, y, y_new, scale, tolerance) / max(y.size, 1))


@njit
def error_of_bands(join, handle, row_blocks, sums, h, error, k, y, y_new, scale, tolerance):
    """Result of `error_norm` over the states of all bands, which exchange the partial sums of their rows in `sums`.

    A band is a part of the states, which one thread or process steps.
    join : function that exchanges `sums`; row_blocks : int64[q, 4]  states of this band and their partial sums
    h, error, k, y, y_new, scale, tolerance : as for `squares`
    """
    for m in range(row_blocks.shape[0]):
        begin, count = row_blocks[m, BEGIN], row_blocks[m, SUMS]
        length = (row_blocks[m, STOP] - begin) // count
        for r in range(count):
            at = begin + r * length
            sums[row_blocks[m, FIRST] + r] = squares(at, at + length, h, error, k, y, y_new, scale, tolerance)
    join(sums, row_blocks, handle)
    total = 0.0
    for r in range(sums.size):
        total += sums[r]
    return sqrt(total / max(y.size, 1))


@njit(forceinline=True)
def weight(theta, dense, j):
    """Weight of stage j in the dense output at the fraction theta of a step: sum of dense[j, m] theta^(m + 1)."""
    w = 0.0
    for m in range(dense.shape[1] - 1, -1, -1):
        w = (w + dense[j, m]) * theta
    return w


@njit
def start_slope_defect(begin, end, start_slope, k, slope, known, out):
    """Write the slope of the solution at the start of a step, minus that of its collocation polynomial there, to `out`.

    begin, end : range of states; start_slope : result of `start_slope_correction`; k : rates at the stages
    known : True if `slope`, the slope of the last stage of the previous step, is available. Otherwise the slope is the
    rate f, and `out` is 0 for states where the difference exceeds that between the first and last stages (a stiff f)
    """
    s = k.shape[0]
    for i in range(begin, end):
        defect = slope[i] if known else k[0, i]
        for j in range(1, s):
            defect -= start_slope[j - 1] * k[j, i]
        out[i] = defect if known or abs(defect) <= abs(k[s - 1, i] - k[1, i]) else 0.0


@njit
def interpolate(begin, end, theta, h, y, f, y_new, f_new, k, dense, start_slope, out):
    """Write the state at t + theta h within a step to `out`, for the states from `begin` to `end` - 1 (dense output).

    It is the method's own polynomial with f in place of k[0], or the Hermite cubic with values y, y_new and slopes
    f, f_new at both ends.
    k : rates at the stages; dense : coefficients of the dense output, empty for the cubic
    start_slope : result of `start_slope_correction`; if it is not empty, f is the result of `start_slope_defect`
    """
    if dense.shape[0] > 0:
        w = h * weight(theta, dense, 0)
        for i in range(begin, end):
            out[i] = y[i] + w * f[i]
        j = 1
        while j < dense.shape[0]:
            if j + 1 < dense.shape[0]:
                a, b, ka, kb = h * weight(theta, dense, j), h * weight(theta, dense, j + 1), k[j], k[j + 1]
                for i in range(begin, end):
                    out[i] += a * ka[i] + b * kb[i]
            else:
                w, ka = h * weight(theta, dense, j), k[j]
                for i in range(begin, end):
                    out[i] += w * ka[i]
            j += 2
        if start_slope.size > 0:
            w, terms = 0.0, dense.shape[1] + 1
            for m in range(terms):
                w = (w + start_slope[start_slope.size - 1 - m]) * theta
            for i in range(begin, end):
                out[i] += h * w * f[i]
        return
    s, r = theta, 1.0 - theta
    h01, h10, h11 = s * s * (1.0 + 2.0 * r), h * s * r * r, -h * s * s * r
    for i in range(begin, end):  # in differences, so that a constant state stays constant to the bit
        out[i] = y[i] + (h01 * (y_new[i] - y[i]) + (h10 * f[i] + h11 * f_new[i]))


@njit
def all_finite(join, handle, row_blocks, sums, y, stage_sums, checked):
    """True if the states y of all bands are finite and below 1e100.

    A band is a part of the states, which one thread or process steps.
    sums : partial sums that bands exchange; a single entry means a single band
    stage_sums : array `sums` of `kernels.stage_sums`
    checked : True if the rhs has already counted the invalid values of the stages that it formed
    """
    bad = 0
    if checked:
        bad, first = stage_sums[BAD], HEAD + stage_sums[BASINS]
        for r in range(stage_sums[OTHERS]):
            bad += count_not_finite(stage_sums[first + 2 * r], stage_sums[first + 2 * r + 1], y)
    elif sums.size == 1:
        bad = count_not_finite(0, y.size, y)
    else:
        for m in range(row_blocks.shape[0]):
            bad += count_not_finite(row_blocks[m, BEGIN], row_blocks[m, STOP], y)
    return sum_of_bands(bad, join, handle, row_blocks, sums) == 0.0


@njit(forceinline=True)
def sum_of_bands(own, join, handle, row_blocks, sums):
    """Sum of the number `own` of this band and the numbers of the other bands; sums : array that bands exchange.

    A band is a part of the states, which one thread or process steps.
    """
    if sums.size == 1:
        return float(own)
    for m in range(row_blocks.shape[0]):
        for r in range(row_blocks[m, FIRST], row_blocks[m, FIRST] + row_blocks[m, SUMS]):
            sums[r] = 0.0
    sums[row_blocks[row_blocks.shape[0] - 1, FIRST]] = own  # of rows of this band, or of states common to all bands
    join(sums, row_blocks, handle)
    total = 0.0
    for r in range(sums.size):
        total += sums[r]
    return total


@njit
def exceeded(join, handle, row_blocks, sums, y, largest):
    """True if the size of a state of any band exceeds its entry in `largest` or is not a number.

    A band is a part of the states, which one thread or process steps; other arguments as for `sum_of_bands`.
    """
    beyond = 0
    for m in range(row_blocks.shape[0]):
        for i in range(row_blocks[m, BEGIN], row_blocks[m, STOP]):
            beyond += not abs(y[i]) <= largest[i]
    return sum_of_bands(beyond, join, handle, row_blocks, sums) > 0.0


@njit(forceinline=True)
def add_up(total, part, carry):
    """(total + part + carry, new rounding error) with the rounding error `carry` of the previous sum (Kahan 1965)."""
    corrected = part + carry
    new = total + corrected
    return new, corrected - (new - total)


@njit(forceinline=True)
def add_stored(h, b, k, y, y_new, stored, carry):
    """Recompute the states `stored` (masses) with compensated sums, so that rounding does not accumulate over steps.

    h : step; b, k : weights and rates of the stages; stored : numbers of these states
    carry : rounding errors of the previous sums. Returns True if this changed a bit of y_new.
    """
    changed = False
    for q in range(stored.size):
        i, total = stored[q], 0.0
        for j in range(b.size):
            total += b[j] * k[j, i]
        new = add_up(y[i], h * total, carry[q])[0]
        changed = changed or new != y_new[i]
        y_new[i] = new
    return changed


@njit
def update_carry(h, b, k, y, stored, carry):
    """Store the rounding errors of `add_stored` in `carry`, for an accepted step."""
    for q in range(stored.size):
        i, total = stored[q], 0.0
        for j in range(b.size):
            total += b[j] * k[j, i]
        carry[q] = add_up(y[i], h * total, carry[q])[1]

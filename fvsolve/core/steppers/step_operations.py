"""Operations common to steps of all kinds: stage sums, error norm, dense output, compensated sums."""

from math import sqrt

from fvsolve.core.kernels.stage_sums import (
    BAD,
    BASINS,
    HEAD,
    OTHERS,
    combine,
    copy,
    count_not_finite,
)
from fvsolve.core.steppers.coefficients import error_of, weights_of
from fvsolve.core.steppers.run_handle import BANDS, call_join
from fvsolve.jit import njit

__all__ = ["combine", "copy"]

# Columns of `row_blocks`, int64[q, 5], the states of a band: first, one beyond the last, number of the first partial
# sum, number of partial sums, number of states of each (the last may have fewer). Errors are summed by rows, and the
# rows are added in the order of their numbers, so that the result does not depend on the bands.
BEGIN, STOP, FIRST, SUMS, LENGTH = range(5)


@njit(forceinline=True)
def error_scale(scale, y):
    """Reference size of the error of a state with value y: scale + |y|, or -scale for a negative scale."""
    return scale + abs(y) if scale >= 0.0 else -scale


@njit
def squares(begin, end, h, error, k, y, y_new, scale, tolerance):
    """Sum of the squared errors of the states from `begin` to `end` - 1, in units of the tolerance.

    The error of a state is h sum e_j k_j with the weights e_j in `error`, the rates k_j of the stages and the step h.
    Its unit is `tolerance` times `error_scale` at the greater of |y| and |y_new|, the sizes at the start and the end.
    scale : see `error_scale`
    """
    # Weights of zero at both ends are common, and each would cost a product for every state.
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
def error_norm(r, h, now, new):
    """Root mean square of the errors of all states of a step of length h in units of the tolerance.

    r : open handle of the run; now, new : rows of y at the start and the end of the step
    """
    y, error = r.y[now], error_of(r.coefficients, r.k.shape[0])
    return sqrt(
        squares(0, y.size, h, error, r.k, y, r.y[new], r.scale, r.control[0]["size"])
        / max(y.size, 1)
    )


@njit
def error_of_bands(handle, r, h, now, new):
    """Result of `error_norm` over the states of all bands, which exchange the partial sums of their rows.

    A band is a part of the states, which one thread or process steps.
    handle : handle of the model; other arguments as for `error_norm`
    """
    error = error_of(r.coefficients, r.k.shape[0])
    k = r.k
    y = r.y[now]
    y_new = r.y[new]
    scale = r.scale
    row_blocks = r.row_blocks
    sums = r.sums
    tolerance = r.control[0]["size"]
    for m in range(row_blocks.shape[0]):
        begin = row_blocks[m, BEGIN]
        stop = row_blocks[m, STOP]
        length = row_blocks[m, LENGTH]
        for row in range(row_blocks[m, SUMS]):
            at, end = begin + row * length, min(begin + (row + 1) * length, stop)
            sums[row_blocks[m, FIRST] + row] = squares(
                at, end, h, error, k, y, y_new, scale, tolerance
            )
    call_join(r.calls[BANDS], sums, row_blocks, handle)
    total = 0.0
    for row in range(sums.size):
        total += sums[row]
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
        # Two stages in each pass over memory.
        while j < dense.shape[0]:
            if j + 1 < dense.shape[0]:
                a = h * weight(theta, dense, j)
                b = h * weight(theta, dense, j + 1)
                ka = k[j]
                kb = k[j + 1]
                for i in range(begin, end):
                    out[i] += a * ka[i] + b * kb[i]
            else:
                w, ka = h * weight(theta, dense, j), k[j]
                for i in range(begin, end):
                    out[i] += w * ka[i]
            j += 2
        if start_slope.size > 0:
            # Correction h psi(theta) (f - p'(0)), see `start_slope_correction`.
            w, terms = 0.0, dense.shape[1] + 1
            for m in range(terms):
                w = (w + start_slope[start_slope.size - 1 - m]) * theta
            for i in range(begin, end):
                out[i] += h * w * f[i]
        return
    s, r = theta, 1.0 - theta
    # Hermite cubic: weights of y_new - y, of f and of f_new.
    h01 = s * s * (1.0 + 2.0 * r)
    h10 = h * s * r * r
    h11 = -h * s * s * r
    # in differences, so that a constant state stays constant to the bit
    for i in range(begin, end):
        out[i] = y[i] + (h01 * (y_new[i] - y[i]) + (h10 * f[i] + h11 * f_new[i]))


@njit
def interpolate_slope(theta, h, y, f, y_new, f_new, k, dense, start_slope, out):
    """Write the derivative of the dense output at t + theta h to `out` : float64[n]; arguments as for `interpolate`."""
    if dense.shape[0] == 0:
        r = 1.0 - theta
        per = 6.0 * theta * r / h
        h10 = r * (1.0 - 3.0 * theta)
        h11 = theta * (3.0 * theta - 2.0)
        for i in range(out.size):
            out[i] = per * (y_new[i] - y[i]) + h10 * f[i] + h11 * f_new[i]
        return
    for i in range(out.size):
        out[i] = 0.0
    for j in range(dense.shape[0]):
        # Derivative of the sum of dense[j, m] theta^(m + 1).
        w = 0.0
        for m in range(dense.shape[1] - 1, -1, -1):
            w = w * theta + (m + 1) * dense[j, m]
        slope = f if j == 0 else k[j]
        for i in range(out.size):
            out[i] += w * slope[i]
    if start_slope.size > 0:
        w, terms = 0.0, dense.shape[1] + 1
        for m in range(terms):
            w = w * theta + (terms - m) * start_slope[start_slope.size - 1 - m]
        for i in range(out.size):
            out[i] += w * f[i]


@njit
def all_finite(handle, r, y, checked, bad=0):
    """True if the states y of all bands are finite and below 1e100.

    A band is a part of the states, which one thread or process steps. A single partial sum means a single band.
    handle, r : handle of the model, open handle of the run
    checked : True if the rhs has already counted the invalid values of the stages that it formed
    bad : number of faults found before in this band
    """
    stage_sums, row_blocks = r.structure, r.row_blocks
    if checked:
        bad, first = bad + stage_sums[BAD], HEAD + stage_sums[BASINS]
        for m in range(stage_sums[OTHERS]):
            bad += count_not_finite(stage_sums[first + 2 * m], stage_sums[first + 2 * m + 1], y)
    elif r.sums.size == 1:
        bad += count_not_finite(0, y.size, y)
    else:
        for m in range(row_blocks.shape[0]):
            bad += count_not_finite(row_blocks[m, BEGIN], row_blocks[m, STOP], y)
    return sum_of_bands(bad, handle, r) == 0.0


@njit(forceinline=True)
def sum_of_bands(own, handle, r):
    """Sum of the number `own` of this band and the numbers of the other bands; arguments as for `all_finite`."""
    sums, row_blocks = r.sums, r.row_blocks
    if sums.size == 1:
        return float(own)
    for m in range(row_blocks.shape[0]):
        for row in range(row_blocks[m, FIRST], row_blocks[m, FIRST] + row_blocks[m, SUMS]):
            sums[row] = 0.0
    # of rows of this band, or of states common to all bands
    sums[row_blocks[row_blocks.shape[0] - 1, FIRST]] = own
    call_join(r.calls[BANDS], sums, row_blocks, handle)
    total = 0.0
    for row in range(sums.size):
        total += sums[row]
    return total


@njit
def exceeded(handle, r, y):
    """True if the size of a state of any band exceeds its entry in `largest` or is not a number.

    Arguments as for `all_finite`.
    """
    beyond, row_blocks = 0, r.row_blocks
    for m in range(row_blocks.shape[0]):
        own = y[row_blocks[m, BEGIN] : row_blocks[m, STOP]]
        largest = r.largest[row_blocks[m, BEGIN] :]
        for i in range(own.size):
            beyond += not abs(own[i]) <= largest[i]
    return sum_of_bands(beyond, handle, r) > 0.0


@njit(forceinline=True)
def add_up(total, part, carry):
    """(total + part + carry, new rounding error) with the rounding error `carry` of the previous sum (Kahan 1965)."""
    corrected = part + carry
    new = total + corrected
    return new, corrected - (new - total)


@njit(forceinline=True)
def stored_sum(r, h, b, y, q):
    """Sum of the state number stored[q] at the start of a step and its change, and new rounding error, by `add_up`.

    h : step; b : weights of the stages; y : state at the start of the step
    """
    i = r.stored[q]
    k = r.k
    total = 0.0
    for j in range(b.size):
        total += b[j] * k[j, i]
    # The change is summed before it is added: it is small against the mass.
    return add_up(y[i], h * total, r.carry[q])


@njit(forceinline=True)
def add_stored(r, h, now, new):
    """Recompute the states `stored` (masses) with compensated sums, so that rounding does not accumulate over steps.

    h : step; now, new : rows of y at its start and its end. Returns True if this changed a bit of the new state.
    """
    changed = False
    b = weights_of(r.coefficients, r.k.shape[0])
    y_new = r.y[new]
    stored = r.stored
    for q in range(stored.size):
        total = stored_sum(r, h, b, r.y[now], q)[0]
        changed = changed or total != y_new[stored[q]]
        y_new[stored[q]] = total
    return changed


@njit
def update_carry(r, h, now):
    """Store the rounding errors of `add_stored` in `carry`, for an accepted step from row `now` of y."""
    b, carry = weights_of(r.coefficients, r.k.shape[0]), r.carry
    for q in range(carry.size):
        carry[q] = stored_sum(r, h, b, r.y[now], q)[1]

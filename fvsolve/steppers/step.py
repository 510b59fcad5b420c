"""What steps of every kind share: sums, error norm, dense output. Knows arrays; controls nothing."""

from math import sqrt

from fvsolve.jit import njit
from fvsolve.kernels.sums import BAD, BASINS, HEAD, HUGE, OTHERS, combine, copy, endless

__all__ = ["HUGE", "combine", "copy"]

# Columns of `spans`, int64[q, 4], the states that a band steps: from where to where, the number of the first sum, and
# how many there are: errors are summed by rows, and these added in the order of their numbers, whatever the bands are.
BEGIN, STOP, FIRST, SUMS = range(4)


@njit(forceinline=True)
def small(scale, y):
    """What errors of a state are measured against: scale + |y|; a scale below zero is meant whatever y is."""
    return scale + abs(y) if scale >= 0.0 else -scale


@njit
def squares(begin, end, h, error, k, y, y_new, scale, tolerance):
    """Sum over [begin:end] of (h sum e_j k_j over tolerance times `small` of the greater of y and y_new)^2."""
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
        w = h * e / (tolerance * small(scale[i], max(abs(y[i]), abs(y_new[i]))))
        total += w * w
    return total


@njit
def error_norm(h, error, k, y, y_new, scale, tolerance):
    """Root mean square of h sum e_j k_j over tolerance times `small` of the greater of y and y_new."""
    return sqrt(squares(0, y.size, h, error, k, y, y_new, scale, tolerance) / max(y.size, 1))


@njit
def error_of_bands(join, handle, row_blocks, sums, h, error, k, y, y_new, scale, tolerance):
    """The same by rows, which bands tell each other; sums : room for these."""
    for m in range(row_blocks.shape[0]):
        begin, many = row_blocks[m, BEGIN], row_blocks[m, SUMS]
        long = (row_blocks[m, STOP] - begin) // many
        for r in range(many):
            at = begin + r * long
            sums[row_blocks[m, FIRST] + r] = squares(at, at + long, h, error, k, y, y_new, scale, tolerance)
    join(sums, row_blocks, handle)
    total = 0.0
    for r in range(sums.size):
        total += sums[r]
    return sqrt(total / max(y.size, 1))


@njit(forceinline=True)
def weight(theta, dense, j):
    """Of stage j in the dense output at theta: sum of dense[j, m] theta^(m + 1)."""
    w = 0.0
    for m in range(dense.shape[1] - 1, -1, -1):
        w = (w + dense[j, m]) * theta
    return w


@njit
def bend_at_start(begin, end, bend, k, slope, known, out):
    """out: by how much the slope at the start of a step differs from that of its polynomial.

    Where the last stage of a step before is not known, f there, unless it differs by more than the stages do: stiff.
    """
    s = k.shape[0]
    for i in range(begin, end):
        found = slope[i] if known else k[0, i]
        for j in range(1, s):
            found -= bend[j - 1] * k[j, i]
        out[i] = found if known or abs(found) <= abs(k[s - 1, i] - k[1, i]) else 0.0


@njit
def interpolate(begin, end, theta, h, y, f, y_new, f_new, k, dense, bend, out):
    """Dense output at t + theta h, of [begin:end]: the method's own polynomial, else the cubic through both ends.

    bend : see `coefficients.bent`; then f is what `bend_at_start` found
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
        if bend.size > 0:
            w, many = 0.0, dense.shape[1] + 1
            for m in range(many):
                w = (w + bend[bend.size - 1 - m]) * theta
            for i in range(begin, end):
                out[i] += h * w * f[i]
        return
    s, r = theta, 1.0 - theta
    h01, h10, h11 = s * s * (1.0 + 2.0 * r), h * s * r * r, -h * s * s * r
    for i in range(begin, end):  # by differences: what stands still does to the last bit
        out[i] = y[i] + (h01 * (y_new[i] - y[i]) + (h10 * f[i] + h11 * f_new[i]))


@njit
def all_finite(join, handle, row_blocks, sums, y, formed, looked):
    """Whether all values of all bands are, and their squares; sums : room for what bands tell each other.

    A single sum is that of one band, of all. formed : see `kernels.sums`; looked : whether who found rates has looked
    """
    bad = 0
    if looked:
        bad, first = formed[BAD], HEAD + formed[BASINS]
        for r in range(formed[OTHERS]):
            bad += endless(formed[first + 2 * r], formed[first + 2 * r + 1], y)
    elif sums.size == 1:
        bad = endless(0, y.size, y)
    else:
        for m in range(row_blocks.shape[0]):
            bad += endless(row_blocks[m, BEGIN], row_blocks[m, STOP], y)
    return sum_of_bands(bad, join, handle, row_blocks, sums) == 0.0


@njit(forceinline=True)
def sum_of_bands(own, join, handle, row_blocks, sums):
    """Sum over all bands of a number that each has; sums : room for what bands tell each other."""
    if sums.size == 1:
        return float(own)
    for m in range(row_blocks.shape[0]):
        for r in range(row_blocks[m, FIRST], row_blocks[m, FIRST] + row_blocks[m, SUMS]):
            sums[r] = 0.0
    sums[row_blocks[row_blocks.shape[0] - 1, FIRST]] = own  # of rows of this band, or of what all have
    join(sums, row_blocks, handle)
    total = 0.0
    for r in range(sums.size):
        total += sums[r]
    return total


@njit
def exceeded(join, handle, row_blocks, sums, y, largest):
    """True if a state of any band is beyond its largest, or not a number."""
    beyond = 0
    for m in range(row_blocks.shape[0]):
        for i in range(row_blocks[m, BEGIN], row_blocks[m, STOP]):
            beyond += not abs(y[i]) <= largest[i]
    return sum_of_bands(beyond, join, handle, row_blocks, sums) > 0.0


@njit(forceinline=True)
def add_up(total, part, carry):
    """(total + part, what rounding took off), with what it took off before put back in (Kahan 1965)."""
    whole = part + carry
    new = total + whole
    return new, whole - (new - total)


@njit(forceinline=True)
def add_stored(h, b, k, y, y_new, stored, carry):
    """Stored masses once more, summed so that a million steps round as one; True where that changed a bit."""
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
def keep_carry(h, b, k, y, stored, carry):
    """What rounding took off in that sum, once the step is taken."""
    for q in range(stored.size):
        i, total = stored[q], 0.0
        for j in range(b.size):
            total += b[j] * k[j, i]
        carry[q] = add_up(y[i], h * total, carry[q])[1]

"""Sums of stages, computed for a block of rows together with its rates, while both lie in the cache.

The function that computes the rates of a large basin also forms their stage y + h sum a_j k_j just before, and the end
of the step just after. y is the state, h the step, a_j and k_j are weights and rates of stages. So each array passes
through memory once for each stage. `sums` of a handle describes the sums; steps write there before they call for rates
(`steppers.erk`). Values equal those of sums over all rows, to the bit.
"""

from fvsolve.core.kernels.band_exchange import address_of
from fvsolve.core.kernels.table_handle import floats_at
from fvsolve.jit import njit

HUGE = 1e100  # greater values count as not finite
# Entries of `sums`, int64, empty if no sums are formed in blocks: mode; number of values that are not finite; addresses
# of the present state, of the sum, of the rates of stages and of their weights; number of states, of earlier stages and
# of all stages; step size, a float; address of the weights at the end of the step; numbers of runs that the step itself
# forms: states in no such basin, cells that all bands read, rows at the edges of bands; number of basins; cells of a
# block. From HEAD on 1 for each basin whose rows are formed in blocks, else 0; then the runs, first and last + 1.
(
    MODE,
    BAD,
    NOW,
    TO,
    RATES,
    WEIGHTS,
    SIZE,
    COUNT,
    STAGES,
    STEP,
    LAST,
    OTHERS,
    CHECKED,
    EDGES,
    BASINS,
    CELLS,
) = range(16)
HEAD = 16
# MODE: nothing; check that all is finite; form the stage before rates; and the end after them
OFF, CHECK, STAGE, STAGE_AND_END = range(4)


@njit(forceinline=True)
def copy(source, target):
    """Copy `source` into `target` by a plain loop: slice assignment of numba checks for overlaps first."""
    for i in range(target.size):
        target[i] = source[i]


@njit
def combine(begin, end, y, h, weights, count, k, out):
    """Write y + h sum over j < count of weights[j] k[j] to `out`, for the states begin .. end - 1.

    y : float64[n]  state; h : step; weights, k : weights and rates of stages, float64[stages, n]
    Three terms are added in a pass where possible.
    """
    first, second, copied = -1, -1, False
    y, out = y[begin:end], out[begin:end]
    base = y
    for j in range(count):
        # Many weights of a tableau are zero; each skipped term saves a pass over memory.
        if weights[j] == 0.0:
            continue
        if first < 0:
            first = j
        elif second < 0:
            second = j
        else:
            c0 = h * weights[first]
            c1 = h * weights[second]
            c2 = h * weights[j]
            k0 = k[first, begin:end]
            k1 = k[second, begin:end]
            k2 = k[j, begin:end]
            for i in range(out.size):
                out[i] = base[i] + (c0 * k0[i] + c1 * k1[i] + c2 * k2[i])
            base = out
            copied = True
            first = -1
            second = -1
    if second >= 0:
        c0 = h * weights[first]
        c1 = h * weights[second]
        k0 = k[first, begin:end]
        k1 = k[second, begin:end]
        for i in range(out.size):
            out[i] = base[i] + (c0 * k0[i] + c1 * k1[i])
    elif first >= 0:
        c0, k0 = h * weights[first], k[first, begin:end]
        for i in range(out.size):
            out[i] = base[i] + c0 * k0[i]
    elif not copied:
        # All weights are zero, so the sum is the state itself.
        copy(y, out)


@njit(forceinline=True)
def count_not_finite(begin, end, y):
    """Number of values y[begin:end] that are NaN, or not below 1e100 in size."""
    bad = 0
    for i in range(begin, end):
        bad += not abs(y[i]) < HUGE
    return bad


@njit
def request_sums(sums, mode, y, h, weights, count, k, to, last):
    """Request the sum y + h sum of weights[j] k[j], written to `to`, from the function that computes the next rates.

    sums : int64 array that describes the request; mode : CHECK, STAGE or STAGE_AND_END
    y, h : state and step; weights, count, k : weights and number of earlier stages, and their rates
    last : weights of all stages at the end of the step
    """
    sums[MODE], sums[NOW], sums[TO], sums[RATES] = (
        mode,
        address_of(y),
        address_of(to),
        address_of(k),
    )
    sums[WEIGHTS], sums[LAST] = address_of(weights), address_of(last)
    sums[SIZE], sums[COUNT], sums[STAGES] = y.size, count, k.shape[0]
    # The step is a float in an array of integers, so it is written through its address.
    floats_at(address_of(sums) + 8 * STEP, 1)[0] = h


@njit
def sum_runs(sums, first, last, y, h, weights, count, k, to):
    """Form the requested sums for runs number `first` to `last` - 1, which no rate function forms in time.

    A run is a range of states, listed in `sums`; y, h, weights, count, k, to : see `request_sums`
    """
    at = HEAD + sums[BASINS]
    for r in range(first, last):
        combine(sums[at + 2 * r], sums[at + 2 * r + 1], y, h, weights, count, k, to)


@njit(forceinline=True)
def requested_mode(tables, b):
    """Mode of the stage sums requested for basin b (see `request_sums`): OFF, CHECK, STAGE or STAGE_AND_END."""
    if tables.sums.size == 0 or tables.sums[HEAD + b] == 0:
        return OFF
    return tables.sums[MODE]


@njit
def form_rows(sums, behind, at, width, begin, stop, left, right):
    """Form the requested sums for cells of a basin: columns left .. right - 1 of rows begin .. stop - 1.

    sums : array that describes the request, see `request_sums`
    behind : True for the end of the step instead of the stage
    at, width : offset of the quantity in the state, and number of cells in a row
    """
    size, stages = sums[SIZE], sums[STAGES]
    y = floats_at(sums[NOW], size)
    to = floats_at(sums[TO], size)
    h = floats_at(address_of(sums) + 8 * STEP, 1)[0]
    k = floats_at(sums[RATES], stages * size).reshape((stages, size))
    weights = floats_at(sums[LAST if behind else WEIGHTS], stages)
    count = stages if behind else sums[COUNT]
    # Whole rows follow each other in memory: a single long loop.
    if left == 0 and right == width:
        combine(at + width * begin, at + width * stop, y, h, weights, count, k, to)
        return
    for j in range(begin, stop):
        combine(at + width * j + left, at + width * j + right, y, h, weights, count, k, to)


@njit
def check_rows(sums, y, at, width, begin, stop, left, right):
    """Count the values of y that are not finite, in columns left .. right - 1 of rows begin .. stop - 1 of a basin.

    at, width : offset of the quantity in the state, and number of cells in a row. The count is added to sums[BAD].
    """
    if left == 0 and right == width:
        sums[BAD] += count_not_finite(at + width * begin, at + width * stop, y)
        return
    for j in range(begin, stop):
        sums[BAD] += count_not_finite(at + width * j + left, at + width * j + right, y)


@njit
def form_checked_runs(sums):
    """Form the stage again in cells that all bands read, where the end of the step has replaced it.

    A band is a part of the states, which one thread or process steps. sums : see `request_sums`
    """
    size, stages = sums[SIZE], sums[STAGES]
    y = floats_at(sums[NOW], size)
    to = floats_at(sums[TO], size)
    h = floats_at(address_of(sums) + 8 * STEP, 1)[0]
    k = floats_at(sums[RATES], stages * size).reshape((stages, size))
    weights = floats_at(sums[WEIGHTS], stages)
    sum_runs(sums, sums[OTHERS], sums[OTHERS] + sums[CHECKED], y, h, weights, sums[COUNT], k, to)

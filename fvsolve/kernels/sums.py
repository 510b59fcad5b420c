"""Sums of stages, those of a block of rows beside its rates, while both lie in cache. Knows addresses; knows no law.

A stage y + h sum a_j k_j of a large basin is formed by whoever finds its rates, just ahead of them, and the end of the
step just behind: so each array passes the memory once a stage. `sums` of a handle says what is to be formed; steps
write there before they ask for rates (`steppers.erk`). Values are those of sums over all rows, to the bit.
"""

from fvsolve.jit import njit
from fvsolve.kernels.joint import address_of, floats_at

HUGE = 1e100  # values beyond it count as not finite
# Places in `sums`, int64, empty where nothing is formed so: what is asked for; values found that are not finite; where
# the present state, what is formed, rates of stages and their weights lie; how many states, stages before this one and
# stages; the step's length, a float; weights at the end; of the runs that steps form themselves how many there are of
# states that nobody else forms, of cells that all look at, and of rows at the edges of bands; how many basins; how many
# cells a block has. From HEAD on 1 for each basin whose rows are formed so, 0 for others; behind them the runs, first
# and one beyond the last.
MODE, BAD, NOW, TO, RATES, WEIGHTS, SIZE, COUNT, STAGES, STEP, LAST, OTHERS, LOOKED, EDGES, BASINS, CELLS = range(16)
HEAD = 16
OFF, LOOK, AHEAD, BOTH = range(4)  # MODE: nothing; whether all is finite; the stage ahead; and the end behind


@njit(forceinline=True)
def copy(source, target):
    """target = source, by a plain loop: numba's slice assignment looks for overlaps first."""
    for i in range(target.size):
        target[i] = source[i]


@njit
def combine(begin, end, y, h, weights, count, k, out):
    """out = y + h sum of weights[j] k[j] over j < count, of [begin:end]; three terms a pass where there are so many."""
    one, two, moved = -1, -1, False
    y, out = y[begin:end], out[begin:end]
    base = y
    for j in range(count):
        if weights[j] == 0.0:
            continue
        if one < 0:
            one = j
        elif two < 0:
            two = j
        else:
            c0, c1, c2 = h * weights[one], h * weights[two], h * weights[j]
            k0, k1, k2 = k[one, begin:end], k[two, begin:end], k[j, begin:end]
            for i in range(out.size):
                out[i] = base[i] + (c0 * k0[i] + c1 * k1[i] + c2 * k2[i])
            base, moved, one, two = out, True, -1, -1
    if two >= 0:
        c0, c1, k0, k1 = h * weights[one], h * weights[two], k[one, begin:end], k[two, begin:end]
        for i in range(out.size):
            out[i] = base[i] + (c0 * k0[i] + c1 * k1[i])
    elif one >= 0:
        c0, k0 = h * weights[one], k[one, begin:end]
        for i in range(out.size):
            out[i] = base[i] + c0 * k0[i]
    elif not moved:
        copy(y, out)


@njit(forceinline=True)
def endless(begin, end, y):
    """How many values of [begin:end] are not finite or have no finite square: in integers, which is vectorised."""
    bad = 0
    for i in range(begin, end):
        bad += not abs(y[i]) < HUGE
    return bad


@njit
def ask(sums, mode, y, h, weights, count, k, to, last):
    """Say what whoever finds the next rates is to form: the stage in `to`, from weights of `count` stages before it.

    last : weights of all stages at the end of the step
    """
    sums[MODE], sums[NOW], sums[TO], sums[RATES] = mode, address_of(y), address_of(to), address_of(k)
    sums[WEIGHTS], sums[LAST] = address_of(weights), address_of(last)
    sums[SIZE], sums[COUNT], sums[STAGES] = y.size, count, k.shape[0]
    floats_at(address_of(sums) + 8 * STEP, 1)[0] = h


@njit
def sum_runs(sums, first, last, y, h, weights, count, k, to):
    """Form runs `first` to `last`, which nobody else does, or not in time."""
    at = HEAD + sums[BASINS]
    for r in range(first, last):
        combine(sums[at + 2 * r], sums[at + 2 * r + 1], y, h, weights, count, k, to)


@njit(forceinline=True)
def asked(tables, b):
    """What is to be formed of a basin."""
    if tables.sums.size == 0 or tables.sums[HEAD + b] == 0:
        return OFF
    return tables.sums[MODE]


@njit
def form(sums, behind, at, wide, begin, stop, left, right):
    """Form columns `left` to `right` of rows `begin` to `stop` of a quantity that lies at `at`, rows `wide` cells.

    behind : the end of the step in place of the stage
    """
    size, stages = sums[SIZE], sums[STAGES]
    y, to, h = floats_at(sums[NOW], size), floats_at(sums[TO], size), floats_at(address_of(sums) + 8 * STEP, 1)[0]
    k = floats_at(sums[RATES], stages * size).reshape((stages, size))
    weights, count = floats_at(sums[LAST if behind else WEIGHTS], stages), stages if behind else sums[COUNT]
    if left == 0 and right == wide:
        combine(at + wide * begin, at + wide * stop, y, h, weights, count, k, to)
        return
    for j in range(begin, stop):
        combine(at + wide * j + left, at + wide * j + right, y, h, weights, count, k, to)


@njit
def look(sums, y, at, wide, begin, stop, left, right):
    """Count what is not finite of such rows of y."""
    if left == 0 and right == wide:
        sums[BAD] += endless(at + wide * begin, at + wide * stop, y)
        return
    for j in range(begin, stop):
        sums[BAD] += endless(at + wide * j + left, at + wide * j + right, y)


@njit
def form_looked_at(sums):
    """Form stages of cells that all look at once more, where the end of the step was put in their place."""
    size, stages = sums[SIZE], sums[STAGES]
    y, to, h = floats_at(sums[NOW], size), floats_at(sums[TO], size), floats_at(address_of(sums) + 8 * STEP, 1)[0]
    k, weights = floats_at(sums[RATES], stages * size).reshape((stages, size)), floats_at(sums[WEIGHTS], stages)
    sum_runs(sums, sums[OTHERS], sums[OTHERS] + sums[LOOKED], y, h, weights, sums[COUNT], k, to)

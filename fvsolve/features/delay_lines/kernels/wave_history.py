"""History of the waves sent into delay lines: ring buffers, lists of jumps, interpolation in time.

A wave is the sum of a smooth part u, stored at accepted times (entries), and of jumps, each with its time:
w(t) = u(t) + sum of the jumps sent up to t. So no interpolation crosses a jump. u is read by the Lagrange polynomial
through up to six entries, as many before t as after it (in the newest interval one more before), so that no wave is
amplified. Entries of a step that is not accepted yet are never read.

The array `past` contains in this order:

    header        HEADER_SIZE numbers
    times         of entries [s]
    arrivals      backward wave at the beginning, forward wave at the end and friction loss of each stretch [kg/s]
    heads         of the lists of jumps, one for each wave of each stretch: sum of the jumps removed from the list,
                  index of the first jump, number of jumps, number of these that have been passed on at its end
    jumps         lists of times, sizes, running sums and bounds of the jumps
    rings         entries (u forward, u backward) of each stretch, as many as its travel time needs
    bounds        of each stretch: entry up to which they are written, forward and backward; least and greatest forward
                  wave, then backward wave, since the entry before, for each entry in rings

So a step through a large network touches little memory: the ends of rings, and heads.

Arguments of all kernels of delay lines: past : wave history; places : result of `offsets_of`; clock : result of
`reading_data`; line, pipe : rows of a delay line and of its pipe; q : stretch within its line; s : stretch counted over
all lines; wave : 0 forward, 1 backward; side : 0 end at `from`, 1 end at `to`; at : offset of a head in `past`.
"""

from fvsolve.jit import njit

HEADER_SIZE = 32
# entries so far, capacity for times, jumps of a wave, stretches
COUNT, CAPACITY, JUMP_CAPACITY, STRETCHES = 0, 1, 2, 3
RING_FACTOR = 4  # factor by which rings are longer than at first
LAST_STEP, EQUAL_STEPS = 5, 6  # length of the last step [s], number of last steps of that length
STEP_BEFORE, EQUAL_STEPS_BEFORE = 7, 8  # values of both before the last entry
GREATEST_JUMP, GREATEST_UNSTORED_JUMP = 9, 10  # greatest jump, greatest jump that did not fit [Pa]
JUMPS_TRAVELLING = 11  # number of jumps now
# time and number of entries for which the stored arrivals hold
ARRIVALS_TIME, ARRIVALS_COUNT = 12, 13
# time of a corrected state until it is recorded again [s]; NaN before its entry; else -INFINITE
CORRECTED_TIME = 14
# arrival of the next jump that ends a step [s]; until it is admitted, no reading includes it
NEXT_ARRIVAL = 15
ONLY_PASSED_JUMPS = 16  # 1 while readings include only jumps that have been passed on
MOST_JUMPS_TRAVELLING = 18  # greatest number of jumps travelling at one time
GREATEST_WAVE = 17  # greatest wave so far, deviation from the initial steady state [Pa]
RESTATED_ENTRY = 20  # number of the last entry that has been recorded again
TOLERANCE = 21  # result of `time_tolerance` [s]
REFLECTION_RATE = 22  # greatest number of stretches that a wave crosses in unit time [1/s]
FIRST_TIME = 23  # time of the first entry [s]
# end of the present segment of the run, where schedules may jump; INFINITE in the last segment [s]
SEGMENT_END = 24
RING_ENTRIES = 19  # capacity of all rings together before they are lengthened
INFINITE = 1e300  # time [s]
PROFILE_ENTRIES = 8  # entries of the initial steady state (zeros) before the first entry
# head of a list of jumps, its size
REMOVED_SUM, FIRST_JUMP, JUMP_COUNT, ARRIVED_COUNT, HEAD_SIZE = 0, 1, 2, 3, 4
# values per jump: time, size, running sum, least and greatest wave beside it (`wave_bounds`)
JUMP_SIZE = 5
BOUNDS_BEGIN, BOUNDS_SIZE = 2, 4  # values in `bounds` before those of entries, values per entry
# values per stretch: backward wave at its beginning, forward wave at its end, delta
ARRIVALS_SIZE = 3
# numbers between rings, one cache line: else entries of the same time would share a few cache sets
RING_GAP = 8
# tolerance of equal times: fraction of a step, and at least of the time
TIME_TOLERANCE, ROUNDING = 1e-9, 1e-14
# relative rounding of a time: the sums of two paths round by half of it each at a stretch
UNIT_ROUNDING = 2.3e-16
# greatest part of a step and of a travel time that counts as rounding of sums
GREATEST_SHARE = 1e-4
# ratio of neighbouring steps, where one was shortened, above which readings are linear; no ratio of round times, which
# rounding would put on either side
GREATEST_STEP_RATIO = 1.9000019
NAN = float("nan")


@njit(forceinline=True)
def time_of(past, k):
    """Time of entry k of the wave history `past` [s]."""
    return past[HEADER_SIZE + (k & (int(past[CAPACITY]) - 1))]


@njit(forceinline=True)
def offsets_of(past):
    """Offsets of arrivals, heads, jumps and rings in `past`, factor by which rings are longer than at first, bounds.

    The offset of the bounds is the last number. These parts of the array are defined in the module docstring.
    """
    stretches, arrivals = int(past[STRETCHES]), HEADER_SIZE + int(past[CAPACITY])
    heads = arrivals + ARRIVALS_SIZE * stretches
    jumps = heads + 2 * HEAD_SIZE * stretches
    rings = jumps + 2 * JUMP_SIZE * int(past[JUMP_CAPACITY]) * stretches
    factor = int(past[RING_FACTOR])
    bounds = rings + 2 * factor * int(past[RING_ENTRIES]) + RING_GAP * stretches
    return arrivals, heads, jumps, rings, factor, bounds


@njit(forceinline=True)
def ring_of(places, line, q):
    """(offset in `past` of the entries of stretch q of a line, bit mask that wraps entry numbers)."""
    length = places[4] * line["ring_size"]
    return places[3] + 2 * (places[4] * line["ring"] + q * length) + RING_GAP * (
        line["stretch"] + q
    ), length - 1


@njit(forceinline=True)
def bounds_of(places, line, q):
    """Offset in `past` of the bounds of entries of stretch q of a line; the mask of `ring_of` wraps entry numbers.

    The numbers of entries up to which they are written are BOUNDS_BEGIN values before.
    """
    entries = places[4] * (line["ring"] + q * line["ring_size"])
    return places[5] + BOUNDS_SIZE * entries + BOUNDS_BEGIN * (line["stretch"] + q + 1)


@njit(forceinline=True)
def jump_head(places, s, wave):
    """Offset in `past` of the head of the list of jumps of a wave of stretch s; a head has HEAD_SIZE numbers."""
    return places[1] + HEAD_SIZE * (2 * s + wave)


@njit(forceinline=True)
def jump_place(past, places, at, i):
    """Offset in `past` of the time of jump i of a list, counted from the oldest one.

    Its other values follow, each past[JUMP_CAPACITY] further than that before (JUMP_SIZE).
    """
    queue = int(past[JUMP_CAPACITY])
    k = int(past[at + FIRST_JUMP]) + i
    return (
        places[2]
        + JUMP_SIZE * queue * ((at - places[1]) // HEAD_SIZE)
        + (k if k < queue else k - queue)
    )


@njit(forceinline=True)
def jump_number(past, places, at, place):
    """Position in a list of the jump whose time is at the offset `place` in `past`, see `jump_place`."""
    queue = int(past[JUMP_CAPACITY])
    k = (
        place
        - places[2]
        - JUMP_SIZE * queue * ((at - places[1]) // HEAD_SIZE)
        - int(past[at + FIRST_JUMP])
    )
    return k if k >= 0 else k + queue


@njit(forceinline=True)
def time_tolerance(past):
    """Tolerance below which two times count as equal [s], see `update_tolerance`."""
    return past[TOLERANCE]


@njit(forceinline=True)
def update_tolerance(past, t, h):
    """Raise the tolerance of equal times at an entry at t, after a step of h [s].

    The arrival time of a jump is a sum of travel times, one for each stretch that it has crossed. Each sum rounds, so
    the times of jumps that arrive together by several paths differ by more, the more reflections there were. The
    tolerance never decreases in a run: a jump that has been passed on as arrived must count as arrived later too.
    """
    rate = past[REFLECTION_RATE]
    sums = min(
        UNIT_ROUNDING * rate * (t - past[FIRST_TIME]) * abs(t), GREATEST_SHARE * min(h, 1.0 / rate)
    )
    past[TOLERANCE] = max(past[TOLERANCE], TIME_TOLERANCE * h, ROUNDING * abs(t), sums)


@njit(forceinline=True)
def latest_arrival(past, t):
    """Latest arrival time of a jump that counts as arrived at t [s].

    Jumps that arrive with a jump that ends a step (`NEXT_ARRIVAL`) wait until that jump is admitted.
    """
    return min(t + time_tolerance(past), past[NEXT_ARRIVAL] - time_tolerance(past))


@njit(forceinline=True)
def arrival_until(sent, tau, latest):
    """Arrival time of a jump after a travel time tau, if it is at most `latest`, else INFINITE.

    It is compared as in `arrived_until`, to the same bits: a jump that readings include must be passed on. An event
    that a jump causes is found where both sides are equal but for rounding.
    """
    return min(sent + tau, latest) if sent <= latest - tau else INFINITE


@njit(forceinline=True)
def newest_before(past, t):
    """Number of the newest entry before t, at least the first of the run; a step that ends at t may read up to it."""
    k = int(past[COUNT]) - 1
    while k > PROFILE_ENTRIES and time_of(past, k) >= t - time_tolerance(past):
        k -= 1
    return k


@njit(forceinline=True)
def lagrange_six(x):
    """Six Lagrange weights of entries k - 2 .. k + 3 at the fraction x in [0, 1) of the way from entry k to k + 1."""
    a = x + 2.0
    b = x + 1.0
    d = x - 1.0
    e = x - 2.0
    f = x - 3.0
    ab = a * b
    de = d * e
    ef = e * f
    return (
        b * x * d * ef / -120.0,
        a * x * d * ef / 24.0,
        ab * d * ef / -12.0,
        ab * x * ef / 12.0,
        ab * x * d * f / -24.0,
        ab * x * de / 120.0,
    )


@njit(forceinline=True)
def lagrange_four(x):
    """Lagrange weights of entries k - 1 .. k + 2 at the fraction x, in the order of `lagrange_six`, other weights 0."""
    b = x + 1.0
    d = x - 1.0
    e = x - 2.0
    return 0.0, x * d * e / -6.0, b * d * e / 2.0, b * x * e / -2.0, b * x * d / 6.0, 0.0


@njit(forceinline=True)
def lagrange_three(x):
    """Lagrange weights of entries k - 1 .. k + 1 at the fraction x, in the order of `lagrange_six`, other weights 0.

    They are used between the two newest entries.
    """
    return 0.0, 0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0), 0.0, 0.0


@njit
def find_interval(past, newest, t):
    """(entry k, fraction of the way to entry k + 1) at time t, up to the entry `newest`.

    From the time of `newest` on the result is (newest - 1, 1). Before the first entry, or all stored ones, it is
    (PROFILE_ENTRIES - 1, 0), an entry of the initial steady state.
    """
    low = max(PROFILE_ENTRIES, int(past[COUNT]) - int(past[CAPACITY]) + PROFILE_ENTRIES)
    high = newest
    if t >= time_of(past, high):
        return high - 1, 1.0
    if t < time_of(past, low):
        return PROFILE_ENTRIES - 1, 0.0
    while high - low > 1:
        middle = (low + high) // 2
        if time_of(past, middle) <= t:
            low = middle
        else:
            high = middle
    return low, (t - time_of(past, low)) / (time_of(past, low + 1) - time_of(past, low))


@njit
def lagrange_unequal(past, newest, t):
    """(entry k at or before t, weights of entries k - 2 .. k + 3) for unequal steps.

    Cubic through four entries; linear if steps differ much, and in the first and the newest interval. The weights are 0
    before the first entry.
    """
    low, x = find_interval(past, newest, t)
    line = (0.0, 0.0, 1.0 - x, x, 0.0, 0.0)
    if low < PROFILE_ENTRIES:
        return low, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0) if x == 0.0 else line
    t1, t2 = time_of(past, low), time_of(past, low + 1)
    if low + 2 > newest or low - 1 < PROFILE_ENTRIES:
        return low, line
    t0, t3 = time_of(past, low - 1), time_of(past, low + 2)
    near = t1 - t0
    here = t2 - t1
    far = t3 - t2
    if max(near, here, far) > GREATEST_STEP_RATIO * min(near, here, far):
        return low, line
    a = t - t0
    b = t - t1
    c = t - t2
    d = t - t3
    return low, (
        0.0,
        b * c * d / ((t0 - t1) * (t0 - t2) * (t0 - t3)),
        a * c * d / (near * (t1 - t2) * (t1 - t3)),
        a * b * d / ((t2 - t0) * here * (t2 - t3)),
        a * b * c / ((t3 - t0) * (t3 - t1) * far),
        0.0,
    )


@njit(forceinline=True)
def reading_data(past, newest):
    """(newest entry, its time [s], 1 / step [1/s], number of equal steps, tolerance of times [s]) for readings.

    newest : number of the last or the last but one entry. Except for the tolerance, the result does not depend on
    whether an entry after `newest` exists already. The number of equal steps is that of the last steps up to `newest`
    that have the length `step`.
    """
    step, even = past[LAST_STEP], past[EQUAL_STEPS]
    if newest != int(past[COUNT]) - 1:
        step, even = past[STEP_BEFORE], past[EQUAL_STEPS_BEFORE]
    return newest, time_of(past, newest), 1.0 / step, even, time_tolerance(past)


@njit(forceinline=True)
def stencil(past, clock, t):
    """(entry k, weights of entries k - 2 .. k + 3) for the smooth part at t, up to the newest entry of `clock`.

    After that entry its value is kept.
    """
    newest = clock[0]
    latest = clock[1]
    per_step = clock[2]
    even = clock[3]
    if t >= latest:  # also before the first step, whose length is not known yet
        return newest, (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    place = (t - latest) * per_step
    if place <= -even:
        return lagrange_unequal(past, newest, t)
    steps = int(place) - 1 if place < int(place) else int(place)
    k, x = newest + steps, place - steps
    # Near the newest entry fewer entries follow, so the polynomial has fewer points.
    if k + 3 <= newest and steps - 2 >= -even:
        return k, lagrange_six(x)
    if k + 2 <= newest and steps - 1 >= -even:
        return k, lagrange_four(x)
    if k + 2 <= newest:
        return lagrange_unequal(past, newest, t)
    return k, lagrange_three(x) if steps - 1 >= -even else (0.0, 0.0, 1.0 - x, x, 0.0, 0.0)


@njit(forceinline=True)
def smooth_waves(past, places, clock, line, q, t):
    """Smooth parts of both waves sent into stretch q of a delay line at t: (forward, backward) [kg/s]."""
    (at, mask), (k, w) = ring_of(places, line, q), stencil(past, clock, t)
    a = at + 2 * ((k - 2) & mask)
    b = at + 2 * ((k - 1) & mask)
    c = at + 2 * (k & mask)
    d = at + 2 * ((k + 1) & mask)
    e = at + 2 * ((k + 2) & mask)
    f = at + 2 * ((k + 3) & mask)
    r = (
        w[0] * past[a]
        + w[1] * past[b]
        + w[2] * past[c]
        + w[3] * past[d]
        + w[4] * past[e]
        + w[5] * past[f]
    )
    a = a + 1
    b = b + 1
    c = c + 1
    d = d + 1
    e = e + 1
    f = f + 1
    l = (
        w[0] * past[a]
        + w[1] * past[b]
        + w[2] * past[c]
        + w[3] * past[d]
        + w[4] * past[e]
        + w[5] * past[f]
    )
    return r, l


@njit
def first_after(past, places, at, t):
    """Number of the jumps of a list that were sent up to t; the first jump sent after t has this position in it."""
    low, high = 0, int(past[at + JUMP_COUNT])
    while low < high:
        middle = (low + high) // 2
        if past[jump_place(past, places, at, middle)] > t:
            high = middle
        else:
            low = middle + 1
    return low


@njit(forceinline=True)
def count_until(past, places, at, i, t):
    """Number of the jumps of a list that were sent up to t, as `first_after`, if it is at least i, by search from i."""
    while i < int(past[at + JUMP_COUNT]) and past[jump_place(past, places, at, i)] <= t:
        i += 1
    return i


@njit(forceinline=True)
def count_back(past, places, at, i, t):
    """Number of the jumps of a list that were sent up to t, as `first_after`, if it is at most i, by search from i."""
    while i > 0 and past[jump_place(past, places, at, i - 1)] > t:
        i -= 1
    return i


@njit(forceinline=True)
def sum_of_first(past, places, at, count):
    """Sum of the jumps removed from the list of a wave and of the first `count` jumps in it [kg/s]."""
    if count == 0:
        return past[at + REMOVED_SUM]
    return past[jump_place(past, places, at, count - 1) + 2 * int(past[JUMP_CAPACITY])]


@njit
def sum_listed_jumps(past, places, at, t):
    """Sum of the jumps of a wave sent up to t [kg/s], including jumps already removed from its list.

    The list must not be empty.
    """
    count = int(past[at + JUMP_COUNT])
    # If the last jump was sent by t, all were, and no search is needed.
    if past[jump_place(past, places, at, count - 1)] > t:
        count = first_after(past, places, at, t)
    return sum_of_first(past, places, at, count)


@njit(forceinline=True)
def jumps_until(past, places, at, t):
    """Sum of the jumps of a wave sent up to t [kg/s], including jumps already removed from its list."""
    return (
        sum_listed_jumps(past, places, at, t)
        if past[at + JUMP_COUNT] > 0.0
        else past[at + REMOVED_SUM]
    )


@njit(forceinline=True)
def passed_jumps(past, places, at):
    """Sum of the jumps of a wave that have been passed on at the end of their stretch [kg/s].

    Jumps removed from the list are included.
    """
    return sum_of_first(past, places, at, int(past[at + ARRIVED_COUNT]))


@njit(forceinline=True)
def arrived_until(past, places, clock, at, t, tau):
    """Sum of the jumps of a wave that have arrived by t, after a travel time tau [kg/s].

    See `latest_arrival` for jumps that are left out. While past[ONLY_PASSED_JUMPS] is 1, the result is `passed_jumps`.
    """
    if past[ONLY_PASSED_JUMPS] > 0.0:
        return passed_jumps(past, places, at)
    # `latest_arrival`
    return jumps_until(past, places, at, min(t + clock[4], past[NEXT_ARRIVAL] - clock[4]) - tau)


@njit(forceinline=True)
def read_waves(past, places, clock, line, q, t):
    """Both waves sent into stretch q of a delay line at t, with their jumps: (forward, backward) [kg/s]."""
    r, l = smooth_waves(past, places, clock, line, q, t)
    until, ahead = t + clock[4], jump_head(places, line["stretch"] + q, 0)
    return r + jumps_until(past, places, ahead, until), l + jumps_until(
        past, places, ahead + HEAD_SIZE, until
    )


@njit(forceinline=True)
def newest_wave(past, places, clock, line, q, wave, t):
    """Wave sent into stretch q of a delay line at the time t of the newest entry, with its jumps up to t [kg/s]."""
    ring, mask = ring_of(places, line, q)
    jumps = jumps_until(past, places, jump_head(places, line["stretch"] + q, wave), t + clock[4])
    return past[ring + 2 * (clock[0] & mask) + wave] + jumps


@njit
def insert_jump(past, places, at, t, size):
    """Insert a jump of a wave into its list, sorted by time; return False if the list is full.

    If the list contains a jump of equal time that has not been passed on, the size is added to it. A jump that is not
    listed becomes part of the smooth part, see `write_entry`.
    t : time at which the jump was sent [s]; size [kg/s]
    """
    queue = int(past[JUMP_CAPACITY])
    count = int(past[at + JUMP_COUNT])
    tolerance = time_tolerance(past)
    i = count
    # From the end of the list, because jumps are inserted mostly in the order of their times.
    while i > 0 and past[jump_place(past, places, at, i - 1)] > t + tolerance:
        i -= 1
    before = jump_place(past, places, at, max(i - 1, 0))
    if i > int(past[at + ARRIVED_COUNT]) and abs(past[before] - t) <= tolerance:
        past[before + queue] += size
        update_running_sums(past, places, at, i - 1)
        return True
    if count == queue:
        return False
    for j in range(count, i, -1):
        here, there = jump_place(past, places, at, j), jump_place(past, places, at, j - 1)
        past[here], past[here + queue] = past[there], past[there + queue]
    here = jump_place(past, places, at, i)
    past[here], past[here + queue] = t, size
    past[at + JUMP_COUNT] = count + 1.0
    past[JUMPS_TRAVELLING] += 1.0
    past[MOST_JUMPS_TRAVELLING] = max(past[MOST_JUMPS_TRAVELLING], past[JUMPS_TRAVELLING])
    update_running_sums(past, places, at, i)
    return True


@njit
def update_running_sums(past, places, at, begin):
    """Update the running sums of the jumps of a wave from position `begin` of its list on."""
    queue, total = int(past[JUMP_CAPACITY]), sum_of_first(past, places, at, begin)
    for j in range(begin, int(past[at + JUMP_COUNT])):
        here = jump_place(past, places, at, j)
        total += past[here + queue]
        past[here + 2 * queue] = total


@njit
def remove_arrived_jumps(past, places, at, t):
    """Remove the jumps that have been passed on and were sent before t from the list of a wave.

    They are added to its sum of removed jumps.
    """
    queue = int(past[JUMP_CAPACITY])
    while past[at + ARRIVED_COUNT] > 0.0 and past[jump_place(past, places, at, 0)] < t:
        past[at + REMOVED_SUM] += past[jump_place(past, places, at, 0) + queue]
        first = int(past[at + FIRST_JUMP]) + 1
        past[at + FIRST_JUMP] = first if first < queue else 0
        past[at + JUMP_COUNT] -= 1.0
        past[at + ARRIVED_COUNT] -= 1.0
        past[JUMPS_TRAVELLING] -= 1.0


@njit
def begin_entry(past, t):
    """Begin an entry at t: write its time and the lengths of the last steps to `past`; return its number."""
    mask, k = int(past[CAPACITY]) - 1, int(past[COUNT])
    if k == 0:
        past[FIRST_TIME] = t
        update_tolerance(past, t, 0.0)
        past[COUNT], past[EQUAL_STEPS], past[LAST_STEP] = PROFILE_ENTRIES + 1.0, 1e18, 1e-300
        past[STEP_BEFORE], past[EQUAL_STEPS_BEFORE] = past[LAST_STEP], past[EQUAL_STEPS]
        past[HEADER_SIZE + PROFILE_ENTRIES] = t
        return PROFILE_ENTRIES
    h = t - time_of(past, k - 1)
    past[STEP_BEFORE], past[EQUAL_STEPS_BEFORE] = past[LAST_STEP], past[EQUAL_STEPS]
    # Steps in the steady state before the start count as equal to the first step.
    if k == PROFILE_ENTRIES + 1:
        past[LAST_STEP] = h
    elif abs(h - past[LAST_STEP]) <= 1e-9 * h:
        past[EQUAL_STEPS] += 1.0
    else:
        past[EQUAL_STEPS], past[LAST_STEP] = 1.0, h
    update_tolerance(past, t, h)
    past[HEADER_SIZE + (k & mask)] = t
    past[COUNT] = k + 1.0
    return k


@njit(forceinline=True)
def write_entry(past, places, line, q, k, wave, value):
    """Store the smooth part of a wave of stretch q as entry k: `value` minus all its jumps so far [kg/s].

    value : whole wave [kg/s]
    """
    at, mask = ring_of(places, line, q)
    jumps = jumps_until(past, places, jump_head(places, line["stretch"] + q, wave), INFINITE)
    past[at + 2 * (k & mask) + wave] = value - jumps

"""What was sent into delay lines, by time, and how it is read back. Knows times and waves; knows no nodes.

A wave is a smooth part u, kept at accepted times, and jumps, each with its time: w(t) = u(t) + sum of jumps up to t.
So nothing is interpolated across a jump. u is read by Lagrange's polynomial through up to six entries around, as many
before as behind (in the newest interval one more before), so that no wave is magnified; entries that a step has not yet
accepted are never read.

past = [head, times of entries, what arrives at the ends of stretches at a time, of each stretch heads of the jumps of
both waves: sum of those that have arrived, which is the first, how many there are, how many of them have arrived in the
last step; times, sizes and sums so far of these jumps; and at last of each stretch a ring of entries (u forward, u
backward), as long as its own delay asks for]. So a step through a large network touches little: the ends of rings, and
heads.
"""

from fvsolve.jit import njit

HEAD = 24
COUNT, CAPACITY, QUEUE, STRETCHES = 0, 1, 2, 3  # entries so far, room for times, for jumps of a wave
WIDER = 4  # rings are so many times as long as at first
STEP, EVEN = 5, 6  # length of the last step [s], and how many were of that length
STEP_BEFORE, EVEN_BEFORE = 7, 8  # both without the last entry
GREATEST, CROWDED, LIVE = 9, 10, 11  # the greatest jump [Pa], the greatest that found no room, how many there are now
KNOWN_TIME, KNOWN_COUNT = 12, 13  # of the arrivals that are kept
MENDED = 14  # time of the last state that was put right [s]
NEXT = 15  # when a jump arrives next where something acts at once [s]: before it has arrived no reading counts it
HELD = 16  # 1 while only jumps that have been passed on are counted
MOST_LIVE = 18  # the most jumps that were on their way at once
SWING = 17  # the greatest wave so far, as a deviation from the profile [Pa]
INFINITE = 1e300  # time [s]
ZEROS = 8  # entries before the first, of the profile
SUM, FIRST, MANY, ARRIVED, HEADS = 0, 1, 2, 3, 4  # of the jumps of a wave
ARRIVALS = 3  # of a stretch: backward wave at its beginning, forward one at its end, delta
APART = 8  # numbers between rings, a cache line: or entries of one time would all fall into the same few of a cache
SAME, ROUNDING = 1e-9, 1e-14  # of a step, and of a time at least: times that are as good as one
RATIO = 1.9  # of neighbouring steps, above which a polynomial through them is a line: so it is where a step was cut


@njit(forceinline=True)
def time_of(past, k):
    """Time of entry k [s]."""
    return past[HEAD + (k & (int(past[CAPACITY]) - 1))]


@njit(forceinline=True)
def places_of(past):
    """Where there begin: (arrivals, heads of jumps, jumps, rings), and how many times as long as at first these are."""
    many, arrivals = int(past[STRETCHES]), HEAD + int(past[CAPACITY])
    heads = arrivals + ARRIVALS * many
    jumps = heads + 2 * HEADS * many
    return arrivals, heads, jumps, jumps + 6 * int(past[QUEUE]) * many, int(past[WIDER])


@njit(forceinline=True)
def ring_of(places, line, q):
    """(where the entries of stretch q of a line begin, mask of their numbers)."""
    room = places[4] * line["room"]
    return places[3] + 2 * (places[4] * line["ring"] + q * room) + APART * (line["stretch"] + q), room - 1


@njit(forceinline=True)
def jumps_at(places, s, wave):
    """Where the head of the jumps of a wave of stretch s lies."""
    return places[1] + HEADS * (2 * s + wave)


@njit(forceinline=True)
def queue_at(places, queue, at):
    """Where the times of jumps lie whose head is at a place; sizes and sums follow."""
    return places[2] + 3 * queue * ((at - places[1]) // HEADS)


@njit(forceinline=True)
def same_time(past):
    """Difference of times that is none [s]."""
    return max(SAME * past[STEP], ROUNDING * abs(time_of(past, int(past[COUNT]) - 1)))


@njit(forceinline=True)
def newest_before(past, t):
    """The newest entry before t: what a step may read that ends there."""
    k = int(past[COUNT]) - 1
    while k > ZEROS and time_of(past, k) >= t - same_time(past):
        k -= 1
    return k


@njit(forceinline=True)
def six(x):
    """Weights of entries -2 .. 3 at x in [0, 1)."""
    a, b, d, e, f = x + 2.0, x + 1.0, x - 1.0, x - 2.0, x - 3.0
    ab, de, ef = a * b, d * e, e * f
    return (
        b * x * d * ef / -120.0, a * x * d * ef / 24.0, ab * d * ef / -12.0, ab * x * ef / 12.0,
        ab * x * d * f / -24.0, ab * x * de / 120.0,
    )  # fmt: skip


@njit(forceinline=True)
def four(x):
    """Weights of entries -1 .. 2 at x in [0, 1), as those of six."""
    b, d, e = x + 1.0, x - 1.0, x - 2.0
    return 0.0, x * d * e / -6.0, b * d * e / 2.0, b * x * e / -2.0, b * x * d / 6.0, 0.0


@njit(forceinline=True)
def three(x):
    """Weights of entries -1 .. 1 at x in [0, 1), as those of six: in the newest interval, which has none behind it."""
    return 0.0, 0.5 * x * (x - 1.0), 1.0 - x * x, 0.5 * x * (x + 1.0), 0.0, 0.0


@njit
def between(past, newest, t):
    """(entry k, share of the way to the next) where t lies; before the first entry that of the profile."""
    low, high = max(ZEROS, int(past[COUNT]) - int(past[CAPACITY]) + ZEROS), newest
    if t >= time_of(past, high):
        return high - 1, 1.0
    if t < time_of(past, low):
        return ZEROS - 1, 0.0
    while high - low > 1:
        middle = (low + high) // 2
        if time_of(past, middle) <= t:
            low = middle
        else:
            high = middle
    return low, (t - time_of(past, low)) / (time_of(past, low + 1) - time_of(past, low))


@njit
def uneven(past, newest, t):
    """(entry before t, weights) where steps differ: a cubic through four entries, or a line where they differ much."""
    low, x = between(past, newest, t)
    line = (0.0, 0.0, 1.0 - x, x, 0.0, 0.0)
    if low < ZEROS:
        return low, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0) if x == 0.0 else line
    t1, t2 = time_of(past, low), time_of(past, low + 1)
    if low + 2 > newest or low - 1 < ZEROS:
        return low, line
    t0, t3 = time_of(past, low - 1), time_of(past, low + 2)
    near, here, far = t1 - t0, t2 - t1, t3 - t2
    if max(near, here, far) > RATIO * min(near, here, far):
        return low, line
    a, b, c, d = t - t0, t - t1, t - t2, t - t3
    return low, (
        0.0, b * c * d / ((t0 - t1) * (t0 - t2) * (t0 - t3)), a * c * d / (near * (t1 - t2) * (t1 - t3)),
        a * b * d / ((t2 - t0) * here * (t2 - t3)), a * b * c / ((t3 - t0) * (t3 - t1) * far), 0.0,
    )  # fmt: skip


@njit(forceinline=True)
def clock_of(past, newest):
    """What every reading asks for: (newest entry, its time, 1 / step, how many steps were of this length, SAME).

    It is the same whether an entry behind the newest is there already or not.
    """
    step, even = past[STEP], past[EVEN]
    if newest != int(past[COUNT]) - 1:
        step, even = past[STEP_BEFORE], past[EVEN_BEFORE]
    return newest, time_of(past, newest), 1.0 / step, even, same_time(past)


@njit(forceinline=True)
def stencil(past, clock, t):
    """(entry k, weights of entries k - 2 .. k + 3) of a smooth part at t, none of them behind the newest of a clock."""
    newest, latest, often, even = clock[0], clock[1], clock[2], clock[3]
    place = (t - latest) * often
    if place <= -even:
        return uneven(past, newest, t)
    whole = int(place) - 1 if place < int(place) else int(place)
    k, x = newest + whole, place - whole
    if k >= newest:
        return newest, (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
    if k + 3 <= newest and whole - 2 >= -even:
        return k, six(x)
    if k + 2 <= newest and whole - 1 >= -even:
        return k, four(x)
    if k + 2 <= newest:
        return uneven(past, newest, t)
    return k, three(x) if whole - 1 >= -even else (0.0, 0.0, 1.0 - x, x, 0.0, 0.0)


@njit(forceinline=True)
def both_waves(past, at, mask, k, w):
    """Smooth parts of both waves of a stretch by weights of entries k - 2 .. k + 3; at : where its entries begin."""
    a, b, c = at + 2 * ((k - 2) & mask), at + 2 * ((k - 1) & mask), at + 2 * (k & mask)
    d, e, f = at + 2 * ((k + 1) & mask), at + 2 * ((k + 2) & mask), at + 2 * ((k + 3) & mask)
    r = w[0] * past[a] + w[1] * past[b] + w[2] * past[c] + w[3] * past[d] + w[4] * past[e] + w[5] * past[f]
    a, b, c, d, e, f = a + 1, b + 1, c + 1, d + 1, e + 1, f + 1
    l = w[0] * past[a] + w[1] * past[b] + w[2] * past[c] + w[3] * past[d] + w[4] * past[e] + w[5] * past[f]
    return r, l


@njit(forceinline=True)
def turn(i, queue):
    """Place in a ring of jumps that lies i behind another."""
    return i if i < queue else i - queue


@njit
def first_after(past, queue, times, first, many, t):
    """Number of the first jump of a list that was sent after t."""
    low, high = 0, many
    while low < high:
        middle = (low + high) // 2
        if past[times + turn(first + middle, queue)] > t:
            high = middle
        else:
            low = middle + 1
    return low


@njit(forceinline=True)
def sum_of_first(past, places, at, count):
    """Sum of the jumps of a wave before the list and of the first ones in it; at : their head."""
    if count == 0:
        return past[at + SUM]
    queue = int(past[QUEUE])
    return past[queue_at(places, queue, at) + 2 * queue + turn(int(past[at + FIRST]) + count - 1, queue)]


@njit
def some_jumps(past, places, at, t):
    """Sum of the jumps of a wave up to t, of which it has some; at : their head."""
    many, queue, first = int(past[at + MANY]), int(past[QUEUE]), int(past[at + FIRST])
    times = queue_at(places, queue, at)
    if past[times + turn(first + many - 1, queue)] <= t:
        return sum_of_first(past, places, at, many)
    return sum_of_first(past, places, at, first_after(past, queue, times, first, many, t))


@njit(forceinline=True)
def jumps_until(past, places, at, t):
    """Sum of the jumps of a wave up to t; at : their head."""
    return some_jumps(past, places, at, t) if past[at + MANY] > 0.0 else past[at + SUM]


@njit(forceinline=True)
def passed_jumps(past, places, at):
    """Sum of the jumps of a wave that have been passed on where they arrive; at : their head."""
    return sum_of_first(past, places, at, int(past[at + ARRIVED]))


@njit(forceinline=True)
def arrived_until(past, places, clock, at, t, tau):
    """Sum of the jumps of a wave that have arrived by t, after a travel time tau; at : their head."""
    if past[HELD] > 0.0:
        return passed_jumps(past, places, at)
    return jumps_until(past, places, at, min(t + clock[4], past[NEXT] - clock[4]) - tau)


@njit(forceinline=True)
def read_both(past, places, clock, line, q, t):
    """Both waves that were sent into stretch q of a line at t [kg/s], from its beginning and from its end."""
    at, mask = ring_of(places, line, q)
    k, w = stencil(past, clock, t)
    r, l = both_waves(past, at, mask, k, w)
    until, ahead = t + clock[4], jumps_at(places, line["stretch"] + q, 0)
    return r + jumps_until(past, places, ahead, until), l + jumps_until(past, places, ahead + HEADS, until)


@njit
def push_jump(past, places, at, t, size):
    """Note a jump of a wave; what is too many joins the smooth part."""
    queue, first, many = int(past[QUEUE]), int(past[at + FIRST]), int(past[at + MANY])
    i, times = many, queue_at(places, queue, at)
    while i > 0 and past[times + turn(first + i - 1, queue)] > t + same_time(past):
        i -= 1
    before = times + turn(first + i - 1, queue) if i > 0 else times
    if i > int(past[at + ARRIVED]) and abs(past[before] - t) <= same_time(past):
        past[before + queue] += size
        add_up(past, places, at, i - 1)
        return True
    if many == queue:
        return False
    for j in range(many, i, -1):
        here, there = times + turn(first + j, queue), times + turn(first + j - 1, queue)
        past[here], past[here + queue] = past[there], past[there + queue]
    here = times + turn(first + i, queue)
    past[here], past[here + queue] = t, size
    past[at + MANY] = many + 1.0
    past[LIVE] += 1.0
    past[MOST_LIVE] = max(past[MOST_LIVE], past[LIVE])
    add_up(past, places, at, i)
    return True


@njit
def add_up(past, places, at, begin):
    """Sums of the jumps of a wave, from that of a number on; at : their head."""
    queue, first = int(past[QUEUE]), int(past[at + FIRST])
    total, times = sum_of_first(past, places, at, begin), queue_at(places, queue, at)
    for j in range(begin, int(past[at + MANY])):
        here = times + turn(first + j, queue)
        total += past[here + queue]
        past[here + 2 * queue] = total


@njit
def forget_jumps(past, places, at, t):
    """Take those that have arrived, and were sent before t, out of the list."""
    queue = int(past[QUEUE])
    times = queue_at(places, queue, at)
    while past[at + ARRIVED] > 0.0 and past[times + int(past[at + FIRST])] < t:
        past[at + SUM] += past[times + int(past[at + FIRST]) + queue]
        past[at + FIRST] = turn(int(past[at + FIRST]) + 1, queue)
        past[at + MANY] -= 1.0
        past[at + ARRIVED] -= 1.0
        past[LIVE] -= 1.0


@njit
def begin_entry(past, t):
    """Make room for an entry at t; returns its number."""
    mask, k = int(past[CAPACITY]) - 1, int(past[COUNT])
    if k == 0:
        past[COUNT], past[EVEN], past[STEP] = ZEROS + 1.0, 1e18, 1e-300
        past[STEP_BEFORE], past[EVEN_BEFORE] = past[STEP], past[EVEN]
        past[HEAD + ZEROS] = t
        return ZEROS
    h = t - time_of(past, k - 1)
    past[STEP_BEFORE], past[EVEN_BEFORE] = past[STEP], past[EVEN]
    if k == ZEROS + 1:
        past[STEP] = h
    elif abs(h - past[STEP]) <= 1e-9 * h:
        past[EVEN] += 1.0
    else:
        past[EVEN], past[STEP] = 1.0, h
    past[HEAD + (k & mask)] = t
    past[COUNT] = k + 1.0
    return k


@njit(forceinline=True)
def write(past, places, line, q, k, wave, value):
    """Keep the smooth part of a wave as entry k."""
    at, mask = ring_of(places, line, q)
    jumps = jumps_until(past, places, jumps_at(places, line["stretch"] + q, wave), INFINITE)
    past[at + 2 * (k & mask) + wave] = value - jumps

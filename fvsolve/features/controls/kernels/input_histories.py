"""Histories of the inputs of blocks with a delay: entries of accepted states, and the breaks between them.

Between two breaks an input is smooth: its value is that of a polynomial through up to six entries, never across one.
A break is a jump of the input (level 0), or of its derivative number 1 to 5 (levels 1 to 5). Where a break arrives, a
delay later, a step ends; it causes a break of the same level in the inputs that depend on this output at once, and of
the next level in those that depend on it through states. At a break there are two entries of the same time, with the
values before and after it. A break of an input that is constant around it is removed.

The array `histories` contains a header, then for each block a head and its entries. An entry has three numbers: time
[s], change of the input since the start, and level of the break if it is the first entry after one, else SMOOTH.
Arguments: histories : this array; at : offset of the head of a block; k : number of an entry, counted from the start.
"""

from fvsolve.core.kernels.dtypes import LONGEST, OK, STATUS
from fvsolve.jit import njit

CAPACITY, FLAGS, BEGINS, BREAK_TIME, POINTS = range(5)
"""Header: entries of a block for which there is space; event flags of the last entry as one number; 1 if the next entry
is at a break of a schedule; time of the last break of an output, by an arrival or a sample; numbers of the entries in
use."""
START, BEFORE, SMALL = 0, 1, 2
"""Numbers of a block: output at which the input has its value of the start; change from it before the first input; size
of a small change of the input."""
COUNT, ARRIVED, NEXT, GREATEST, BREAK_LEVEL, HEAD = range(6)
"""Head: number of entries so far; first entry after the last break that has arrived, and after the next one to arrive,
-1 for none; greatest change so far, at least a small change; level of the break that the last break of an output
causes; size of the head."""
MOST_POINTS = 6
HEADER = POINTS + MOST_POINTS  # size of the header
ENTRY = 3  # numbers of an entry
SMOOTH = -1.0
JUMP, KINK, LAST_LEVEL, NONE = 0.0, 1.0, 5.0, 9.0
# of times, relative to the time and the delay, and of jumps, relative to the greatest change
ROUNDING = 1e-12
# product of the distances of the middle of six equal steps from their ends
MIDDLE = (0.5 * 1.5 * 2.5) ** 2
FAR = 1e300  # [s]
LEAST_RATIO = 0.3  # least ratio of a step in a polynomial to that in which the polynomial is used


@njit(forceinline=True)
def head_of(histories, number):
    """Offset of the head of a history."""
    return HEADER + number * (HEAD + ENTRY * int(histories[CAPACITY]))


@njit(forceinline=True)
def place_of(histories, at, k):
    """Offset of entry k."""
    return at + HEAD + ENTRY * (k % int(histories[CAPACITY]))


@njit(forceinline=True)
def time_of(histories, at, k):
    """Time of entry k [s]."""
    return histories[place_of(histories, at, k)]


@njit(forceinline=True)
def is_after_break(histories, at, k):
    """True if entry k is the first one after a break."""
    return histories[place_of(histories, at, k) + 2] != SMOOTH


@njit
def value_before(tables, control, t):
    """Change of the input of a block at the time t - delay."""
    histories, before = tables.histories, tables.floats[control["data"] + BEFORE]
    at = head_of(histories, control["history"])
    # No break has arrived yet: the output still belongs to the time before the first entry.
    if histories[at + ARRIVED] < 0.0:
        return before
    # Entries from the next break on are later than t - delay: none of them may be read.
    last = int(histories[at + COUNT] if histories[at + NEXT] < 0.0 else histories[at + NEXT]) - 1
    first, time = int(histories[at + ARRIVED]), t - control["delay"]
    oldest = max(0, int(histories[at + COUNT]) - int(histories[CAPACITY]))
    if first >= oldest and time < time_of(histories, at, first) - ROUNDING * (
        abs(t) + control["delay"]
    ):
        if first == 0:  # this and the next line: a part of the last step is computed again
            return before
        first, last = oldest, first - 1
    first = max(first, oldest)
    return interpolated(histories, at, first, last, time)


@njit
def interpolated(histories, at, first, last, time):
    """Change of the input at a time between the entries `first` and `last`; constant beyond them."""
    if first >= last or time <= time_of(histories, at, first):
        return histories[place_of(histories, at, first) + 1]
    if time >= time_of(histories, at, last):
        return histories[place_of(histories, at, last) + 1]
    low, high = first, last
    while high - low > 1:
        middle = (low + high) // 2
        if time_of(histories, at, middle) <= time:
            low = middle
        else:
            high = middle
    if is_after_break(histories, at, high):  # the time is that of a break, but for rounding
        return histories[place_of(histories, at, low) + 1]
    points = choose_points(histories, at, first, last, low)
    base = histories[place_of(histories, at, low) + 1]
    value = 0.0
    # Lagrange polynomial of the differences from entry `low`.
    for i in range(POINTS, POINTS + points):
        here, weight = place_of(histories, at, int(histories[i])), 1.0
        for j in range(POINTS, POINTS + points):
            if j != i:
                other = time_of(histories, at, int(histories[j]))
                weight *= (time - other) / (histories[here] - other)
        # so that a constant input has a constant output
        value += weight * (histories[here + 1] - base)
    return base + value


@njit
def choose_points(histories, at, first, last, low):
    """Write the numbers of up to six entries for a polynomial from entry `low` to the next one; returns their count.

    They lie between the entries `first` and `last`, half of them on each side where possible. Entries close to each
    other are left out, as they would get large weights of opposite signs. No break is crossed, except breaks of a level
    of at least the number of points that there are without: their error is not greater than that of so few points.
    """
    histories[POINTS], histories[POINTS + 1], points, left, right = low, low + 1, 2, low, low + 1
    gap = LEAST_RATIO * (time_of(histories, at, right) - time_of(histories, at, left))
    count_left = 1
    count_right = 1
    # In the second turn, breaks of high derivatives may be crossed, which so few points do not resolve.
    for turn in range(2):
        crossed = NONE if turn == 0 else float(points)
        goes_left = True
        goes_right = True
        while points < MOST_POINTS and (goes_left or goes_right):
            # Points are added on the side with fewer of them: in the middle a polynomial is most accurate.
            if goes_left and (not goes_right or count_left <= count_right):
                chosen = point_before(histories, at, left, first, gap, crossed)
                goes_left = chosen >= 0
                left = left if chosen < 0 else chosen
                count_left = count_left + 1
            else:
                chosen = point_after(histories, at, right, last, gap, crossed)
                goes_right = chosen >= 0
                right = right if chosen < 0 else chosen
                count_right = count_right + 1
            if chosen >= 0:
                histories[POINTS + points] = chosen
                points += 1
    return points


@njit(forceinline=True)
def stops_at(histories, at, k, crossed):
    """True if entry k is the first one after a break of a level below `crossed`."""
    level = histories[place_of(histories, at, k) + 2]
    return level != SMOOTH and level < crossed


@njit
def point_before(histories, at, k, first, gap, crossed):
    """Last entry that is at least `gap` [s] before entry k, from the entry `first` on; -1 for none.

    crossed : least level of breaks between both
    """
    time, i = time_of(histories, at, k) - gap, k
    while i > first and not stops_at(histories, at, i, crossed):
        i -= 1
        if time_of(histories, at, i) <= time:
            return i
    return -1


@njit
def point_after(histories, at, k, last, gap, crossed):
    """First entry that is at least `gap` [s] after entry k, up to the entry `last`; -1 for none.

    crossed : least level of breaks between both
    """
    time, i = time_of(histories, at, k) + gap, k
    while i < last and not stops_at(histories, at, i + 1, crossed):
        i += 1
        if time_of(histories, at, i) >= time:
            return i
    return -1


@njit(forceinline=True)
def flags_as_number(armed):
    """All event flags as one number, which other flags hardly have."""
    number = 0.0
    for i in range(armed.size):
        number = (31.0 * number + armed[i] + 1.0) % 1000003.0
    return number


@njit
def record_inputs(t, out, tables):
    """Store the inputs of all blocks with a delay in an accepted state, and the breaks that they have there."""
    histories = tables.histories
    if histories.size == 0 or out[STATUS] != OK:
        return
    flags, longest = flags_as_number(tables.armed), 0.0
    switched = flags != histories[FLAGS] or histories[BEGINS] > 0.0
    caused = histories[BREAK_TIME] == t
    for k in range(tables.controls.size):
        control = tables.controls[k]
        if control["delay"] > 0.0:
            at, level = head_of(histories, control["history"]), SMOOTH
            # An event or a schedule breaks the derivative of every input, a break of an output only some.
            if switched:
                level = KINK
            elif caused and histories[at + BREAK_LEVEL] <= LAST_LEVEL:
                level = max(KINK, histories[at + BREAK_LEVEL])
            change = (
                out[tables.block_settings[0]["outputs"] + 2 * k + 1]
                - tables.floats[control["starts"]]
            )
            before = tables.floats[control["data"] + BEFORE]
            small = tables.floats[control["data"] + SMALL]
            store_input(histories, at, t, change, level, before, small)
            limit = accurate_step(histories, at, tables.settings[0]["tolerance"])
            longest = limit if longest == 0.0 else min(longest, limit)
    histories[FLAGS], histories[BEGINS], out[LONGEST] = flags, 0.0, longest


@njit
def accurate_step(histories, at, tolerance):
    """Longest next step for which the error between two entries is within a tolerance [s]; FAR for no limit.

    The error of a polynomial through six entries is D times the product of their distances from the time. D is the
    divided difference of the last seven. The error is relative to the greatest change so far, or to a small change.
    """
    count = int(histories[at + COUNT])
    first = count - MOST_POINTS - 1
    # Fewer than seven entries have no divided difference of sixth order.
    if first < 0 or tolerance == 0.0:
        return FAR
    # Across a break the divided difference says nothing about the smooth parts.
    for k in range(first + 1, count):
        if is_after_break(histories, at, k):
            return FAR
    difference = 0.0
    for i in range(first, count):
        product = 1.0
        for j in range(first, count):
            if j != i:
                product *= time_of(histories, at, i) - time_of(histories, at, j)
        # Relative to the first value, so that a constant input gives exactly zero.
        difference += (
            histories[place_of(histories, at, i) + 1]
            - histories[place_of(histories, at, first) + 1]
        ) / product
    step = time_of(histories, at, count - 1) - time_of(histories, at, count - 2)
    # Error in the middle interval of equal steps as long as the last one.
    error = abs(difference) * MIDDLE * step**MOST_POINTS
    allowed = tolerance * histories[at + GREATEST]
    # The error grows with the sixth power of the step.
    return step * (allowed / error) ** (1.0 / MOST_POINTS) if error > 0.0 else FAR


@njit
def store_input(histories, at, t, change, level, before, small):
    """Store the change of an input at the time t; level : that of a break by other reasons than its own jump.

    before : change before the first entry; small : size of a small change
    """
    count = int(histories[at + COUNT])
    histories[at + GREATEST] = max(small, histories[at + GREATEST], abs(change))
    if count == 0:
        add_entry(histories, at, t, change, JUMP if change != before else KINK)
        return
    place = place_of(histories, at, count - 1)
    if t > histories[place]:
        if histories[place + 2] >= KINK and is_constant(histories, at, count, change):
            histories[at + COUNT] = count - 1.0
            if histories[at + NEXT] == count - 1:
                histories[at + NEXT] = -1.0
        add_entry(histories, at, t, change, SMOOTH)
        return
    if t < histories[place]:
        return
    # Two different values at the same time: the input jumps.
    if abs(change - histories[place + 1]) > ROUNDING * histories[at + GREATEST]:
        level = JUMP
    if level == SMOOTH:
        return
    if histories[place + 2] == SMOOTH:
        add_entry(histories, at, t, change, level)
    else:  # the last entry is already the one after a break at this time
        histories[place + 1], histories[place + 2] = change, min(level, histories[place + 2])


@njit(forceinline=True)
def is_constant(histories, at, count, change):
    """True if the last three entries of a history have the value `change`."""
    for k in range(max(0, count - 3), count):
        if histories[place_of(histories, at, k) + 1] != change:
            return False
    return count >= 3


@njit
def add_entry(histories, at, t, change, level):
    """Append an entry to a history."""
    count = int(histories[at + COUNT])
    place = place_of(histories, at, count)
    histories[place], histories[place + 1], histories[place + 2] = t, change, level
    # Breaks arrive in the order of their entries, so only the first one is awaited.
    if level != SMOOTH and histories[at + NEXT] < 0.0:
        histories[at + NEXT] = count
    histories[at + COUNT] = count + 1.0


@njit(forceinline=True)
def next_break(histories, control):
    """Time at which the next break of the input of a block arrives [s]. There must be one."""
    at = head_of(histories, control["history"])
    return time_of(histories, at, int(histories[at + NEXT])) + control["delay"]


@njit(forceinline=True)
def awaits_break(histories, control):
    """True if a break of the input of a block with a delay has not arrived yet."""
    return histories[head_of(histories, control["history"]) + NEXT] >= 0.0


@njit(forceinline=True)
def break_arrives(histories, control, t):
    """True if a break of the input of a block arrives at the time t, but for rounding, or has arrived before."""
    late = awaits_break(histories, control)
    return late and next_break(histories, control) - t <= ROUNDING * (abs(t) + control["delay"])


@njit
def admit_breaks(tables, number, t):
    """Let all breaks of the input of a block arrive that are due at the time t; number : of the block."""
    histories, control = tables.histories, tables.controls[number]
    at = head_of(histories, control["history"])
    while break_arrives(histories, control, t):
        k, count = int(histories[at + NEXT]), int(histories[at + COUNT])
        set_breaks(tables, number, t, histories[place_of(histories, at, k) + 2])
        histories[at + ARRIVED], histories[at + NEXT] = k, -1.0
        for later in range(k + 1, count):
            if is_after_break(histories, at, later):
                histories[at + NEXT] = later
                break


@njit
def set_breaks(tables, number, t, level):
    """Note that the output of a block has a break at the time t, for all inputs; number, level : of block and break.

    At one time the lowest level counts.
    """
    histories, integers = tables.histories, tables.integers
    for k in range(tables.controls.size):
        control = tables.controls[k]
        if control["delay"] > 0.0:
            at, own = head_of(histories, control["history"]), NONE
            for i in range(control["source_count"] + control["later_count"]):
                if integers[control["sources"] + i] == number:
                    own = level if i < control["source_count"] else level + 1.0
            histories[at + BREAK_LEVEL] = (
                min(own, histories[at + BREAK_LEVEL]) if histories[BREAK_TIME] == t else own
            )
    histories[BREAK_TIME] = t

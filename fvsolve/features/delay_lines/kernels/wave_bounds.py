"""Bounds of the waves sent into delay lines, beside jumps and between entries.

The bounds of a jump contain the wave on both sides of it. The bounds of entry k contain the wave at all times from
entry k - 1 to entry k, on both sides of all jumps. So a few comparisons show that a cell cannot get new extremes in a
step. Bounds are written once per entry, and again if the entry is recorded again.

Arguments are those of `wave_history`; ring, mask : result of `ring_of`.
"""

from fvsolve.features.delay_lines.kernels import wave_history as history
from fvsolve.features.delay_lines.kernels.line_rates import (
    BEFORE_ALL,
    entry_before,
    smooth_wave_linear,
)
from fvsolve.jit import njit

BOUND_ROUNDING = 1e-12  # of sums of waves, relative to their parts
GRID_ROUNDING = 1e-6  # of times in the grid of equal steps, as fraction of a step


@njit(forceinline=True)
def wave_at_jump(past, places, clock, ring, mask, at, wave, i):
    """Wave sent into a stretch just after jump i of its list [kg/s]; ring, mask : result of `ring_of`."""
    sent = past[history.jump_place(past, places, at, i)]
    count = history.count_until(past, places, at, i + 1, sent + clock[4])
    return smooth_wave_linear(past, clock, ring, mask, wave, sent) + history.sum_of_first(
        past, places, at, count
    )


@njit(forceinline=True)
def smooth_changes(past, clock, ring, mask, wave, t):
    """Sum of the changes of the smooth part of a wave in three intervals between entries, the second one around t."""
    k, _ = entry_before(past, clock, t)
    if k == BEFORE_ALL:
        return 0.0
    a, b = past[ring + 2 * ((k - 1) & mask) + wave], past[ring + 2 * (k & mask) + wave]
    c = past[ring + 2 * ((k + 1) & mask) + wave]
    d = past[ring + 2 * (min(k + 2, clock[0]) & mask) + wave]
    return abs(b - a) + abs(c - b) + abs(d - c)


@njit
def write_jump_bounds(past, places, clock, ring, mask, at, wave, begin):
    """Write the bounds of the jumps of a wave from position `begin` of its list on; ring, mask : result of `ring_of`.

    They include the sum of the smooth part and all jumps up to this one, for jumps at times that count as equal.
    """
    queue = int(past[history.JUMP_CAPACITY])
    for i in range(begin, int(past[at + history.JUMP_COUNT])):
        place = history.jump_place(past, places, at, i)
        sent = past[place]
        size = past[place + queue]
        total = past[place + 2 * queue]
        wave_after = wave_at_jump(past, places, clock, ring, mask, at, wave, i)
        smooth = smooth_wave_linear(past, clock, ring, mask, wave, sent)
        # Wave after the jump and before it; the third differs among jumps at times that count as equal.
        first = wave_after
        second = wave_after - size
        third = smooth + total
        # Widened by the rounding of sums and of times, so that no value read later lies outside.
        rounding = BOUND_ROUNDING * (abs(smooth) + abs(total) + abs(size) + abs(wave_after))
        rounding += GRID_ROUNDING * smooth_changes(past, clock, ring, mask, wave, sent)
        past[place + 3 * queue] = min(first, second, third) - rounding
        past[place + 4 * queue] = max(first, second, third) + rounding


@njit
def write_bounds(past, places, clock, line, q, wave):
    """Write the bounds of a wave of stretch q for the last entry, and for its jumps since the entry before.

    If those of earlier entries are missing, write them too, for one travel time.
    """
    newest = clock[0]
    same = clock[4]
    queue = int(past[history.JUMP_CAPACITY])
    near = 2.0 * same + GRID_ROUNDING / clock[2]
    at, (ring, mask) = (
        history.jump_head(places, line["stretch"] + q, wave),
        history.ring_of(places, line, q),
    )
    k, bounds = newest, history.bounds_of(places, line, q) + 2 * wave
    written = bounds - history.BOUNDS_BEGIN - wave
    # Begin earlier: at an entry recorded again, or one travel time back if bounds are missing.
    if past[written] != newest - 1 or past[history.RESTATED_ENTRY] == newest - 1:
        oldest = history.time_of(past, newest - 1) - (
            line["tau"] if past[written] != k - 1 else 0.0
        )
        k = newest - 1
        while (
            k > newest - mask + 1
            and k > history.PROFILE_ENTRIES
            and history.time_of(past, k - 1) > oldest - near
        ):
            k -= 1
    past[written], k = newest, max(k, history.PROFILE_ENTRIES)
    begin = history.time_of(past, k - 1) if k > history.PROFILE_ENTRIES else -history.INFINITE
    count = int(past[at + history.JUMP_COUNT])
    i = history.count_back(past, places, at, count, begin - near)
    write_jump_bounds(past, places, clock, ring, mask, at, wave, i)
    # Jumps sent before the first interval are part of the wave at its beginning.
    before = history.count_until(past, places, at, i, begin + same)
    while k <= newest:
        end, first = history.time_of(past, k), history.sum_of_first(past, places, at, before)
        after = history.count_until(past, places, at, before, end + same)
        last, b = history.sum_of_first(past, places, at, after), past[ring + 2 * (k & mask) + wave]
        a = past[ring + 2 * ((k - 1) & mask) + wave] if k > history.PROFILE_ENTRIES else 0.0
        turn = a + (b - a)  # greatest or least value of rounded interpolation
        low, high = min(a + first, b + last, turn + last), max(a + first, b + last, turn + last)
        # Jumps near both ends too, because a time of reading may be rounded past an entry.
        i = history.count_until(past, places, at, i, begin - near)
        for j in range(i, count):
            place = history.jump_place(past, places, at, j)
            if past[place] > end + near:
                break
            low, high = min(low, past[place + 3 * queue]), max(high, past[place + 4 * queue])
        place = bounds + history.BOUNDS_SIZE * (k & mask)
        past[place], past[place + 1], begin, before = low, high, end, after
        k += 1


@njit(forceinline=True)
def bounds_between(past, bounds, mask, wave, first, last):
    """(least, greatest) of the bounds of a wave for the entries `first` to `last`; bounds : result of `bounds_of`."""
    place = bounds + history.BOUNDS_SIZE * (first & mask) + 2 * wave
    low, high = past[place], past[place + 1]
    for k in range(first + 1, last + 1):
        place = bounds + history.BOUNDS_SIZE * (k & mask) + 2 * wave
        low, high = min(low, past[place]), max(high, past[place + 1])
    return low, high


@njit(forceinline=True)
def entry_back(past, wrap, k, t):
    """First entry at or after t, if it is at most k, by search from k; wrap : capacity for times, less 1."""
    while k > history.PROFILE_ENTRIES and past[history.HEADER_SIZE + ((k - 1) & wrap)] >= t:
        k -= 1
    return k


@njit(forceinline=True)
def entry_ahead(past, wrap, k, newest, t):
    """First entry at or after t, at most `newest`, if it is at least k, by search from k; wrap : see `entry_back`."""
    while k < newest and past[history.HEADER_SIZE + (k & wrap)] < t:
        k += 1
    return k

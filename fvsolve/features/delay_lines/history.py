"""History of the waves in delay lines as a single array: its size, its ring buffers, and its place in a memory."""

import math

import numpy as np

from fvsolve.errors import Notice
from fvsolve.features.delay_lines.kernels import wave_history as at

# stored jumps: in all lines together, least and most of each wave
TOTAL_JUMPS = 2**16
LEAST_JUMPS = 32
MOST_JUMPS = 1024
# spare entries beyond a delay: in all lines together, least and most of each
TOTAL_SPARE = 2**14
LEAST_SPARE = 32
MOST_SPARE = 256
HISTORY_DELAYS = 1.1  # a history spans this many delays
MARGIN_ENTRIES = 8  # and so many entries before that
LEAST_STEPS = 16  # steps


def set_rings(delays: np.ndarray, longest: float) -> None:
    """Set the size of the ring buffer of each stretch of delay lines, in entries, and its place among the rings.

    A ring holds HISTORY_DELAYS times the delay in steps of `longest` [s], and spare entries; sizes are powers of two.
    """
    if not len(delays):
        return
    count = int(delays["stretches"].sum())
    spare = min(MOST_SPARE, max(LEAST_SPARE, TOTAL_SPARE // max(1, count)))
    entries = HISTORY_DELAYS * delays["hold"] / longest + MARGIN_ENTRIES + spare
    delays["ring_size"] = 1 << np.ceil(np.log2(entries)).astype(np.int64)
    sizes = delays["ring_size"] * delays["stretches"]
    delays["ring"] = np.cumsum(sizes) - sizes


def history_size(delays: np.ndarray, wider: int = 1) -> int:
    """Size of the history array of these delay lines, with ring buffers `wider` times as long as at first."""
    if not len(delays):
        return 0
    count, entries = int(delays["stretches"].sum()), wider * ring_entries(delays)
    per_wave = at.HEAD_SIZE + at.JUMP_SIZE * jump_capacity(count)
    per_stretch = at.ARRIVALS_SIZE + 2 * per_wave + at.RING_GAP + at.BOUNDS_BEGIN
    times = wider * int(delays["ring_size"].max())
    return at.HEADER_SIZE + times + per_stretch * count + (2 + at.BOUNDS_SIZE) * entries


def ring_entries(delays: np.ndarray) -> int:
    """Capacity of the ring buffers of all stretches together, in entries, before they are lengthened."""
    return int((delays["ring_size"] * delays["stretches"]).sum())


def jump_capacity(count: int) -> int:
    """Number of jumps of each wave that can be stored at the same time, for `count` stretches."""
    return max(LEAST_JUMPS, min(MOST_JUMPS, TOTAL_JUMPS // count))


def reset_history(past: np.ndarray, delays: np.ndarray) -> None:
    """Clear the history array and write its sizes."""
    past[:] = 0.0
    begin_history(past, delays)


def begin_history(past: np.ndarray, delays: np.ndarray) -> None:
    """Write the sizes of a history to an array of zeros."""
    if not len(delays):
        return
    count = int(delays["stretches"].sum())
    sizes = [
        at.CAPACITY,
        at.JUMP_CAPACITY,
        at.STRETCHES,
        at.RING_FACTOR,
        at.ARRIVALS_TIME,
        at.CORRECTED_TIME,
    ]
    wider = 1 if past.size == history_size(delays) else ring_factor(past, delays)
    past[sizes] = (
        wider * int(delays["ring_size"].max()),
        jump_capacity(count),
        count,
        wider,
        math.nan,
        -math.inf,
    )
    past[at.NEXT_ARRIVAL], past[at.RING_ENTRIES] = at.INFINITE, ring_entries(delays)
    past[at.SEGMENT_END], past[at.REFLECTION_RATE] = at.INFINITE, 1.0 / float(delays["tau"].min())


def ring_factor(past: np.ndarray, delays: np.ndarray) -> int:
    """Factor by which ring buffers are longer than at first, from the size of the history array."""
    wider = 1
    while history_size(delays, wider) < past.size:
        wider *= 2
    return wider


def stored_history(memory: dict[str, np.ndarray]) -> np.ndarray:
    """History of delay lines in the memory of a state; raises ValueError if the memory contains no history."""
    if "past" not in memory:
        text = "the memory of the state contains no history of delay lines; expected a State that a run returned"
        raise ValueError(text)
    return memory["past"].copy()


def stored_entries(past: np.ndarray) -> np.ndarray:
    """Numbers of all entries whose times are still stored, without those of the initial steady state."""
    return np.arange(
        max(at.PROFILE_ENTRIES, int(past[at.COUNT]) - int(past[at.CAPACITY])), int(past[at.COUNT])
    )


def jump_times(past: np.ndarray, delays: np.ndarray, begin: float, end: float) -> np.ndarray:
    """Times at which jumps reach ends or middles of stretches, between `begin` and `end` [s], increasing."""
    places, queue = at.offsets_of(past), int(past[at.JUMP_CAPACITY])
    heads = past[places[1] : places[2]].reshape(-1, at.HEAD_SIZE)
    line_of, arrivals = np.repeat(np.arange(len(delays)), delays["stretches"]), []
    for head in np.flatnonzero(heads[:, at.JUMP_COUNT]):
        line, first = delays[line_of[head // 2]], places[2] + at.JUMP_SIZE * queue * head
        order = (
            int(heads[head, at.FIRST_JUMP]) + np.arange(int(heads[head, at.JUMP_COUNT]))
        ) % queue
        sent = past[first + order]
        arrivals += [sent + line["tau"], sent + 0.5 * line["tau"]]
    times, tolerance = np.sort(np.concatenate([[], *arrivals])), at.time_tolerance(past)
    times = times[(times > begin + tolerance) & (times < end - tolerance)]
    return times[np.diff(times, prepend=-np.inf) > tolerance]


def steps_left(past: np.ndarray, delays: np.ndarray) -> int:
    """Number of steps that can be taken before an entry that is still needed is overwritten."""
    count, sizes = int(past[at.COUNT]), int(past[at.RING_FACTOR]) * delays["ring_size"]
    if count == 0:
        return int(sizes.min()) - MARGIN_ENTRIES - LEAST_STEPS
    stored = stored_entries(past)
    times = past[at.HEADER_SIZE + (stored & (int(past[at.CAPACITY]) - 1))]
    oldest = stored[0] + np.maximum(
        0, np.searchsorted(times, times[-1] - HISTORY_DELAYS * delays["hold"]) - MARGIN_ENTRIES
    )
    return int((sizes - (count - oldest)).min())


def with_doubled_rings(past: np.ndarray, delays: np.ndarray) -> np.ndarray:
    """Copy of the history with ring buffers twice as long, with the same entries."""
    wider = 2 * int(past[at.RING_FACTOR])
    result = np.zeros(history_size(delays, wider))
    result[: at.HEADER_SIZE] = past[: at.HEADER_SIZE]
    result[[at.CAPACITY, at.RING_FACTOR]] *= 2.0
    stored = stored_entries(past)
    old, new = at.HEADER_SIZE, at.HEADER_SIZE
    result[new + (stored & (int(result[at.CAPACITY]) - 1))] = past[
        old + (stored & (int(past[at.CAPACITY]) - 1))
    ]
    here, there = at.offsets_of(past), at.offsets_of(result)
    result[there[0] : there[3]] = past[here[0] : here[3]]  # all except rings and bounds
    for row in delays:
        for q in range(row["stretches"]):
            (old, old_mask), (new, new_mask) = at.ring_of(here, row, q), at.ring_of(there, row, q)
            own = stored[max(0, stored.size - old_mask - 1) :]
            for wave in range(2):
                result[new + 2 * (own & new_mask) + wave] = past[old + 2 * (own & old_mask) + wave]
    return result


def jump_overflow_notices(past: np.ndarray) -> list[Notice]:
    """List with a notice if there was no storage for some jumps, which were smoothed; else empty."""
    if not past.size or past[at.GREATEST_UNSTORED_JUMP] == 0.0:
        return []
    share = past[at.GREATEST_UNSTORED_JUMP] / past[at.GREATEST_JUMP]
    text = (
        f"more than {int(past[at.JUMP_CAPACITY])} jumps were travelling in one pipe: some of them, of up to "
        f"{share:.3g} times the greatest jump, were smoothed over a step; raise `numerics.delay_tolerance`, so that "
        'fewer jumps are stored, or set pipe_model = "finite-volume"'
    )
    return [Notice("jumps", "numerics", text, "delay_tolerance", float(share), None)]

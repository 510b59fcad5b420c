"""The past of delay lines as one array: its sizes, its room, what of it a state remembers. Knows no pipes."""

from __future__ import annotations

import math

import numpy as np

from fvsolve.errors import Notice
from fvsolve.kernels.delay import history as at

JUMPS, LEAST_JUMPS, MOST_JUMPS = 2**16, 32, 1024  # kept in all lines together, and of each wave
ENTRIES, LEAST_SPARE, MOST_SPARE = 2**14, 32, 256  # beyond those of a delay: in all lines together, and of each
OLDER = 1.1  # delays that a past goes back, and
BESIDE = 8  # entries before that
LEAST_ROOM = 16  # steps


def rings_of(delays: np.ndarray, longest: float) -> None:
    """Give each stretch a ring that holds its delay in steps of this length [s] and some more, a power of two."""
    if not len(delays):
        return
    many = int(delays["stretches"].sum())
    spare = min(MOST_SPARE, max(LEAST_SPARE, ENTRIES // max(1, many)))
    wanted = OLDER * delays["hold"] / longest + BESIDE + spare
    delays["room"] = 1 << np.ceil(np.log2(wanted)).astype(np.int64)
    every = delays["room"] * delays["stretches"]
    delays["ring"] = np.cumsum(every) - every


def past_size(delays: np.ndarray, wider: int = 1) -> int:
    """Numbers that a run keeps of these lines, rings `wider` times as long as at first."""
    if not len(delays):
        return 0
    many, entries = int(delays["stretches"].sum()), wider * int((delays["room"] * delays["stretches"]).sum())
    per_stretch = at.ARRIVALS + 2 * at.HEADS + 6 * queue_of(many) + at.APART
    return at.HEAD + wider * int(delays["room"].max()) + per_stretch * many + 2 * entries


def queue_of(many: int) -> int:
    """Jumps of each wave of so many stretches that are kept at once."""
    return max(LEAST_JUMPS, min(MOST_JUMPS, JUMPS // many))


def begin_past(past: np.ndarray, delays: np.ndarray) -> None:
    """Nothing was before; say the sizes."""
    if not len(delays):
        return
    past[:], many = 0.0, int(delays["stretches"].sum())
    sizes = [at.CAPACITY, at.QUEUE, at.STRETCHES, at.WIDER, at.KNOWN_TIME, at.MENDED]
    wider = 1 if past.size == past_size(delays) else wider_of(past, delays)
    past[sizes] = wider * int(delays["room"].max()), queue_of(many), many, wider, math.nan, -math.inf
    past[at.NEXT] = at.INFINITE


def wider_of(past: np.ndarray, delays: np.ndarray) -> int:
    """How many times as long as at first rings of a past of this size are."""
    wider = 1
    while past_size(delays, wider) < past.size:
        wider *= 2
    return wider


def without_past(memory: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a state remembers beside the past of delay lines, and that; ValueError where it is not such a memory."""
    size = int(memory[-1]) if memory.size and np.isfinite(memory[-1]) else -1
    if not 0 <= size < memory.size:
        raise ValueError("no such past")
    return memory[: memory.size - 1 - size], memory[memory.size - 1 - size : -1]


def kept_entries(past: np.ndarray) -> np.ndarray:
    """Numbers of all entries whose times are kept."""
    return np.arange(max(at.ZEROS, int(past[at.COUNT]) - int(past[at.CAPACITY])), int(past[at.COUNT]))


def times_of_jumps(past: np.ndarray, delays: np.ndarray, begin: float, end: float) -> np.ndarray:
    """When jumps reach the ends or the middles of stretches, after `begin` and before `end` [s], in order."""
    places, queue = at.places_of(past), int(past[at.QUEUE])
    heads = past[places[1] : places[2]].reshape(-1, at.HEADS)
    line_of, found = np.repeat(np.arange(len(delays)), delays["stretches"]), []
    for head in np.flatnonzero(heads[:, at.MANY]):
        line, first = delays[line_of[head // 2]], places[2] + 3 * queue * head
        order = (int(heads[head, at.FIRST]) + np.arange(int(heads[head, at.MANY]))) % queue
        sent = past[first + order]
        found += [sent + line["tau"], sent + 0.5 * line["tau"]]
    times, apart = np.sort(np.concatenate([[], *found])), at.same_time(past)
    times = times[(times > begin + apart) & (times < end - apart)]
    return times[np.diff(times, prepend=-np.inf) > apart]


def room_left(past: np.ndarray, delays: np.ndarray) -> int:
    """Steps that can be taken before an entry is lost that is still to be read."""
    count, rooms = int(past[at.COUNT]), int(past[at.WIDER]) * delays["room"]
    if count == 0:
        return int(rooms.min()) - BESIDE - LEAST_ROOM
    kept = kept_entries(past)
    times = past[at.HEAD + (kept & (int(past[at.CAPACITY]) - 1))]
    wanted = kept[0] + np.maximum(0, np.searchsorted(times, times[-1] - OLDER * delays["hold"]) - BESIDE)
    return int((rooms - (count - wanted)).min())


def doubled(past: np.ndarray, delays: np.ndarray) -> np.ndarray:
    """The same past with room for twice as many entries."""
    wider = 2 * int(past[at.WIDER])
    found = np.zeros(past_size(delays, wider))
    found[: at.HEAD] = past[: at.HEAD]
    found[[at.CAPACITY, at.WIDER]] *= 2.0
    kept = kept_entries(past)
    old, new = at.HEAD, at.HEAD
    found[new + (kept & (int(found[at.CAPACITY]) - 1))] = past[old + (kept & (int(past[at.CAPACITY]) - 1))]
    here, there = at.places_of(past), at.places_of(found)
    found[there[0] : there[3]] = past[here[0] : here[3]]  # all but rings
    for row in delays:
        for q in range(row["stretches"]):
            (old, old_mask), (new, new_mask) = at.ring_of(here, row, q), at.ring_of(there, row, q)
            own = kept[max(0, kept.size - old_mask - 1) :]
            for wave in range(2):
                found[new + 2 * (own & new_mask) + wave] = past[old + 2 * (own & old_mask) + wave]
    return found


def crowded(past: np.ndarray) -> list[Notice]:
    """A notice where jumps found no room as such."""
    if not past.size or past[at.CROWDED] == 0.0:
        return []
    share = past[at.CROWDED] / past[at.GREATEST]
    text = (
        f"more than {int(past[at.QUEUE])} jumps were on their way in one pipe: some, up to {share:.3g} of the "
        'greatest, were smoothed over a step; raise numerics.accuracy, which keeps fewer, or set line = "cells"'
    )
    return [Notice("jumps", "numerics", text, "accuracy", float(share), None)]

"""Histories of the inputs of blocks with a delay: their array, its space for entries, and its data in a state."""

import numpy as np

from fvsolve.features.controls.kernels import input_histories as at

FIRST_CAPACITY = 1024  # entries of a block
ENTRIES_OF_STEP = 2  # most entries at the end of a step: one, and one after a break there
LEAST_STEPS = 256  # steps
# a history spans this many delays: the last step, at most a delay long, may be computed again
DELAYS_NEEDED = 2.0
MARGIN = at.MOST_POINTS  # and so many entries before that


def delays_of(controls: np.ndarray) -> np.ndarray:
    """Delays of blocks with a delay [s], in the order of their histories; controls : table of blocks."""
    return controls["delay"][controls["delay"] > 0.0]


def histories_size(controls: np.ndarray, capacity: int = FIRST_CAPACITY) -> int:
    """Size of the array of all histories with space for `capacity` entries each; 0 if no block has a delay."""
    count = len(delays_of(controls))
    return at.HEADER + count * (at.HEAD + at.ENTRY * capacity) if count else 0


def reset_histories(histories: np.ndarray, controls: np.ndarray) -> None:
    """Clear all histories; the space for entries stays."""
    count = len(delays_of(controls))
    if not count:
        return
    capacity = ((histories.size - at.HEADER) // count - at.HEAD) // at.ENTRY
    histories[:] = 0.0
    histories[at.CAPACITY], histories[at.BREAK_TIME] = capacity, -np.inf
    heads = histories[at.HEADER :].reshape(count, -1)
    heads[:, [at.ARRIVED, at.NEXT]] = -1.0


def stored_histories(memory: dict[str, np.ndarray]) -> np.ndarray:
    """Histories in the memory of a state; raises ValueError if the memory contains none."""
    if "histories" not in memory:
        text = "the memory of the state contains no histories of delayed inputs; expected a State that a run returned"
        raise ValueError(text)
    return memory["histories"].copy()


def stored_entries(histories: np.ndarray, head: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(numbers of the entries of a history that are stored, entries : float64[n, 3]); head : its head and entries."""
    count, capacity = int(head[at.COUNT]), int(histories[at.CAPACITY])
    numbers = np.arange(max(0, count - capacity), count)
    return numbers, head[at.HEAD :].reshape(-1, at.ENTRY)[numbers % capacity]


def steps_left(histories: np.ndarray, delays: np.ndarray) -> int:
    """Number of steps that can be taken before an entry that is still needed is overwritten."""
    capacity, most = int(histories[at.CAPACITY]), 0
    for head, delay in zip(histories[at.HEADER :].reshape(delays.size, -1), delays, strict=True):
        _, entries = stored_entries(histories, head)
        if len(entries):
            oldest = np.searchsorted(entries[:, 0], entries[-1, 0] - DELAYS_NEEDED * delay) - MARGIN
            most = max(most, len(entries) - max(0, int(oldest)))
    return (capacity - most) // ENTRIES_OF_STEP


def with_doubled_space(histories: np.ndarray, delays: np.ndarray) -> np.ndarray:
    """Copy of all histories with space for twice as many entries."""
    capacity = 2 * int(histories[at.CAPACITY])
    result = np.zeros(at.HEADER + delays.size * (at.HEAD + at.ENTRY * capacity))
    result[: at.HEADER], result[at.CAPACITY] = histories[: at.HEADER], capacity
    heads, new_heads = (
        array[at.HEADER :].reshape(delays.size, -1) for array in (histories, result)
    )
    for head, new in zip(heads, new_heads, strict=True):
        numbers, entries = stored_entries(histories, head)
        new[: at.HEAD] = head[: at.HEAD]
        new[at.HEAD :].reshape(-1, at.ENTRY)[numbers % capacity] = entries
    return result


def with_space(histories: np.ndarray, controls: np.ndarray) -> np.ndarray:
    """These histories, with more space for entries if only few steps are left."""
    while steps_left(histories, delays_of(controls)) < LEAST_STEPS:
        histories = with_doubled_space(histories, delays_of(controls))
    return histories

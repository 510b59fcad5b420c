"""Pairwise combinations: few rows that contain every pair of values of two lists, instead of a full product."""

from itertools import combinations, product


def pairs(*lists) -> list[tuple]:
    """Rows with one value of each list; each pair of values of two lists occurs in a row. Deterministic and greedy."""
    left: set = set()
    for i, j in combinations(range(len(lists)), 2):
        left.update(((i, a), (j, b)) for a, b in product(indices(lists[i]), indices(lists[j])))
    rows = []
    while left:
        best = max(product(*map(indices, lists)), key=lambda row: len(left & met(row)))
        left -= met(best)
        rows.append(tuple(values[k] for values, k in zip(lists, best, strict=True)))
    return rows


def indices(values) -> range:
    return range(len(values))


def met(row: tuple) -> set:
    return set(combinations(enumerate(row), 2))

"""Combinations of parameters that contain every pair of values, or every value, instead of a full product."""

from itertools import combinations, product

from _pytest.mark import ParameterSet


def pairs(*lists) -> list[tuple]:
    """Rows with one value of each list; each pair of values of two lists occurs in a row. Deterministic and greedy."""
    left: set = set()
    for i, j in combinations(range(len(lists)), 2):
        left.update(((i, a), (j, b)) for a, b in product(indices(lists[i]), indices(lists[j])))
    rows = []
    while left:
        best = max(product(*map(indices, lists)), key=lambda row: len(left & pairs_of(row)))
        left -= pairs_of(best)
        rows.append(tuple(values[k] for values, k in zip(lists, best, strict=True)))
    return rows


def indices(values) -> range:
    return range(len(values))


def pairs_of(row: tuple) -> set:
    return set(combinations(enumerate(row), 2))


def is_in_turn(item, mark: str = "in_turn") -> bool:
    """False for the combinations of parameters that the mark leaves out.

    The k-th value of the longest list is combined with value k of each other list, which begins again at its end. So
    each value of each list occurs at least once.
    """
    if not item.get_closest_marker(mark):
        return True
    axes = [place_in_list(mark, item.callspec.params) for mark in item.iter_markers("parametrize")]
    _, k = max(axes, key=lambda axis: axis[0])
    return all(index == k % size for size, index in axes)


def place_in_list(mark, values: dict) -> tuple[int, int]:
    """Length of the list of a mark `parametrize`, and the index of the values of a test in it."""
    names, rows = mark.args[0], list(mark.args[1])
    names = [name.strip() for name in names.split(",")] if isinstance(names, str) else names
    rows = [
        row.values if isinstance(row, ParameterSet) else (row,) if len(names) == 1 else row
        for row in rows
    ]
    same = [all(own is values[name] for name, own in zip(names, row, strict=True)) for row in rows]
    return len(rows), same.index(True)

"""Names of states; names of cells are made on request, because a mesh can have millions of cells."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence


class Numbered(Sequence):
    """Sequence `stem[0]`, `stem[1]` and so on, of a given length."""

    def __init__(self, stem: str, count: int) -> None:
        self.stem, self.count = stem, count

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, i):
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(self.count))]
        if not -self.count <= i < self.count:
            raise IndexError(i)
        return f"{self.stem}[{int(i) % self.count}]"


class StateNames(Sequence):
    """Names of all states, part by part."""

    def __init__(self) -> None:
        self.parts: list[Sequence[str]] = []
        self.firsts: list[int] = []
        self.count = 0

    def __copy__(self) -> StateNames:
        """Copy to which names can be added without effect on the original."""
        names = StateNames()
        names.parts, names.firsts, names.count = self.parts.copy(), self.firsts.copy(), self.count
        return names

    def add(self, names: Sequence[str]) -> None:
        """Append names."""
        self.parts.append(names)
        self.firsts.append(self.count)
        self.count += len(names)

    def __len__(self) -> int:
        return self.count

    def __getitem__(self, i):
        if isinstance(i, slice):
            return [self[k] for k in range(*i.indices(self.count))]
        if not -self.count <= i < self.count:
            raise IndexError(i)
        i = int(i) % self.count
        k = bisect_right(self.firsts, i) - 1
        return self.parts[k][i - self.firsts[k]]

    def __iter__(self) -> Iterator[str]:
        return (name for part in self.parts for name in part)

    def __eq__(self, other) -> bool:
        return (
            isinstance(other, Sequence)
            and len(other) == self.count
            and all(map(str.__eq__, self, other))
        )

    __hash__ = None

    def __repr__(self) -> str:
        return repr(list(self))

    def single(self) -> Iterator[tuple[int, str]]:
        """Yield index and name of each state outside the sequences `Numbered`, which are the names of basin cells."""
        for first, part in zip(self.firsts, self.parts, strict=True):
            if not isinstance(part, Numbered):
                yield from enumerate(part, first)

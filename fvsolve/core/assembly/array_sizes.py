"""Sizes of the arrays that all functions of a model share, as parts and features of a case reserve them."""

from collections.abc import Callable

import numpy as np

from fvsolve.core.kernels import dtypes as rec


class ArraySizes:
    """Stretches of `out`, rows of the ledger, arrays of a run and work arrays, as they have been reserved so far.

    offsets : offset in `out` of each stretch, known when `place` has been called
    run_arrays : name of an array of `RunArrays` -> its shape
    """

    def __init__(self) -> None:
        self.ledger_rows: list[tuple[str, int]] = []
        self.stretches: list[tuple[str, int]] = []
        self.offsets: dict[str, int] = {}
        self.size = 0
        self.run_arrays: dict[str, int | tuple[int, int]] = {}
        self.marks = self.feature_marks = 0
        self.first_mark = 0  # of those of features
        self.event_flags = 0
        self.feature_power = self.feature_stored = 0
        self.last_power = self.last_stored = 0
        # True if `out` depends on rates, also where they are not requested
        self.reads_rates = False
        self.scratch: list[Callable[[int], int]] = []
        self.spare: list[Callable[[int], int]] = [lambda out: out]
        self.places = [0]

    def ledger(self, name: str, rows: int) -> None:
        """Reserve rows of the ledger of the time loop; they lie in `out`, in the order of the calls."""
        self.ledger_rows.append((name, int(rows)))

    def out(self, name: str, size: int) -> None:
        """Reserve a stretch of `out`, the array that the right-hand side writes in addition to dydt."""
        self.stretches.append((name, int(size)))

    def run_array(self, name: str, shape: int | tuple[int, int]) -> None:
        """State the shape of an array of `RunArrays`."""
        self.run_arrays[name] = shape

    def flags(self, count: int) -> int:
        """Reserve event flags of the run, behind those that are reserved; return the number of the first."""
        self.event_flags += int(count)
        return self.event_flags - int(count)

    def mark(self, count: int) -> int:
        """Reserve entries of `marks` before those of devices; return the number of the first."""
        self.feature_marks += int(count)
        return self.first_mark + self.feature_marks - int(count)

    def need_places(self, count: int) -> None:
        """State the number of cells of a pipe, or of places that are computed like them."""
        self.places.append(int(count))

    def need_scratch(self, size: Callable[[int], int] | int) -> None:
        """State a size that a function needs of `scratch`; a function gives it from the greatest number of places."""
        self.scratch.append(size if callable(size) else lambda places, size=size: size)

    def need_spare(self, size: Callable[[int], int]) -> None:
        """State a size that a function needs of `spare`, as a function of the size of `out`."""
        self.spare.append(size)

    def place(self) -> np.ndarray:
        """Place all stretches; offsets in `out` : `kernels.dtypes.LAYOUT`[1], without work arrays."""
        layout, at = np.zeros(1, rec.LAYOUT), rec.OUT_HEAD
        for name, size in (
            ("pressure", self.stretches[0][1]),
            *self.ledger_rows,
            *self.stretches[1:],
        ):
            self.offsets[name], at = at, at + size
            if name in rec.LAYOUT.names:
                layout[name] = self.offsets[name]
        layout["size"] = self.size = at
        layout["forces"] = layout["rates"] = -1
        layout["device_mark"] = self.first_mark + self.feature_marks
        layout["feature_power"], layout["feature_stored"] = self.feature_power, self.feature_stored
        layout["last_power"], layout["last_stored"] = self.last_power, self.last_stored
        return layout

    def shapes(self) -> rec.RunArrays:
        """Shapes of all arrays of a run; those that nobody has stated are empty."""
        found = dict.fromkeys(rec.RunArrays._fields, 0) | self.run_arrays
        places = max(self.places)
        found["scratch"] = max((int(size(places)) for size in self.scratch), default=0)
        found["spare"] = max(int(size(self.size)) for size in self.spare)
        found["marks"], found["armed"] = self.marks + self.feature_marks, self.event_flags
        return rec.RunArrays(**found)

"""What one run of a model writes, and so no other may: flags, marks, extremes, room to work in. Knows no time loop."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from fvsolve.kernels import records as rec

if TYPE_CHECKING:
    from fvsolve.model.model import Model


LINE = 8  # floats of a cache line


def lined(size: int) -> np.ndarray:
    """Zeros from a cache line on."""
    room = np.zeros(size + LINE)
    first = -(room.ctypes.data // 8) % LINE
    return room[first : first + size]


def wiped(shapes: rec.Written) -> rec.Written:
    """What runs write, of these shapes, all zero."""
    _, work, *others = shapes
    return rec.Written(np.zeros(1, rec.CLOCK), lined(work), *map(np.zeros, others))


class Slate:
    """Wiped at first, and new with each run; the model beside it is only read, by as many runs at once as there are.

    clock : until when schedules are as in the segment, and the step that is given; see `records.CLOCK`
    armed : 1.0 where an event has happened and still holds; marks : first times of what a model cannot follow [s]
    envelope, extremes : least and greatest of all cells and of all probes, each above its time
    """

    def __init__(self, model: Model) -> None:
        self.model, self.written, self.tables = model, wiped(model.shapes), model.tables
        if len(model.tables.walls) > 0 or (model.tables.basins["frame"] >= 0).any():  # what is drawn moves
            basins = model.tables.basins.copy()
            self.tables = model.tables._replace(plane=lined(model.tables.plane.size), basins=basins)
            self.tables.plane[:] = model.tables.plane
        if len(model.tables.rides):  # who asks what joints hold makes it heavy
            self.tables = self.tables._replace(rides=model.tables.rides.copy())
        self.clock = self.written.clock[0]
        self.armed, self.marks = self.written.armed, self.written.marks
        self.envelope, self.extremes = self.written.envelope, self.written.extremes
        self.clock["limit"], self.marks[:] = np.inf, np.nan
        for array in (self.envelope, self.extremes):
            array[0], array[1], array[2], array[3] = np.inf, np.nan, -np.inf, np.nan

    @cached_property
    def handle(self) -> np.ndarray:
        """The tables of the model, what is written here, and what there is to call, as compiled functions take them."""
        from fvsolve.kernels.handle import make_handle

        functions = self.model.functions
        return make_handle((*self.tables, *self.written, functions.calls, functions.hooks))

    def evaluate(self, t: float, y: np.ndarray, limit: float) -> tuple[np.ndarray, np.ndarray]:
        """`Model.evaluate` where devices stand as the flags here have them, which follow what holds at (t, y)."""
        t, y = self.model.given(t, y)
        self.clock["limit"] = limit
        dydt, out = np.zeros(y.size), self.model.new_out()
        self.arm(t, y)
        self.model.functions.rhs(t, y, dydt, out, self.handle)
        return dydt, out

    def arm(self, t: float, y: np.ndarray) -> None:
        """Set the flags of all events to what holds at (t, y); what a device does there can hang on other devices."""
        g = np.zeros(self.armed.size)
        for _ in range(3 + 2 * len(self.model.events)):
            self.model.functions.events(t, y, self.handle, g)
            changed = np.any((g <= 0.0) != (self.armed > 0.0))
            self.armed[:] = g <= 0.0
            if not changed:
                return

    def fields(self, y: np.ndarray, out: np.ndarray) -> dict[str, Any]:
        """`Model.fields`, with the least and greatest pressures of pipes so far."""
        found = self.model.fields(y, out)
        found["out"] = out
        for k, (pipe, row) in enumerate(zip(self.model.pipes, self.model.tables.pipes, strict=True)):
            own, cells = found[pipe.name], row["cell"] + np.arange(pipe.cells)
            least, greatest = (self.model.cell_pressure(k, self.envelope[i, cells]) for i in (0, 2))
            own["least_pressure"] = np.minimum(least, own["pressure"])
            own["greatest_pressure"] = np.maximum(greatest, own["pressure"])
        return found

    def observe(self, t: float, y: np.ndarray, out: np.ndarray) -> np.ndarray:
        """Values of all probes at (t, y), with `out` as `evaluate` gave it : float64[probes] [SI]."""
        values = np.zeros(len(self.model.probes))
        self.model.functions.observe(t, y, out, self.handle, values)
        return values

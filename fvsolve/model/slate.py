"""What one run of a model writes, and so no other may: flags, marks, extremes, room to work in. Knows no time loop."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from fvsolve.kernels import records as rec
from fvsolve.kernels.delay.history import COUNT
from fvsolve.model.past import LEAST_ROOM, begin_past, doubled, room_left, without_past

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
    found = {name: np.zeros(shape) for name, shape in shapes._asdict().items() if name not in rec.INTEGERS}
    found |= {name: np.zeros(getattr(shapes, name), dtype=np.int64) for name in shapes._fields if name in rec.INTEGERS}
    found |= {"clock": np.zeros(1, rec.CLOCK), "work": lined(shapes.work)}
    if shapes.sharp:
        from fvsolve.kernels.handle import room_within

        found["sharp"] = room_within()
    return rec.Written(**found)


class Slate:
    """Wiped at first, and new with each run; the model beside it is only read, by as many runs at once as there are.

    clock : until when schedules are as in the segment, and the step that is given; see `records.CLOCK`
    armed : 1.0 where an event has happened and still holds; marks : first times of what a model cannot follow [s]
    envelope, extremes : least and greatest of all cells, and of all probes and what is watched, each above its time
    bands : of every basin, the first of the rows, of a mesh of the cells, that are stepped here and one beyond the
    last; joint : see `kernels.joint`, empty where all are; sums : see `kernels.sums`
    """

    def __init__(self, model: Model) -> None:
        self.model, self.written, self.tables = model, wiped(model.shapes), model.tables
        if len(model.tables.walls) > 0 or (model.tables.basins["frame"] >= 0).any():  # what is drawn moves
            basins = model.tables.basins.copy()
            self.tables = model.tables._replace(plane=lined(model.tables.plane.size), basins=basins)
            self.tables.plane[:] = model.tables.plane
        if len(model.tables.rides):  # who asks what joints hold makes it heavy
            self.tables = self.tables._replace(rides=model.tables.rides.copy())
        self.clock, self.full_at = self.written.clock[0], -np.inf  # entries of a past, at which its rings are full
        self.armed, self.marks = self.written.armed, self.written.marks
        self.envelope, self.extremes = self.written.envelope, self.written.extremes
        begin_past(self.written.past, model.tables.delays)
        self.clock["limit"], self.marks[:] = np.inf, np.nan
        basins = model.tables.basins
        self.written.bands[1::2] = np.where(basins["nx"] > 0, basins["ny"], basins["n"])  # all
        for array in (self.envelope, self.extremes):
            array[0], array[1], array[2], array[3] = np.inf, np.nan, -np.inf, np.nan

    @cached_property
    def handle(self) -> np.ndarray:
        """The tables of the model, what is written here, and what there is to call, as compiled functions take them."""
        functions = self.model.functions
        return self.linked(self.written, (functions.calls, functions.hooks))

    def linked(self, written: rec.Written, called: tuple) -> np.ndarray:
        """The handle of the tables with these arrays that are written, and these functions."""
        from fvsolve.kernels.handle import linked, places_of

        model = self.model
        shared = model.places if self.tables is model.tables else places_of(self.tables)
        sharp = places_of(self.tables._replace(**model.sharp)) if model.sharp else shared
        return linked(shared, sharp, written, called)

    def blank(self, armed: np.ndarray | float = 0.0) -> None:
        """Ready for a look at another state: flags as given, nothing sent into delay lines."""
        self.armed[:], self.clock["limit"] = armed, np.inf
        begin_past(self.past, self.model.tables.delays)

    @property
    def past(self) -> np.ndarray:
        """What was sent into delay lines."""
        return self.written.past

    @past.setter
    def past(self, past: np.ndarray) -> None:
        self.written, self.full_at = self.written._replace(past=past), -np.inf
        self.__dict__.pop("handle", None)

    def recall(self, state) -> None:
        """Take the past of delay lines from what a state remembers; of one without memory there is none."""
        if len(self.model.tables.delays) and state is not None and state.memory.size:
            self.past = without_past(state.memory)[1].copy()

    def room(self) -> float:
        """Steps that can be taken before the past of delay lines forgets what is yet to arrive."""
        delays = self.model.tables.delays
        if not len(delays):
            return np.inf
        count = self.past[COUNT]
        if self.full_at - count < LEAST_ROOM:  # which holds for any steps: looked at again only where it runs short
            while (left := room_left(self.past, delays)) < LEAST_ROOM:
                self.past = doubled(self.past, delays)
            self.full_at = count + left
        return float(self.full_at - count)

    def along(self, t: float, out: np.ndarray, parts: int = 1) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Pipe -> both waves in the middle of so many equal parts of its cells, of delay lines [kg/s]."""
        found = {}
        if len(self.model.tables.delays):
            from fvsolve.kernels.delay.along import along_lines

            for which, row in enumerate(self.model.tables.delays):
                n = parts * int(row["places"])
                found[int(row["pipe"])] = r, l = np.zeros(n), np.zeros(n)  # noqa: E741
                along_lines(t, out, self.handle, which, r, l)
        return found

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
        if not self.armed.size:
            return
        g = np.zeros(self.armed.size)
        for _ in range(3 + 2 * len(self.model.events)):
            self.model.functions.events(t, y, self.handle, g)
            changed = np.any((g <= 0.0) != (self.armed > 0.0))
            self.armed[:] = g <= 0.0
            if not changed:
                return

    def fields(self, t: float, y: np.ndarray, out: np.ndarray) -> dict[str, Any]:
        """`Model.fields`, with the least and greatest pressures of pipes so far."""
        found = self.model.fields(y, out, self.along(t, out))
        found["out"] = out
        for k, (pipe, row) in enumerate(zip(self.model.pipes, self.model.tables.pipes, strict=True)):
            own, cells = found[pipe.name], row["cell"] + np.arange(pipe.cells)
            least, greatest = (self.model.cell_pressure(k, self.envelope[i, cells]) for i in (0, 2))
            own["least_pressure"] = np.minimum(least, own["pressure"])
            own["greatest_pressure"] = np.maximum(greatest, own["pressure"])
        return found

    def observe(self, t: float, y: np.ndarray, out: np.ndarray) -> np.ndarray:
        """Values of all probes at (t, y), with `out` as `evaluate` gave it : float64[probes] [SI]."""
        values = np.zeros(len(self.model.tables.probes))
        self.model.functions.observe(t, y, out, self.handle, values)
        return values[: len(self.model.probes)]

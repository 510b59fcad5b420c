"""Data that one run of a model writes: event flags, first occurrences, extremes, work arrays."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from fvsolve.case.probe import OF_PRESSURE
from fvsolve.core.assembly.model_draft import aligned_zeros
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.model.compiled_case import CompiledCase


def zeros_for_run(shapes: rec.RunArrays) -> rec.RunArrays:
    """Arrays that a run writes, filled with zeros; shapes : shape of each."""
    arrays = {
        name: np.zeros(shape)
        for name, shape in shapes._asdict().items()
        if name not in rec.INTEGERS
    }
    arrays |= {
        name: np.zeros(getattr(shapes, name), dtype=np.int64)
        for name in shapes._fields
        if name in rec.INTEGERS
    }
    arrays |= {"clock": np.zeros(1, rec.CLOCK), "work": aligned_zeros(shapes.work)}
    return rec.RunArrays(**arrays)


class RunData:
    """Mutable data of one run, created anew for each run. The model itself is read-only and shared by runs.

    clock : end of the segment (schedules take their left limit there) and the given step, see `kernels.dtypes.CLOCK`
    armed : flag of each event, 1.0 while its condition holds; marks : first times at which the model does not hold [s]
    envelope : float64[4, cells]  least sum of both waves in each cell [kg/s], its time [s], greatest sum, its time
    extremes : float64[4, probes]  least value, its time, greatest value and its time, of probes, then of watched
    quantities
    accepted : 1 if there is an accepted state, then pressures of nodes and flows of valves there, as in `out`, then all
    these of the state before; see `kernels.node_clusters.begin_accepted`
    maxima : greatest values of cells of meshes over all accepted steps, see `MeshedPart.maxima`
    bands : for each meshed part first row (or first cell) that this thread computes, and the one after its last
    joint : see `kernels.band_exchange`, empty if one thread computes all; sums : see `kernels.stage_sums`
    """

    def __init__(self, model: CompiledCase) -> None:
        self.model, self.written, self.tables = model, zeros_for_run(model.shapes), model.tables
        self.clock = self.written.clock[0]
        self.armed, self.marks = self.written.armed, self.written.marks
        self.envelope, self.extremes = self.written.envelope, self.written.extremes
        self.maxima, self.accepted = self.written.maxima, self.written.accepted
        self.features = [feature.run(self) for feature in model.features]
        for own in self.features:
            self.tables = self.tables._replace(**own.written_tables())
        self.kept: list = []  # arrays behind handles
        # number of arrays that have been replaced since the start, because they have grown
        self.replaced = 0
        self.clock["limit"], self.marks[:] = np.inf, np.nan
        self.use_flags(model.flags)
        # all
        self.written.bands[:] = [
            row for part in model.meshed for row in part.band(0, part.row_count)
        ]
        for array in (self.envelope, self.extremes):
            array[0], array[1], array[2], array[3] = np.inf, np.nan, -np.inf, np.nan

    @property
    def undetermined_probes(self) -> np.ndarray:
        """True for each probe of a pressure that nothing determined at a step, at isolated nodes : bool[probes]."""
        probes, nodes = self.tables.probes, len(self.model.node_names)
        isolated = np.isfinite(self.marks[self.marks.size - nodes :])
        if not isolated.any():
            return np.zeros(len(probes), bool)
        reads_node = np.isin(probes["kind"], (rec.PRESSURE, rec.PRESSURE_BETWEEN))
        return reads_node & isolated[np.where(reads_node, probes["index"], 0)]

    @cached_property
    def isolated_probes(self) -> np.ndarray:
        """True for each probe of a pressure in a part that is isolated during the whole run : bool[probes]."""
        parts, both = self.model.isolated, (*self.model.probes, *self.model.watched)
        return np.array(
            [
                f"{probe.part}.{probe.name}" in parts and probe.quantity in OF_PRESSURE
                for probe in both
            ],
            bool,
        )

    @cached_property
    def handle(self) -> np.ndarray:
        """Handle of the model's tables, these arrays and the functions to call, an argument of compiled functions."""
        functions = self.model.functions
        return self.linked_handle(self.written, (functions.calls, functions.hooks))

    def linked_handle(self, written: rec.RunArrays, callables: tuple) -> np.ndarray:
        """Handle of the model's tables with other written arrays and functions.

        callables : (calls, hooks) of `kernels.compiled_functions.Functions`
        """
        from fvsolve.core.kernels.table_handle import (
            View,
            addresses_of,
            linked_handles,
            places_in_memory,
        )

        model = self.model
        shared = model.places if self.tables is model.tables else addresses_of(self.tables)
        views = []
        for own in self.features:
            for name, (array, replaced) in own.views().items():
                views.append(
                    View(
                        array,
                        addresses_of(self.tables._replace(**replaced)),
                        self.feature_tables(name),
                    )
                )
        following = [array for own in self.features for array in own.coefficients()]
        written = written._replace(memory=places_in_memory([*self.arrays().values(), *following]))
        self.kept.append(written.memory)
        return linked_handles(shared, views, written, callables, self.feature_tables(), self.kept)

    def feature_tables(self, view: str = "") -> list:
        """Tables of the features of the case, by slot; view : name of another view of the model."""
        tables: list = [None] * (1 + max((own.feature.slot for own in self.features), default=-1))
        for own in self.features:
            tables[own.feature.slot] = own.tables(view)
        return tables

    def reset(self, armed: np.ndarray | None = None) -> None:
        """Reset for another state: event flags as given or as at the start, and empty histories."""
        self.clock["limit"] = np.inf
        self.accepted[:] = 0.0
        self.use_flags(self.model.flags if armed is None else armed)
        for own in self.features:
            own.reset()

    def return_to_earlier(self) -> None:
        """Let iterations start from the accepted state before the last one, as those of the last one did."""
        half = self.accepted.size // 2
        self.accepted[:half] = self.accepted[half:]

    def arrays(self) -> dict[str, np.ndarray]:
        """Arrays that a state needs in addition to y, by name; they may grow in a run."""
        found = {}
        for own in self.features:
            found |= own.arrays()
        return found

    def set_array(self, name: str, values: np.ndarray) -> None:
        """Set one of `arrays`; the handle is made again only if the size is new."""
        own = next(owner for owner in self.features if name in owner.arrays())
        if own.store(name, values):
            self.replaced += 1
            self.__dict__.pop("handle", None)

    def restore_history(self, state) -> None:
        """Set the arrays of features from the memory of a state.

        They are unchanged if state or memory are missing. Raises ValueError if the memory contains no history.
        """
        if state is None or not state.memory:
            return
        for own in self.features:
            own.restore(state.memory)

    def history_capacity(self) -> float:
        """Number of steps that fit before a history would lose an entry that is still needed.

        Infinite without histories. Where there is little space left it is doubled; then the arrays of the histories
        and `handle` are new.
        """
        return min((own.capacity() for own in self.features), default=np.inf)

    def along(
        self, t: float, out: np.ndarray, parts: int = 1
    ) -> dict[int, tuple[np.ndarray, np.ndarray]]:
        """Waves along pipes without cells [kg/s] : number of the pipe -> (forward, backward), float64[parts * cells].

        They are the waves in the middle of each of `parts` equal parts of every cell.
        t, out : time and the result of `evaluate` there
        """
        return {pipe: both for own in self.features for pipe, both in own.waves(t, out, parts)}

    def begin_segment(self, t: float, y: np.ndarray, end: float) -> None:
        """Let features continue at the time t [s] of state y, together with jumps of schedules.

        A segment of the run begins at t. end : its end, where schedules may jump again; infinity for the last one [s]
        """
        for own in self.features:
            own.begin_segment(t, y, end)

    def evaluate(self, t: float, y: np.ndarray, limit: float) -> tuple[np.ndarray, np.ndarray]:
        """Right-hand side and `out`, as `Model.evaluate`, with event flags set to the conditions at (t, y).

        Waves arrive as stored in the histories of features.
        """
        return self.evaluate_checked(*self.model.checked(t, y), limit)

    def evaluate_checked(
        self, t: float, y: np.ndarray, limit: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Result of `evaluate` for arguments in the form that `Model.checked` returns."""
        self.clock["limit"] = limit
        dydt, out = np.zeros(y.size), self.model.new_out()
        self.set_flags(t, y)
        self.model.functions.rhs(t, y, dydt, out, self.handle)
        return dydt, out

    def set_flags(self, t: float, y: np.ndarray) -> None:
        """Set the flags of all events to the conditions at (t, y).

        Iterates, because devices may depend on other devices.
        """
        if not self.armed.size:
            return
        g = np.zeros(self.armed.size)
        for _ in range(3 + 2 * len(self.model.events)):
            self.model.functions.events(t, y, self.handle, g)
            before = self.armed.copy()
            self.use_flags(g <= 0.0)
            if (before == self.armed).all():
                return
            self.store_times(t, before)

    def use_flags(self, flags: np.ndarray) -> None:
        """Set the event flags, and what features keep for them."""
        self.armed[:] = flags
        for own in self.features:
            own.follow_flags()

    def apply_event(self, y: np.ndarray) -> str:
        """Let features change flags and states y at an event; returns the text of a fault, "" for none."""
        return next((text for own in self.features if (text := own.at_event(y))), "")

    def store_times(self, t: float, before: np.ndarray) -> None:
        """Let features continue at an event at t [s]; before : event flags before the change."""
        for own in self.features:
            own.flags_changed(t, before)

    def fields(self, t: float, y: np.ndarray, out: np.ndarray) -> dict[str, Any]:
        """Values as in `Model.fields`, with the least and greatest pressures in pipes up to now, and a key "out".

        out : result of `evaluate`, which is also the value of this key
        """
        fields = self.model.fields(y, out, self.along(t, out))
        fields["out"], at = out, 0
        least, greatest = (self.model.cell_pressures(self.envelope[i]) for i in (0, 2))
        for pipe in self.model.pipes:
            own, cells = fields[pipe.name], slice(at, at := at + pipe.cells)
            own["min_pressure"] = np.minimum(least[cells], own["pressure"])
            own["max_pressure"] = np.maximum(greatest[cells], own["pressure"])
        return fields

    def observe(self, t: float, y: np.ndarray, out: np.ndarray) -> np.ndarray:
        """Values of all probes at (t, y), `out` as returned by `evaluate` : float64[probes] [SI]."""
        values = np.zeros(len(self.model.tables.probes))
        self.model.functions.observe(t, y, out, self.handle, values)
        return values[: len(self.model.probes)]

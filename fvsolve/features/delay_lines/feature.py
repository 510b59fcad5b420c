"""Delay lines of a case: pipes whose waves are a history instead of cells."""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import numpy as np

from fvsolve.core.assembly.features import Feature, FeatureRun, with_slot
from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.rhs_assembly import RhsTerms
from fvsolve.core.steppers import automatic
from fvsolve.core.steppers.tableau import method_named
from fvsolve.features.delay_lines import choice, history, lower
from fvsolve.features.delay_lines.kernels import wave_history
from fvsolve.features.delay_lines.kernels.tables import DELAY, LINE_SETTINGS, SLOT, LineTables

TERMS = RhsTerms(
    outgoing_waves="line_rates: outgoing_line_waves",
    incoming_waves="line_rates: incoming_line_waves",
    observe="line_rates: observe_lines",
    record="history_update: record_lines",
    network_power="line_energy: power_lines",
    stored="line_energy: stored_lines",
    package="fvsolve.features.delay_lines.kernels",
)


class DelayLines(Feature, slot=0, wakes="pipe_model delay-line, pipe_model auto"):
    """Delay lines of a case.

    chosen : pipe -> by cells or as a delay line; delays : table of the lines; line_of : row of it for each pipe, or -1
    settings, node_ends : see `kernels.tables`
    sharp : tables of the model that are replaced while a jump is solved; sharp_delays : its table of the lines
    """

    step_histories = ("past",)

    def __init__(self, case, given_up=()) -> None:
        super().__init__(case, given_up)
        self.chosen = choice.line_methods(case, given_up)
        self.delays = self.sharp_delays = np.zeros(0, DELAY)
        self.settings = np.zeros(1, LINE_SETTINGS)
        self.node_ends = np.zeros(1, dtype=np.int64)
        self.line_of = np.zeros(0, dtype=np.int64)
        self.sharp: dict[str, np.ndarray] = {}

    @property
    def sets_arrivals(self) -> bool:
        return len(self.delays) > 0

    @property
    def further_cells(self) -> int:
        # of a line only stretches are stepped
        return int((self.delays["stretches"] - self.delays["places"]).sum())

    # build ----------

    def fill_pipe(self, draft, name, link, row) -> bool:
        chosen = self.chosen[name]
        if chosen.pipe_model != "delay-line":
            return False
        row["rate_factor"] = chosen.rate * link.length / link.cells / row["speed"]
        row["cells"] = 0
        row["y"] = draft.states(
            [f"{name}.mass"], 1e5 * row["admittance"] * link.length / row["speed"]
        )
        return True

    def lower(self, draft) -> None:
        lower.lower_delays(draft, self)
        self.settings[0]["jumps"] = 0.25 * draft.case.numerics.delay_tolerance
        if len(self.delays):
            method = method_named(automatic.first_method(draft.case.numerics.method))
            self.settings[0]["weights"], self.settings[0]["stages"] = (
                len(draft.floats),
                method.stages,
            )
            draft.floats += [*map(float, method.b), *method.times]

    def grouped(self, draft, group) -> None:
        lower.mark_event_ends(self.delays, draft, group)

    def settle(self, draft) -> list[str]:
        return lower.divide_lines(draft, self)

    def reserve(self, draft) -> None:
        if not len(self.delays):
            return
        lines, sizes = len(self.delays), draft.sizes
        capacity = history.jump_capacity(int(sum(self.delays["stretches"])))
        sizes.need_places(self.delays["places"].max())
        sizes.need_scratch(lambda places: 3 * places + capacity)
        # two copies of `out`, three values for each probe and node, arrival times of jumps and changes that they cause
        values = 3 * (len(draft.probe_table) + len(draft.node_table))
        arrivals = 2 * (1 << (4 * lines - 1).bit_length()) + 8 * lines + 1
        sizes.need_spare(lambda out: 2 * out + values + arrivals)

    def close(self, draft) -> None:
        self.sharp, self.sharp_delays = lower.jump_tables(draft, self)
        for array in (self.delays, self.sharp_delays, self.settings, self.node_ends, self.line_of):
            array.flags.writeable = False
        for array in self.sharp.values():
            array.flags.writeable = False

    def copy_for(self, case) -> DelayLines:
        own = copy.copy(self)
        own.case, own.delays = case, self.delays.copy()
        return own

    # model ----------

    def terms(self, model, cast) -> list[tuple[str, RhsTerms]]:
        return [("pipes", TERMS)] if len(self.delays) else []

    def refusal(self, function: str) -> str:
        if not len(self.delays):
            return ""
        text = f"{function}(t, y) is not defined for a model with delay lines: y does not contain their waves"
        return f'{text}; expected pipe_model = "finite-volume" (or rhs(State) instead of rhs(t, y))'

    def run(self, run_data) -> LineRun:
        return LineRun(self, run_data)

    def step_notices(self, model, method) -> list:
        if not len(self.delays):
            return []
        from fvsolve.core.step_limits.step_notices import given_step, span
        from fvsolve.features.delay_lines.growth import line_growth_notices

        return line_growth_notices(model, method, given_step(model), span(model))

    def seen_by_jumps(self) -> DelayLines:
        """Copy of the feature with the lines as a jump passes them."""
        own = copy.copy(self)
        own.delays, own.sharp = self.sharp_delays, {}
        return own


class LineRun(FeatureRun):
    """History of the waves in delay lines.

    past : the history; full_at : number of its entries at which its rings are full; sharp : handle of the view "sharp"
    """

    def __init__(self, feature: DelayLines, run_data) -> None:
        super().__init__(feature, run_data)
        self.delays, self.full_at = feature.delays, -math.inf
        self.past = np.zeros(history.history_size(self.delays))
        self.sharp = np.zeros(0, dtype=np.int64)
        if len(self.delays):
            from fvsolve.core.kernels.table_handle import empty_handle

            self.sharp = empty_handle()
        history.begin_history(self.past, self.delays)

    def tables(self, view: str = "") -> LineTables:
        own = self.feature
        delays = own.sharp_delays if view == "sharp" else own.delays
        return LineTables(delays, own.settings, own.node_ends, own.line_of, self.past, self.sharp)

    def views(self):
        return {"sharp": (self.sharp, self.feature.sharp)} if len(self.delays) else {}

    def arrays(self):
        return {"past": self.past}

    def store(self, name: str, values: np.ndarray) -> bool:
        self.full_at = -math.inf
        if self.past.size == values.size:
            self.past[:] = values
            return False
        self.past = values
        return True

    def reset(self) -> None:
        history.reset_history(self.past, self.delays)

    def restore(self, memory) -> None:
        if len(self.delays):
            self.run_data.set_array("past", history.stored_history(memory))

    def capacity(self) -> float:
        if not len(self.delays):
            return np.inf
        count = self.past[wave_history.COUNT]
        # a bound for any steps: checked again only near it
        if self.full_at - count < history.LEAST_STEPS:
            while (left := history.steps_left(self.past, self.delays)) < history.LEAST_STEPS:
                self.run_data.set_array("past", history.with_doubled_rings(self.past, self.delays))
            self.full_at = count + left
        return float(self.full_at - count)

    def begin_segment(self, t: float, y: np.ndarray, end: float) -> None:
        past = self.past
        if not past.size:
            return
        past[wave_history.SEGMENT_END] = min(end, wave_history.INFINITE)
        if past[wave_history.COUNT] > 0.0 and past[
            wave_history.NEXT_ARRIVAL
        ] <= t + wave_history.time_tolerance(past):
            model = self.run_data.model
            out, values = model.new_out(), np.zeros(len(model.tables.probes))
            out[rec.STATUS] = rec.ARRIVED
            model.functions.record(t, y, out, self.run_data.handle, values)

    def waves(self, t: float, out: np.ndarray, parts: int):
        from fvsolve.features.delay_lines.kernels.line_rates import waves_along_line

        for index, row in enumerate(self.delays):
            n = parts * int(row["places"])
            r, l = np.zeros(n), np.zeros(n)  # noqa: E741
            waves_along_line(t, out, self.run_data.handle, index, r, l)
            yield int(row["pipe"]), (r, l)

    def corrected_at(self, t: float) -> bool:
        # A step in which a jump in a delay line corrected masses of storing nodes or flows of columns: half steps have
        # no such correction. The mark is removed when the corrected state is recorded again.
        return self.past.size > 0 and self.past[wave_history.CORRECTED_TIME] == t

    def notices(self) -> list:
        run = self.run_data
        return history.jump_overflow_notices(self.past) + lower.friction_notices(
            run.model, self.delays, run.extremes
        )


def lines_of(model) -> np.ndarray:
    """Delay lines of a model : DELAY[lines]."""
    own = with_slot(model.features, SLOT)
    return np.zeros(0, DELAY) if own is None else own.delays


def history_of(run_data) -> np.ndarray:
    """History of the waves in the delay lines of a run; empty without delay lines."""
    own = with_slot(run_data.features, SLOT)
    return np.zeros(0) if own is None else own.past


def seen_by_jumps(model):
    """Copy of a model with the tables of the view "sharp", in which short lines need their travel time."""
    own = with_slot(model.features, SLOT)
    others = [own.seen_by_jumps() if other is own else other for other in model.features]
    return replace(model, tables=model.tables._replace(**own.sharp), features=others)

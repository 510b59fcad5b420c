"""Run of a model from its start to its end, in segments between jumps and kinks of schedules."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from fvsolve.core.model import Model, State
from fvsolve.core.solve import run_summary as found
from fvsolve.core.solve.partition import CLOSE_MESSAGE, postponed_interrupts, threads_of
from fvsolve.core.solve.run_checks import RunChecks, split_step_notices
from fvsolve.core.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.core.solve.run_summary import Event, Summary, mass_ledger
from fvsolve.core.steppers import automatic, loop_records
from fvsolve.core.steppers.ledger import LEDGER_ROWS
from fvsolve.errors import FvsolveError, RunError, listing
from fvsolve.units import show

CHECKPOINT_SECONDS = 1.0
CHUNK_SECONDS = 0.1
FIRST_CHUNK = 1000.0  # steps before the first pause
# steps between two checks by `RunChecks.check` where it is needed often
# A run under error control ends if this count of attempted steps advances by less than this fraction of the run.
STALLED_ATTEMPTS, STALLED_ADVANCE = 2000, 1e-10
FREQUENT_CHECK_STEPS = loop_records.GROWTH_CHECK_STEPS
PERSISTENT = ("extremes", "envelope", "maxima", "marks", "armed", "accepted")


class MemoryMismatch(RunError):
    """Error: the restart data in `State.memory` do not match the run."""


def initial_state(model: Model) -> State:
    """Initial state of a model: zero, as states are deviations from the steady start, except for a dam break."""
    if not isinstance(model, Model):
        raise FvsolveError(
            f"initial_state takes a Model, not {type(model).__name__}; expected the result of build()"
        )
    return State(model.case.numerics.start, model.start.copy())


def solve(
    model: Model,
    state: State,
    sink: Any,
    progress: Callable[[float, float, int], None] | None = None,
    threads: int = 1,
    comm: Any = None,
) -> Summary:
    """Run a model from `state` to the end time of its case; returns the summary of the run.

    sink : object that receives the output rows, field frames and checkpoints; frames are not computed for a sink with
    `takes_fields` False
    progress : function of (simulated time [s], elapsed time [s], steps), called about ten times a second
    threads : number of threads
    comm : MPI communicator, whose other ranks follow this rank, in place of threads
    A state with restart data in `memory` continues an interrupted run with identical bits, with any number of threads.
    A run that fails or is interrupted returns too: see `Summary.reason`. Raises FvsolveError for invalid arguments, and
    MemoryMismatch for restart data of another run.
    """
    if not isinstance(model, Model) or not isinstance(state, State):
        raise FvsolveError(
            f"solve takes a Model and a State, not {type(model).__name__} and {type(state).__name__}; "
            "expected the results of build() and initial_state()"
        )
    if progress is not None and not callable(progress):
        raise FvsolveError(
            f"progress = {progress!r} cannot be called; expected progress(t, seconds, steps)"
        )
    if isinstance(threads, bool) or not isinstance(threads, (int, np.integer)) or threads < 1:
        raise FvsolveError(
            f"threads = {show(threads)} is not a number of threads; expected an integer of 1 or more"
        )
    if comm is not None and not callable(getattr(comm, "bcast", None)):
        text = f"comm = {show(comm)} is not an MPI communicator"
        raise FvsolveError(f"{text}; expected MPI.COMM_WORLD of mpi4py, or None")
    missing = [
        name
        for name in ("rows", "field", "checkpoint", "end")
        if not callable(getattr(sink, name, None))
    ]
    try:
        model.checked(state.t, state.y)
        run = Run(model, state, sink, progress, threads, comm)
        if missing:
            lacks = listing(f"{name}()" for name in missing)
            raise FvsolveError(f"sink = {show(sink)} is not a sink: it has no {lacks}")
    except BaseException:
        if comm is not None:
            comm.bcast(CLOSE_MESSAGE)
        raise
    return run.go()


class Run:
    """State and actions of a run in progress."""

    loop_type = RunLoop

    def __init__(
        self, model: Model, state: State, sink, progress, threads: int = 1, comm=None
    ) -> None:
        self.model, self.sink, self.progress = model, sink, progress
        self.threads, self.notices = threads_of(model, threads if comm is None else comm.size)
        comm = comm if self.threads > 1 else None
        self.began = time.perf_counter()
        self.loop = self.loop_type(model, threads=self.threads, comm=comm)
        self.run_data = self.loop.run_data
        self.loop.on_switch = self.stop_columns
        numerics, output = model.case.numerics, model.case.output
        self.start, self.end = numerics.start, numerics.end
        jumps = {t: jump for t, jump in model.breaks if self.start <= t <= self.end}
        self.starts_with_jump, self.ends_with_jump = (
            jumps.pop(self.start, False),
            jumps.pop(self.end, False),
        )
        self.bounds = [(t, jump) for t, jump in sorted(jumps.items())] + [(self.end, True)]
        self.watches = [
            watch for part in model.meshed for watch in part.watches(part.deviations(model.start))
        ]
        fields = output.fields if self.watches or getattr(sink, "takes_fields", True) else 0
        self.loop.stepper.set_control(
            start=self.start,
            every=output.every or (self.end - self.start) / 1000,
            field_count=fields,
            field_every=(self.end - self.start) / fields if fields else 0.0,
        )
        self.segment, self.fresh = 0, not state.memory
        self.changes: list[tuple[float, float, float]] = []  # changes of the method under `auto`
        self.loop.now[:] = state.y
        self.loop.state["t"] = state.t
        self.budget, self.seconds, self.saved = FIRST_CHUNK, 0.0, time.perf_counter()
        self.checks = RunChecks(self.run_data, comm is not None)
        self.loop.stepper.largest = self.checks.largest_if_needed
        if self.checks.needs_frequent_checks:
            self.budget = FREQUENT_CHECK_STEPS
        self.processor = 0.0  # CPU time of the steps of this process [s]
        # time from which results are invalid, because states have grown [s]
        self.invalid_from = np.inf
        # steps left in a chunk, time of the last pause: rows, frames and new segments do not end a chunk
        self.left, self.paused = self.budget, self.saved
        self.last_stall_check: np.ndarray | None = None  # time, attempted steps
        if not self.fresh:
            try:
                self.restore(state.memory)
            except (KeyError, TypeError, ValueError, IndexError, OverflowError):
                # damaged checkpoint, or from another solver
                numbers = sum(map(np.size, state.memory.values()))
                raise MemoryMismatch(
                    f"the checkpoint does not match this run ({numbers} numbers of restart data); "
                    "start again with --force, or with a State with an empty `memory`"
                ) from None
        self.setup = time.perf_counter() - self.began

    # memory -------------------------------------------------------------------------------------------------

    def views(self) -> dict[str, np.ndarray]:
        """Arrays of fixed size that change during the run and that a resumed run needs, by name."""
        views = {
            name: getattr(self.run_data, name) for name in PERSISTENT
        } | self.loop.stepper.restart_arrays()
        views |= {f"watch {k}": watch.greatest for k, watch in enumerate(self.watches)}
        return views | {
            "sloshing": self.checks.sloshing.restart_data,
            "step doubling": self.checks.step_doubling.restart_data,
            "energy": self.checks.energy.restart_data,
        }

    def memory(self) -> dict[str, np.ndarray]:
        """All data that a resumed run needs in addition to t and y, as arrays by name."""
        loop, rates = self.loop, self.checks.rates
        own = {
            "run": [self.segment, self.seconds, self.processor, loop.last_switch, loop.at_once],
            "changes": self.changes,
            "switched": loop.switched,
            "recent events": loop.recent_events,
            "rates": [rates.get(part.name, 0.0) for part in self.checks.moving],
        }
        memory = {name: np.array(values, dtype=np.float64) for name, values in own.items()}
        memory |= {name: array.copy() for name, array in self.run_data.arrays().items()}
        return memory | {name: view.copy() for name, view in self.views().items()}

    def restore(self, memory: dict[str, np.ndarray]) -> None:
        """Restore the result of `memory`; raises ValueError or KeyError if it does not match this run."""
        loop, t = self.loop, float(self.loop.state["t"])
        for name, array in self.run_data.arrays().items():
            if (memory[name].size == 0) != (array.size == 0):
                raise ValueError(f"array {name} does not match")
            self.run_data.set_array(name, memory[name].copy())
        segment, self.seconds, self.processor, loop.last_switch, at_once = memory["run"].tolist()
        self.segment, loop.at_once = int(segment), int(at_once)
        if not 0 <= self.segment < len(self.bounds):
            raise ValueError("number of the segment out of range")
        self.changes = [tuple(row) for row in memory["changes"].reshape(-1, 3).tolist()]
        if len(self.changes) % 2 == 1:
            automatic.change(loop.stepper)
        loop.switched = [(t, int(k)) for t, k in memory["switched"].reshape(-1, 2).tolist()]
        loop.recent_events.extend(memory["recent events"].tolist())
        names = [part.name for part in self.checks.moving]
        self.checks.rates.update(zip(names, memory["rates"].tolist(), strict=True))
        if memory.keys() != self.memory().keys():
            raise ValueError("names of the arrays do not match")
        for name, view in self.views().items():
            if memory[name].shape != view.shape or memory[name].dtype != view.dtype:
                raise ValueError(f"array {name} does not match")
            view[...] = memory[name]
        self.run_data.return_to_earlier()  # the run computes the rates of this state once more
        counts = np.array([float(loop.state[name]) for name in loop_records.COUNTS.values()])
        are_valid = np.isfinite(counts).all() and counts.min() >= 0.0
        if loop.state["t"] != t or not are_valid or not self.checks.has_valid_counts:
            raise ValueError("counts that no run has")
        loop.stepper.after_restore()

    def state(self) -> State:
        return State(self.loop.t, self.loop.now.copy(), self.memory())

    # rows and frames ----------------------------------------------------------------------------------------

    def row(self, t: float, limit: float) -> np.ndarray:
        """Write the output row of the present state at time t [s]; returns the output array `out`.

        limit : time [s] at which schedules with a jump take the value before the jump
        """
        out = self.loop.evaluate(limit)
        self.loop.record(t, self.loop.now, out, self.run_data.handle, self.loop.stepper.values)
        self.sink.rows(
            np.array([t]), self.loop.stepper.values[None, : len(self.model.probes)].copy()
        )
        return out

    def flush(self) -> None:
        if self.loop.progress["rows"]:
            rows = self.loop.take_rows()
            self.sink.rows(rows[:, 0], rows[:, 1 : 1 + len(self.model.probes)])
            self.update_extremes(rows)

    def update_extremes(self, rows: np.ndarray) -> None:
        """Update the extremes of the probes by output rows between steps, so that no row exceeds the extremes.

        Pressures that were not determined at a step are left out, see `RunData.undetermined_probes`.
        rows : float64[rows, 1 + probes]  time [s] and values of the probes
        """
        least, t_min, greatest, t_max = self.run_data.extremes
        t, values = rows[:, 0], rows[:, 1:]
        at = values.argmin(axis=0)
        each = np.arange(values.shape[1])
        known = ~self.run_data.undetermined_probes
        lower = ((extreme := values[at, each]) < least) & known
        if lower.any():
            least[lower], t_min[lower] = extreme[lower], t[at][lower]
        at = values.argmax(axis=0)
        higher = ((extreme := values[at, each]) > greatest) & known
        if higher.any():
            greatest[higher], t_max[higher] = extreme[higher], t[at][higher]

    def watch(self, t: float, y: np.ndarray) -> None:
        """Pass state y at time t [s] to the checks of meshes."""
        for watch in self.watches:
            watch.check(t, y)

    def frame(self, t: float, y: np.ndarray, out: np.ndarray, last: bool = False) -> None:
        """Pass the fields at time t [s] to the sink; the last frame also has the greatest values of meshes."""
        self.watch(t, y)
        fields = self.run_data.fields(t, y, out)
        for name, values in found.find_maxima(self.run_data, t).items() if last else ():
            fields[name] |= values
        with postponed_interrupts():  # other ranks may be writing too
            self.sink.field(t, fields)

    def pass_outputs(self, t: float, out: np.ndarray) -> None:
        """Count the rows due up to time t [s] as written, and write the field frame if one is due.

        t : time of a jump or of the end of the run, whose row is written already
        out : output array of the right-hand side at t
        """
        state, control = self.loop.state, self.loop.control
        start, near = control["start"], 1e-12 * max(abs(t), abs(self.end))
        while control["every"] > 0 and start + state["next_output"] * control["every"] <= t + near:
            state["next_output"] += 1
        if control["field_every"] > 0 and state["next_field"] <= control["field_count"]:
            if start + state["next_field"] * control["field_every"] <= t + near:
                state["next_field"] += 1
                self.frame(t, self.loop.now, out, state["next_field"] > control["field_count"])

    # the run ------------------------------------------------------------------------------------------------

    def go(self) -> Summary:
        reason = "interrupted: resume with --resume"
        try:
            if self.fresh:
                self.open()
            reason = self.segments()
        except KeyboardInterrupt:
            self.loop.take_rows()
            return self.close(reason, saved=False)
        finally:
            self.loop.close()
        return self.close(reason)

    def open(self) -> None:
        out = self.row(self.start, self.start)
        self.loop.switched.clear()  # initial device states are not events
        if self.loop.control["field_every"] > 0:
            self.frame(self.start, self.loop.now, out)
        self.loop.state["next_output"] = self.loop.state["next_field"] = 1.0
        self.begin_segment(self.starts_with_jump)

    def stop_columns(self) -> None:
        """Stop rigid columns that collide or can no longer flow.

        The first time at which a column loses a flow above 1e-3 of its scale is recorded in the marks.
        """
        model, t = self.model, self.loop.t
        for k, flow in self.loop.stop_columns(self.bounds[self.segment][0]):
            at = len(model.pipes) + 3 * len(model.node_names) + k
            scale = model.scale[model.tables.columns[k]["y"]]
            if abs(flow) > 1e-3 * scale and np.isnan(self.run_data.marks[at]):
                self.run_data.marks[at] = t

    def begin_segment(self, jumped: bool) -> None:
        end, jump = self.bounds[self.segment]
        last = self.segment == len(self.bounds) - 1 and not self.ends_with_jump
        self.run_data.begin_segment(self.loop.t, self.loop.now, np.inf if last else end)
        self.stop_columns()
        self.checks.step_doubling.begin(self.loop.state["steps"])
        if jumped:
            self.row(self.loop.t, end)
        self.loop.begin(end, end if jump else NO_LIMIT)
        if jumped or self.loop.t == self.start:
            self.checks.energy.begin(self.loop)

    def segments(self) -> str:
        """Step through the remaining segments; returns the reason for the end of the run."""
        if not self.fresh:
            end, jump = self.bounds[self.segment]
            self.loop.resume(end, end if jump else NO_LIMIT)
        while True:
            reason = self.steps()
            if reason:
                return reason
            end, jump = self.bounds[self.segment]
            if jump:
                out = self.row(end, end)
                self.pass_outputs(end, out)
            if self.segment == len(self.bounds) - 1:
                if self.ends_with_jump:
                    self.run_data.begin_segment(self.loop.t, self.loop.now, np.inf)
                    self.row(end, np.inf)
                return "finished"
            self.segment += 1
            self.begin_segment(jump)

    def steps(self) -> str:
        """Step to the end of the segment; returns "", or the reason why the run cannot continue."""
        while True:
            before = time.perf_counter()
            steps = self.loop.state["steps"]
            busy = self.busy
            due = min(
                self.checks.step_doubling.steps_left(steps), self.checks.energy.prepare(self.loop)
            )
            code = self.loop.run(min(self.left, due))
            self.processor += self.busy - busy
            self.left = max(0.0, self.left - (self.loop.state["steps"] - steps))
            self.seconds += time.perf_counter() - before
            self.flush()
            self.checks.step_doubling.check(self.loop)
            self.checks.energy.check(self.loop)
            grown = self.checks.check(self.loop.t, self.loop.now)
            # the message about chattering names the parts
            if grown and code != loop_records.CHATTERING:
                self.invalid_from = self.checks.sound
                return grown
            if code == loop_records.FIELD:
                count = self.loop.state["next_field"] - 1
                due = self.start + count * self.loop.control["field_every"]
                self.frame(due, self.loop.stepper.y_out, self.loop.stepper.out_row)
            elif code == loop_records.BUDGET_SPENT and automatic.is_change_due(self.loop.stepper):
                self.changes.append(automatic.change(self.loop.stepper))
            elif code == loop_records.BUDGET_SPENT and self.left <= 0.0:
                self.pause()
                self.left, self.paused = self.budget, time.perf_counter()
                if stalled := self.stalled():
                    return self.failure(stalled)
            elif code == loop_records.DONE:
                lost = self.model.y_size == 0 and self.loop.feature_failure()  # no rate can tell
                return self.failure(code) if lost else ""
            elif code not in (loop_records.BUDGET_SPENT, loop_records.ROWS_FULL):
                return self.failure(code)

    @property
    def busy(self) -> float:
        """CPU time of all threads or MPI ranks that step the run [s]."""
        return time.thread_time() + (0.0 if self.loop.team is None else self.loop.team.seconds)

    def pause(self) -> None:
        """Report progress, save a checkpoint if due, and set the number of steps until the next pause (about 0.1 s)."""
        spent = time.perf_counter() - self.paused
        factor = CHUNK_SECONDS / spent if spent > 0 else 4.0
        most = FREQUENT_CHECK_STEPS if self.checks.needs_frequent_checks else 1e9
        self.budget = float(np.clip(self.budget * np.clip(factor, 0.25, 4.0), 10, most))
        if self.progress is not None:
            self.progress(
                self.loop.t, time.perf_counter() - self.began, int(self.loop.state["steps"])
            )
        if time.perf_counter() - self.saved > CHECKPOINT_SECONDS:
            self.save()

    def stalled(self) -> int:
        """Code of the failure of a run under error control whose steps no longer advance, otherwise 0.

        Rates with noise let Newton fail, or errors stay, at any step above the rounding of time: such a run has no end.
        """
        state, control = self.loop.state, self.loop.control
        now = np.array(
            [self.loop.t, state["steps"] + state["rejections"] + state["newton_failures"]]
        )
        if self.last_stall_check is None:
            self.last_stall_check = now
        advance, attempts = now - self.last_stall_check
        if attempts < STALLED_ATTEMPTS:
            return 0
        self.last_stall_check = now
        if control["mode"] != loop_records.TOLERANCE or advance >= STALLED_ADVANCE * (
            self.end - self.start
        ):
            return 0
        return (
            loop_records.NEWTON_STUCK if state["newton_failures"] > 0.0 else loop_records.TINY_STEP
        )

    def save(self) -> None:
        self.sink.checkpoint(self.state())
        self.saved = time.perf_counter()

    def failure(self, code: int) -> str:
        """Reason why a run stopped: failure, place, time and remedy.

        code : code of `steppers.loop_records` that the time loop returned
        The advice of the density law is added for BAD_VALUE, NEWTON_STUCK and TINY_STEP. For BAD_VALUE, `invalid_from`
        is set.
        """
        if code == loop_records.BAD_VALUE:
            self.invalid_from = self.checks.sound
        numbers = code in (
            loop_records.BAD_VALUE,
            loop_records.NEWTON_STUCK,
            loop_records.TINY_STEP,
        )
        return (
            "stopped: "
            + self.loop.failure_text(code)
            + (self.model.case.law.advice if numbers else "")
        )

    def methods(self) -> list[dict]:
        """Time methods used in the run: dicts with start time [s], name and reason."""
        name = self.model.case.numerics.method
        if name != automatic.AUTO:
            return [{"time": self.start, "method": name, "why": "given by numerics.method"}]
        control = self.loop.control
        return automatic.method_history(self.start, self.changes, control["price"], control["size"])

    def pumped_energy(self, watched: dict) -> dict:
        """Energy of pumps and its cost; empty without `[energy]`. watched : extremes by probe"""
        if self.model.case.energy is None:
            return {}
        from fvsolve.parts.pump.energy_use import energy_use

        return energy_use(self.model, self.loop.now, watched, self.loop.t - self.start)

    def close(self, reason: str, saved: bool = True) -> Summary:
        model, loop = self.model, self.loop
        if reason != "finished" and saved and loop.t > self.start and np.all(np.isfinite(loop.now)):
            self.save()
        if reason == "finished":
            self.watch(loop.t, loop.now)
        ledger = loop.stepper.ledger.reshape(LEDGER_ROWS, -1)[:2]
        first = int(model.layout["source"] - model.layout["supply"])
        booked = ledger[
            :, [*range(len(model.node_names)), *range(first, first + len(model.sources))]
        ]
        ledgers = {"mass": mass_ledger(model, loop.now, booked)}
        for feature in model.features:
            ledgers |= feature.ledgers(model, loop.now, ledger)
        watched = [notice for entry in self.watches for notice in entry.notices()]
        warnings = [*self.notices, *watched, *self.checks.warnings(ledgers)]
        warnings += found.device_notices(self.run_data) + found.spill_notices(self.run_data)
        warnings += [
            notice for own in self.run_data.features for notice in own.end_notices(loop.now)
        ]
        warnings += split_step_notices(model.case.numerics, loop.stepper.counts())
        entered = ledger[:, : len(model.node_names)].sum(axis=0)
        events = [Event(t, *model.events[k]) for t, k in loop.switched]
        held = [
            mark
            for own in self.run_data.features
            for mark in own.held_marks(self.start, loop.t, entered)
        ]
        unsupplied, losses = found.unsupplied_demands(
            self.run_data, (self.start, loop.t), entered, events
        )
        warnings += unsupplied + found.undetermined_notices(self.run_data)
        events = sorted([*events, *losses], key=lambda event: event.time)
        ok = reason == "finished" and not held and all(entry.ok for entry in warnings)
        extremes, watched = found.find_extremes(self.run_data)
        summary = Summary(
            reason,
            ok,
            loop.t,
            found.find_marks(self.run_data, held) + held,
            ledgers,
            extremes,
            found.find_envelope(self.run_data),
            found.find_point_envelopes(self.run_data),
            watched,
            loop.stepper.counts(),
            self.methods(),
            model.all_cells,
            self.seconds,
            self.processor,
            self.setup,
            events,
            found.find_cavities(self.run_data),
            warnings,
            self.threads,
            self.invalid_from,
            maxima := found.find_maxima(self.run_data, loop.t),
            found.find_run_ups(model, maxima),
            self.pumped_energy(watched),
        )
        self.sink.end(summary)
        return summary

"""Run of a case with changed keys, its outcome, and its CPU time."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from time import perf_counter

import numpy as np

from fvsolve.argument_checks import COUNT, FUNCTION, TABLE, TEXT
from fvsolve.core.run import model_of
from fvsolve.core.solve.solve import Run
from fvsolve.errors import CaseError, FvsolveError, collect_faults, listing

# Overrides: no output of cell values, which no study needs.
NO_FIELDS: dict = {"output.fields": 0, "output.lines": {}, "output.grids": {}}
POINTS = 5  # points of a cell of a line at which waves are evaluated
# at the middles of fifths; exact to degree 5
WEIGHTS = np.array([275.0, 100.0, 402.0, 100.0, 275.0]) / 1152.0


def name_list(given: str | Sequence[str] | None) -> list[str] | None:
    """Convert a name or names to a list without duplicates; None stays None."""
    return (
        None if given is None else list(dict.fromkeys([given] if isinstance(given, str) else given))
    )


def has_diverged(reason: str) -> bool:
    """True if a run ended because a value was not finite or grew without bound; reason : reason of its end."""
    return "not finite" in reason or "has grown to" in reason


@dataclass(frozen=True, eq=False)
class Outcome:
    """Outcome of a run, in SI; the outcome of a refused case has only `refused` and a reason.

    reason : reason of the end of the run, or of the refusal; ok : True if the run reached its end
    t : time of the last state [s]; y : float64[n]  last state
    rows : float64[k, 1 + probes]  time [s], then the values of the probes, whose names are in `probes`
    envelope : pipe -> {"min_pressure", "max_pressure" [Pa], ...: float64[cells]}, extremes over the run
    counts : numbers of `steps`, `rejections`, evaluations of the rates `rhs`, ...
    seconds : wall time of the steps alone [s]; processor : their CPU time [s]; run_data : `RunData` of the run
    lines : waves in delay lines at the end, see `line_averages`
    """

    reason: str
    ok: bool = False
    refused: bool = False
    t: float = float("nan")
    y: np.ndarray = field(default_factory=lambda: np.zeros(0))
    rows: np.ndarray = field(default_factory=lambda: np.zeros((0, 1)))
    probes: tuple[str, ...] = ()
    envelope: dict[str, dict[str, np.ndarray]] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    seconds: float = float("nan")
    processor: float = float("nan")
    model: object = None
    run_data: object = None
    lines: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    def __getstate__(self) -> dict:
        """State for pickling, without `run_data` and the model, which the other process builds from case and keys."""
        return vars(self) | {"model": None, "run_data": None}

    @property
    def cell_updates(self) -> int:
        """Cost that is independent of the machine: evaluations of the rates, times cells.

        Without cells, the evaluations are multiplied by the number of states.
        """
        cells = self.model.all_cells + sum(feature.further_cells for feature in self.model.features)
        return self.counts.get("rhs", 0) * max(1, cells or self.model.y_size)


class RowSink:
    """Receiver of the output of a run; stores only the rows of probes, in SI."""

    takes_fields = False  # field frames need not be computed

    def __init__(self) -> None:
        self.blocks: list[np.ndarray] = []

    def rows(self, t, values) -> None:
        """Store probe rows; t : float64[k] [s]; values : float64[k, probes] [SI]."""
        self.blocks.append(np.column_stack([t, values]))

    def field(self, t: float, frame: dict) -> None:
        """Ignore a field frame with values of cells."""

    def checkpoint(self, state) -> None:
        """Ignore a checkpoint."""

    def end(self, summary) -> None:
        """Ignore the end of the run."""


def study_model(case, set: Mapping | None = None):
    """Build the model of a case with changed keys, without output of cell values, for `outcome`. Raises CaseError."""
    from fvsolve.case import load

    return model_of(load(case, {**(set or {}), **NO_FIELDS}))


def outcome(
    case,
    set: Mapping | None = None,
    y: np.ndarray | None = None,
    best_of: int = 1,
    run: Callable | None = None,
    budget: float = np.inf,
) -> Outcome:
    """Run a case with changed keys, or a model as it is. A refused case gives an outcome with its reason.

    set : changed keys of a case, ignored for a model
    y : float64[n]  initial state (default `solve.initial_state`, zero except for a basin with a start of its own)
    best_of : number of runs, of which the fastest counts. Runs after the first contain no compilation; they are omitted
    if the first took more than `budget` [s].
    run : function(model, state, sink, progress) that returns the `Run` (default `solve.Run` itself)
    Raises KeyboardInterrupt if the user interrupts a run.
    """
    try:
        model = study_model(case, set) if not hasattr(case, "tables") else case
    except CaseError as error:
        return Outcome(refusal_text(error), refused=True)
    outcomes = [_single_run(model, y, run)]
    outcomes += [
        _single_run(model, y, run) for _ in range(best_of - 1) if outcomes[0].seconds <= budget
    ]
    return min(outcomes, key=lambda entry: entry.seconds)


def end_if_interrupted(reason: str) -> None:
    """Raise KeyboardInterrupt if a run was interrupted: it ends cleanly at Ctrl-C, but the study must end too."""
    if reason.startswith("interrupted"):
        raise KeyboardInterrupt


def checked_case(case, set: Mapping | None, find_faults: Callable):
    """Case with changed keys. Raises CaseError with the faults of the case and those of arguments of a study.

    find_faults : find_faults(case) -> faults of the arguments; its case is None if the case itself has faults
    """
    from fvsolve.case import load

    faults, loaded = [], None
    with collect_faults(faults):
        loaded = load(case, dict(set or {}))
    faults += find_faults(loaded)
    if faults:
        raise CaseError(faults, "case" if loaded is None else loaded.name)
    return loaded


def refusal_text(error: CaseError) -> str:
    """Reason of a refusal in one line: each different message once, after the first key at which it occurs."""
    first = {fault.message: fault.place for fault in reversed(error.faults)}
    return (
        f"refused: {'; '.join(f'{place}: {message}' for message, place in reversed(first.items()))}"
    )


def _single_run(model, y, run) -> Outcome:
    from fvsolve.core.solve import initial_state
    from fvsolve.core.solve.solve import Run

    state, sink = initial_state(model), RowSink()
    if y is not None:
        state.y[:] = y
    solver = (run or Run)(model, state, sink, None)
    summary = solver.go()
    end_if_interrupted(summary.reason)
    rows = np.concatenate([np.empty((0, 1 + len(model.probes))), *sink.blocks])
    names = tuple(probe.text for probe in model.case.probes)
    return Outcome(
        summary.reason,
        summary.finished,
        False,
        summary.t,
        solver.loop.now.copy(),
        rows,
        names,
        summary.envelope,
        summary.counts,
        summary.seconds,
        solver.processor,
        model,
        solver.run_data,
        line_averages(solver.run_data, summary.t, solver.loop.stepper.out),
    )


def line_averages(run_data, t: float, out: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Averages of the waves in delay lines over the cells of their output, at the time t [s].

    out : output array of the right-hand side at t, as from `RunData.evaluate`
    Returns {name of the delay line: (r + l, r - l)}, float64[cells] each [kg/s], with the forward wave r and the
    backward wave l.
    """
    sums = {}
    for k, (r, l) in run_data.along(t, out, POINTS).items():  # noqa: E741
        r, l = r.reshape(-1, POINTS) @ WEIGHTS, l.reshape(-1, POINTS) @ WEIGHTS  # noqa: E741
        sums[run_data.model.pipes[k].name] = r + l, r - l
    return sums


# kinds, for `validated`
STUDY_ARGUMENTS = {"set": TABLE, "jobs": COUNT, "dask": TEXT, "progress": FUNCTION}
Progress = Callable[[int, int, str], None]  # (finished points, all points, text of the next point)


def refuse_basins(case, study: str, allow_sloshing: bool = False) -> None:
    """Raise FvsolveError if a case has basins, whose cells a study cannot refine or replace yet.

    study : name of the study in the message; allow_sloshing : True to accept basins with a free surface on bodies
    """
    sloshing = [
        name
        for name in case.meshes
        if case.nodes[name].on and case.nodes[name].physics_type.has_modes
    ]
    names = [name for name in case.meshes if not (allow_sloshing and name in sloshing)]
    if names:
        raise FvsolveError(f"{study} does not support basins yet; the case has {listing(names)}")


# limits of CPU time -----------------------------------------------------------------------------------------------

MAX_RUNS = 5  # greatest number of runs, of which the fastest counts
# wall time of all runs together, including the first, above which no run is repeated [s]
REPEAT_TIME = 0.4
CPU_LIMIT = 30.0  # CPU time after which a run is stopped [s]
# CPU time after which a reference run, or a row of an order study, is stopped [s]
REFERENCE_CPU_LIMIT = 120.0
PROBE_STEPS = 20_000  # steps after which a run that only compiles is stopped
GIVEN_UP = "given up after"


class CappedRun(Run):
    """Run that stops between two chunks of steps as soon as its cost exceeds a limit."""

    max_seconds, max_steps = np.inf, np.inf

    def pause(self) -> None:
        """Do what a run does between two chunks of steps, then check the cost."""
        super().pause()
        self.check()

    def check(self) -> None:
        """Raise GivenUp if CPU time or number of steps exceeds its limit."""
        if self.processor > self.max_seconds or self.loop.state["steps"] > self.max_steps:
            raise GivenUp

    def segments(self) -> str:
        """Run to the end; returns the reason for the end, such as "finished", or "given up after ..." at the limit."""
        try:
            return super().segments()
        except GivenUp:
            return (
                f"{GIVEN_UP} {self.processor:.3g} s, at t = {self.loop.t:.3g} s of {self.end:.3g} s"
            )


class GivenUp(Exception):
    """Raised to end a run that costs too much."""


def capped(seconds: float = np.inf, steps: float = np.inf) -> Callable:
    """Function that makes a `CappedRun`, for `outcome`, with limits of CPU time [s] and of the number of steps."""

    def make(*arguments) -> CappedRun:
        run = CappedRun(*arguments)
        run.max_seconds, run.max_steps = seconds, steps
        return run

    return make


def best_run(model, most: int = MAX_RUNS) -> Outcome:
    """Outcome with the least CPU time among up to `most` runs of a model.

    A run that stops early, or exceeds its limit, is not repeated. A run is not begun if the wall time of all runs
    together would probably exceed `REPEAT_TIME`.
    """
    began, fastest = perf_counter(), outcome(model, run=capped(CPU_LIMIT))
    for _ in range(most - 1 if fastest.ok else 0):
        if perf_counter() - began + fastest.seconds > REPEAT_TIME:
            break
        fastest = min(fastest, outcome(model, run=capped(CPU_LIMIT)), key=lambda run: run.processor)
    return fastest


def best_run_of(case, keys) -> Outcome:
    """Outcome of `best_run` for a case with changed keys; a refused case gives an outcome with its reason."""
    try:
        return best_run(study_model(case, keys))
    except CaseError as error:
        return Outcome(refusal_text(error), refused=True)


def compile_seconds(model) -> float:
    """Wall time of a first run minus that of a second [s]: the time to compile, or to load compiled code."""
    times = []
    for _ in range(2):
        began = perf_counter()
        outcome(model, run=capped(steps=PROBE_STEPS))
        times.append(perf_counter() - began)
    return max(0.0, times[0] - times[1])

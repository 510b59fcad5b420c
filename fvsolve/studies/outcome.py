"""Run of a case with changed keys, and its outcome."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fvsolve.errors import CaseError, FvsolveError, listing
from fvsolve.run import model_of
from fvsolve.studies.delay_line_keys import line_averages


def name_list(given: str | Sequence[str] | None) -> list[str] | None:
    """Convert a name or names to a list without duplicates; None stays None."""
    return None if given is None else list(dict.fromkeys([given] if isinstance(given, str) else given))


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
    lines : waves in delay lines at the end, see `delay_line_keys.line_averages`
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
        """Cost that is independent of the machine: evaluations of the rates, times cells plus stretches of delay lines.

        Without cells and stretches, the evaluations are multiplied by the number of states.
        """
        delays, cells = self.model.tables.delays, self.model.all_cells
        if len(delays):  # of delay lines only the stretches are stepped
            cells += int((delays["stretches"] - delays["places"]).sum())
        return self.counts.get("rhs", 0) * max(1, cells or self.model.y_size)


class RowSink:
    """Receiver of the output of a run; stores only the rows of probes, in SI."""

    def __init__(self) -> None:
        self.blocks: list[np.ndarray] = []

    def rows(self, t, values) -> None:
        """Store probe rows; t : float64[k] [s]; values : float64[k, probes] [SI]."""
        self.blocks.append(np.column_stack([t, values]))

    def field(self, t: float, frame: dict) -> None:
        """Ignore a field frame with values of cells."""

    def checkpoint(self, state, extra: dict) -> None:
        """Ignore a checkpoint."""

    def end(self, summary) -> None:
        """Ignore the end of the run."""


def study_model(case, set: Mapping | None = None):
    """Build the model of a case with changed keys, without output of cell values, for `outcome`. Raises CaseError."""
    from fvsolve.case import load

    return model_of(load(case, {**(set or {}), "output.fields": 0, "output.lines": {}}))


def outcome(
    case, set: Mapping | None = None, y: np.ndarray | None = None, best_of: int = 1, run: Callable | None = None,
    budget: float = np.inf,
) -> Outcome:  # fmt: skip
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
    outcomes += [_single_run(model, y, run) for _ in range(best_of - 1) if outcomes[0].seconds <= budget]
    return min(outcomes, key=lambda entry: entry.seconds)


def refusal_text(error: CaseError) -> str:
    """Reason of a refusal in one line: each different message once, after the first key at which it occurs."""
    first = {fault.message: fault.place for fault in reversed(error.faults)}
    return f"refused: {'; '.join(f'{place}: {message}' for message, place in reversed(first.items()))}"


def _single_run(model, y, run) -> Outcome:
    from fvsolve.solve import initial_state
    from fvsolve.solve.solve import Run

    state, sink = initial_state(model), RowSink()
    if y is not None:
        state.y[:] = y
    solver = (run or Run)(model, state, sink, None)
    summary = solver.go()
    if summary.reason.startswith("interrupted"):  # a run ends cleanly at Ctrl-C; the study must end too
        raise KeyboardInterrupt
    rows = np.concatenate([np.empty((0, 1 + len(model.probes))), *sink.blocks])
    names = tuple(probe.text for probe in model.case.probes)
    return Outcome(
        summary.reason, summary.finished, False, summary.t, solver.loop.now.copy(), rows, names,
        summary.envelope, summary.counts, summary.seconds, solver.processor, model, solver.run_data,
        line_averages(solver.run_data, summary.t, solver.loop.stepper.out),
    )  # fmt: skip


Progress = Callable[[int, int, str], None]  # (finished points, all points, text of the next point)


def refuse_basins(case, study: str, allow_sloshing: bool = False) -> None:
    """Raise FvsolveError if a case has basins, whose cells a study cannot refine or replace yet.

    study : name of the study in the message; allow_sloshing : True to accept basins with a free surface on bodies
    """
    names = [
        name
        for name in case.meshes
        if not (allow_sloshing and case.nodes[name].on and case.nodes[name].physics_type.has_modes)
    ]
    if names:
        raise FvsolveError(f"{study} does not support basins yet; the case has {listing(names)}")

"""One run of a study: a case with some keys changed, and what came of it. Knows runs; knows no question."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from fvsolve.errors import CaseError, FvsolveError, listing
from fvsolve.run import model_of
from fvsolve.studies.lines import averages


def names(given: str | Sequence[str] | None) -> list[str] | None:
    """Names as a list, each once, one name standing for a list of it; None where nothing is said."""
    return None if given is None else list(dict.fromkeys([given] if isinstance(given, str) else given))


def grown(reason: str) -> bool:
    """Whether a run ended because its numbers grew without end."""
    return "not finite" in reason or "has grown to" in reason


@dataclass(frozen=True, eq=False)
class Outcome:
    """How a run ended and what it holds, in SI; a refused one has only its reason.

    y : float64[n]  last state; rows : float64[k, 1 + probes]  time [s], then the probes named in `probes`
    envelope : pipe -> "least_pressure", "greatest_pressure" [Pa], ... of its cells over the run
    counts : steps, rejections, rhs, ...; seconds : stepping alone, nothing compiled [s]; processor : its CPU time [s]
    slate : what the run wrote, its envelope and flags; lines : of delay lines at the end, see `lines.averages`
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
    slate: object = None
    lines: dict[str, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict)

    def __getstate__(self) -> dict:
        """For another process: without the model, which is made there of the same case and keys."""
        return vars(self) | {"model": None, "slate": None}

    @property
    def cell_updates(self) -> int:
        """Calls of the rates times cells and stretches (or states, without any): a cost that no machine changes."""
        delays, cells = self.model.tables.delays, self.model.all_cells
        if len(delays):  # of which stretches are stepped
            cells += int((delays["stretches"] - delays["places"]).sum())
        return self.counts.get("rhs", 0) * max(1, cells or self.model.y_size)


class RowSink:
    """The sink of a study's run: its rows in SI, nothing else."""

    def __init__(self) -> None:
        self.blocks: list[np.ndarray] = []

    def rows(self, t, values) -> None:
        """Keep probe rows: t float64[k] [s], values float64[k, probes] [SI]."""
        self.blocks.append(np.column_stack([t, values]))

    def field(self, t: float, frame: dict) -> None:
        """Not kept."""

    def checkpoint(self, state, extra: dict) -> None:
        """Not kept."""

    def end(self, summary) -> None:
        """Nothing to close."""


def prepared(case, set: Mapping | None = None):
    """The model of a case with keys changed, without frames; what `outcome` takes. Raises CaseError."""
    from fvsolve.case import load

    return model_of(load(case, {**(set or {}), "output.fields": 0, "output.lines": {}}))


def outcome(
    case, set: Mapping | None = None, y: np.ndarray | None = None, best_of: int = 1, run: Callable | None = None,
    budget: float = np.inf,
) -> Outcome:  # fmt: skip
    """Run a case (or a model) with keys changed; a case that is refused is an outcome too.

    y : float64[n]  the state to start from, in place of no deviation from the profile
    best_of : runs, of which the quickest counts; from the second on everything is compiled and in the cache, and
    there is none where the first took more than `budget` [s]
    run : what makes the run of (model, state, sink, progress), `solve.Run` if left out
    """
    try:
        model = prepared(case, set) if not hasattr(case, "tables") else case
    except CaseError as error:
        return Outcome(refusal(error), refused=True)
    found = [_once(model, y, run)]
    found += [_once(model, y, run) for _ in range(best_of - 1) if found[0].seconds <= budget]
    return min(found, key=lambda one: one.seconds)


def refusal(error: CaseError) -> str:
    """Why a case was refused, in one line: every fault with its place, one that many places share with the first."""
    first = {fault.message: fault.place for fault in reversed(error.faults)}
    return f"refused: {'; '.join(f'{place}: {message}' for message, place in reversed(first.items()))}"


def _once(model, y, run) -> Outcome:
    from fvsolve.solve import initial_state
    from fvsolve.solve.solve import Run

    state, sink = initial_state(model), RowSink()
    if y is not None:
        state.y[:] = y
    made = (run or Run)(model, state, sink, None)
    summary = made.go()
    if summary.reason.startswith("interrupted"):  # a run ends cleanly at Ctrl-C; a study ends with it
        raise KeyboardInterrupt
    rows = np.concatenate([np.empty((0, 1 + len(model.probes))), *sink.blocks])
    names = tuple(probe.text for probe in model.case.probes)
    return Outcome(
        summary.reason, summary.finished, False, summary.t, made.loop.now.copy(), rows, names,
        summary.envelope, summary.counts, summary.seconds, made.processor, model, made.slate,
        averages(made.slate, summary.t, made.loop.stepper.out),
    )  # fmt: skip


Progress = Callable[[int, int, str], None]  # (points finished, points in all, what is next), for progress


def without_basins(case, study: str, riding: bool = False) -> None:
    """Raises FvsolveError where a case has basins, whose cells a study does not refine or replace yet.

    riding : whether those that ride on bodies with a free surface will do
    """
    names = [name for name in case.meshes if not (riding and case.nodes[name].on and case.nodes[name].own.sloshes)]
    if names:
        raise FvsolveError(f"{study} does not know basins yet; the case has {listing(names)}")

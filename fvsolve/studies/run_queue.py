"""Queue of the runs of a study, computed in parallel if other processes are available."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from fvsolve.case import Case, load
from fvsolve.errors import RunError
from fvsolve.studies.case_pickle import PickledCase
from fvsolve.studies.outcome import Outcome, study_model
from fvsolve.studies.parallel import TaskPool


class RunRequest(NamedTuple):
    """Request for a run with changed keys.

    function : function(case, keys) at module level that makes the run; returns an `Outcome`, or a collection with one
    keys : dotted key -> value; stages : overrides that are applied first, in order, to the case of the study
    """

    function: Callable[[Case, Mapping[str, Any]], Any]
    keys: dict[str, Any]
    stages: tuple[dict[str, Any], ...] = ()


class RunQueue:
    """Runs of a study. A result computed ahead is returned once; other runs are computed when requested.

    source : case of the study, as for `load`
    jobs : number of local processes; dask : address of a scheduler, used instead of local processes.
    Context manager: workers are closed on exit.
    """

    def __init__(self, source: Any, jobs: int = 1, dask: str | None = None) -> None:
        self.pool = TaskPool(RequestRunner(source), jobs, dask)
        self.results: dict[str, Any] = {}

    @property
    def in_process(self) -> bool:
        """True if all runs are computed in this process, one after another."""
        return self.pool.in_process

    def run_ahead(self, requests: Sequence[RunRequest]) -> Iterator[int]:
        """Compute runs before their results are requested; yields the index of each finished run.

        requests : runs from cheap to expensive. The cheapest is computed first, because the study needs it first,
        then the others from the most expensive on, so that processes end together. A single process computes
        nothing ahead.
        """
        if self.in_process or not requests:
            return
        order = [0, *range(len(requests) - 1, 0, -1)]
        for position, answer in self.pool.run([requests[k] for k in order]):
            self.results[repr(requests[order[position]])] = answer
            yield order[position]

    def __call__(self, case: Case, request: RunRequest) -> Any:
        """Result of a run, computed now unless it was computed ahead; case : the case after `request.stages`."""
        answer = self.results.pop(repr(request), None)
        if answer is None:
            return request.function(case, request.keys)
        if isinstance(answer, Outcome) and not answer.refused and answer.model is None:
            return replace(answer, model=study_model(case, request.keys))
        return answer

    def __enter__(self) -> RunQueue:
        return self

    def __exit__(self, *_: Any) -> None:
        self.pool.__exit__()


class RequestRunner:
    """Callable that makes the run of a `RunRequest`, in this or another process.

    The case after each sequence of stages (see `RunRequest`) is stored and used again for later runs.
    """

    def __init__(self, source: Any) -> None:
        self.sent = PickledCase(source)
        self.staged: dict[str, Case] = {}

    def __call__(self, request: RunRequest) -> Any:
        name = repr(request.stages)
        if name not in self.staged:
            first_stage, *later = request.stages or ({},)
            case = load(self.sent.source, first_stage)
            for stage in later:
                case = load(case, stage)
            self.staged[name] = case
        return request.function(self.staged[name], request.keys)

    def lost_result(self, request: RunRequest) -> Any:
        """Raise RunError, because a study cannot continue without the run of a request that crashed its process."""
        keys = ", ".join(f"{key} = {value}" for key, value in request.keys.items()) or "the keys of the case"
        raise RunError(f"the process that made the run with {keys} was killed repeatedly. Is there enough memory?")

    def __getstate__(self) -> dict[str, Any]:
        return {"sent": self.sent, "staged": {}}

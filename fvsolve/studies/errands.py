"""Runs that a study asks for, made by other processes where there are any. Knows cases and runs; judges nothing."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from fvsolve.case import Case, load
from fvsolve.errors import RunError
from fvsolve.studies.many import Bench
from fvsolve.studies.outcome import Outcome, prepared
from fvsolve.studies.sent import Sent


class Errand(NamedTuple):
    """A run: how(case, keys), a function of a module that gives an `Outcome`, or one and more.

    stages : what is set on the study's case before, in turn
    """

    how: Callable[[Case, Mapping[str, Any]], Any]
    keys: dict[str, Any]
    stages: tuple[dict[str, Any], ...] = ()


class Errands:
    """Runs of one study: those that were made ahead are handed out once, all others are made when they are asked for.

    jobs : processes of this machine; dask : address of a scheduler, in place of these. A context: nobody stays.
    """

    def __init__(self, source: Any, jobs: int = 1, dask: str | None = None) -> None:
        self.bench = Bench(Runner(source), jobs, dask)
        self.found: dict[str, Any] = {}

    @property
    def alone(self) -> bool:
        """Whether all are made here, in turn."""
        return self.bench.alone

    def ahead(self, errands: Sequence[Errand]) -> Iterator[int]:
        """Make runs, the cheapest first of all and then from the end, where the dearest stand; the number of each.

        None with one job: who asks for them has them made in turn.
        """
        if self.alone or not errands:
            return
        order = [0, *range(len(errands) - 1, 0, -1)]
        for at, answer in self.bench.do([errands[k] for k in order]):
            self.found[repr(errands[order[at]])] = answer
            yield order[at]

    def __call__(self, case: Case, errand: Errand) -> Any:
        """What a run gave; `case` is the study's with the stages of the errand."""
        answer = self.found.pop(repr(errand), None)
        if answer is None:
            return errand.how(case, errand.keys)
        if isinstance(answer, Outcome) and not answer.refused and answer.model is None:
            return replace(answer, model=prepared(case, errand.keys))
        return answer

    def __enter__(self) -> Errands:
        return self

    def __exit__(self, *_: Any) -> None:
        self.bench.__exit__()


class Runner:
    """What makes runs of one case, wherever."""

    def __init__(self, source: Any) -> None:
        self.sent = Sent(source)
        self.staged: dict[str, Case] = {}

    def __call__(self, errand: Errand) -> Any:
        name = repr(errand.stages)
        if name not in self.staged:
            first, *others = errand.stages or ({},)
            case = load(self.sent.source, first)
            for stage in others:
                case = load(case, stage)
            self.staged[name] = case
        return errand.how(self.staged[name], errand.keys)

    def lost(self, errand: Errand) -> Any:
        """Nothing can stand for it."""
        keys = ", ".join(f"{key} = {value}" for key, value in errand.keys.items())
        raise RunError(f"the process that made the run of {keys} has ended, again and again; was memory too small?")

    def __getstate__(self) -> dict[str, Any]:
        return {"sent": self.sent, "staged": {}}

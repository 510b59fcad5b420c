"""Outcomes of runs for the comparison of equivalent cases, and their differences."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from hypothesis import reject

import fvsolve
from fvsolve.core.model.model_facts import cost_notices
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.solve.solve import Run
from invariance.random_scenes import IMPLICIT


@dataclass
class Outcome:
    """Outcome of a run: reason of its end, or "refused" if it did not start, and the rows of every probe."""

    ended: str
    t: np.ndarray
    rows: dict[str, np.ndarray]
    result: fvsolve.Result | None = None


REFUSALS = ("above every source", "no steady state", "follows the flow of this valve at once")
# Relative error of a step: rounding may decide which steps Newton's method divides (summary key `parted`).
IN_PARTS = 1e-3
SCENES = {"built": 0, "dear": 0}
# allowed share of costly cases, and number allowed in addition (0 of 550 were costly)
FAIR, FIRST = 0.25, 2


def outcome_of(source, **more) -> Outcome:
    """Outcome of a run; CaseErrors with the words of `REFUSALS` count as "refused", all others are raised.

    Cases with explicit steps much shorter than those of waves (notice `cost`) are not run, because they may take hours.
    Hypothesis draws another case instead. The test fails if many cases are costly.
    """
    try:
        model = fvsolve.build(fvsolve.load(source)) if isinstance(source, dict) else source
        SCENES["built"] += 1
        if isinstance(model, fvsolve.Model) and cost_notices(model, None, ""):
            SCENES["dear"] += 1
            assert SCENES["dear"] <= FIRST + FAIR * SCENES["built"], SCENES
            reject()
        result = fvsolve.run(source, **more)
    except fvsolve.CaseError as error:
        if not all(any(words in str(fault) for words in REFUSALS) for fault in error.faults):
            raise
        return Outcome("refused", np.empty(0), {})
    ended = result.reason.split(" at ")[0]
    return Outcome(
        ended, np.array(result.t), {str(p): np.array(result[str(p)]) for p in result.probes}, result
    )


@contextmanager
def with_frames() -> Iterator[None]:
    """Context in which runs in memory compute field frames, as runs with a directory do; there must be frames."""
    times: list[float] = []
    before = MemorySink.takes_fields, MemorySink.field
    MemorySink.takes_fields, MemorySink.field = True, lambda self, t, frame: times.append(t)
    try:
        yield
    finally:
        MemorySink.takes_fields, MemorySink.field = before
    assert times


def broken_off_and_whole(case: dict, share: float) -> tuple[Run, Run]:
    """Run of a case that was interrupted after a share of its end time and resumed by a new model, and whole run.

    Asserts that final states and ledgers of both agree to the bit.
    """
    model, end = fvsolve.build(fvsolve.load(case)), case["numerics"]["end"]

    def late(t, seconds, steps):
        run.budget = 1.0  # steps until the next call
        if t > share * end:
            raise KeyboardInterrupt

    run = Run(model, fvsolve.initial_state(model), MemorySink(model), late)
    run.left = 1.0
    assert run.go().reason.startswith("interrupted") and share * end < run.state().t < end
    other = fvsolve.build(fvsolve.load(case))
    again, whole = (
        Run(other, state, MemorySink(other), None)
        for state in (run.state(), fvsolve.initial_state(other))
    )
    ended = again.go(), whole.go()
    assert ended[0].reason == ended[1].reason == "finished" and ended[0].ledgers == ended[1].ledgers
    ends = again.state(), whole.state()
    assert ends[0].t == ends[1].t and np.array_equal(ends[0].y, ends[1].y)
    return again, whole


def kind_of(name: str) -> str:
    return name.rsplit(".", 1)[1].split("@")[0]


def alike(
    one: Outcome,
    other: Outcome,
    within: float = 0.0,
    name: Callable[[str], str] = str,
    change=None,
    later=0.0,
) -> None:
    """Assert that two runs have equal ends and rows, to the bit or `within` the greatest value of each quantity.

    name(probe) : name of the probe in the second run; change(probe, values) : expected values there
    """
    assert other.ended == one.ended
    assert len(other.t) == len(one.t)
    if within > 0.0 and any(
        said.result is not None and said.result.summary.get("parted") for said in (one, other)
    ):
        within = max(within, IN_PARTS)
    if within == 0.0:
        assert np.array_equal(other.t, one.t + later)
    else:
        assert np.allclose(other.t - later, one.t, rtol=0.0, atol=1e-9)
    greatest: dict[str, float] = {}
    wanted = {
        probe: values if change is None else change(probe, values)
        for probe, values in one.rows.items()
    }
    for probe, values in wanted.items():
        kind = kind_of(probe)
        greatest[kind] = max(greatest.get(kind, 1e-9), float(np.max(np.abs(values), initial=0.0)))
    apart = {
        probe: float(np.max(np.abs(other.rows[name(probe)] - values), initial=0.0))
        / greatest[kind_of(probe)]
        for probe, values in wanted.items()
    }
    worst = max(apart, key=apart.get, default=None)
    assert worst is None or apart[worst] <= within, (worst, apart[worst])


# warning of numba while it compiles
EXPERIMENTAL = "ignore:First-class function type feature is experimental"
ROUND = 1e-9


def near(case: dict) -> float:
    """Allowed difference between equivalent cases, over the greatest value of the quantity.

    An implicit step with weno5 may have two solutions, which differ by the error of a step, and rounding selects one.
    In one example both residuals are 5e-12 and the solutions differ by 1.4e-6.
    """
    if case["numerics"]["scheme"] == "weno5" and case["numerics"]["method"] in IMPLICIT:
        return IN_PARTS
    return 10 * case["numerics"].get("rtol", 0.1 * ROUND)

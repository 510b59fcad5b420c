"""What a scene tells, and how far two tellings are apart. Knows results; knows no scene."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from hypothesis import reject

import fvsolve
from fvsolve.model.model_facts import cost_notices


@dataclass
class Told:
    """How it ended ("refused" where it did not begin), and the rows of every probe."""

    ended: str
    t: np.ndarray
    rows: dict[str, np.ndarray]
    result: fvsolve.Result | None = None


REFUSALS = ("above every source", "no steady state")
# Of a kind, what a step errs by: rounding may decide which steps of Newton are taken in parts, as runs say.
IN_PARTS = 1e-3
SCENES = {"built": 0, "dear": 0}
FAIR, FIRST = 0.25, 2  # share of dear scenes, beside the first ones, above which a claim fails (0 of 550 were dear)


def told(source, **more) -> Told:
    """Run a scene, which may be refused in the words of `REFUSALS`; any other error is one.

    One whose explicit steps follow something far quicker than waves is not run: that may take hours, as `check` says.
    Hypothesis draws another in its place; a scene that is not drawn fails, and so does a claim if many are dear.
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
        return Told("refused", np.empty(0), {})
    ended = result.reason.split(" at ")[0]
    return Told(ended, np.array(result.t), {str(p): np.array(result[str(p)]) for p in result.probes}, result)


def kind_of(name: str) -> str:
    return name.rsplit(".", 1)[1].split("@")[0]


def alike(
    one: Told, other: Told, within: float = 0.0, name: Callable[[str], str] = str, change=None, later=0.0
) -> None:
    """The same end and the same rows, to the bit or `within` the greatest value of their kind.

    name(probe) is what the other calls it; change(probe, values) what the other should show of the one.
    """
    assert other.ended == one.ended
    assert len(other.t) == len(one.t)
    if within > 0.0 and any(said.result is not None and said.result.summary.get("parted") for said in (one, other)):
        within = max(within, IN_PARTS)
    if within == 0.0:
        assert np.array_equal(other.t, one.t + later)
    else:
        assert np.allclose(other.t - later, one.t, rtol=0.0, atol=1e-9)
    greatest: dict[str, float] = {}
    wanted = {probe: values if change is None else change(probe, values) for probe, values in one.rows.items()}
    for probe, values in wanted.items():
        kind = kind_of(probe)
        greatest[kind] = max(greatest.get(kind, 1e-9), float(np.max(np.abs(values), initial=0.0)))
    apart = {
        probe: float(np.max(np.abs(other.rows[name(probe)] - values), initial=0.0)) / greatest[kind_of(probe)]
        for probe, values in wanted.items()
    }
    worst = max(apart, key=apart.get, default=None)
    assert worst is None or apart[worst] <= within, (worst, apart[worst])

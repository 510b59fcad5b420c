"""The growth check runs inside the compiled loop at every sixteenth step, with one thread or several."""

from __future__ import annotations

from collections import Counter

import pytest
from solve.test_soundness import closing, said
from solve.test_threads import liquid

import fvsolve
from fvsolve.solve.run_checks import GROWTH_LIMIT
from fvsolve.solve.run_loop import RunLoop
from fvsolve.steppers.loop_records import GROWTH_CHECK_STEPS


@pytest.fixture
def returns(monkeypatch):
    """Counter of the returns of the time loop to Python."""
    count, steps = Counter(), RunLoop.steps

    def counted(loop, budget):
        count["returns"] += 1
        return steps(loop, budget)

    monkeypatch.setattr(RunLoop, "steps", counted)
    return count


def test_growth_is_seen_within_sixteen_steps():
    """Growth by 2 c - 1 = 1.04 per step, of upwind and Euler at Courant number c, is reported within sixteen steps."""
    case = closing(scheme="upwind", method="euler", courant=1.02)
    case["numerics"]["end"] = 100.0
    result = fvsolve.run(case)
    (grown,) = said(result, "growth")
    assert result.summary["steps"] % GROWTH_CHECK_STEPS == 0
    assert 1.0 < grown.value / grown.limit <= 1.04**GROWTH_CHECK_STEPS
    assert f"{GROWTH_LIMIT * grown.value / grown.limit:.3g}" in grown.text


def test_a_run_beyond_a_limit_that_does_not_grow_stays_in_the_loop(returns):
    case = closing(scheme="upwind", method="euler", courant=1.0 + 1e-8)
    case["numerics"]["end"] = 100.0
    result = fvsolve.run(case)
    assert said(result, "step-limit") and not said(result, "growth")
    assert returns["returns"] < result.summary["steps"] / (4 * GROWTH_CHECK_STEPS)


def test_threads_stop_at_the_same_step(returns):
    case = liquid()
    case["numerics"] |= {"courant": 2.0, "end": 1.0}
    one, three = (fvsolve.run(case, threads=many) for many in (1, 3))
    assert [one.summary["threads"], three.summary["threads"]] == [1, 3] and returns["returns"] < 10
    assert one.summary["steps"] % GROWTH_CHECK_STEPS == 0 and one.summary["steps"] == three.summary["steps"]
    assert said(one, "growth") == said(three, "growth") != []

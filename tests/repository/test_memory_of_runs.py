"""Memory that a process keeps: nothing of a case stays when its last user is gone."""

import gc
import sys
import weakref

import pytest
from reference.scenes import branched

import fvsolve
from fvsolve.core.solve import advance, initial_state
from fvsolve.studies import sweep


def use_model(case) -> None:
    model = fvsolve.build(case)
    advance(model, initial_state(model), 0.01)
    fvsolve.vary(model, {"links.valve.area": 0.004})


USES = {
    "load": lambda case: None,
    "build, advance and vary": use_model,
    "run": lambda case: fvsolve.run(case),
    "overrides": lambda case: fvsolve.run(case, set={"numerics.end": 0.02}),
    "check": lambda case: fvsolve.build(case).checks,
    "sweep": lambda case: sweep(case, {"links.valve.area": [0.004, 0.005]}),
}


@pytest.fixture
def scene():
    case = branched(fields=0)
    case["numerics"] |= {"end": 0.05}
    return case


@pytest.mark.parametrize("use", USES.values(), ids=USES)
def test_the_parts_of_a_case_are_gone_with_the_case(use, scene):
    case = fvsolve.load(scene)
    parts = [
        weakref.ref(part)
        for part in (*case.nodes.values(), *case.links.values(), case.fluid, case.numerics)
    ]
    use(case)
    del case
    gc.collect()
    assert [part() for part in parts if part() is not None] == []


def test_a_run_retains_no_memory(scene):
    """A block is a small object: before, each run kept more than a hundred."""
    for _ in range(5):
        fvsolve.run(scene)
    gc.collect()
    before = sys.getallocatedblocks()
    for _ in range(20):
        fvsolve.run(scene)
    gc.collect()
    assert (sys.getallocatedblocks() - before) / 20 < 30

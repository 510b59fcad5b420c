"""A model is read-only, and several runs share it one after another or at once."""

import hashlib
import subprocess
import sys
import threading
import tomllib

import numpy as np
import pytest
from reference.folders import CASES

import fvsolve
from fvsolve.model import Model, RunData
from fvsolve.solve.run_loop import NO_LIMIT, RunLoop
from fvsolve.steppers import loop_records
from fvsolve.studies.outcome import outcome

SCENES = {  # pipes; flags and marks of devices; cells and work arrays of a basin; scalars; Newton's method
    "nine pipes": ("streeter-nine-pipes", {"numerics.end": 5.0}),
    "nine pipes, log": ("streeter-nine-pipes", {"numerics.end": 0.5, "fluid.law": "log"}),
    "check valve": ("check-valve-slam", {}),
    "relief valve": ("relief-on-closed-main", {}),
    "pump with its vessel": ("pump-trip-air-vessel", {}),
    "basin": ("dam-break", {}),
    "tracer in a basin": ("tracer-basin", {"numerics.end": 20.0}),
    "cylinder": ("cylinder-servo", {"numerics.end": 0.1}),
}


def built(scene: str) -> Model:
    name, set = SCENES[scene]
    case = tomllib.loads((CASES / f"{name}.toml").read_text(encoding="utf-8"))
    case = {key: part for key, part in case.items() if key not in ("expect", "compare")}
    return fvsolve.build(fvsolve.load(case, {"output.fields": 0, "output.lines": {}, **set}))


def bits(model: Model) -> str:
    """Hash of the bytes of all arrays of a model, including the structure of its Jacobian."""
    arrays = (*model.tables, model.scale, model.start, *model.profiles.values(), model.structure.shape)
    return hashlib.sha256(b"".join(array.tobytes() for array in arrays)).hexdigest()


def written(run) -> list[np.ndarray]:
    """Rows, final state, event flags, marks, envelopes and extremes of a run."""
    slate = run.run_data
    return [run.rows, run.y, slate.armed, slate.marks, slate.envelope, slate.extremes]


def same(one: list[np.ndarray], other: list[np.ndarray]) -> bool:
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, other, strict=True))


@pytest.mark.parametrize("scene", SCENES)
def test_a_run_leaves_its_model_as_it_was(scene):
    """A run does not change a byte of its model, and a second run gives equal results."""
    model = built(scene)
    before = bits(model)
    first = written(outcome(model))
    rates = model.rhs(model.case.numerics.start, model.start)
    assert bits(model) == before
    assert same(written(outcome(model)), first)
    assert np.array_equal(model.rhs(model.case.numerics.start, model.start), rates)


def test_nobody_writes_into_a_model():
    model = built("check valve")
    for array in (*model.tables, model.scale, model.start, *model.profiles.values()):
        assert not array.flags.writeable
    with pytest.raises(ValueError, match="read-only"):
        model.tables.nodes["pressure"] = 0.0


@pytest.mark.parametrize("scene", SCENES)
def test_runs_of_one_model_at_once_are_the_runs_alone(scene):
    """Three threads with one model, one from another state, give the results of single runs."""
    model = built(scene)
    moved = model.start + 1e-3 * model.scale
    alone = [written(outcome(model)), written(outcome(model, y=moved))]
    starts, found, together = [None, moved, None], {}, threading.Barrier(3)

    def run(k: int) -> None:
        together.wait()
        found[k] = written(outcome(model, y=starts[k]))

    threads = [threading.Thread(target=run, args=(k,)) for k in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert same(found[0], alone[0]) and same(found[2], alone[0]) and same(found[1], alone[1])
    assert not same(alone[0], alone[1])


@pytest.mark.parametrize("scene", SCENES)
def test_runs_of_one_model_step_by_step_in_turn_are_the_runs_alone(scene):
    """Two runs of one model with alternating steps give the states of single runs."""
    model, states = built(scene), []
    moved = model.start + 1e-3 * model.scale
    for loops in ([begun(model, model.start)], [begun(model, moved)], [begun(model, y) for y in (model.start, moved)]):
        for _ in range(60):
            for loop in loops:
                assert loop.run(1.0) == loop_records.BUDGET_SPENT
        states += [loop.now.copy() for loop in loops]
    assert np.array_equal(states[0], states[2]) and np.array_equal(states[1], states[3])
    assert not np.array_equal(states[0], states[1])


def begun(model: Model, y: np.ndarray) -> RunLoop:
    """Time loop from a state at the start time, before its first step."""
    loop = RunLoop(model)
    loop.now[:] = y
    loop.state["t"] = model.case.numerics.start
    loop.begin(model.case.numerics.end, NO_LIMIT)
    return loop


def test_threads_that_ask_for_compiled_code_at_once_get_it():
    """Two threads of a new process compile at once and give equal results."""
    code = """
import sys, threading, fvsolve
together, found = threading.Barrier(2), {}
def run(k):
    together.wait()
    found[k] = fvsolve.run(sys.argv[1], {"numerics.method": "esdirk-4", "output.fields": 0}).extremes
threads = [threading.Thread(target=run, args=(k,)) for k in range(2)]
for thread in threads: thread.start()
for thread in threads: thread.join()
assert found[0] == found[1]
"""
    subprocess.run([sys.executable, "-c", code, str(CASES / "check-valve-slam.toml")], check=True)


def test_slates_of_one_model_share_no_array_that_is_written():
    model = built("tracer in a basin")
    one, other = RunData(model), RunData(model)
    assert not any(np.shares_memory(a, b) for a, b in zip(one.written, other.written, strict=True))

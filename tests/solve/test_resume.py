"""A run that is killed at random times and resumed equals the uninterrupted run to the bit."""

import json
import random
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from basins.test_basin import alone, basin
from reference.checkpoints import write_sealed
from reference.scenes import branched

import fvsolve
from fvsolve.output.memory_sink import MemorySink
from fvsolve.solve.solve import Run

OFTEN = """
import sys
from importlib import import_module
import fvsolve
from fvsolve.output.memory_sink import MemorySink
from fvsolve.solve.solve import Run
import_module("fvsolve.solve.solve").CHECKPOINT_SECONDS = 0.02
print(fvsolve.run(sys.argv[1], out=sys.argv[2], resume=True, pictures=False).reason)
"""
WORK = ("rhs", "ended", "seconds", "seconds_setup", "seconds_total", "cost")  # work of the run, not its results


def long_run(**numerics) -> dict:
    """Case with about a second of steps."""
    case = branched(fields=20)
    case["nodes"]["tower"] = {"type": "tank", "area": 2.0, "level": 5.0, "height": 30.0, "elevation": 10.0}
    case["links"]["riser"] = {"type": "valve", "from": "fork", "to": "tower", "area": 0.01,
                              "discharge_coefficient": 0.6}  # fmt: skip
    case["numerics"] = {"end": 2500.0, "scheme": "muscl", "method": "ssp-rk3", **numerics}
    case["output"] |= {"every": 0.1, "probes": [*case["output"]["probes"], "tower.level"]}
    return case


def started(script: Path, case: Path, out: Path) -> subprocess.Popen:
    command = [sys.executable, str(script), str(case), str(out)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def same_files(one: Path, other: Path) -> None:
    files = sorted(path.relative_to(one) for path in one.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(other) for path in other.rglob("*") if path.is_file())
    for name in files:
        if name.name == "summary.json":
            said, again = (json.loads((run / name).read_text()) for run in (one, other))
            assert {**said, **dict.fromkeys(WORK)} == {**again, **dict.fromkeys(WORK)}
        elif name.name != "restart.npz":  # times of checkpoints differ
            assert (one / name).read_bytes() == (other / name).read_bytes(), name


@pytest.mark.parametrize(
    "numerics, kills",
    [({"courant": 0.5}, 2), ({"method": "bogacki-shampine", "rtol": 1e-7}, 1)],
    ids=["courant", "error control"],
)
def test_killed_at_random_moments_and_resumed_is_the_unbroken_run(tmp_path, numerics, kills):
    seed = random.randrange(10**6)
    print("seed", seed)
    moments = random.Random(seed)
    case, script = long_run(**numerics), tmp_path / "often.py"
    script.write_text(OFTEN)
    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    assert whole.ok, whole.reason
    file, broken, reached = tmp_path / "whole" / "case.toml", tmp_path / "broken", 0.0
    for _ in range(kills):
        wanted = reached + moments.uniform(0.0, 0.3) * whole.t[-1]
        running = started(script, file, broken)
        while running.poll() is None and checkpoint(broken) <= wanted:
            time.sleep(0.004)
        running.kill()
        running.communicate()
        before, reached = reached, checkpoint(broken)
        assert running.returncode != 0 and before <= wanted < reached < whole.t[-1]  # within the run
    said = started(script, file, broken).communicate()
    assert said == ("finished\n", "")
    same_files(tmp_path / "whole", broken)


def checkpoint(folder: Path) -> float:
    """Time of the last checkpoint [s], 0 without a checkpoint."""
    if not (folder / "restart.npz").exists():
        return 0.0
    with np.load(folder / "restart.npz") as kept:
        return float(kept["t"])


def test_a_later_end_goes_on_to_the_longer_run(tmp_path):
    short = {"output.every": 0.01, "output.fields": 0}
    fvsolve.run(branched(), set=short, out=tmp_path / "run", pictures=False)
    later = {**short, "numerics.end": 1.5}
    result = fvsolve.run(branched(), set=later, out=tmp_path / "run", resume=True, pictures=False)
    unbroken = fvsolve.run(branched(), set=later)
    assert result.t[-1] == 1.5 and np.array_equal(result.t, unbroken.t)
    assert np.array_equal(result["gate.pressure"], unbroken["gate.pressure"])


def test_an_earlier_end_than_the_checkpoint_is_refused(tmp_path):
    fvsolve.run(branched(), out=tmp_path / "run", pictures=False)
    place = tmp_path / "run" / "restart.npz"
    with np.load(place) as file:
        arrays = dict(file)
    write_sealed(place, {**arrays, "t": np.float64(7.0)})
    with pytest.raises(fvsolve.RunError, match="after numerics.end"):
        fvsolve.run(branched(), out=tmp_path / "run", resume=True)


def test_resume_and_force_contradict(tmp_path):
    with pytest.raises(fvsolve.RunError, match="state only one of them"):
        fvsolve.run(branched(), out=tmp_path / "run", resume=True, force=True)


def test_a_run_that_came_to_its_end_is_left_as_it_is(tmp_path):
    fvsolve.run(branched(), out=tmp_path / "run", pictures=False)
    before = (tmp_path / "run" / "summary.json").stat().st_mtime_ns
    assert fvsolve.run(branched(), out=tmp_path / "run", resume=True).ok
    assert (tmp_path / "run" / "summary.json").stat().st_mtime_ns == before


def test_nothing_to_resume_is_a_start(tmp_path):
    assert fvsolve.run(branched(), out=tmp_path / "run", resume=True).ok


def test_resume_needs_a_directory():
    with pytest.raises(fvsolve.RunError, match="give it as the argument `out`"):
        fvsolve.run(branched(), resume=True)


def test_a_checkpoint_of_another_case_is_refused_with_a_remedy(tmp_path):
    fvsolve.run(branched(), out=tmp_path / "run", pictures=False)
    with pytest.raises(fvsolve.RunError, match="another case.*--force"):
        fvsolve.run(branched(), set={"links.main.cells": 31}, out=tmp_path / "run", resume=True)


def test_other_claims_and_titles_are_no_other_case(tmp_path):
    fvsolve.run(branched(), out=tmp_path / "run", pictures=False)
    said = {"title": "Another", "expect": {"min(valve.flow)": {"value": 0.0, "atol": 1.0}}}
    assert fvsolve.run(branched(), set=said, out=tmp_path / "run", resume=True).ok


@pytest.mark.parametrize("key, there", {"numpy": "0.0.1", "target": "znver9-01234567"}.items())
def test_a_checkpoint_of_other_versions_is_refused_with_a_remedy(tmp_path, key, there):
    place = tmp_path / "run" / "restart.npz"
    fvsolve.run(branched(), out=tmp_path / "run", pictures=False)
    with np.load(place) as file:
        arrays = dict(file)
    arrays["identity"] = np.array(json.dumps(json.loads(str(arrays["identity"])) | {key: there}))
    write_sealed(place, arrays)
    with pytest.raises(fvsolve.RunError, match=f"other versions.*{key} {there}.*--force"):
        fvsolve.run(branched(), out=tmp_path / "run", resume=True)


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 not a checkpoint"])
def test_a_damaged_checkpoint_is_refused_with_a_remedy(tmp_path, damage):
    fvsolve.run(branched(), out=tmp_path / "run", pictures=False)
    (tmp_path / "run" / "restart.npz").write_bytes(damage)
    with pytest.raises(fvsolve.RunError, match="cannot be read.*--force"):
        fvsolve.run(branched(), out=tmp_path / "run", resume=True)


def test_a_history_that_lost_rows_is_refused_with_a_remedy(tmp_path):
    fvsolve.run(branched(), out=tmp_path / "run", pictures=False)
    (tmp_path / "run" / "summary.json").unlink()
    history = tmp_path / "run" / "history.csv"
    history.write_bytes(history.read_bytes()[:10])
    with pytest.raises(fvsolve.RunError, match="shorter.*--force"):
        fvsolve.run(branched(), out=tmp_path / "run", resume=True)


def test_what_was_seen_of_a_basin_before_is_known_after(tmp_path):
    """A resumed run keeps the greatest rates and the shortest waves so far, from which notices are made at its end."""
    case = alone(basin((40.0, 20.0), (16, 8), 0.2, start={"level": "where(x < 20, 0.2, 0.1)"}), 6.0, step=0.05)
    case["numerics"].pop("courant", None)
    case["output"] |= {"fields": 12}
    model = fvsolve.build(fvsolve.load(case))

    def late(t, seconds, steps):
        run.budget = 5.0  # steps until the next call
        if t > 3.0:
            raise KeyboardInterrupt

    run = Run(model, fvsolve.initial_state(model), MemorySink(model), late)
    run.left = 5.0
    assert run.go().reason.startswith("interrupted") and run.checks.rates and run.watches[0].greatest[0] >= 0.0
    again = Run(model, run.state(), MemorySink(model), None)
    assert again.checks.rates == run.checks.rates
    assert [one.greatest.tolist() for one in again.watches] == [one.greatest.tolist() for one in run.watches]


class Keeping(MemorySink):
    """Sink in memory that also keeps all checkpoints; its field frames are computed."""

    takes_fields = True

    def __init__(self, model) -> None:
        super().__init__(model)
        self.states = []

    def checkpoint(self, state, extra) -> None:
        self.states.append(state)


@pytest.mark.parametrize(
    "output",
    [{"fields": 40, "every": 1.0}, {"fields": 80, "every": 1.0}, {"fields": 0, "every": 5e-5}],
    ids=["a frame at each step", "two frames in each step", "more rows in a step than are held"],
)
def test_a_run_whose_steps_all_write_pauses_and_goes_on_from_there(output, monkeypatch):
    monkeypatch.setattr(import_module("fvsolve.solve.solve"), "CHECKPOINT_SECONDS", 0.0)
    case = branched()
    case["numerics"] = {"end": 2.0, "scheme": "upwind", "method": "implicit-midpoint", "step": 0.05}
    case["output"] |= output
    model, times = fvsolve.build(fvsolve.load(case)), []

    def go(state):
        sink = Keeping(model)
        run = Run(model, state, sink, lambda t, seconds, steps: times.append(t))
        run.budget = run.left = 10.0
        assert run.go().reason == "finished"
        return sink, run.loop.now.copy()

    whole, end = go(fvsolve.initial_state(model))
    assert times and 0.0 < times[0] < 2.0
    half = whole.states[0]
    again, same = go(half)
    assert 0.0 < half.t < 2.0 and np.array_equal(same, end)
    rows = whole.table()
    assert np.array_equal(again.table(), rows[rows[:, 0] > half.t])

"""A run that is killed at random times and resumed equals the uninterrupted run to the bit."""

import json
import random
import re
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from reference.basins import alone, basin
from reference.checkpoints import write_sealed
from reference.networks_without_waves import FALLING, reducing, town
from reference.resumed_runs import long_run, same_files
from reference.scenes import branched

import fvsolve
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.solve.solve import Run

OFTEN = """
import sys
from importlib import import_module
import fvsolve
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.solve.solve import Run
import_module("fvsolve.core.solve.solve").CHECKPOINT_SECONDS = 0.02
print(fvsolve.run(sys.argv[1], out=sys.argv[2], resume=True, pictures=False).reason)
"""


def started(script: Path, case: Path, out: Path) -> subprocess.Popen:
    command = [sys.executable, str(script), str(case), str(out)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


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
        # within the run
        assert running.returncode != 0 and before <= wanted < reached < whole.t[-1]
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


def test_a_checkpoint_of_another_case_is_refused_with_its_keys_and_a_remedy(tmp_path):
    fvsolve.run(branched(), out=tmp_path / "run", pictures=False)
    cells = fvsolve.load(branched()).links["main"].cells
    with pytest.raises(
        fvsolve.RunError, match=rf"another case: links.main.cells {cells} \(now 31\)\. .*--force"
    ):
        fvsolve.run(branched(), set={"links.main.cells": 31}, out=tmp_path / "run", resume=True)
    other = {"numerics.method": "euler", "numerics.scheme": "upwind"}
    with pytest.raises(
        fvsolve.RunError,
        match=r'numerics.method ".*" \(now "euler"\), numerics.scheme.*courant, step',
    ):
        fvsolve.run(branched(), set=other, out=tmp_path / "run", resume=True)
    (tmp_path / "run" / "case.toml").write_text("[damaged")
    with pytest.raises(fvsolve.RunError, match="another case. A continued run may change"):
        fvsolve.run(branched(), set={"links.main.cells": 31}, out=tmp_path / "run", resume=True)


def ends_at(end: float, **numerics) -> dict:
    """Keys of a run without frames, with rows at the same times for every end."""
    return {"output.every": 0.01, "output.fields": 0, "numerics.end": end} | {
        f"numerics.{key}": value for key, value in numerics.items()
    }


@pytest.fixture
def often(monkeypatch) -> None:
    """Runs of this process pause every 10 steps, and write a checkpoint at each pause."""
    for name, value in (
        ("FIRST_CHUNK", 10.0),
        ("CHUNK_SECONDS", 1e-9),
        ("CHECKPOINT_SECONDS", 0.0),
    ):
        monkeypatch.setattr(import_module("fvsolve.core.solve.solve"), name, value)


@pytest.mark.parametrize(
    "first, second",
    [
        (dict(courant=0.8, method="ssp-rk3"), dict(courant=0.4, method="ssp-rk3")),
        (dict(step=1e-3, method="radau-iia-5"), dict(step=5e-4, method="radau-iia-5")),
        (dict(courant=0.8, method="dormand-prince"), dict(rtol=1e-6, method="dormand-prince")),
        (dict(rtol=1e-4, method="rodas-5p"), dict(rtol=1e-6, method="rodas-5p")),
    ],
)
def test_a_run_continues_with_other_steps_and_a_notice(tmp_path, often, first, second):
    """From the state of the checkpoint on, the result is that of the new steps alone."""
    out = tmp_path / "run"
    begun = fvsolve.run(branched(), set=ends_at(0.5, **first), out=out, pictures=False)
    with np.load(out / "restart.npz") as kept:
        t, y = float(kept["t"]), kept["y"]
    assert 0.3 < t <= 0.5
    result = fvsolve.run(
        branched(), set=ends_at(1.0, **second), out=out, resume=True, pictures=False
    )
    keys = sorted({*first, *second} - {"method"})
    change = {
        "t": t,
        "keys": {f"numerics.{key}": [first.get(key), second.get(key)] for key in keys},
    }
    assert (
        result.ok and begun.summary["continued"] == [] and result.summary["continued"] == [change]
    )
    assert fvsolve.open_run(out).summary["continued"] == [change]
    noted = [item["text"] for item in result.summary["warnings"] if item["kind"] == "continued"]
    assert (out / "case.toml").read_text().splitlines()[:1] == [f"# {text}" for text in noted]
    assert noted[0].startswith(f"from t = {t:.9g} s on: numerics.") and "before: " in noted[0]
    if "rtol" not in second:  # from there on twice as many steps in the same time
        assert result.summary["steps"] == pytest.approx(
            begun.summary["steps"] * (2.0 * t + 4.0 * (1.0 - t)), rel=0.05
        )
    model = fvsolve.build(fvsolve.load(branched(), ends_at(1.0, **second)))
    alone = fvsolve.advance(model, fvsolve.State(t, y, {}), 1.0)
    seen = dict(zip([probe.text for probe in model.probes], model.observe(alone), strict=True))
    assert result["gate.pressure"][-1] == pytest.approx(
        seen["gate.pressure"], rel=1e-4 if "rtol" in second else 1e-9
    )


def test_every_change_of_steps_is_stored(tmp_path, often):
    for end, courant in ((0.4, 0.8), (0.6, 0.4), (0.8, 0.4), (1.0, 0.6)):
        result = fvsolve.run(
            branched(), set=ends_at(end, courant=courant), out=tmp_path, resume=True, pictures=False
        )
    first, second = result.summary["continued"]
    assert (first["keys"], second["keys"]) == (
        {"numerics.courant": [0.8, 0.4]},
        {"numerics.courant": [0.4, 0.6]},
    )
    assert 0.2 < first["t"] <= 0.4 and 0.6 < second["t"] <= 0.8
    assert fvsolve.load(tmp_path / "case.toml").numerics.courant == 0.6


def test_other_steps_are_refused_for_a_finished_run_and_with_histories(tmp_path, often):
    fvsolve.run(branched(), out=tmp_path / "run", pictures=False)
    with pytest.raises(
        fvsolve.RunError,
        match=r"holds the finished run.*numerics.courant = 0.3 \(before: .*--force",
    ):
        fvsolve.run(branched(), set={"numerics.courant": 0.3}, out=tmp_path / "run", resume=True)
    lines = {"numerics.pipe_model": "delay-line", "numerics.scheme": "upwind"}
    fvsolve.run(
        branched(), set=ends_at(0.5, step=0.01) | lines, out=tmp_path / "lines", pictures=False
    )
    with pytest.raises(
        fvsolve.RunError, match="numerics.step cannot change in a continued run with delay lines"
    ):
        fvsolve.run(
            branched(), set=ends_at(1.0, step=0.005) | lines, out=tmp_path / "lines", resume=True
        )


def test_the_command_continues_with_other_steps(fvs, tmp_path, often):
    place = (
        "--out",
        tmp_path / "run",
        "--no-pictures",
        "--set",
        "links.main.cells=20",
        "--set",
        "output.every=0.05",
        "--set",
        "expect={}",
    )
    assert fvs("run", "valve-closure", *place, "--set", "numerics.end=1")[0] == 0
    more = ("--resume", "--set", "numerics.end=2", "--set", "numerics.courant=0.4")
    code, out, _ = fvs("run", "valve-closure", *place, *more)
    assert code == 0 and re.search(
        r"note: from t = 0\.\d+ s on: numerics.courant = 0.4 \(before: 0.9\)", out
    )


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


def test_observations_of_a_basin_before_a_break_are_known_after_it(tmp_path):
    """A resumed run keeps the greatest rates and the shortest waves so far, from which notices are made at its end."""
    case = alone(
        basin((40.0, 20.0), (16, 8), 0.2, start={"level": "where(x < 20, 0.2, 0.1)"}),
        6.0,
        step=0.05,
    )
    case["numerics"].pop("courant", None)
    case["output"] |= {"fields": 12}
    model = fvsolve.build(fvsolve.load(case))

    def late(t, seconds, steps):
        run.budget = 5.0  # steps until the next call
        if t > 3.0:
            raise KeyboardInterrupt

    run = Run(model, fvsolve.initial_state(model), MemorySink(model), late)
    run.left = 5.0
    assert (
        run.go().reason.startswith("interrupted")
        and run.checks.rates
        and run.watches[0].greatest[0] >= 0.0
    )
    again = Run(model, run.state(), MemorySink(model), None)
    assert again.checks.rates == run.checks.rates
    assert [one.greatest.tolist() for one in again.watches] == [
        one.greatest.tolist() for one in run.watches
    ]


class Keeping(MemorySink):
    """Sink in memory that also keeps all checkpoints; its field frames are computed."""

    takes_fields = True

    def __init__(self, model) -> None:
        super().__init__(model)
        self.states = []

    def checkpoint(self, state) -> None:
        self.states.append(state)


@pytest.mark.parametrize(
    "output",
    [{"fields": 40, "every": 1.0}, {"fields": 80, "every": 1.0}, {"fields": 0, "every": 5e-5}],
    ids=["a frame at each step", "two frames in each step", "more rows in a step than are held"],
)
def test_a_run_that_writes_at_every_step_pauses_and_goes_on_from_there(output, monkeypatch):
    monkeypatch.setattr(import_module("fvsolve.core.solve.solve"), "CHECKPOINT_SECONDS", 0.0)
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


@pytest.mark.parametrize("method", ["dormand-prince", "radau-iia-5", "auto"])
def test_a_day_without_waves_that_is_resumed_is_the_unbroken_day_to_the_bit(often, method):
    """The iterations of its network begin at the last accepted state, which checkpoints contain; a valve acts at once.

    The run goes on from each checkpoint: before, between and after the switches of the valve.
    """
    case = town(reducing(), source=FALLING, method=method, rtol=1e-7)
    model = fvsolve.build(fvsolve.load(case))

    def go(state):
        sink = Keeping(model)
        run = Run(model, state, sink, None)
        summary = run.go()
        assert summary.reason == "finished"
        return sink, run.loop.now.copy(), summary

    whole, end, first = go(fvsolve.initial_state(model))
    assert len(whole.states) >= 4 and len(first.events) >= 4
    rows = whole.table()
    for state in whole.states:
        assert state.memory["accepted"][0] == 1.0
        again, same, second = go(state)
        assert np.array_equal(same, end) and second.events == first.events
        assert np.array_equal(again.table(), rows[rows[:, 0] > state.t])

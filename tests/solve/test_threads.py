"""Threads that share the rows of basins give the bits of one thread: states, ledgers, rows, frames and resumed runs."""

import importlib
import os
import signal
import threading
from dataclasses import replace

import numpy as np
import pytest
from reference.basin_scenes import MESH, SCENES, VALVE, carried, dyed, water, with_maxima
from reference.scenes import AMBIENT, reservoir, scene

import fvsolve
from fvsolve.core.kernels import band_exchange
from fvsolve.core.output.memory_sink import MemorySink
from fvsolve.core.solve import initial_state
from fvsolve.core.solve.partition import divisible_rows, single_thread_reason
from fvsolve.core.solve.run_loop import RunLoop
from fvsolve.core.solve.solve import MemoryMismatch, Run, solve
from fvsolve.errors import FvsolveError


def band_threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name.startswith("band")]


@pytest.fixture(autouse=True)
def no_thread_outlives_a_test():
    yield
    # They return by themselves, on a busy machine a little later than the run.
    for thread in band_threads():
        thread.join(10.0)
    assert not band_threads()


DYED_MESH = {"cells": [60, 48], "holes": [[1.8, 1.25, 2.6, 1.875]]}


class FrameSink(MemorySink):
    """Sink in memory that also keeps field frames."""

    takes_fields = True

    def field(self, t, values):
        self.frames = [*getattr(self, "frames", []), values]


def result_bytes(case, threads: int, state=None):
    """Bytes of all results of a run, and its summary."""
    case = case | {"output": case["output"] | {"fields": 3}}
    model = fvsolve.build(fvsolve.load(case))
    sink, state = FrameSink(model), state or initial_state(model)
    sink.begin(model, state)
    run = Run(model, state, sink, None, threads)
    summary = run.go()
    assert summary.reason == "finished", summary.reason
    loop = run.loop
    cells = [
        np.asarray(array)
        for frame in sink.frames
        for name in ("pool", "sheet", "round", "other")
        if name in frame
        for array in frame[name].values()
    ]
    kept = [
        loop.now,
        *loop.stepper.restart_arrays().values(),
        run.run_data.marks,
        run.run_data.extremes,
        sink.table(),
    ]
    kept += cells
    return [np.array(one).tobytes() for one in kept], summary


@pytest.mark.parametrize("name", SCENES)
def test_any_number_of_threads_gives_the_same_bits(name):
    case = SCENES[name]
    assert not single_thread_reason(fvsolve.build(fvsolve.load(case)))
    bits, one = result_bytes(case, 1)
    for threads in (2, 3, 4):
        found, summary = result_bytes(case, threads)
        assert found == bits, threads
        assert summary.threads == threads and summary.ledgers == one.ledgers


FORMED = (
    "muscl, ssp-rk2",
    "muscl, a limiter of its own, rk4",
    "upwind5, ssp-rk3",
    "a tolerance",
    "a tolerance, first same as last",
    "a liquid",
    "a liquid between walls",
    "a liquid, upwind5",
    "a dye",
    "walls all around",
    "rain and Horton",
    "rain and Green-Ampt, rk4",
)


@pytest.mark.in_turn
@pytest.mark.parametrize("name", FORMED)
@pytest.mark.parametrize("cells", [1, 20, 10**6])
def test_stages_formed_with_rates_have_the_bits_of_those_formed_after_all(name, cells, monkeypatch):
    """Blocked stages have the bits of whole stages, for several block sizes and numbers of threads."""
    bits, _ = result_bytes(SCENES[name], 1)
    here = importlib.import_module("fvsolve.core.solve.partition")
    monkeypatch.setattr(here, "LEAST_STATES", 0)
    monkeypatch.setattr(here, "CACHED_CELLS", cells)
    model = fvsolve.build(fvsolve.load(SCENES[name]))
    assert RunLoop(model).stepper.structure.size > 0
    assert result_bytes(SCENES[name], 1)[0] == bits
    assert result_bytes(SCENES[name], 3)[0] == bits


def test_number_of_threads_may_equal_that_of_rows():
    assert result_bytes(water(), 12)[0] == result_bytes(water(), 1)[0]


def test_two_basins_with_a_basin_that_each_thread_steps_as_a_whole():
    """Several basins give equal bits, although each thread computes all cells of a small mesh that is not a grid."""
    case = water()
    case["nodes"]["round"] = {
        "type": "basin",
        "size": [2.0, 2.0],
        "cells": [6, 6],
        "holes": [[0.0, 0.0, 1.0, 1.0]],
        "level": 0.4,
        "patches": {"near": {"side": "east"}},
    }
    case["nodes"]["other"] = {
        "type": "basin",
        "size": [2.0, 2.0],
        "cells": [5, 7],
        "level": 0.7,
        "patches": {"near": {"side": "east"}},
    }
    for name in ("round", "other"):
        case["links"][name] = VALVE | {"from": f"{name}.near", "to": "pool.near"}
    case = with_maxima(case, "pool", "round", "other")
    bits, _ = result_bytes(case, 1)
    found, summary = result_bytes(case, 3)
    assert found == bits
    (notice,) = [one for one in summary.warnings if one.kind == "threads"]
    why = "round: its mesh is not a full rectangle and has fewer than 2048 cells"
    assert notice.text == f"each thread computes all rows of these basins: {why}"


def stepped(case, threads: int, spoil=lambda team: None) -> bytes:
    """Bytes of the final state; `spoil` may change the team of threads before the run."""
    model = fvsolve.build(fvsolve.load(case))
    loop = RunLoop(model, threads=threads)
    loop.now[:] = model.start
    if loop.team is not None:
        spoil(loop.team)
    loop.begin(model.case.numerics.end, 1e308)
    try:
        loop.run(1e9)
    finally:
        loop.close()
    return loop.now.tobytes()


@pytest.mark.parametrize("threads, mesh", [(2, {}), (3, {}), (2, MESH)])
def test_a_row_that_is_not_taken_from_a_neighbour_is_seen(threads, mesh):
    """A missing exchange of a row changes the state, so equal bits prove that all rows are exchanged."""

    def forget(team):
        team.members[1].written.joint[band_exchange.STATES] -= 1

    case = water(basin={"patches": {}} | mesh, link=None)
    whole = stepped(case, 1)
    assert stepped(case, threads) == whole
    assert stepped(case, threads, forget) != whole


def test_bands_that_do_not_wait_for_each_other_are_seen():
    """A planted race, in which threads do not wait for each other, changes the state."""

    def race(team):
        for member in team.members:
            member.written.joint[band_exchange.BAND_COUNT] = 1
            team.board.view(np.int64)[
                band_exchange.LINE * member.number + band_exchange.SHARED_ADDRESS
            ] = member.stepper.y.ctypes.data

    case = water(basin={"patches": {}, "cells": [40, 40]}, link=None, step=1e-3)
    whole = stepped(case, 1)
    assert stepped(case, 2) == whole
    assert any(stepped(case, 2, race) != whole for _ in range(5))


def test_handles_of_threads_are_formed_again_only_where_an_array_has_grown():
    """A run pauses many times; a handle for each pause would fill the memory."""
    model = fvsolve.build(fvsolve.load(water(end=1.0)))
    loop = RunLoop(model, threads=2)
    loop.now[:] = model.start
    loop.begin(1.0, np.inf)
    loop.run(4.0)
    kept = [len(worker.run_data.kept) for worker in loop.team.members]
    for _ in range(5):
        loop.run(4.0)
    assert [len(worker.run_data.kept) for worker in loop.team.members] == kept
    loop.close()


def test_a_run_that_cannot_begin_ends_its_threads():
    """A sink without methods, and restart data of another run, are found after the threads have been started."""
    model = fvsolve.build(fvsolve.load(water(end=1.0)))
    state = initial_state(model)
    with pytest.raises(FvsolveError, match="is not a sink"):
        solve(model, state, object(), threads=2)
    with pytest.raises(MemoryMismatch):
        solve(model, replace(state, memory={"run": np.zeros(3)}), MemorySink(model), threads=2)
    assert not band_threads()


def test_a_run_is_resumed_by_another_number_of_threads_to_the_same_bits(tmp_path, monkeypatch):
    case = with_maxima(water(end=0.2, step=1e-3), "pool")
    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    settings = {"CHECKPOINT_SECONDS": 0.0, "CHUNK_SECONDS": 0.0, "FIRST_CHUNK": 80.0}
    for name, value in settings.items():  # checkpoints after 80, 100, 110, ... steps
        monkeypatch.setattr(importlib.import_module("fvsolve.core.solve.solve"), name, value)

    def stop(t, seconds, steps):
        if t > 0.11:
            raise KeyboardInterrupt

    broken = fvsolve.run(case, out=tmp_path / "broken", threads=3, progress=stop, pictures=False)
    assert broken.reason.startswith("interrupted")
    with np.load(tmp_path / "broken" / "restart.npz") as file:
        assert 0.0 < file["t"] < 0.2
    again = {"out": tmp_path / "broken", "resume": True, "pictures": False}
    broken = fvsolve.run(tmp_path / "broken" / "case.toml", threads=2, **again)
    assert broken.ok and broken.summary["threads"] == 2
    assert whole.ok and whole.ledger == broken.ledger
    files = [
        sorted([*(tmp_path / name).rglob("*.vtu"), tmp_path / name / "history.csv"])
        for name in ("whole", "broken")
    ]
    assert len(files[0]) == len(files[1]) > 2
    assert all(one.read_bytes() == other.read_bytes() for one, other in zip(*files, strict=True))


def test_ctrl_c_while_threads_march_ends_a_run_cleanly(tmp_path):
    """An interrupt signal during compiled code ends a run of two threads after their return."""
    case = water(basin={"cells": [80, 80]}, end=50.0)
    fvsolve.run(water(basin={"cells": [80, 80]}, end=1e-3), threads=2)  # compiles all functions
    timer = threading.Timer(1.5, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    found = fvsolve.run(case, out=tmp_path / "run", threads=2, pictures=False)
    timer.join()
    assert found.reason.startswith("interrupted")
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


NETWORK = scene(
    {"a": reservoir(AMBIENT), "b": reservoir(2 * AMBIENT)},
    {"v": {"type": "valve", "from": "a", "to": "b", "area": 1e-3}},
    0.1,
    {"method": "rk4", "step": 0.01},
)
ALONE = {
    "an implicit method": (water(method="tr-bdf2"), "tr-bdf2 solves for all states at once"),
    "no basin": (NETWORK, "the case has no basin"),
    "fifth order of a dye": (carried("weno5"), "sheet: its scalars use the scheme weno5"),
    "a dye that decays": (dyed(decay=0.1), "pool: dye decays"),
    "a dye on a mesh": (
        dyed(mesh=DYED_MESH),
        "pool: its mesh is not a full rectangle and carries scalars",
    ),
}


@pytest.mark.parametrize("name", ALONE)
def test_work_of_a_single_thread_is_reported(name):
    case, why = ALONE[name]
    model = fvsolve.build(fvsolve.load(case))
    assert why in single_thread_reason(model) and divisible_rows(model)["most"] == 1
    run = fvsolve.run(model, threads=2)
    (said,) = [one for one in run.summary["warnings"] if one["kind"] == "threads"]
    assert (
        run.summary["threads"] == 1
        and "threads = 2, but one thread is used" in said["text"]
        and why in said["text"]
    )


@pytest.mark.parametrize("threads", [0, -1, 1.5, "2", True, None])
def test_a_number_of_threads_that_is_none_is_named(threads):
    with pytest.raises(FvsolveError, match="threads = .*expected a whole number, 1 or more"):
        fvsolve.run(water(), threads=threads)


def test_more_threads_than_rows_are_named():
    with pytest.raises(
        FvsolveError,
        match="pool has 12 rows, and each thread needs at least one; expected at most 12",
    ):
        fvsolve.run(water(), threads=13)
    text = (
        "pool has 12 blocks of 256 cells, and each thread needs at least one; expected at most 12"
    )
    with pytest.raises(FvsolveError, match=text):
        fvsolve.run(water(basin=MESH), threads=13)


def test_check_states_the_shareable_parts(fvs):
    assert "threads: up to 50 share 50 rows of tank" in fvs("check", "dam-break")[1]
    assert "threads: 1; plain: its mesh is not a full rectangle" in fvs("check", "flooding")[1]

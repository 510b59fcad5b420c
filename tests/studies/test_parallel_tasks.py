"""Tasks in other processes or Dask workers give the results of local tasks, even if processes are killed."""

import json
import os
import signal
import socket
import subprocess
import sys
import textwrap
import time
from multiprocessing import active_children

import pytest
from reference.scenes import NO_FRICTION, junction, pipe, reservoir, scene, valve

from fvsolve.case.text import write
from fvsolve.core.output.summary_file import plain
from fvsolve.core.steppers.tableau import tableau
from fvsolve.errors import FvsolveError, RunError
from fvsolve.studies import chart, failure_map, order, stability
from fvsolve.studies import parallel as engine
from fvsolve.studies.parallel import TaskPool, next_chunk_size


class Work:
    """Task that squares a number; numbers in `deadly` kill another process, always or until the file `once` exists."""

    def __init__(self, deadly=(), once=None) -> None:
        self.deadly, self.once, self.home = deadly, once, os.getpid()

    def __call__(self, task):
        if (
            task in self.deadly
            and os.getpid() != self.home
            and not (self.once and os.path.exists(self.once))
        ):
            if self.once:
                open(self.once, "w").close()
            os.kill(os.getpid(), signal.SIGKILL)
        if task == "fault":
            raise ValueError("what a task raises")
        return task * task, os.getpid()

    def lost_result(self, task):
        return "lost", task


def run_tasks(work, tasks, jobs=1, dask=None):
    with TaskPool(work, jobs, dask) as pool:
        yield from pool.run(tasks)


def squares(found) -> dict:
    return {number: answer[0] for number, answer in found.items()}


def test_all_tasks_are_done_and_the_first_in_this_process():
    tasks = [3, 1, 4, 1, 5, 9, 2, 6]
    found = dict(run_tasks(Work(), tasks, jobs=2))
    assert squares(found) == {k: task * task for k, task in enumerate(tasks)}
    assert found[0][1] == os.getpid() and os.getpid() not in {found[k][1] for k in range(1, 8)}
    assert dict(run_tasks(Work(), tasks)) == {
        k: (task * task, os.getpid()) for k, task in enumerate(tasks)
    }
    assert [*run_tasks(Work(), [], jobs=2)] == [] and squares(
        dict(run_tasks(Work(), [7], jobs=2))
    ) == {0: 49}


def test_a_process_that_is_killed_costs_its_chunk_and_another_repeats_it(tmp_path):
    found = dict(run_tasks(Work({5}, str(tmp_path / "killed")), range(200), jobs=2))
    assert (tmp_path / "killed").exists() and squares(found) == {k: k * k for k in range(200)}


def test_a_task_that_kills_every_process_is_lost_and_nothing_else():
    # alone at first, and later among others of a chunk
    found = dict(run_tasks(Work({1, 8}), range(12), jobs=2))
    assert {k for k, answer in found.items() if answer == ("lost", k)} == {1, 8}
    rest = {*range(12)} - {1, 8}
    assert squares({k: found[k] for k in rest}) == {k: k * k for k in rest}


def test_processes_end_with_their_parent(tmp_path):
    """Processes end with a killed parent; otherwise their tasks would continue for hours."""
    script = """if True:
        import os, signal, sys, time
        from fvsolve.studies.parallel import TaskPool
        def square(task):
            if task: open(f"{sys.argv[1]}/{os.getpid()}", "w").close(); time.sleep(60.0)
        if __name__ == "__main__": [*TaskPool(square, jobs=2).run([0, 1, 2])]"""
    (tmp_path / "script.py").write_text(textwrap.dedent(script))
    (tmp_path / "there").mkdir()
    running = subprocess.Popen([sys.executable, tmp_path / "script.py", tmp_path / "there"])
    until(lambda: len([*(tmp_path / "there").iterdir()]) == 2)
    running.kill()
    running.wait()
    until(
        lambda: (
            not any(os.path.exists(f"/proc/{one.name}") for one in (tmp_path / "there").iterdir())
        )
    )


def until(holds) -> None:
    for _ in range(400):
        if holds():
            return
        time.sleep(0.02)
    raise AssertionError("it never came about")


def test_exceptions_of_a_task_are_raised_here_and_no_process_stays():
    before = {*active_children()}  # processes of Dask
    with pytest.raises(ValueError, match="what a task raises"):
        dict(run_tasks(Work(), [1, 2, "fault", 4], jobs=2))
    assert not {*active_children()} - before


def test_chunks_take_about_a_second_and_grow_no_faster_than_that_can_be_known():
    assert next_chunk_size(1, 0.01, 1) == engine.MAX_GROWTH
    assert next_chunk_size(8, 0.08, 8) == 64 and next_chunk_size(64, 0.64, 64) == 100
    assert next_chunk_size(100, 10.0, 100) == 10 and next_chunk_size(1, 60.0, 1) == 1


def test_workers_of_dask_give_the_results_of_processes(cluster):
    tasks = [*range(50)]
    found = dict(run_tasks(Work(), tasks, dask=cluster.scheduler_address))
    assert squares(found) == {k: k * k for k in tasks}
    assert os.getpid() not in {found[k][1] for k in range(1, 50)}
    with pytest.raises(ValueError, match="what a task raises"):
        dict(run_tasks(Work(), [1, 2, "fault", 4], dask=cluster.scheduler_address))


def test_a_worker_of_dask_that_is_killed_costs_its_chunk(cluster, tmp_path):
    found = dict(
        run_tasks(Work({5}, str(tmp_path / "killed")), range(60), dask=cluster.scheduler_address)
    )
    assert (tmp_path / "killed").exists() and squares(found) == {k: k * k for k in range(60)}


def test_a_scheduler_that_is_not_there_is_named(monkeypatch):
    from fvsolve.studies import parallel as cluster_room

    pytest.importorskip("distributed", reason="Dask is an extra")
    monkeypatch.setattr(cluster_room, "TIMEOUT", 0.5)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
        for wrong in (address, "nowhere:at:all", "tcp://"):
            said = f'no Dask scheduler answers at "{wrong}": .*; expected an address such as tcp'
            with pytest.raises(FvsolveError, match=said):
                dict(run_tasks(Work(), [1, 2, 3], dask=wrong))


def test_a_scheduler_without_workers_is_named(monkeypatch):
    distributed = pytest.importorskip("distributed", reason="Dask is an extra")
    from fvsolve.studies import parallel as room

    monkeypatch.setattr(room, "TIMEOUT", 0.5)
    with distributed.LocalCluster(n_workers=0, dashboard_address=":0") as empty:
        with pytest.raises(FvsolveError, match="has no workers; start workers: dask worker tcp"):
            dict(run_tasks(Work(), [1, 2, 3], dask=empty.scheduler_address))


def test_another_version_is_named_with_both_numbers(cluster, monkeypatch):
    from fvsolve.studies import parallel as room

    own = room.program_versions()
    assert room.program_differences(own) == [] and room.program_differences(
        {**own, "sources": "other"}
    ) == [f"sources other (here {own['sources']})"]
    assert room.program_differences(ModuleNotFoundError("No module named 'fvsolve'")) == [
        "no fvsolve (No module named 'fvsolve')"
    ]
    asked = []

    def versions(said, own=room.version_numbers):
        asked.append(said)
        # the first call is local
        return own(said) | ({} if len(asked) == 1 else {"distributed": "2019.1"})

    monkeypatch.setattr(room, "version_numbers", versions)
    said = (
        r"has other versions, .*: the scheduler has distributed 2019.1 \(here .*worker .*"
        r"; install the same versions there"
    )
    with pytest.raises(FvsolveError, match=said):
        dict(run_tasks(Work(), [1, 2, 3], dask=cluster.scheduler_address))


def test_a_scheduler_that_goes_away_is_reported_without_endless_waiting(monkeypatch):
    distributed = pytest.importorskip("distributed", reason="Dask is an extra")
    from fvsolve.studies import parallel as room

    monkeypatch.setattr(room, "TIMEOUT", 3.0)
    made = distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, dashboard_address=":0", processes=False
    )
    found = run_tasks(Slow(), range(20), dask=made.scheduler_address)
    next(found), next(found)
    made.close()
    with pytest.raises(RunError, match=r"lost the Dask scheduler at .*\. Finished runs are kept"):
        list(found)


class Slow(Work):
    def __call__(self, task):
        time.sleep(0.2)
        return super().__call__(task)


# ----------------------------------------------------------------------------------------------------------------------
# Studies with several processes give the results of one process, except measured times.


CLOCKS = ("seconds", "processor", "compile_seconds", "front", "default_seconds", "by_updates")


@pytest.fixture
def line() -> dict:
    """Case of a pipe with a closing valve."""
    nodes = {"lake": reservoir(1e6), "gate": junction(), "out": reservoir(101325.0)}
    links = {
        "main": pipe(
            "lake", "gate", 100.0, 0.3, 1000.0, 10, friction=NO_FRICTION, initial_flow=0.05
        ),
        "valve": valve("gate", "out", 0.01, {"start": 0.05, "duration": 0.2, "value": [1.0, 0.2]}),
    }
    numerics = {"scheme": "upwind5", "method": "rk4", "courant": 0.8}
    return scene(nodes, links, 0.4, numerics, ["gate.pressure", "valve.flow"])


def timeless(found):
    """Results without the keys of CLOCKS."""
    if isinstance(found, dict):
        return {key: timeless(one) for key, one in found.items() if key not in CLOCKS}
    return [timeless(one) for one in found] if isinstance(found, list) else found


def test_an_order_is_the_same(line):
    asked = {"levels": 3, "cells": 8, "reference": "finer"}
    alone, together = (plain(order(line, jobs=jobs, **asked).plain()) for jobs in (1, 2))
    assert timeless(together) == timeless(alone)


def test_a_map_is_the_same_by_a_method_that_only_this_process_knows(line, tmp_path):
    tableau("midpoint-of-mine", "0 |\n1/2 | 1/2\n----+----\n | 0 1")
    asked = {
        "schemes": ["upwind"],
        "methods": ["euler", "midpoint-of-mine"],
        "courants": [0.5, 0.9, 1.5],
    }
    alone = failure_map(line, tolerance=0.05, **asked)
    together = failure_map(line, tolerance=0.05, jobs=2, out=tmp_path, **asked)
    assert timeless(plain(together.plain())) == timeless(plain(alone.plain()))
    assert len({one.verdict for one in alone.squares}) > 1  # with verdicts that need shorter steps
    # all runs are in the cache
    again = failure_map(line, tolerance=0.05, jobs=2, out=tmp_path, **asked)
    assert again.squares == together.squares


def test_a_chart_is_the_same(line):
    asked = {"schemes": ["upwind5"], "methods": ["rk4", "ssp-rk3"], "cells": [10, 20]}
    alone, together = (plain(chart(line, jobs=jobs, **asked).plain()) for jobs in (1, 2))
    assert timeless(together) == timeless(alone) and len(alone["points"]) >= 4


def test_rows_of_stability_are_the_same(line):
    asked = {"schemes": ["upwind", "upwind5"], "methods": ["euler", "rk4"], "steps": 10}
    alone, together = (stability(line, jobs=jobs, **asked).plain() for jobs in (1, 2))
    assert plain(together) == plain(alone)


@pytest.mark.parametrize(
    ("study", "asked"),
    [
        (order, {"levels": 3, "cells": 8, "reference": "finer"}),
        (chart, {"schemes": ["upwind5"], "methods": ["rk4", "ssp-rk3"], "cells": [10, 20]}),
        (
            failure_map,
            {
                "schemes": ["upwind"],
                "methods": ["euler"],
                "courants": [0.5, 0.9, 1.5],
                "tolerance": 0.05,
            },
        ),
        (stability, {"schemes": ["upwind", "upwind5"], "methods": ["euler", "rk4"], "steps": 10}),
    ],
)
def test_workers_of_dask_find_the_same(line, cluster, study, asked):
    alone, there = (
        plain(study(line, dask=dask, **asked).plain()) for dask in (None, cluster.scheduler_address)
    )
    assert timeless(there) == timeless(alone)


def test_tasks_without_a_name_to_be_sent_by_are_refused(line):
    with pytest.raises(
        FvsolveError,
        match="initial, source and exact are functions of this process; expected jobs = 1",
    ):
        order(line, jobs=2, initial=lambda pipe, x: (x, x))
    with pytest.raises(FvsolveError, match="jobs = 0 is out of range; expected 1 or more"):
        order(line, jobs=0)


def test_commands_take_jobs(line, fvs, tmp_path):
    (tmp_path / "line.toml").write_text(write(line))
    words = (
        "order",
        tmp_path / "line.toml",
        "--levels",
        "2",
        "--cells",
        "8",
        "--reference",
        "finer",
        "--json",
    )
    code, out, _ = fvs(*words, "--jobs", "2", "--out", tmp_path / "two")
    assert code == 0 and len(json.loads(out)["studies"][0]["rows"]) == 2
    code, _, err = fvs("stability", "--jobs", "2")
    assert code == 2 and "--jobs: needs a case" in err
    code, _, err = fvs("chart", tmp_path / "line.toml", "--models", "--jobs", "2")
    assert code == 2 and "--jobs: not valid with --models" in err

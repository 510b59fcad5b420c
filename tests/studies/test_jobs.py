"""Studies with several processes give the results of one process, except measured times."""

import json

import pytest
from reference.scenes import NO_FRICTION, junction, pipe, reservoir, scene, valve

from fvsolve.case.text import write
from fvsolve.errors import FvsolveError
from fvsolve.output.summary_file import plain
from fvsolve.steppers.tableau import tableau
from fvsolve.studies import chart, failure_map, order, stability

CLOCKS = ("seconds", "processor", "compile_seconds", "front", "default_seconds", "by_updates")


@pytest.fixture
def line() -> dict:
    """Case of a pipe with a closing valve."""
    nodes = {"lake": reservoir(1e6), "gate": junction(), "out": reservoir(101325.0)}
    links = {
        "main": pipe("lake", "gate", 100.0, 0.3, 1000.0, 10, friction=NO_FRICTION, initial_flow=0.05),
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
    asked = {"levels": 3, "cells": 8, "against": "finer"}
    alone, together = (plain(order(line, jobs=jobs, **asked).plain()) for jobs in (1, 2))
    assert timeless(together) == timeless(alone)


def test_a_map_is_the_same_by_a_method_that_only_this_process_knows(line, tmp_path):
    tableau("midpoint-of-mine", "0 |\n1/2 | 1/2\n----+----\n | 0 1")
    asked = {"schemes": ["upwind"], "methods": ["euler", "midpoint-of-mine"], "courants": [0.5, 0.9, 1.5]}
    alone = failure_map(line, tolerance=0.05, **asked)
    together = failure_map(line, tolerance=0.05, jobs=2, out=tmp_path, **asked)
    assert timeless(plain(together.plain())) == timeless(plain(alone.plain()))
    assert len({one.verdict for one in alone.squares}) > 1  # with verdicts that need shorter steps
    again = failure_map(line, tolerance=0.05, jobs=2, out=tmp_path, **asked)  # all runs are in the cache
    assert again.squares == together.squares


def test_a_chart_is_the_same(line):
    asked = {"schemes": ["upwind5"], "methods": ["rk4", "ssp-rk3"], "cells": [10, 20]}
    alone, together = (plain(chart(line, jobs=jobs, **asked).plain()) for jobs in (1, 2))
    assert timeless(together) == timeless(alone) and len(alone["points"]) >= 4


def test_rows_of_stability_are_the_same(line):
    asked = {"schemes": ["upwind", "upwind5"], "methods": ["euler", "rk4"], "steps": 50}
    alone, together = (stability(line, jobs=jobs, **asked).plain() for jobs in (1, 2))
    assert plain(together) == plain(alone)


@pytest.mark.parametrize(
    ("study", "asked"),
    [
        (order, {"levels": 3, "cells": 8, "against": "finer"}),
        (chart, {"schemes": ["upwind5"], "methods": ["rk4", "ssp-rk3"], "cells": [10, 20]}),
        (failure_map, {"schemes": ["upwind"], "methods": ["euler"], "courants": [0.5, 0.9, 1.5], "tolerance": 0.05}),
        (stability, {"schemes": ["upwind", "upwind5"], "methods": ["euler", "rk4"], "steps": 50}),
    ],
)
def test_workers_of_dask_find_the_same(line, cluster, study, asked):
    alone, there = (plain(study(line, dask=dask, **asked).plain()) for dask in (None, cluster.scheduler_address))
    assert timeless(there) == timeless(alone)


def test_what_has_no_name_to_be_sent_by_is_refused(line):
    with pytest.raises(
        FvsolveError, match="initial, source and exact are functions of this process. Expected jobs = 1"
    ):
        order(line, jobs=2, initial=lambda pipe, x: (x, x))
    with pytest.raises(FvsolveError, match="jobs = 0 is out of range. Expected 1 or more"):
        order(line, jobs=0)


def test_commands_take_jobs(line, fvs, tmp_path):
    (tmp_path / "line.toml").write_text(write(line))
    words = ("order", tmp_path / "line.toml", "--levels", "2", "--cells", "8", "--reference", "finer", "--json")
    code, out, _ = fvs(*words, "--jobs", "2", "--out", tmp_path / "two")
    assert code == 0 and len(json.loads(out)["studies"][0]["rows"]) == 2
    code, _, err = fvs("stability", "--jobs", "2")
    assert code == 2 and "--jobs: needs a case" in err
    code, _, err = fvs("chart", tmp_path / "line.toml", "--models", "--jobs", "2")
    assert code == 2 and "--jobs: not valid with --models" in err

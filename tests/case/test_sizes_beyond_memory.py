"""Runs that cannot advance, or do not fit into memory or on disk, are refused at once; long runs are announced."""

import re

import pytest
from reference.refusals import refused
from reference.scenes import branched, still

import fvsolve
from fvsolve.case.resource_checks import disk_size, free_memory
from fvsolve.cli.printing import cost_estimate, duration
from fvsolve.errors import RunError

POOL = {
    "type": "basin",
    "physics": "transport",
    "size": [1.0, 1.0],
    "cells": [4, 4],
    "velocity": {"u": 0, "v": 0},
}


@pytest.mark.parametrize("settings, words", [
    ({"numerics.courant": 1e-25}, "numerics.courant: 1e-25 gives steps of .* s, below the rounding error of the"),
    ({"numerics.courant": 1e-14, "numerics.end": 1e4}, "below the rounding error of the time; expected more than"),
    ({"output.every": 1e-9, "numerics.end": 1e4}, r"output.every: 1e-09 s gives 1e\+13 rows of 5 numbers, about .* TB"),
    ({"output.every": 1e-25}, "output.every: 1e-25 s is below the rounding error of the time"),
    ({"links.main.cells": 10**8}, r"links.main.cells: 1e\+08 cells take about 50 GB of memory, and .* are free"),
    ({"links.main.cells": 2 * 10**7, "numerics.method": "radau-iia-5"}, "cells take about 60 GB of memory"),
])  # fmt: skip
def test_settings_that_cannot_advance_or_fit_are_refused_before_the_build(settings, words):
    if "memory" in words and free_memory() > 50e9:
        pytest.skip("here it fits")
    refused(branched(), words, set=settings)


def test_basins_likewise():
    case = branched()
    case["nodes"]["pool"] = POOL | {"cells": [10**5, 10**5]}
    refused(case, r"nodes.pool.cells: 1e\+10 cells take about 6 TB of memory")
    case = branched() | {"nodes": {"pool": POOL}, "links": {}, "scalars": {"dye": {}}}
    case["output"]["probes"], case["numerics"]["courant"] = ["pool.dye@0.5,0.5"], 1e-25
    refused(case, "numerics.courant: 1e-25 gives steps")


@pytest.mark.parametrize("settings", [
    {"numerics.courant": 1e-3}, {"output.every": 1e-6}, {"links.main.cells": 10**5},
    {"numerics.end": 1e12, "output.every": 1e9},
])  # fmt: skip
def test_settings_that_fit_are_accepted(settings):
    assert fvsolve.load(branched(), settings)


def test_a_table_larger_than_the_disk_is_refused_by_its_place(tmp_path, monkeypatch):
    # of the system
    monkeypatch.setattr("shutil.disk_usage", lambda path: type("Usage", (), {"free": 1000})())
    with pytest.raises(RunError, match=r"run: history\.csv needs at least 2 kB, but 1 kB are free"):
        fvsolve.run(branched(fields=0), out=tmp_path / "run")
    assert not (tmp_path / "run" / ".lock").exists()


def test_the_estimate_of_the_disk_is_near_the_written_size(tmp_path):
    case = branched(fields=50)
    fvsolve.run(case, {"output.every": "1 ms"}, tmp_path / "run")
    files = [tmp_path / "run" / "history.csv", *(tmp_path / "run" / "fields").iterdir()]
    found = disk_size(fvsolve.load(case, {"output.every": "1 ms", "output.fields": 0}))
    assert 0.5 < found / files[0].stat().st_size < 2.0


@pytest.mark.parametrize("group", ["nodes", "links", "scalars", "lines"])
def test_long_names_are_refused_at_once(group):
    case, name = branched() | {"scalars": {}}, "x" * 10**5
    case["nodes"]["pool"] = POOL
    case["output"]["lines"] = {}
    tables = {
        **{one: case[one] for one in ("nodes", "links", "scalars")},
        "lines": case["output"]["lines"],
    }
    parts = {
        "nodes": {"type": "junction"},
        "links": case["links"]["valve"],
        "scalars": {},
        "lines": {"basin": "pool", "from": [0, 0], "to": [1, 1]},
    }
    tables[group][name] = parts[group]
    error = refused(case)
    assert "has 100000 letters; expected at most 60" in str(error) and len(str(error)) < 5000


def test_a_long_reference_gets_a_short_message():
    error = refused(
        branched(),
        set={"links.valve.to": "y" * 10**5, "output.probes": ["z" * 10**5 + ".pressure"]},
    )
    assert len(str(error)) < 5000


def test_a_long_unit_is_refused_at_once():
    refused(
        branched(),
        "has 100004 letters, more than a number with its unit; expected a length",
        set={"links.main.length": "900 " + "m" * 10**5},
    )
    refused(
        branched(),
        "unknown unit of 100000 letters; expected a pressure",
        set={"output.units": {"pressure": "q" * 10**5}},
    )


def test_a_long_run_is_announced_before_it_starts(fvs, tmp_path, monkeypatch):
    long = fvsolve.build(fvsolve.load(branched(), {"numerics.end": 1e12, "output.every": 1e9}))
    assert re.fullmatch(r"case will take about \S+ years", cost_estimate(long))
    large = fvsolve.build(
        fvsolve.load(branched(fields=10**6), {"numerics.end": 1e-2, "output.every": 1e-3})
    )
    assert re.fullmatch(r"case will take about .* GB on disk", cost_estimate(large))
    assert cost_estimate(fvsolve.build(fvsolve.load(still()))) == ""
    assert [duration(one) for one in (100.0, 240.0, 86400.0, 1e6)] == [
        "1e+02 s",
        "4 minutes",
        "24 hours",
        "12 days",
    ]

"""Sweep: a row for each combination with the numbers of its run; finished rows are reused, failed rows explained."""

import codecs
import csv
import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from reference.scenes import NO_FRICTION, junction, pipe, reservoir, scene, valve
from scipy.stats import qmc

import fvsolve
from fvsolve.case.text import write
from fvsolve.cli.app import value_of
from fvsolve.cli.sweep import split_list
from fvsolve.errors import CaseError, FvsolveError, RunError
from fvsolve.report.draw.object_pictures import quantity_figure
from fvsolve.studies import sweep
from fvsolve.studies.sampling import key_ranges, points_from_file, sample_points
from fvsolve.studies.sweep import Sweep, as_option_text


@pytest.fixture
def line(tmp_path) -> dict:
    """Case of a pipe with a closing valve."""
    nodes = {"lake": reservoir(1e6), "gate": junction(), "out": reservoir(101325.0)}
    links = {
        "main": pipe(
            "lake", "gate", 100.0, 0.3, 1000.0, 20, friction=NO_FRICTION, initial_flow=0.05
        ),
        "valve": valve("gate", "out", 0.01, {"start": 0.1, "duration": 0.05, "value": [1.0, 0.0]}),
    }
    numerics = {"scheme": "muscl", "method": "ssp-rk3", "courant": 0.9}
    return scene(nodes, links, 0.5, numerics, ["gate.pressure", "valve.flow"])


VARY = {"links.main.cells": [10, 20], "numerics.courant": [0.5, 4.0]}


def test_rows_are_the_numbers_of_the_runs_in_the_order_of_the_values(line):
    made = sweep(line, VARY)
    assert [(row["links.main.cells"], row["numerics.courant"]) for row in made.rows] == [
        (10, 0.5),
        (10, 4.0),
        (20, 0.5),
        (20, 4.0),
    ]
    for row in (made.rows[0], made.rows[2]):
        alone = fvsolve.run(line, {key: row[key] for key in VARY})
        assert row["ok"] and row["reason"] == "finished" and row["t [s]"] == 0.5
        assert row["max(gate.pressure) [Pa]"] == alone.extremes["gate.pressure"].maximum
        assert row["t_max(gate.pressure) [s]"] == alone.extremes["gate.pressure"].t_max
        assert row["min(valve.flow) [m3/s]"] == alone.extremes["valve.flow"].minimum
        assert row["final(gate.pressure) [Pa]"] == alone["gate.pressure"][-1]
        assert row["steps"] == alone.summary["steps"]


def test_a_run_that_stops_or_is_refused_is_a_row_with_its_reason(line):
    made = sweep(line, {"numerics.courant": [4.0, 0.5, -1.0]}, {"numerics.end": 5.0})
    stopped, fine, refused = made.rows
    # the run blew up
    assert stopped["max(gate.pressure) [Pa]"] is stopped["final(gate.pressure) [Pa]"] is None
    assert fine["ok"]
    assert (
        not stopped["ok"] and "halve the step" in stopped["reason"] and 0.1 < stopped["t [s]"] < 5.0
    )
    assert not refused["ok"] and refused["reason"].startswith("refused: numerics.courant: -1.0")


def test_finished_rows_are_reused_and_a_changed_case_is_not_mistaken_for_them(line, tmp_path):
    sweep(line, VARY, out=tmp_path)
    more = {**VARY, "links.main.cells": [10, 20, 40]}
    assert sweep(line, more, out=tmp_path).reused == 4
    assert sweep(line, more, {"nodes.lake.pressure": 9e5}, out=tmp_path).reused == 0
    with open(tmp_path / "sweep.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 6 and rows[4]["ok"] == "True"


def test_other_processes_find_the_same(line):
    alone, together = sweep(line, VARY).rows, sweep(line, VARY, jobs=2).rows
    for row in (*alone, *together):
        row.pop("seconds")
    assert together == alone


def test_an_interrupted_sweep_retains_its_rows_and_goes_on(line, tmp_path):
    def stop(done, total, what):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        sweep(line, VARY, out=tmp_path, progress=stop)
    with open(tmp_path / "sweep.csv", newline="") as file:
        assert len(list(csv.DictReader(file))) == 2
    assert sweep(line, VARY, out=tmp_path).reused == 2


def test_ctrl_c_during_a_run_retains_the_rows_that_are_finished(line, tmp_path):
    (tmp_path / "line.toml").write_text(
        write({**line, "output": {"every": 1.0, "probes": ["gate.pressure"]}})
    )
    script = """if True:
        import os, signal, sys
        from fvsolve.cli import main
        from fvsolve.core.solve.solve import Run
        Run.pause = lambda self: os.kill(os.getpid(), signal.SIGINT)  # after 1000 steps
        main()"""
    command = [
        sys.executable,
        "-c",
        script,
        "sweep",
        "line.toml",
        "--set",
        "numerics.end=0.5,2000,0.4",
        "--out",
        "o",
    ]
    left = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (
        left.returncode == 130
        and "interrupted after 1 of 3" in left.stderr
        and "Traceback" not in left.stderr
    )
    assert len((tmp_path / "o" / "points.jsonl").read_text().splitlines()) == 1


@pytest.mark.parametrize("send", [os.kill, os.killpg], ids=["to it", "to all, as a terminal does"])
def test_ctrl_c_breaks_off_the_runs_of_other_processes_and_retains_finished_rows(
    line, tmp_path, send
):
    (tmp_path / "line.toml").write_text(
        write({**line, "output": {"every": 1e6, "probes": ["gate.pressure"]}})
    )
    values = "numerics.end=0.5,0.4,1e7,2e7"
    command = [
        sys.executable,
        "-m",
        "fvsolve",
        "sweep",
        "line.toml",
        "--set",
        values,
        "--jobs",
        "2",
        "--out",
        "o",
    ]
    running = subprocess.Popen(
        command, cwd=tmp_path, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    kept = tmp_path / "o" / "points.jsonl"
    try:
        while not kept.exists() or len(kept.read_text().splitlines()) < 2:
            assert running.poll() is None, running.communicate()
            time.sleep(0.01)
        time.sleep(0.3)  # a row is stored before it is counted
        send(running.pid, signal.SIGINT)
        err = running.communicate(timeout=30)[1]  # ends when no process has the pipe open
    finally:
        if running.poll() is None:
            os.killpg(running.pid, signal.SIGKILL)
    assert (
        running.returncode == 130 and "interrupted after 2 of 4" in err and "Traceback" not in err
    )
    assert len(kept.read_text().splitlines()) == 2


def test_a_row_shows_events_that_the_model_could_not_follow(line, fvs, tmp_path):
    # rho a v exceeds the pressure of the lake
    shut = {"start": 0.1, "duration": 0.05, "value": [1.0, 0.0]}
    quiet, marked = sweep(line, {"links.valve.opening": [1.0, shut]}).rows
    assert quiet["marks"] == "" and marked["ok"] and "below vapour pressure" in marked["marks"]
    (tmp_path / "line.toml").write_text(write(line))
    values = f"links.valve.opening=1.0,{as_option_text(shut)}"
    code, out, _ = fvs("sweep", tmp_path / "line.toml", "--set", values, "--out", tmp_path)
    assert code == 0 and marked["marks"] in " ".join(out.split())
    with open(tmp_path / "sweep.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert value_of(rows[1]["links.valve.opening"]) == shut and rows[1]["marks"] == marked["marks"]


@pytest.mark.parametrize(
    "value",
    [400, 0.1, 1e-7, True, "upwind5", "900 m", "400", "true", "a,b", "", " x", 'say "so"', [1.0, [0.0]],
     {"model": "steady", "factor": 0.02, "on": False}],
)  # fmt: skip
def test_a_value_is_written_as_set_reads_it(value):
    (text,) = split_list(as_option_text(value))
    assert value_of(text) == value and type(value_of(text)) is type(value)


def test_a_fault_of_every_run_is_a_fault_of_the_sweep(line, tmp_path):
    with pytest.raises(
        FvsolveError, match="all 2 runs are refused: links.main.cells: 0 is out of range"
    ):
        sweep(line, {"numerics.courant": [0.5, 0.4]}, {"links.main.cells": 0}, out=tmp_path)
    assert not (tmp_path / "sweep.csv").exists()


def test_keys_that_do_not_exist_are_named_all_at_once_before_anything_runs(line, tmp_path):
    vary, told = (
        {"links.main.cels": [10, 20], "numerics.courant": [0.5, 0.4], "nodes.lak.pressure": [1e6]},
        [],
    )
    with pytest.raises(CaseError) as raised:
        sweep(
            line,
            vary,
            {"links.valve.aera": 1.0},
            out=tmp_path,
            progress=lambda *said: told.append(said),
        )
    said = str(raised.value)
    assert 'links.main.cels: unknown key; did you mean "cells"?' in said and "3 faults" in said
    assert (
        'links.valve.aera: unknown key; did you mean "area"?' in said
        and 'no node named "lak"' in said
    )
    assert told == [] and not (tmp_path / "points.jsonl").exists()


def test_a_key_that_another_brings_is_none_that_does_not_exist(line):
    new = {
        "type": "orifice",
        "from": "gate",
        "to": "out",
        "area": 1e-4,
        "discharge_coefficient": 0.6,
    }
    made = sweep(line, {"links.more.area": [1e-4, 2e-4]}, {"links.more": new})
    assert [row["ok"] for row in made.rows] == [True, True]


def test_a_case_that_was_read_with_other_values_retains_them(line):
    read = fvsolve.load(line, {"links.main.cells": 10})
    made = sweep(read, {"numerics.courant": [0.5, 0.9]})
    assert (
        made.rows[1]["steps"]
        == fvsolve.run(line, {"links.main.cells": 10, "numerics.courant": 0.9}).summary["steps"]
    )


@pytest.mark.parametrize(
    "text, parts",
    [
        ("1,2,3", ["1", "2", "3"]),
        ("[1.0, 0.0],[1.0, 0.5]", ["[1.0, 0.0]", "[1.0, 0.5]"]),
        ('{ model = "none" }, { model = "steady", factor = 0.02 }',
         ['{ model = "none" }', '{ model = "steady", factor = 0.02 }']),
        ('"a,b",c', ['"a,b"', "c"]),
        ("20 mm, 30 mm", ["20 mm", "30 mm"]),
    ],
)  # fmt: skip
def test_values_are_parted_at_commas_outside_of_brackets_and_quotes(text, parts):
    assert split_list(text) == parts


@pytest.mark.parametrize("vary, jobs", [({}, 1), ({"numerics.courant": [0.5]}, 1), (VARY, 0)])
def test_a_sweep_of_nothing_is_refused(line, vary, jobs):
    with pytest.raises(FvsolveError, match="no key varies|expected 1 or more"):
        sweep(line, vary, jobs=jobs)


def test_the_command_prints_the_rows_and_fails_where_a_row_does(fvs, tmp_path):
    code, out, _ = fvs(
        "sweep", "two-tanks", "--set", "numerics.rtol=1e-4,1e-6", "--out", tmp_path, "--json"
    )
    said = json.loads(out)
    assert (
        code == 0
        and said["keys"] == ["numerics.rtol"]
        and [row["ok"] for row in said["rows"]] == [True, True]
    )
    code, out, _ = fvs("sweep", "two-tanks", "--set", "numerics.rtol=1e-4,2", "--out", tmp_path)
    assert code == 1 and "refused: numerics.rtol" in out
    code, _, err = fvs("sweep", "two-tanks", "--set", "numerics.rtol", "--out", tmp_path)
    assert code == 2 and "expected KEY=a,b,c" in err


def bare(rows) -> list[dict]:
    """Rows without measured time."""
    return [{key: one for key, one in row.items() if key != "seconds"} for row in rows]


def test_points_of_a_list_and_of_a_file_are_the_runs(line, tmp_path):
    points = [
        {"links.main.cells": 10, "nodes.lake.pressure": 9e5},
        {"links.main.cells": 12, "nodes.lake.pressure": 1e6},
    ]
    made = sweep(line, points=points)
    assert made.keys == ("links.main.cells", "nodes.lake.pressure")
    (tmp_path / "points.csv").write_text(
        "links.main.cells,nodes.lake.pressure\n10,900000.0\n12,1e6\n"
    )
    assert bare(sweep(line, points=tmp_path / "points.csv").rows) == bare(made.rows)
    grid = sweep(line, {"links.main.cells": [10, 12], "nodes.lake.pressure": [9e5, 1e6]}, jobs=2)
    assert bare([grid.rows[0], grid.rows[3]]) == bare(made.rows)


def test_rows_are_the_same_to_the_bit_in_any_engine_and_order(line, cluster):
    vary = {
        "links.main.cells": [10, 20],
        "links.valve.area": [0.01, 0.012],
        "numerics.courant": [0.5, -1.0, 0.9],
    }
    here = bare(sweep(line, vary).rows)
    assert bare(sweep(line, vary, jobs=2).rows) == here
    turned = bare(sweep(line, {key: vary[key] for key in reversed(vary)}).rows)
    assert {repr(sorted(row.items(), key=str)) for row in turned} == {
        repr(sorted(row.items(), key=str)) for row in here
    }
    assert bare(sweep(line, vary, dask=cluster.scheduler_address).rows) == here
    alone = [fvsolve.run(line, {key: row[key] for key in vary}) for row in here if row["ok"]]
    assert [row["max(gate.pressure) [Pa]"] for row in here if row["ok"]] == [
        one.extremes["gate.pressure"].maximum for one in alone
    ]


def test_a_sweep_that_is_killed_goes_on_where_it_was_a_torn_line_or_not(line, tmp_path):
    (tmp_path / "line.toml").write_text(
        write({**line, "output": {"every": 1e6, "probes": ["gate.pressure"]}})
    )
    values = ["--set", "numerics.end=0.5,0.4,0.3,1e7", "--jobs", "2"]
    command = [sys.executable, "-m", "fvsolve", "sweep", "line.toml", "--out", "o", *values]
    running = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.DEVNULL)
    kept = tmp_path / "o" / "points.jsonl"
    try:
        while not kept.exists() or len(kept.read_text().splitlines()) < 3:
            assert running.poll() is None
            time.sleep(0.01)
    finally:
        running.kill()
        running.wait()
    with open(kept, "a") as file:
        file.write('{"key": "half of a li')
    for reused in (3, 4):  # the whole line after the torn line is found too
        made = sweep(
            tmp_path / "line.toml", {"numerics.end": [0.5, 0.4, 0.3, 0.2]}, out=tmp_path / "o"
        )
        assert made.reused == reused and [row["t [s]"] for row in made.rows] == [0.5, 0.4, 0.3, 0.2]
    assert all(json.loads(text)["key"] for text in kept.read_text().splitlines())


def test_a_disk_that_is_full_in_the_middle_is_named_and_stored_rows_are_reused(line, tmp_path):
    """Files may have 3000 bytes, enough for two rows and a part of the third."""
    resource = pytest.importorskip("resource", reason="a limit of Unix")
    vary, limits = (
        {"numerics.courant": [0.5, 0.6, 0.7, 0.8]},
        resource.getrlimit(resource.RLIMIT_FSIZE),
    )
    sweep(line, {"numerics.courant": [0.5, 0.9]})  # compiled code is written too
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (3000, limits[1]))
        with pytest.raises(
            RunError, match="points.jsonl: cannot be written: .*. Finished results are kept"
        ):
            sweep(line, vary, out=tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    kept = (tmp_path / "points.jsonl").read_bytes()
    assert 0 < kept.count(b"\n") < 4 and not kept.endswith(b"\n")  # the last line is torn
    made = sweep(line, vary, out=tmp_path)
    assert made.reused == kept.count(b"\n") and bare(made.rows) == bare(sweep(line, vary).rows)


def test_two_sweeps_in_the_same_folder_are_refused_and_the_first_loses_nothing(line, tmp_path):
    def again(done, total, what):
        if done == 1:
            with pytest.raises(RunError, match="is in use: a study still writes there"):
                sweep(line, VARY, out=tmp_path)

    assert len(sweep(line, VARY, out=tmp_path, progress=again).rows) == 4


def test_progress_states_the_remaining_time(line):
    told = []
    sweep(line, VARY, progress=lambda *said: told.append(said))
    assert [said[:2] for said in told] == [(k, 4) for k in range(5)]
    assert told[0][2] == "links.main.cells = 10, numerics.courant = 0.5"
    assert " s left, links.main.cells = 10" in told[1][2]


def test_a_file_that_a_value_names_is_part_of_the_reused_key(line, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in "ab":
        (tmp_path / f"{name}.csv").write_text("t [s],opening [-]\n0,1\n0.2,0\n")
    vary = {"links.valve.opening": [{"file": "a.csv"}, {"file": "b.csv"}]}
    sweep(line, vary, out=tmp_path / "o")
    assert sweep(line, vary, out=tmp_path / "o").reused == 2
    (tmp_path / "b.csv").write_text("t [s],opening [-]\n0,1\n0.3,0\n")
    assert sweep(line, vary, out=tmp_path / "o").reused == 1


def test_numbers_on_the_axes_of_a_sweep_over_four_keys_do_not_overlap():
    keys = ("a.b", "c.d", "e.f", "g.h")
    rows = [
        dict.fromkeys(keys, x) | {"ok": True, "reason": "finished", "max(x) [m]": x}
        for x in (0.0008, 0.0014)
    ]
    figure = quantity_figure(Sweep(keys, rows, 0), "max(x) [m]", {key: key for key in keys})
    figure.canvas.draw()
    for axes in figure.axes[: len(keys)]:
        low, high = axes.get_xlim()
        boxes = [
            tick.label1.get_window_extent()
            for tick in axes.xaxis.get_major_ticks()
            if low <= tick.get_loc() <= high
        ]
        assert len(boxes) > 1 and all(
            left.x1 < right.x0 for left, right in zip(boxes, boxes[1:], strict=False)
        )


def mapped(rows: list[dict]):
    """Axes of the picture of a sweep over two keys."""
    made = Sweep(("a.b", "c.d"), [{"ok": True, "reason": "finished"} | row for row in rows], 0)
    figure = quantity_figure(made, "max(x) [m]", {"a.b": "a.b [s]", "c.d": "c.d"})
    figure.canvas.draw()
    return figure.axes


def test_a_sweep_over_two_keys_is_a_map():
    """A grid has squares with their values, first key across and second key up; failed runs are crossed and empty."""
    rows = [
        {"a.b": a, "c.d": c, "max(x) [m]": 10.0 * k + j}
        for k, a in enumerate((0.1, 0.5, 3.0))
        for j, c in enumerate(("low", "high"))
    ]
    rows[-1] |= {"ok": False, "max(x) [m]": None}
    axes, bar = mapped(rows[::-1])
    table = axes.collections[0].get_array().reshape(2, 3)
    assert [one.get_text() for one in axes.get_xticklabels()] == ["0.1", "0.5", "3"]
    # in order of occurrence
    assert [one.get_text() for one in axes.get_yticklabels()] == ["high", "low"]
    assert table[0].tolist() == [1.0, 11.0, None] and table[1].tolist() == [0.0, 10.0, 20.0]
    assert {one.get_text() for one in axes.texts} == {"0", "1", "10", "11", "20"}
    assert axes.lines[0].get_xydata().tolist() == [[2.5, 0.5]] and bar.get_ylabel().startswith(
        "max(x) [m], crossed"
    )
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("a.b [s]", "c.d")


def test_points_over_two_keys_are_dots_where_they_lie():
    points = [(0.1, 5.0), (0.2, 3.0), (0.4, 4.0)]
    axes, _ = mapped([{"a.b": a, "c.d": c, "max(x) [m]": a * c} for a, c in points])
    assert axes.collections[0].get_offsets().tolist() == [list(one) for one in points]
    assert axes.collections[0].get_array().tolist() == [a * c for a, c in points]


@pytest.mark.filterwarnings("error")
def test_a_map_of_runs_that_all_failed_is_crosses():
    axes, _ = mapped([{"a.b": a, "c.d": c, "ok": False} for a in (1, 2) for c in (1, 2)])
    assert len(axes.lines[0].get_xydata()) == 4 and not axes.texts


def test_the_table_is_parquet_too_and_every_extreme_has_a_chart(line, fvs, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason="pyarrow is an extra")
    (tmp_path / "line.toml").write_text(write(line))
    to = ("--out", tmp_path / "o")
    code, out, _ = fvs(
        "sweep", tmp_path / "line.toml", "--set", "links.valve.area=0.01,0.02", *to, "--json"
    )
    said = json.loads(out)
    assert code == 0 and {path.rpartition("/")[2] for path in said["charts"]} == {
        "max-gate.pressure.png",
        "min-gate.pressure.png",
        "max-valve.flow.png",
        "min-valve.flow.png",
    }
    assert all(os.path.getsize(path) > 1000 for path in said["charts"])
    table = parquet.read_table(tmp_path / "o" / "sweep.parquet").to_pydict()
    for name in ("links.valve.area", "ok", "max(gate.pressure) [Pa]", "steps"):
        assert table[name] == [row[name] for row in said["rows"]]
    again = ("sweep", tmp_path / "line.toml", "--set", "links.valve.area=0.01,0.03", *to)
    assert fvs(*again, "--quantity", "final(valve.flow)")[0] == 0
    assert [path.name for path in (tmp_path / "o" / "charts").iterdir()] == ["final-valve.flow.png"]
    code, _, err = fvs(*again, "--quantity", "max(x)")
    assert code == 2 and 'no quantity "max(x)". Quantities are' in err


# ----------------------------------------------------------------------------------------------------------------------
# Samples fill their ranges and depend only on the seed; a file of points reports all its faults.


RANGES = {
    "links.valve.area": ["10 cm2", 0.002],
    "links.valve.opening.start": [0.5, "1 s"],
    "nodes.outfall.pressure": ["0 barg", "1 barg"],
}


@pytest.fixture(scope="module")
def case():
    return fvsolve.load("valve-closure")


def test_ends_of_ranges_are_read_in_their_units_pressures_absolute(case):
    assert key_ranges(case, RANGES) == {
        "links.valve.area": (0.001, 0.002),
        "links.valve.opening.start": (0.5, 1.0),
        "nodes.outfall.pressure": (101325.0, 201325.0),
    }


@pytest.mark.parametrize(
    ("name", "key", "given", "read"),
    [
        ("two-tanks", "nodes.high.area", ["100 cm2", 0.02], (0.01, 0.02)),
        ("pump-trip", "links.pump.efficiency", [0.6, 0.7], (0.6, 0.7)),
        ("cylinder-servo", "links.spool.overlap", [-0.1, 0.1], (-0.1, 0.1)),
        ("chlorine", "reactions.oxidation.forward", [1e-6, 2e-6], (1e-6, 2e-6)),
    ],
)
def test_a_number_that_may_also_be_a_table_has_a_range(name, key, given, read):
    assert key_ranges(fvsolve.load(name), {key: given}) == {key: read}


@pytest.mark.parametrize("kind", ["sobol", "lhs"])
def test_a_sample_fills_its_ranges_more_evenly_than_chance_and_follows_its_seed(case, kind):
    found = sample_points(case, RANGES, f"{kind}:64", seed=3)
    values = np.array([[*one.values()] for one in found])
    low, high = np.array([*key_ranges(case, RANGES).values()]).T
    unit = (values - low) / (high - low)
    assert values.shape == (64, 3) and unit.min() >= 0.0 and unit.max() <= 1.0
    assert qmc.discrepancy(unit) < 0.5 * qmc.discrepancy(np.random.default_rng(0).random((64, 3)))
    # one in each 64th
    assert all(np.array_equal(np.sort(np.floor(64 * column)), np.arange(64)) for column in unit.T)
    assert (
        sample_points(case, RANGES, f"{kind}:64", seed=3)
        == found
        != sample_points(case, RANGES, f"{kind}:64", seed=4)
    )


def test_all_faults_of_ranges_are_reported_at_once(case):
    wrong = {
        "links.valve.area": [0.002, 0.001],
        "links.main.length": ["900 m", 900],
        "links.main.cells": [10, 20],
        "numerics.scheme": ["muscl", "weno5"],
        "links.main.diameter": [0.1, "1 kg"],
        "links.main.lengt": [1, 2],
        "nodes.lake.head": [1, 2, 3],
        "links.main.wave_speed": [-1.0, 1000.0],
    }
    with pytest.raises(CaseError) as raised:
        key_ranges(case, wrong)
    said = str(raised.value)
    assert "8 faults" in said and "the range from 0.002 to 0.001 is reversed" in said
    assert (
        'the range from "900 m" to 900 is empty' in said
        and '"1 kg" is a mass; expected a length' in said
    )
    assert "links.main.cells: is not a continuous quantity" in said
    assert "numerics.scheme: is not a continuous quantity" in said
    assert 'unknown key "links.main.lengt"' in said and "[1, 2, 3] is not a range" in said
    assert "-1.0 is out of range" in said


@pytest.mark.parametrize(
    "sample", ["sobol", "sobol:0", "sobol:-3", "halton:8", "lhs:1e3", "sobol:99999999999"]
)
def test_a_sample_that_is_none_is_named(case, sample):
    with pytest.raises(FvsolveError, match="expected sobol:N or lhs:N with N runs"):
        sample_points(case, RANGES, sample, 0)


def read(case, tmp_path, text: str | bytes) -> list[dict]:
    path = tmp_path / "points.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return points_from_file(path, case, case.raw)


PLAIN = [
    {"links.valve.area": "17.5 cm2", "nodes.lake.head": 45.5},
    {"links.valve.area": "18.0 cm2", "nodes.lake.head": 30.0},
]


@pytest.mark.parametrize(
    "text",
    [
        "links.valve.area [cm2],nodes.lake.head\n17.5,45.5\n18,30\n",
        "links.valve.area [cm2];nodes.lake.head\n17,5;45,5\n18;30\n",
        "links.valve.area [cm2]\tnodes.lake.head\r\n17,5\t45,5\r\n\r\n18\t30\r\n",
        codecs.BOM_UTF8 + b"links.valve.area [cm2], nodes.lake.head\n17.5, 45.5\n18, 30\n",
        "links.valve.area [cm2];nodes.lake.head\n17.5;45.5\n18;30\n".encode("utf-16"),
        "# a remark\nlinks.valve.area [cm2],nodes.lake.head\n17.5,45.5\n18,30",
    ],
    ids=[
        "commas",
        "semicolons and decimal commas",
        "tabs, blank and foreign lines",
        "a BOM",
        "UTF-16",
        "a remark",
    ],
)
def test_separators_marks_and_decimal_commas_are_understood(case, tmp_path, text):
    assert read(case, tmp_path, text) == PLAIN


def test_cells_are_read_as_settings_are(case, tmp_path):
    text = 'numerics.scheme,links.main.cells,links.valve.opening,nodes.lake.head\nmuscl,20,"[1.0, 0.5]",45 m\n'
    assert read(case, tmp_path, text + "upwind5,40,0.5,30 m\n") == [
        {
            "numerics.scheme": "muscl",
            "links.main.cells": 20,
            "links.valve.opening": [1.0, 0.5],
            "nodes.lake.head": "45 m",
        },
        {
            "numerics.scheme": "upwind5",
            "links.main.cells": 40,
            "links.valve.opening": 0.5,
            "nodes.lake.head": "30 m",
        },
    ]


def test_all_faults_of_a_file_are_reported_at_once(case, tmp_path):
    text = "links.valve.aera;nodes.lake.head [kg];numerics.scheme [m];nodes.lake.head\n17,7;45;a;1\n;30 kg;b;2 kg\n"
    with pytest.raises(FvsolveError) as raised:
        read(case, tmp_path, text)
    said = str(raised.value)
    assert 'links.valve.aera: unknown key; did you mean "area"?' in said
    assert "two columns have the key nodes.lake.head" in said
    assert (
        '"kg" is a mass; expected a head' in said
        and "values of numerics.scheme have no unit" in said
    )
    assert (
        "line 3, links.valve.aera: is empty; expected a value in every row" in said
        and '"2 kg" is a mass' in said
    )


@pytest.mark.parametrize(
    "text, said",
    [
        ("", "has no rows; expected a header"),
        ("links.valve.area\n", "has no rows; expected a header"),
        ("1,2\n3,4\n", "has no header"),
        ("links.valve.area,nodes.lake.head\n1,2\n1\n", "line 3: 1 cell under 2 headers"),
        (
            "links.valve.area,nodes.lake.head\n0,5,3\n",
            "line 2: 3 cells under 2 headers; with decimal commas",
        ),
        (b"\xff\xfe\x00", "is not UTF-8 or UTF-16 text"),
    ],
)
def test_an_invalid_table_is_named_with_its_line(case, tmp_path, text, said):
    with pytest.raises(FvsolveError, match=said):
        read(case, tmp_path, text)


def test_a_file_that_is_not_there_is_named(case, tmp_path):
    with pytest.raises(FvsolveError, match="nowhere.csv: No such file"):
        sweep(case, points=tmp_path / "nowhere.csv")


@pytest.mark.parametrize(
    "given, said",
    [
        ({"points": []}, "`points` is empty or has different keys"),
        (
            {"points": [{"links.valve.area": 1.0}, {"nodes.lake.head": 1.0}]},
            "`points` is empty or has different keys",
        ),
        (
            {"points": [{"links.valve.area": 1.0}], "vary": {"links.valve.area": [1.0, 2.0]}},
            "expected no `vary`",
        ),
        ({"sample": "sobol:8"}, "no key varies"),
        (
            {"vary": {"links.valve.area": [1.0, 2.0], "nodes.lake.head": []}},
            "nodes.lake.head: no values",
        ),
    ],
)
def test_combinations_that_exclude_each_other_are_named(case, given, said):
    with pytest.raises(FvsolveError, match=said):
        sweep(case, **given)

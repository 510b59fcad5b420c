"""Files of a run read back to the last bit, open in other programs, and are not overwritten by accident.

Frames have the positions of bodies, and of basins on bodies. A folder has at most one writer, a run or a study; its
lock ends with the process.
"""

import json
import math
import signal
import subprocess
import sys
import tomllib
import tracemalloc
from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from reference.folders import CASES
from reference.scenes import AMBIENT, BRANCHED_PROBES, branched, scene, still

import fvsolve
from fvsolve import run
from fvsolve.core.output import network_layout
from fvsolve.core.output.csv_files import HistoryFile, read_headers, read_table
from fvsolve.core.output.fields import FieldSeries, read_series
from fvsolve.core.output.unit_columns import UnitColumn
from fvsolve.errors import RunError
from fvsolve.studies import sweep
from fvsolve.studies.result_cache import ResultCache

UNITS = {"pressure": "barg", "flow": "l/s", "time": "ms"}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("run") / "fork"
    fvsolve.run(branched(), out=place)
    return place


def test_the_directory_contains_the_documented_files(folder):
    names = {path.name for path in folder.iterdir()}
    assert names == {
        *("summary.json", "history.csv", "history.png", "envelope.csv", "envelope.png"),
        *("fields.pvd", "fields", "case.toml", "restart.npz"),
    }
    listed = set(json.loads((folder / "summary.json").read_text())["files"])
    assert listed == names - {"fields", "history.png", "envelope.png"}


def test_history_reads_back_to_the_last_bit(folder):
    result, again = fvsolve.run(branched()), fvsolve.open_run(folder)
    assert again.probes == BRANCHED_PROBES
    assert np.array_equal(again.t, result.t)
    assert all(np.array_equal(again[name], result[name]) for name in BRANCHED_PROBES)
    assert again.extremes == result.extremes and again.reason == result.reason == "finished"


def test_headers_carry_units(folder):
    first = (folder / "history.csv").read_text().splitlines()[0]
    assert (
        first == "t [s],gate.pressure [Pa],gate.head [m],valve.flow [m3/s],main.velocity@0.5 [m/s]"
    )


def test_output_units_are_those_of_the_table_the_extremes_and_the_envelope(folder, tmp_path):
    si, case = fvsolve.open_run(folder), branched()
    case["output"]["units"] = UNITS
    fvsolve.run(case, out=tmp_path / "units")
    result = fvsolve.open_run(tmp_path / "units")
    assert read_headers(tmp_path / "units" / "history.csv")[:2] == [
        ("t", "ms"),
        ("gate.pressure", "barg"),
    ]
    assert result.t == pytest.approx(1e3 * si.t) and result.seconds == pytest.approx(si.seconds)
    assert result["gate.pressure"] == pytest.approx((si["gate.pressure"] - AMBIENT) / 1e5)
    assert result["valve.flow"] == pytest.approx(1e3 * si["valve.flow"])
    assert result.si("gate.pressure") == pytest.approx(si["gate.pressure"], rel=1e-14)
    greatest = si.extremes["gate.pressure"].maximum
    assert result.extremes["gate.pressure"].maximum == pytest.approx((greatest - AMBIENT) / 1e5)
    assert result.envelope["main"]["max_pressure"] == pytest.approx(
        (si.envelope["main"]["max_pressure"] - AMBIENT) / 1e5
    )


def test_the_resolved_case_runs_again_to_the_same_numbers(folder):
    again, result = fvsolve.run(folder / "case.toml"), fvsolve.open_run(folder)
    assert all(np.array_equal(again[name], result[name]) for name in BRANCHED_PROBES)


def test_frames_read_back_through_meshio(folder):
    frames = read_series(folder / "fields.pvd")
    assert [t for t, _ in frames] == pytest.approx(np.linspace(0.0, 1.0, len(frames)))
    assert len(frames) >= 5
    mesh = meshio.read(frames[-1][1])
    # a tree of connected pipes
    assert mesh.cells_dict["line"].shape == (55, 2) and len(mesh.points) == 56
    data = mesh.cell_data_dict
    assert {"pressure", "head", "velocity", "flow", "min_pressure", "max_pressure"} <= data.keys()
    pressure = data["pressure"]["line"]
    assert np.all(data["min_pressure"]["line"] <= pressure)
    assert np.all(data["max_pressure"]["line"] >= pressure)
    assert mesh.points[:, 2].min() == 0.0 and mesh.points[:, 2].max() == 40.0


def test_the_last_frame_has_the_extremes_of_the_envelope(folder):
    data = meshio.read(read_series(folder / "fields.pvd")[-1][1]).cell_data_dict
    envelope = fvsolve.open_run(folder).envelope
    for name in ("min_pressure", "max_pressure"):
        along = np.concatenate([envelope[pipe][name] for pipe in ("main", "branch", "last")])
        assert np.array_equal(data[name]["line"], along)


def test_the_series_is_whole_after_every_frame(tmp_path):
    model = fvsolve.build(fvsolve.load(branched()))
    series = FieldSeries(tmp_path, model)
    series.start()
    zero = dict.fromkeys(
        ("pressure", "head", "velocity", "flow", "min_pressure", "max_pressure"), np.zeros(30)
    )
    frame = {
        pipe.name: {name: one[: pipe.cells] for name, one in zero.items()} for pipe in model.pipes
    }
    assert read_series(tmp_path / "fields.pvd") == []
    for count in range(1, 4):
        series.write(0.1 * count, frame)
        assert len(read_series(tmp_path / "fields.pvd")) == count


def test_no_frames_where_none_are_requested(tmp_path):
    fvsolve.run(branched(fields=0), out=tmp_path / "run")
    assert not (tmp_path / "run" / "fields.pvd").exists()


def test_rows_are_not_stored_in_memory(tmp_path):
    columns = [UnitColumn(f"n{i}.pressure", "pressure", "Pa") for i in range(4)]
    history = HistoryFile(tmp_path / "history.csv", UnitColumn("t", "time", "s"), columns)
    history.start()
    block = np.random.default_rng(1).random((1000, 4))
    history.write(np.arange(1000.0), block)
    tracemalloc.start()
    for k in range(1, 51):
        history.write(1000.0 * k + np.arange(1000.0), block)
    kept = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    history.close()
    assert kept < 1e5
    assert np.array_equal(read_table(tmp_path / "history.csv")[-1000:, 1:], block)


def test_a_run_is_not_overwritten_without_force(folder, tmp_path):
    before = (folder / "history.csv").read_bytes()
    with pytest.raises(fvsolve.RunError, match="--force"):
        fvsolve.run(branched(), out=folder)
    assert (folder / "history.csv").read_bytes() == before


def test_force_replaces_a_run_and_nothing_else(tmp_path):
    place = tmp_path / "run"
    fvsolve.run(branched(), out=place)
    (place / "notes.txt").write_text("mine")
    fvsolve.run(branched(fields=0), out=place, force=True)
    assert (place / "notes.txt").read_text() == "mine"
    assert not (place / "fields.pvd").exists() and not list((place / "fields").iterdir())


def test_a_bad_case_leaves_the_run_before_it_alone(folder):
    case = branched()
    case["links"]["main"]["diameter"] = -1.0
    with pytest.raises(fvsolve.CaseError):
        fvsolve.run(case, out=folder, force=True)
    assert fvsolve.open_run(folder).ok


def test_an_unended_directory_is_no_result(tmp_path):
    with pytest.raises(fvsolve.RunError, match="not hold a finished run"):
        fvsolve.open_run(tmp_path)


def test_expectations_are_those_of_the_table(folder):
    result = fvsolve.open_run(folder)
    pressure = result["gate.pressure"]
    mean = np.sum(0.5 * (pressure[1:] + pressure[:-1]) * np.diff(result.t)) / (
        result.t[-1] - result.t[0]
    )
    claims = {
        "max(gate.pressure)": result.extremes["gate.pressure"].maximum,
        "min(gate.pressure)": result.extremes["gate.pressure"].minimum,
        "final(gate.pressure)": pressure[-1],
        "mean(gate.pressure)": mean,
        "at(gate.pressure, 0.5)": np.interp(0.5, result.t, pressure),
    }
    expect = {text: {"value": float(value), "rtol": 1e-12} for text, value in claims.items()}
    found = fvsolve.run(branched(expect=expect))
    assert [one.text for one in found.expectations if one.ok] == list(claims)
    wrong = {text: {"value": float(value) * 1.01, "rtol": 1e-3} for text, value in claims.items()}
    assert not any(one.ok for one in fvsolve.run(branched(expect=wrong)).expectations)


def test_a_comparison_finds_a_shifted_copy_of_the_run(folder, tmp_path):
    result = fvsolve.open_run(folder)
    rows = [
        f"{1e3 * (t - 0.05)!r},{(p - AMBIENT) / 1e5 + 0.5!r}"
        for t, p in zip(result.t.tolist(), result["gate.pressure"].tolist(), strict=True)
    ]
    (tmp_path / "rig.csv").write_text("clock [ms],p [barg]\n" + "\n".join(rows))
    measured = {
        "file": str(tmp_path / "rig.csv"),
        "time": "clock [ms]",
        "value": "p [barg]",
        "shift": 0.05,
    }
    found = fvsolve.run(branched(compare={"gate.pressure": measured}), out=tmp_path / "run")
    (one,) = found.comparisons
    assert one.rms == pytest.approx(0.5e5, rel=1e-3) and one.greatest_difference == pytest.approx(
        -0.5e5, rel=1e-3
    )
    assert one.computed_peak == pytest.approx(one.measured_peak - 0.5e5)
    assert one.t_computed_peak == pytest.approx(one.t_measured_peak)
    assert (tmp_path / "run" / "rig.csv").is_file()
    again = fvsolve.open_run(tmp_path / "run")
    assert again.comparisons == found.comparisons
    again.plot(tmp_path / "again.png")
    assert (tmp_path / "again.png").read_bytes() == (tmp_path / "run" / "history.png").read_bytes()


def test_a_run_that_blows_up_leaves_everything_so_far(tmp_path):
    case = branched()
    case["numerics"] = {"end": 20.0, "scheme": "upwind5", "method": "rk4", "courant": 3.0}
    result = fvsolve.run(case, out=tmp_path / "run")
    assert not result.ok and result.reason.startswith("stopped")
    assert 0.0 < result.summary["t"] < 20.0
    assert len(result.t) > 1 and np.all(np.isfinite(result["gate.pressure"]))
    assert json.loads((tmp_path / "run" / "summary.json").read_text())["ok"] is False
    assert tomllib.loads((tmp_path / "run" / "case.toml").read_text())["numerics"]["courant"] == 3.0


def test_frame_is_a_pandas_table(folder):
    pandas = pytest.importorskip("pandas")
    frame = fvsolve.open_run(folder).frame()
    assert isinstance(frame, pandas.DataFrame) and frame.index.name == "t [s]"
    assert list(frame.columns)[0] == "gate.pressure [Pa]"


def test_a_probe_that_is_not_there_is_named(folder):
    with pytest.raises(fvsolve.FvsolveError, match='did you mean "gate.head"'):
        fvsolve.open_run(folder)["gate.haed"]


def network(links: dict[str, tuple[str, str]], **positions) -> SimpleNamespace:
    names = dict.fromkeys(name for ends in links.values() for name in ends)
    return SimpleNamespace(
        places=dict.fromkeys(names),
        nodes={name: SimpleNamespace(position=positions.get(name)) for name in names},
        links={name: SimpleNamespace(ports={"from": a, "to": b}) for name, (a, b) in links.items()},
        routes={},
    )


def test_stated_positions_are_used():
    places = network_layout.plan_positions(
        network({"x": ("a", "b")}, a=(1.0, 2.0), b=(3.0, 4.0)), {"x": 9.0}
    )
    assert places["a"].tolist() == [1.0, 2.0] and places["b"].tolist() == [3.0, 4.0]


def test_where_a_pipe_is_cut_its_place_is_that_along_the_pipe():
    """A junction at a chainage does not change a plan with stated positions."""
    case = {
        "schema": 1,
        "fluid": {"name": "Water"},
        "numerics": {"end": 1.0},
        "nodes": {
            "a": {"type": "reservoir", "head": 20.0, "elevation": 0.0, "position": [100.0, 0.0]},
            "b": {"type": "junction", "elevation": 0.0, "position": [100.0, 400.0]},
            "tap": {"type": "junction", "on": "main", "at": 100.0},
        },
        "links": {
            "main": {
                "type": "pipe",
                "from": "a",
                "to": "b",
                "length": 400.0,
                "diameter": 0.1,
                "wave_speed": 1000.0,
                "friction": {"model": "none"},
                "cells": 40,
            }
        },
    }
    places = network_layout.plan_positions(fvsolve.load(case), {"main-1": 100.0, "main-2": 300.0})
    assert places["tap"].tolist() == [100.0, 100.0] and places["b"].tolist() == [100.0, 400.0]


def test_a_chain_is_laid_out_straight_and_to_scale():
    chain = network({"x": ("a", "b"), "y": ("b", "c"), "z": ("c", "d")})
    places = network_layout.plan_positions(chain, {"x": 100.0, "y": 50.0, "z": 200.0})
    plan = np.array([places[name] for name in "abcd"])
    assert plan == pytest.approx(np.array([[0, 0], [100, 0], [150, 0], [350, 0]]), abs=1e-3)


@pytest.mark.parametrize("count", [30, network_layout.MAX_DENSE_NODES + 50])
def test_a_network_has_the_same_layout_every_time_with_no_two_nodes_in_the_same_place(count):
    links = {f"p{i}": (f"n{i}", f"n{(i * 7) // 10}") for i in range(1, count)}
    lengths = {name: 50.0 + 10.0 * (i % 7) for i, name in enumerate(links)}
    one, two = (network_layout.plan_positions(network(links), lengths) for _ in range(2))
    plan = np.array(list(one.values()))
    assert np.array_equal(plan, np.array(list(two.values())))
    apart = np.linalg.norm(plan[:, None] - plan[None], axis=2) + 1e9 * np.eye(count)
    assert apart.min() > 0.1


def test_parallel_links_bend_apart():
    bends = network_layout.link_bends(
        network({"x": ("a", "b"), "y": ("b", "a"), "z": ("b", "c")}).links
    )
    assert bends["z"] == 0.0 and bends["x"] == bends["y"] != 0.0  # x and y start at opposite ends


def test_a_turning_boom_and_its_tank_are_written_where_they_are(tmp_path):
    rate = 0.4
    boom = {
        "type": "body",
        "mass": 10.0,
        "inertia": [1.0, 1.0, 1.0],
        "centre_of_mass": [1.0, 0, 0],
        "points": {"tip": [2.0, 0, 0]},
        "joint": {
            "kind": "revolute",
            "axis": [0, 0, 1],
            "at": [5.0, 0, 1.0],
            "angle": {"time": [0, 9], "value": [0, 9 * rate]},
        },
    }
    tank = {
        "type": "basin",
        "on": "boom",
        "at": [2.0, 0, 0.5],
        "size": [1.0, 1.0],
        "cells": [2, 2],
        "level": 0.2,
    }
    world = {"type": "frame", "points": {"post": [5.0, 3.0, 1.0]}}
    stay = {"type": "spring", "from": "world.post", "to": "boom.tip", "stiffness": 1.0}
    case = scene(
        {"boom": boom, "b": tank, "world": world}, {"stay": stay}, 2.0, {"scheme": "upwind"}
    )
    case["output"]["fields"] = 4
    run(case, out=tmp_path / "r")
    frames = read_series(tmp_path / "r" / "fields.pvd")
    bodies = [(t, meshio.read(path)) for t, path in frames if path.name.startswith("bodies")]
    tanks = [(t, meshio.read(path)) for t, path in frames if path.name.startswith("b-")]
    assert len(bodies) == len(tanks) == 5
    for (t, one), (_, other) in zip(bodies, tanks, strict=True):
        east = np.array([math.cos(rate * t), math.sin(rate * t), 0.0])
        north = np.array([-east[1], east[0], 0.0])
        tip = np.array([5.0, 0, 1.0]) + 2.0 * east
        assert np.abs(one.points - tip).sum(axis=1).min() < 1e-9
        assert np.abs(one.points - [5.0, 3.0, 1.0]).sum(axis=1).min() < 1e-9
        assert set(one.cell_data["body"][0]) == {0, -1}
        corner = tip + east + north + [0, 0, 0.5]
        assert np.abs(other.points - corner).sum(axis=1).min() < 1e-9
        assert other.cell_data["normal"][0] == pytest.approx(np.tile([0, 0, 1.0], (4, 1)))


@pytest.mark.parametrize(
    ("physics", "attitude", "along"),
    [
        ({"level": 0.2}, {"yaw": "90 deg"}, [0.0, 1.0, 0.0]),
        (
            {"physics": "liquid", "thickness": 0.1, "pressure": "2 bar"},
            {"yaw": "90 deg"},
            [0.0, 1.0, 0.0],
        ),
        (
            {"physics": "liquid", "thickness": 0.1, "pressure": "2 bar"},
            {"pitch": "-30 deg"},
            [math.sqrt(0.75), 0.0, 0.5],
        ),
    ],
)
def test_velocities_in_frames_are_along_axes_of_the_world_and_on_lines_along_those_of_the_basin(
    physics, attitude, along, tmp_path
):
    hull = {
        "type": "body",
        "mass": 10.0,
        "inertia": [1.0, 1.0, 1.0],
        "joint": {"kind": "fixed", "attitude": attitude},
    }
    tank = {
        "type": "basin",
        "on": "hull",
        "size": [1.0, 1.0],
        "cells": [4, 4],
        "start": {"u": 0.3},
        **physics,
    }
    case = scene({"hull": hull, "tank": tank}, {}, 1e-6, {"scheme": "upwind"})
    case["output"] |= {
        "fields": 1,
        "lines": {"cut": {"basin": "tank", "from": [0.2, 0.5], "to": [0.8, 0.5]}},
    }
    run(case, out=tmp_path / "r")
    frame = meshio.read(tmp_path / "r" / "fields" / "tank-000000.vtu")
    assert frame.cell_data["velocity"][0] == pytest.approx(
        np.tile(0.3 * np.array(along), (16, 1)), abs=1e-12
    )
    line = np.genfromtxt(tmp_path / "r" / "lines" / "cut-000000.csv", delimiter=",", names=True)
    assert (
        line["u_ms"] == pytest.approx(np.full(line.size, 0.3))
        and np.abs(line["v_ms"]).max() < 1e-12
    )


@pytest.mark.parametrize(
    ("fields", "out", "reason"),
    [(0, True, "fields is 0"), (2, False, "nothing was written"), (2, None, "the case has no ")],
)
def test_a_run_without_frames_states_the_single_reason(fields, out, reason, tmp_path):
    stone = {"type": "body", "mass": 1.0, "inertia": [1.0, 1.0, 1.0]}
    weight = {"type": "mass", "mass": 1.0}
    coil = {"type": "spring", "from": "wall", "to": "weight", "stiffness": 1.0}
    lone = out is None
    nodes = {"weight": weight, "wall": {"type": "frame"}} if lone else {"stone": stone}
    case = scene(
        nodes,
        {"coil": coil} if lone else {},
        0.1,
        {"method": "rk4", "step": 0.01, "scheme": "upwind"},
    )
    case["output"]["fields"] = fields
    found = run(case, out=None if out is False else tmp_path / "r")
    with pytest.raises(RunError, match=reason) as told:
        found.view(field="speed")
    assert (
        sum(
            one in str(told.value)
            for one in ("fields is 0", "nothing was written", "the case has no ")
        )
        == 1
    )


WAITING = """
import sys
import fvsolve

def wait(t, seconds, steps):
    print("going", flush=True)
    sys.stdin.readline()

fvsolve.run(sys.argv[1], out=sys.argv[2], progress=wait)
"""


@pytest.fixture
def running(tmp_path):
    """Folder and process of a run that waits in its first call of `progress`."""
    case = tmp_path / "case.toml"
    case.write_text(
        fvsolve.load(still(), {"numerics.step": "1 us", "numerics.method": "rk4"}).resolved()
    )
    (tmp_path / "wait.py").write_text(WAITING)
    command = [sys.executable, str(tmp_path / "wait.py"), str(case), str(tmp_path / "out")]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "going\n"
        yield tmp_path / "out", process
        process.kill()


@pytest.mark.parametrize(
    "how", [{}, {"force": True}, {"resume": True}], ids=["anew", "force", "resume"]
)
def test_a_run_that_is_going_is_let_alone(running, how):
    folder, process = running
    before = (folder / "restart.npz").read_bytes(), (folder / "history.csv").stat().st_size
    with pytest.raises(RunError, match=r"out is in use: a run still writes there\. .*--out"):
        fvsolve.run(folder.parent / "case.toml", out=folder, **how)
    assert before == (
        (folder / "restart.npz").read_bytes(),
        (folder / "history.csv").stat().st_size,
    )
    assert process.poll() is None


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no such signal")
def test_the_lock_goes_with_its_process(running):
    folder, process = running
    process.kill()
    process.wait()
    short = {"numerics.end": "1 ms", "output.every": "0.1 ms"}
    assert fvsolve.run(folder.parent / "case.toml", short, out=folder, force=True).ok
    assert not (folder / ".lock").exists()


def test_a_run_that_fails_lets_go(tmp_path):
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            fvsolve.run(
                still(),
                {"numerics.step": "1 us", "numerics.method": "rk4"},
                tmp_path,
                force=True,
                progress=lambda *_: 1 / 0,
            )
    assert fvsolve.run(still(), out=tmp_path, force=True).ok
    with pytest.raises(RunError, match="holds a run; replace it"):
        fvsolve.run(still(), out=tmp_path)
    assert fvsolve.run(still(), out=tmp_path, resume=True).ok
    assert not (tmp_path / ".lock").exists()


def test_studies_share_no_folder(tmp_path):
    vary = {"nodes.pond.level": [1.0, 2.0]}
    with (
        ResultCache(tmp_path),
        pytest.raises(RunError, match="is in use: a study still writes there"),
    ):
        sweep(still(), vary, out=tmp_path)
    assert len(sweep(still(), vary, out=tmp_path).rows) == 2
    written = {path.name for path in tmp_path.iterdir()}
    # sweep.parquet needs pyarrow
    assert written - {"sweep.parquet"} == {"points.jsonl", "sweep.csv"}


@pytest.mark.parametrize("stated", [True, False])
def test_conduits_in_frames_lie_between_their_ends(tmp_path, stated):
    """Each is drawn in its length and width where nodes state positions, else where the layout has its nodes."""
    case = tomllib.loads((CASES / "storm-sewer.toml").read_text(encoding="utf-8"))
    case["numerics"]["end"] = "1 s"
    del case["expect"]
    at = {"street": (0.0, 0.0), "upper": (60.0, 0.0), "lower": (60.0, 120.0)}
    at |= {"joint": (120.0, 120.0), "river": (120.0, 60.0)}
    for name, node in case["nodes"].items():
        if stated:
            node["position"] = list(at[name])
    assert fvsolve.run(case, out=tmp_path / "run", pictures=False).ok
    middles = {}
    for name, link in case["links"].items():
        frame = meshio.read(next((tmp_path / "run" / "fields").glob(f"{name}-*.vtu")))
        cells = frame.points[frame.cells[0].data][:, :, :2]
        west, east = cells[0].mean(axis=0), cells[-1].mean(axis=0)
        step = (east - west) / (len(cells) - 1)
        middles[name] = west - 0.5 * step, east + 0.5 * step
        if stated:
            for spot, end in zip(middles[name], ("from", "to"), strict=True):
                assert spot == pytest.approx(at[link[end]], abs=1e-4)
            area = abs(np.cross(cells[0][1] - cells[0][0], cells[0][3] - cells[0][0]))
            width = float(link["diameter"].removesuffix(" mm")) * 1e-3
            assert area == pytest.approx(width * np.hypot(*step), rel=1e-3)
    for first, second in (("head", "collector"), ("collector", "main"), ("main", "outfall")):
        assert middles[first][1] == pytest.approx(middles[second][0], abs=1e-4)

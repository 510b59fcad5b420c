"""MPI ranks that share the rows of basins give the bits of one process; cases that cannot be shared are reported."""

import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import meshio
import numpy as np
import pytest
from reference.basin_scenes import SCENES, liquid, water, with_maxima

import fvsolve
from fvsolve.core.output.fields import read_series
from fvsolve.report.draw.field_canvas import read_frame
from fvsolve.report.draw.scene import DrawnScene, DrawnUnit

pytest.importorskip("mpi4py", reason="the extra mpi is not there")
MPIEXEC = Path(sys.executable).with_name("mpiexec")
if not MPIEXEC.exists():
    pytest.skip("no mpiexec beside Python", allow_module_level=True)
SCRIPT = """
import json, sys
import fvsolve
from fvsolve.core.run import mpi_run as ranks
cases, out = json.loads(sys.argv[1]), sys.argv[2]
for name, case in cases.items():
    fvsolve.run(case, out=f"{out}/{name}", pictures=False)
"""
NAMES = (
    "muscl, ssp-rk2",
    "a tolerance",
    "a pipe",
    "delay lines",
    "a liquid",
    "a dye in water",
    "greatest values",
    "a mesh",
    "a liquid on a mesh",
)


def ranks(many: int, *command, timeout=300, **environment) -> subprocess.CompletedProcess:
    command = [str(MPIEXEC), "-n", str(many), *map(str, command)]
    environment = os.environ | environment
    return subprocess.run(
        command, capture_output=True, text=True, timeout=timeout, env=environment, check=False
    )


def same(one: Path, other: Path) -> bool:
    """True if two runs have equal histories, ledgers and frames."""
    said, again = (json.loads((run / "summary.json").read_text()) for run in (one, other))
    keys = ("ledgers", "extremes", "steps", "reason", "marks")
    frames = [[drawn(path) for _, path in read_series(run / "fields.pvd")] for run in (one, other)]
    history = [(run / "history.csv").read_bytes() for run in (one, other)]
    kept = all(said[key] == again[key] for key in keys)
    kept &= all(
        path.read_bytes() == (other / path.name).read_bytes() for path in one.glob("maxima-*.vtu")
    )
    return kept and frames[0] == frames[1] != [] and history[0] == history[1]


def drawn(path: Path) -> dict[str, bytes]:
    """Bytes of the corners and cell data of a frame, with all its pieces in order."""
    pieces = [path]
    if path.suffix == ".pvtu":
        pieces = [
            path.parent / one.attrib["Source"]
            for one in ElementTree.parse(path).getroot().iter("Piece")
        ]
    meshes = [meshio.read(one) for one in pieces]
    found = {"corners": [one.points[block.data].ravel() for one in meshes for block in one.cells]}
    for name in meshes[0].cell_data:
        found[name] = [np.ravel(values) for one in meshes for values in one.cell_data[name]]
    return {name: np.concatenate(parts).tobytes() for name, parts in found.items()}


def drawing(name: str, fields: int) -> dict:
    """A scene with frames; those on meshes, which have most steps, end after a half."""
    case = SCENES[name]
    end = case["numerics"]["end"] * (0.5 if "a mesh" in name else 1.0)
    return case | {
        "numerics": case["numerics"] | {"end": end},
        "output": case["output"] | {"fields": fields},
    }


def alone_and_by_ranks(many: int, cases: dict, folder: Path) -> None:
    """Run cases one after the other in this process, which also compiles, and then by the same ranks."""
    for name, case in cases.items():
        fvsolve.run(case, out=folder / "one" / name, pictures=False)
    found = ranks(many, sys.executable, "-c", SCRIPT, json.dumps(cases), folder / "ranks")
    assert found.returncode == 0, found.stderr


@pytest.fixture(scope="module")
def of_two(tmp_path_factory) -> Path:
    """Folder of the runs of all cases that are shared by two ranks."""
    folder, grows = tmp_path_factory.mktemp("ranks"), liquid()
    grows["numerics"] |= {"courant": 2.0, "end": 1.0}
    cases = {name: drawing(name, 2) for name in NAMES[::3]}
    cases |= {
        "grows": grows,
        "a dye": drawing("a dye", 1),
        "implicit": water(method="tr-bdf2", step=0.02),
    }
    alone_and_by_ranks(2, cases, folder)
    return folder


@pytest.mark.parametrize("many", [2, 3])
def test_ranks_give_the_bits_of_a_single_process(tmp_path, many, request):
    names, folder = (
        (NAMES[::3], request.getfixturevalue("of_two")) if many == 2 else (NAMES, tmp_path)
    )
    if many == 3:
        alone_and_by_ranks(3, {name: drawing(name, 2) for name in names}, folder)
    for name in names:
        assert same(folder / "one" / name, folder / "ranks" / name), name
        one, said = (
            json.loads((folder / kind / name / "summary.json").read_text())
            for kind in ("one", "ranks")
        )
        assert said["threads"] == many and one["threads"] == 1


def test_growth_without_end_stops_all_ranks_at_the_same_step(of_two):
    one, said = (
        json.loads((of_two / kind / "grows" / "summary.json").read_text())
        for kind in ("one", "ranks")
    )
    assert said["threads"] == 2 and "has grown" in said["reason"]
    assert (said["steps"], said["reason"]) == (one["steps"], one["reason"])


def test_frames_written_by_ranks_read_as_those_of_a_single_process(of_two):
    """A VTK reader finds one basin in the frames of several ranks, equal to that of one process, with its unit."""
    names = sorted(path.name for path in (of_two / "ranks" / "a dye" / "fields").iterdir())
    assert names == [
        f"sheet{part}-00000{k}.{kind}"
        for part, kind in (("", "pvtu"), (".0", "vtu"), (".1", "vtu"))
        for k in range(2)
    ]
    runs = [
        of_two / kind / "a dye" / "fields" / f"sheet-000001.{end}"
        for kind, end in (("one", "vtu"), ("ranks", "pvtu"))
    ]
    asked = DrawnScene("", DrawnUnit("dye", ""), *[DrawnUnit("length", "m")] * 2, [])
    one, two = (read_frame(path, asked) for path in runs)
    assert (
        two.n_cells == one.n_cells == 132
        and two.n_points == one.n_points
        and asked.quantity.unit == "mg/l"
    )
    assert np.array_equal(two.cell_centers().points, one.cell_centers().points)
    assert np.array_equal(two["dye"], one["dye"])


def test_a_run_of_3_ranks_is_resumed_by_2_and_by_1(tmp_path):
    case = with_maxima(water(end=0.15, step=1e-3), "pool")
    whole = fvsolve.run(case, out=tmp_path / "whole", pictures=False)
    stopping = SCRIPT.replace("pictures=False", "progress=stop, pictures=False").replace(
        "import json",
        """
import importlib
solve = importlib.import_module("fvsolve.core.solve.solve")
solve.CHECKPOINT_SECONDS, solve.CHUNK_SECONDS, solve.FIRST_CHUNK = 0.0, 0.0, 80.0  # after 80, 100, 110, ... steps
def stop(t, *given):
    if t > 0.11:
        raise KeyboardInterrupt
import json""",
        1,
    )
    found = ranks(3, sys.executable, "-c", stopping, json.dumps({"run": case}), tmp_path)
    assert found.returncode == 0, found.stderr
    said = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert said["reason"].startswith("interrupted")
    with np.load(tmp_path / "run" / "restart.npz") as file:
        assert 0.0 < file["t"] < 0.15
    found = ranks(
        2,
        sys.executable,
        "-m",
        "fvsolve",
        "run",
        tmp_path / "run" / "case.toml",
        "--out",
        tmp_path / "run",
        "--resume",
    )
    assert found.returncode == 0 and found.stdout.count("finished at") == 1, (
        found.stdout + found.stderr
    )
    assert whole.ok and same(tmp_path / "whole", tmp_path / "run")


def test_ranks_with_different_cases_are_named(tmp_path):
    differing = SCRIPT.replace(
        "for name",
        """
from mpi4py import MPI
cases["run"]["nodes"]["pool"]["manning"] += 0.01 * MPI.COMM_WORLD.rank
for name""",
        1,
    )
    found = ranks(2, sys.executable, "-c", differing, json.dumps({"run": water()}), tmp_path)
    assert (
        found.returncode != 0
        and "rank 1 has another case than rank 0; expected the same file" in found.stderr
    )


def test_a_rank_that_cannot_read_its_case_ends_all_with_its_message(tmp_path):
    failing = SCRIPT.replace(
        "for name",
        """
from mpi4py import MPI
if MPI.COMM_WORLD.rank == 1:
    cases["run"] = "nowhere.toml"
for name""",
        1,
    )
    found = ranks(2, sys.executable, "-c", failing, json.dumps({"run": water()}), tmp_path)
    assert found.returncode != 0 and "rank 1: " in found.stderr and "nowhere.toml" in found.stderr


def test_a_rank_that_fails_in_the_middle_ends_all_with_its_message(tmp_path):
    failing = SCRIPT.replace(
        "for name",
        """
from mpi4py import MPI
from fvsolve.core.solve.parallel_bands import MpiRanks as Ranks
def fails(self, name, at):
    raise MemoryError("planted")
if MPI.COMM_WORLD.rank == 1:
    Ranks.gather = fails
for name""",
        1,
    )
    found = ranks(2, sys.executable, "-c", failing, json.dumps({"run": water()}), tmp_path)
    assert found.returncode != 0 and "rank 1: MemoryError: planted" in found.stderr


def test_more_ranks_than_rows_threads_of_ranks_and_a_fault_are_reported_once(tmp_path, monkeypatch):
    case = water(basin={"cells": [8, 2], "patches": {}}, link=None)
    found = ranks(3, sys.executable, "-c", SCRIPT, json.dumps({"run": case}), tmp_path / "a")
    assert found.returncode != 0 and found.stderr.count("; expected at most 2") == 1
    found = ranks(
        2,
        sys.executable,
        "-m",
        "fvsolve",
        "run",
        "dam-break",
        "--threads",
        "2",
        "--out",
        tmp_path / "b",
    )
    assert (
        found.returncode != 0
        and found.stderr.count("under MPI each of the 2 ranks is one thread") == 1
    )
    found = ranks(2, sys.executable, "-m", "fvsolve", "run", "dam-brake", "--out", tmp_path / "c")
    assert found.returncode != 0 and found.stderr.count("dam-brake") >= 1


def test_mpi_without_mpi4py_is_named(tmp_path):
    without = "import sys; sys.modules['mpi4py'] = None\n" + SCRIPT
    found = ranks(2, sys.executable, "-c", without, json.dumps({"run": water()}), tmp_path)
    assert (
        found.returncode != 0
        and "MPI started 2 processes, but mpi4py is not installed" in found.stderr
    )
    assert 'pip install "fvsolve[mpi]"' in found.stderr


def test_a_run_of_a_single_process_is_stepped_by_rank_0_alone(of_two):
    said = json.loads((of_two / "ranks" / "implicit" / "summary.json").read_text())
    assert said["threads"] == 1 and "threads = 2, but one thread is used" in json.dumps(
        said["warnings"]
    )

"""Commands that are killed at any instant: what was complete stays, and the folder is used or refused in one message.

FVSOLVE_EXAMPLES=1000 draws that many new instants for each command.
"""

import os
import shutil
import signal
import subprocess
import sys
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis_profiles import examples
from reference.scenes import branched

import fvsolve
from fvsolve.file_replacement import TEMPORARY, remove_unfinished, replacing, write_file

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
LONGEST = 2.5  # about the duration of the commands below [s]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """Folder with a case file, a finished run of it, and its report."""
    from fvsolve.report.report_files import write_report

    folder, case = tmp_path_factory.mktemp("kills"), branched(fields=20)
    case["numerics"] = {"end": 1.0, "scheme": "muscl", "method": "ssp-rk3", "step": "0.05 ms"}
    case["output"] |= {"every": 0.002}
    (folder / "case.toml").write_text(fvsolve.load(case).resolved())
    assert fvsolve.run(folder / "case.toml", out=folder / "run").ok
    write_report(folder / "run")
    return folder


def killed(after: float, *arguments) -> bool:
    """Start a command and kill it with its processes after a time [s]; True if it was still running."""
    process = subprocess.Popen(
        [sys.executable, "-m", "fvsolve", *map(str, arguments)],
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        process.wait(after)
        return False
    except subprocess.TimeoutExpired:
        return True
    finally:
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        process.wait()


@given(share=st.floats(0.05, 1.0))
@examples(4)
def test_a_run_that_is_killed_is_continued_with_equal_rows(finished, tmp_path_factory, share):
    out = tmp_path_factory.mktemp("killed") / "run"
    killed(share * LONGEST, "run", finished / "case.toml", "--out", out)
    # the lock ended with its process
    resumed = fvsolve.run(finished / "case.toml", out=out, resume=True)
    assert (
        resumed.ok
        and (out / "history.csv").read_bytes() == (finished / "run" / "history.csv").read_bytes()
    )
    assert len(list((out / "fields").glob("*.vtu"))) == 21 and not [
        p for p in out.rglob(".*") if ".tmp" in p.name
    ]
    shutil.rmtree(out)


@given(share=st.floats(0.3, 1.0))
@examples(4)
def test_a_report_that_is_killed_leaves_the_old_or_the_new_page(
    finished, fvs, tmp_path_factory, share
):
    out = tmp_path_factory.mktemp("killed") / "run"
    shutil.copytree(finished / "run", out)
    killed(share * LONGEST, "report", out, "--xlsx")
    text = (out / "report.html").read_text(encoding="utf-8")
    assert text.rstrip().endswith("</html>")
    assert fvsolve.open_run(out).ok and fvs("report", out)[0] == 0
    shutil.rmtree(out)


@given(share=st.floats(0.3, 1.0))
@examples(3)
def test_a_sweep_that_is_killed_retains_its_finished_points(finished, fvs, tmp_path_factory, share):
    out = tmp_path_factory.mktemp("killed") / "sweep"
    command = (
        "sweep",
        finished / "case.toml",
        "--set",
        "links.valve.area=0.003,0.004,0.005,0.006",
        "--out",
        out,
    )
    killed(share * LONGEST, *command)
    points = out / "points.jsonl"
    kept = points.read_text().splitlines() if points.is_file() else []
    assert fvs(*command)[0] == 0
    now = points.read_text().splitlines()
    assert len(now) == 4 and len((out / "sweep.csv").read_text().splitlines()) == 5
    assert [line for line in kept if line.endswith("}")] == now[
        : len([line for line in kept if line.endswith("}")])
    ]
    shutil.rmtree(out)


WRITER = """
import sys
from fvsolve.file_replacement import replacing
with replacing(sys.argv[1]) as fresh, open(fresh, "w") as file:
    file.write("new")
    file.flush()
    print("half", flush=True)
    sys.stdin.read()
"""


def test_a_kill_within_a_write_leaves_the_old_file_and_leftovers_are_removed(tmp_path):
    write_file(tmp_path / "a.html", "old")
    with subprocess.Popen(
        [sys.executable, "-c", WRITER, str(tmp_path / "a.html")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    ) as process:
        process.stdout.readline()
        process.kill()
    assert (tmp_path / "a.html").read_text() == "old"
    (left,) = [path for path in tmp_path.iterdir() if path.name != "a.html"]
    assert int(TEMPORARY.fullmatch(left.name)[1]) == process.pid and left.suffix == ".html"
    remove_unfinished(tmp_path, process.pid + 1)
    assert left.exists()
    remove_unfinished(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["a.html"]


def test_a_new_file_retains_rights_and_links_and_devices_stay(tmp_path):
    target = tmp_path / "target.csv"
    target.write_text("old")
    target.chmod(0o640)
    (tmp_path / "link.csv").symlink_to(target)
    write_file(tmp_path / "link.csv", "new")
    assert (tmp_path / "link.csv").is_symlink() and target.read_text() == "new"
    assert target.stat().st_mode & 0o777 == 0o640
    write_file(os.devnull, "nothing")
    assert os.stat(os.devnull).st_rdev != 0 and sorted(os.listdir(tmp_path)) == [
        "link.csv",
        "target.csv",
    ]


def test_a_write_that_fails_leaves_the_old_file_and_names_it(tmp_path):
    write_file(tmp_path / "a", "old")
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "a") as fresh:
        fresh.write_text("half")
        1 / 0  # noqa: B018
    with pytest.raises(FileNotFoundError) as error:
        write_file(tmp_path / "none" / "b.txt", "text")
    assert error.value.filename == str(tmp_path / "none" / "b.txt")
    assert (tmp_path / "a").read_text() == "old" and os.listdir(tmp_path) == ["a"]


def test_no_module_writes_a_result_in_place():
    """Places that open files for writing: those of growing files and of temporary folders."""
    import re
    from pathlib import Path

    package = Path(fvsolve.__file__).parent
    pattern = re.compile(
        r"\.write_text\(|\.write_bytes\(|\.savefig\(|savez\((?!file)|[( ]open\([^)]*\"[wa]b?\"|copyfile\("
    )
    found = {
        (path.relative_to(package).as_posix(), line.strip())
        for path in package.rglob("*.py")
        for line in path.read_text(encoding="utf-8").splitlines()
        if pattern.search(line) and "fresh" not in line
    }
    allowed = {
        # growing files, cut to a checkpoint
        "core/output/csv_files.py",
        "core/output/fields.py",
        "studies/result_cache.py",
        # caches
        "compile/store.py",
        "compile/numba_internals.py",
        "compile/cache_folders.py",
        "core/fluid/property_cache.py",
        # temporary folders
        "studies/validation/library.py",
        "studies/validation/epanet_networks.py",
        "studies/validation/data_files.py",
        "exchange/epanet/toolkit_process.py",  # a temporary folder
        "exchange/fmi/cosimulation.py",
        "display.py",  # memory
    }
    assert {row for row in found if row[0] not in allowed} == set()


def test_a_killed_process_takes_time_of_the_command_alone(finished):
    """The instants of the tests above lie within the commands."""
    begun = time.perf_counter()
    assert killed(0.05, "run", finished / "case.toml", "--out", finished / "other")
    assert time.perf_counter() - begun < LONGEST * 4

"""A folder has at most one writer, a run or a study; its lock ends with the process."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest
from reference.scenes import still

import fvsolve
from fvsolve.errors import RunError
from fvsolve.studies import sweep
from fvsolve.studies.result_cache import ResultCache

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
    case.write_text(fvsolve.load(still(), {"numerics.step": "1 us", "numerics.method": "rk4"}).resolved())
    (tmp_path / "wait.py").write_text(WAITING)
    command = [sys.executable, str(tmp_path / "wait.py"), str(case), str(tmp_path / "out")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "going\n"
        yield tmp_path / "out", process
        process.kill()


@pytest.mark.parametrize("how", [{}, {"force": True}, {"resume": True}], ids=["anew", "force", "resume"])
def test_a_run_that_is_going_is_let_alone(running, how):
    folder, process = running
    before = (folder / "restart.npz").read_bytes(), (folder / "history.csv").stat().st_size
    with pytest.raises(RunError, match=r"out is in use: a run still writes there\. .*--out"):
        fvsolve.run(folder.parent / "case.toml", out=folder, **how)
    assert before == ((folder / "restart.npz").read_bytes(), (folder / "history.csv").stat().st_size)
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
            fvsolve.run(still(), {"numerics.step": "1 us", "numerics.method": "rk4"}, tmp_path, force=True,
                        progress=lambda *_: 1 / 0)  # fmt: skip
    assert fvsolve.run(still(), out=tmp_path, force=True).ok
    with pytest.raises(RunError, match="holds a run; replace it"):
        fvsolve.run(still(), out=tmp_path)
    assert fvsolve.run(still(), out=tmp_path, resume=True).ok
    assert not (tmp_path / ".lock").exists()


def test_studies_share_no_folder(tmp_path):
    vary = {"nodes.pond.level": [1.0, 2.0]}
    with ResultCache(tmp_path), pytest.raises(RunError, match="is in use: a study still writes there"):
        sweep(still(), vary, out=tmp_path)
    assert len(sweep(still(), vary, out=tmp_path).rows) == 2
    written = {path.name for path in tmp_path.iterdir()}
    assert written - {"sweep.parquet"} == {"points.jsonl", "sweep.csv"}  # sweep.parquet needs pyarrow

"""Standard streams that are closed, missing or full: commands end with their exit code, and files are complete."""

import errno
import io
import os
import subprocess
import sys

import pytest
from reference.scenes import still

import fvsolve
from fvsolve.cli import main
from fvsolve.cli.streams import SafeStream, safe_streams

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="the shell of POSIX")
FILES = ["case.toml", "history.csv", "history.png", "restart.npz", "summary.json"]
FULL = pytest.mark.skipif(not os.path.exists("/dev/full"), reason="no /dev/full")


@pytest.fixture(scope="module")
def case(tmp_path_factory):
    path = tmp_path_factory.mktemp("case") / "case.toml"
    path.write_text(fvsolve.load(still(title="A")).resolved())
    assert fvsolve.run(path, pictures=False).ok  # compiles
    return path


def shell(line: str, folder) -> subprocess.CompletedProcess:
    """Run a line of bash; `fvsolve` is the command of this interpreter."""
    name = f'fvsolve() {{ "{sys.executable}" -m fvsolve "$@"; }}'
    return subprocess.run(
        ["bash", "-c", f"{name}\n{line}"], cwd=folder, capture_output=True, text=True
    )


@pytest.mark.parametrize("streams, code", [
    (">&-", 0), ("2>&-", 0), ("<&-", 0), (">&- 2>&- <&-", 0), ("| true; exit ${PIPESTATUS[0]}", 0),
    pytest.param("> /dev/full", 2, marks=FULL), pytest.param("2> /dev/full", 0, marks=FULL),
    pytest.param("> /dev/full 2>&1", 2, marks=FULL), pytest.param("--json > /dev/full", 2, marks=FULL),
])  # fmt: skip
def test_a_run_is_complete_whatever_its_streams_are(streams, code, case, tmp_path):
    done = shell(f"fvsolve run {case} --out out {streams}", tmp_path)
    assert (
        done.returncode == code
        and "Traceback" not in done.stderr
        and "internal error" not in done.stderr
    )
    assert "Exception ignored" not in done.stderr
    assert sorted(os.listdir(tmp_path / "out")) == FILES
    if streams.endswith("> /dev/full") and code:
        assert done.stderr == "standard output: cannot be written: No space left on device\n"


@pytest.mark.parametrize("streams", [">&- 2>&- <&-", "| true; exit ${PIPESTATUS[0]}"])
@pytest.mark.parametrize("command, code", [
    ("list", 0), ("--version", 0), ("run nothing", 2), ("nonsense", 2), ("schema", 0), ("compare none none", 2),
])  # fmt: skip
def test_each_command_retains_its_exit_code(command, code, streams, tmp_path):
    done = shell(f"fvsolve {command} {streams}", tmp_path)
    assert (
        done.returncode == code
        and "Traceback" not in done.stderr
        and "internal error" not in done.stderr
    )


def test_a_sweep_with_other_processes_needs_no_streams(case, tmp_path):
    done = shell(
        f"fvsolve sweep {case} --set numerics.end=0.1,0.2 --jobs 2 --out out >&- 2>&- <&-", tmp_path
    )
    assert (
        done.returncode == 0 and len((tmp_path / "out" / "sweep.csv").read_text().splitlines()) == 3
    )


def test_a_process_without_streams_may_call_the_command(case, tmp_path, monkeypatch):
    """As under pythonw: the streams are None, before and after."""
    with monkeypatch.context() as patch:
        for name in ("stdin", "stdout", "stderr"):
            patch.setattr(sys, name, None)
        patch.setattr(sys, "argv", ["fvsolve", "run", str(case), "--out", str(tmp_path / "out")])
        with pytest.raises(SystemExit) as left:
            main()
        assert (sys.stdin, sys.stdout, sys.stderr) == (None, None, None)
    assert not left.value.code and sorted(os.listdir(tmp_path / "out")) == FILES


class Full(io.StringIO):
    def write(self, text):
        raise OSError(errno.ENOSPC, "No space left on device")


def test_a_stream_discards_text_after_its_first_error():
    stream = SafeStream(Full())
    assert stream.write("abc") == 3 and stream.error.errno == errno.ENOSPC
    stream.writelines(["a", "b"])
    stream.flush()
    closed = io.StringIO()
    closed.close()
    stream = SafeStream(closed)
    assert stream.write("abc") == 3 and stream.error.errno == errno.EBADF


def test_streams_are_restored(monkeypatch):
    before = sys.stdin, sys.stdout, sys.stderr
    with pytest.raises(ZeroDivisionError), safe_streams() as output:
        assert sys.stdout is output
        1 / 0  # noqa: B018
    assert (sys.stdin, sys.stdout, sys.stderr) == before

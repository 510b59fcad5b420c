"""Pictures that a second process draws equal those drawn after the run; none is lost if that process fails."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from reference.scenes import branched

import fvsolve
from fvsolve.report.draw.plot_process import processor_count

BEGIN = """
import sys
from pathlib import Path
from fvsolve.report.draw.plot_process import PlotProcess, Picture
t = [0.0, 1.0]
arguments = {"t": t, "values": __import__("numpy").array([t, t]).T, "probes": [("a.level", "m"), ("b.level", "m")]}
wanted = [Picture(Path(name), "history_figure", arguments) for name in ("one.png", "two.png")]
"""
alone = pytest.mark.skipif(processor_count() < 2, reason="one processor draws in one process")


def python(code: str, folder: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-c", BEGIN + code], cwd=folder, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    return done.stdout


@pytest.fixture
def fork(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("fork.toml").write_text(fvsolve.load(branched(fields=0)).resolved())


def command(*words: str):
    done = subprocess.run(
        [sys.executable, "-m", "fvsolve", "run", "fork.toml", *words],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done


def test_pictures_of_a_command_are_those_of_its_result(fork):
    said = command("--json")
    run = fvsolve.open_run("runs/fork")
    run.plot("history.png"), run.plot_envelope("envelope.png")
    for name in ("history.png", "envelope.png"):
        assert Path(name).read_bytes() == (run.directory / name).read_bytes()
    assert said.stderr == "" and said.stdout.startswith('{"') and said.stdout.count("\n") == 1
    assert not [path for path in run.directory.iterdir() if path.name.startswith(".")]


def test_pictures_are_drawn_only_on_request(fork):
    assert ".png" not in command("--no-pictures").stdout
    assert not list(Path("runs/fork").glob("*.png"))
    assert fvsolve.run("fork.toml", out="other", pictures=False).ok and not list(
        Path("other").glob("*.png")
    )
    before = Path("runs/fork/history.csv").stat().st_mtime_ns
    assert "history.png" in command("--resume").stdout.splitlines()[-1]
    assert Path("runs/fork/history.csv").stat().st_mtime_ns == before


@alone
def test_a_second_process_draws_and_is_gone_at_the_end(tmp_path):
    code = """
with PlotProcess(second_process=True) as painter:
    process = painter.process
    print(painter.draw(wanted), "matplotlib" in sys.modules, process.poll(), Path("two.png").stat().st_size > 5000)
print(process.poll() is None)
"""
    assert python(code, tmp_path).split("\n")[:2] == ["{} False None True", "False"]


@alone
def test_a_second_process_that_dies_loses_nothing(tmp_path):
    code = """
with PlotProcess(second_process=True) as painter:
    painter.process.kill()
    print(painter.draw(wanted), Path("one.png").stat().st_size > 5000, Path("two.png").stat().st_size > 5000)
"""
    assert python(code, tmp_path) == "{} True True\n"


@pytest.mark.parametrize("beside", [pytest.param(True, marks=alone), False])
def test_items_that_cannot_be_drawn_are_named_and_the_rest_is_drawn(tmp_path, beside):
    (tmp_path / "one.png").mkdir()
    code = f"""
with PlotProcess(second_process={beside}) as painter:
    failed = painter.draw(wanted)
print(*failed, "IsADirectoryError" in failed[Path("one.png")], Path("two.png").stat().st_size > 5000)
"""
    assert python(code, tmp_path) == "one.png True True\n"
    assert sorted(os.listdir(tmp_path)) == ["one.png", "two.png"]


@alone
def test_a_second_process_that_is_killed_while_it_writes_leaves_no_half_picture(tmp_path):
    code = """
with PlotProcess(second_process=True) as painter:
    Path(f".{painter.process.pid}-0.tmp.png").touch()
    Path(".1-0.tmp.png").touch()  # of another process
    class Broken:
        def __reduce__(self):
            raise KeyboardInterrupt
    try:
        painter.draw([*wanted[:1], Picture(Path("two.png"), "history_figure", {"t": Broken()})])
    except KeyboardInterrupt:
        print(sorted(str(path) for path in Path(".").iterdir()))
"""
    assert python(code, tmp_path) == "['.1-0.tmp.png', 'one.png']\n"


def test_an_interrupted_drawing_leaves_no_incomplete_picture(tmp_path):
    code = """
class Broken:
    def __iter__(self):
        raise KeyboardInterrupt
arguments["probes"] = Broken()
with PlotProcess(second_process=False) as painter:
    try:
        painter.draw(wanted)
    except KeyboardInterrupt:
        print(list(Path(".").iterdir()))
"""
    assert python(code, tmp_path) == "[]\n"

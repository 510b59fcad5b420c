"""Common features of studies: a path as case, progress without a terminal, and `--set` with `--method`."""

import time

import pytest

from fvsolve.cli import terminal
from fvsolve.studies import failure_map

CASE = """
schema = 1
[fluid]
name = "user"
density = 1000.0
bulk_modulus = 2.2e9
viscosity = 1e-3
vapor_pressure = 2300.0
law = "linear"
[nodes.a]
type = "tank"
area = 1.0
level = 3.0
[nodes.b]
type = "tank"
area = 1.0
level = 2.0
[links.hole]
type = "orifice"
from = "a"
to = "b"
diameter = 0.1
loss_coefficient = 2.0
[numerics]
end = 20.0
method = "euler"
step = 0.1
[output]
every = 0.5
probes = ["a.level"]
"""


@pytest.fixture
def path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / "levels.toml"
    file.write_text(CASE)
    return file


def test_a_map_takes_a_path(path):
    found = failure_map(str(path), methods=["rk4"], steps=[0.1])
    assert [one.verdict for one in found.squares] == ["stable"]


def test_without_a_terminal_a_study_says_now_and_then_where_it_is(monkeypatch, capsys):
    monkeypatch.setattr(terminal, "PROGRESS_INTERVAL", 1e-3)
    with terminal.progress_line() as progress:
        progress(3, 9, "upwind with rk4")
        latest = time.monotonic() + 5.0
        said = ""
        while not said and time.monotonic() < latest:
            time.sleep(2e-3)
            said = capsys.readouterr().err
    assert said.splitlines()[0] == "3 of 9: upwind with rk4"


def test_a_line_of_progress_is_not_repeated_unchanged(monkeypatch, capsys):
    monkeypatch.setattr(terminal, "PROGRESS_INTERVAL", 1e-3)
    with terminal.progress_line() as progress:
        for done in (3, 4):
            progress(done, 9, "rk4")
            time.sleep(0.1)
    assert capsys.readouterr().err.splitlines() == ["3 of 9: rk4", "4 of 9: rk4"]


@pytest.mark.parametrize("study", ["chart", "order", "failure-map", "stability"])
def test_a_setting_that_belongs_to_the_method_asked_for_is_read_with_it(fvs, path, study):
    own = ["--set", "numerics.rtol=1e-5", "--method", "dormand-prince"]
    columns = {"failure-map": ["--step", "0.1"], "chart": ["--rtol", "1e-4,1e-6"]}.get(study, [])
    code, _, said = fvs(study, path, *own, *columns)
    assert "rtol" not in said and code == 0, said


def test_a_setting_that_belongs_to_no_method_asked_for_is_refused(fvs, path):
    code, _, said = fvs("stability", path, "--set", "numerics.rtol=1e-5", "--method", "rk4")
    assert code == 2 and "rtol" in said

"""Linearisation, stability and response of large models, and named refusals."""

import sys

import numpy as np
import pytest
from reference.scenes import chamber, junction, lake, pipe, scene, valve

from fvsolve.cli import main
from fvsolve.errors import FvsolveError
from fvsolve.model.energy_norm import energy_form
from fvsolve.studies import operating_point
from fvsolve.studies.linearise import eigenvalues_near, linearise, poles_of
from fvsolve.studies.ports.response import response
from fvsolve.studies.stability import growth, real_runs
from fvsolve.studies.stability.stability import stability


def line(cells, probes=()):
    """Case of a lossless pipe of 600 m and 1200 m/s between a lake and a dead end."""
    numerics = {"scheme": "upwind5", "method": "rk4", "courant": 0.5}
    nodes = {"top": lake(50.0), "end": junction()}
    return scene(nodes, {"main": pipe("top", "end", 600.0, 0.5, 1200.0, cells)}, 1.0, numerics, probes)


def masses():
    """Case of two masses on a spring, without fluid."""
    nodes = {name: {"type": "mass", "mass": 10.0} for name in "ab"}
    spring = {"type": "spring", "from": "a", "to": "b", "stiffness": 1e6}
    return scene(nodes, {"s": spring}, 1.0, {"method": "rk4", "step": 1e-3})


def ran(monkeypatch, capsys, tmp_path, *arguments):
    """Standard error of a command that exits with status 2."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "argv", ["fvsolve", *arguments])
    with pytest.raises(SystemExit) as left:
        main()
    assert left.value.code == 2
    return capsys.readouterr().err


def test_of_20000_states_the_slowest_poles_and_the_outputs_are_found_soon():
    found = linearise(line(10000, ["end.pressure", "main.flow@0.5"]))
    assert found.c.shape == (2, 20000) and np.count_nonzero(found.c[0]) < 20
    values = poles_of(found.a, energy_form(found.at.model))
    exact = (2 * np.arange(1, 10) - 1) * 0.5
    assert [p["frequency"] for p in values.poles()[:9]] == pytest.approx(exact, rel=1e-6)
    assert not values.complete and "of 20000: eigenvalues nearest 0" in values.description


def test_outputs_found_by_halves_are_those_of_every_state_tried_alone(monkeypatch):
    case = line(40, ["end.pressure", "main.flow@0.37", "main.pressure@0.1"])
    found = linearise(case).c
    monkeypatch.setattr(operating_point, "visible_states", lambda at, *more: range(at.model.y_size))
    assert np.array_equal(found, linearise(case).c) and np.count_nonzero(found) > 3


def test_an_eigenvalue_that_is_too_late_is_left_out_and_said():
    found = linearise(line(900))
    e = energy_form(found.at.model).seen(found.a)
    assert eigenvalues_near(e, 1e-3, latest=0.0).size == 0


def test_what_takes_too_long_to_predict_is_refused_with_the_way_out(monkeypatch):
    monkeypatch.setattr(growth, "TIME_LIMIT", -1.0)
    with pytest.raises(FvsolveError, match="600 states and 100 steps take longer.*--set links.NAME.cells=100.*--steps"):
        stability(line(300), steps=100)


def test_what_takes_too_long_to_measure_is_left_out_and_said(monkeypatch):
    monkeypatch.setattr(real_runs, "TIME_LIMIT", -1.0)
    (row,) = stability(line(8), steps=100).rows
    assert np.isfinite(row.predicted) and np.isnan(row.measured) and "take longer" in row.left_out["measured"]


def test_runs_that_leave_the_state_where_no_linear_step_fails_are_explained():
    nodes = {"high": chamber(1e-3, 3e5), "low": chamber(1e-3, 2e5)}
    case = scene(nodes, {"hole": valve("high", "low", 1e-5)}, 1.0, {"method": "rodas-4", "step": 1.0})
    (row,) = stability(case, steps=100).rows
    assert np.isinf(row.predicted) and 0.0 < row.measured < np.inf
    assert any("leaves the linearised state" in note for note in row.notes)


def test_auto_is_the_method_it_begins_with_once_and_says_so():
    found = stability(masses(), methods=["auto", "dormand-prince"], steps=50)
    assert [row.method for row in found.rows] == ["dormand-prince"] and "rodas-5p" in found.notes[0]
    assert stability(masses(), methods=["rk4"], steps=50).notes == ()


@pytest.mark.parametrize("arguments, said", [
    (["--set", "a=1", "--at", "1", "--left-limit"], "--set, --at, --left-limit: needs a case: fvsolve stability CASE"),
    (["chamber-chain", "--cells", "4", "--courant", "1"], "--cells, --courant: not valid with a case, only without"),
    (["chamber-chain", "--method", ""], '--method "" is an empty list'),
    (["--scheme", ","], '--scheme "," is an empty list'),
])  # fmt: skip
def test_options_that_say_nothing_are_refused(arguments, said, monkeypatch, capsys, tmp_path):
    assert said in ran(monkeypatch, capsys, tmp_path, "stability", *arguments)


def test_a_folder_that_cannot_be_written_is_named(monkeypatch, capsys, tmp_path):
    (tmp_path / "taken").write_text("")
    for command in (
        ["stability", "chamber-chain"],
        ["linearise", "chamber-chain"],
        ["stability", "--scheme", "upwind"],
    ):
        assert "taken: cannot be written" in ran(monkeypatch, capsys, tmp_path, *command, "--out", "taken")


def test_a_scene_without_pressures_has_no_port():
    with pytest.raises(FvsolveError, match="has no port"):
        response(masses(), "a")


def test_a_sparse_matrix_goes_to_a_file_of_its_own_name(tmp_path):
    from fvsolve.cli.linear_commands import write_matrices

    for cells, name in ((5, "A.csv"), (501, "A-sparse.csv")):
        folder = tmp_path / str(cells)
        folder.mkdir()
        write_matrices(folder, linearise(line(cells)))
        assert [path.name for path in folder.glob("A*.csv")] == [name]


def test_a_train_too_long_for_its_energy_norm_is_refused(monkeypatch):
    from fvsolve.model import energy_norm

    monkeypatch.setattr(energy_norm, "MAX_GROUP", 1)
    with pytest.raises(FvsolveError, match="2 positions are joined by springs"):
        stability(masses(), steps=50)

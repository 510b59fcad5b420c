"""Methods with a tableau file beside the case: in a case, in a run and its directory, and in a chart."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from reference.refusals import refused

import fvsolve
from fvsolve.steppers import METHODS

TWO_TANKS = Path(fvsolve.__file__).parents[1] / "cases" / "two-tanks.toml"
SSP43 = """
0   |
1/2 | 1/2
1   | 1/2 1/2
1/2 | 1/6 1/6 1/6
----+----------------
    | 1/6 1/6 1/6 1/2
    | 1/4 1/4 1/4 1/4
"""  # Kraaijevanger 1991
HEUN_EULER = "0 |\n1 | 1\n--+----\n  | 1/2 1/2\n  | 1 0"


@pytest.fixture(autouse=True)
def forgotten():
    """Restore METHODS after a test."""
    known = dict(METHODS)
    yield
    METHODS.clear()
    METHODS.update(known)


def placed(folder, tableau=SSP43, file="ssp43.txt", method="ssp43.txt"):
    """Case file with its method file in a folder."""
    (folder / file).parent.mkdir(parents=True, exist_ok=True)
    (folder / file).write_text(tableau)
    case = folder / "tanks.toml"
    text = TWO_TANKS.read_text().replace('method = "dormand-prince"', f'method = "{method}"')
    case.write_text(text.replace("rtol = 1e-8", "rtol = 1e-6"))
    return case


def test_a_method_of_a_file_is_that_of_its_tableau(tmp_path):
    """The path is relative to the case, and the steps equal those with `tableau`."""
    run = fvsolve.run(placed(tmp_path, file="methods/ssp43.txt", method="methods/ssp43.txt"))
    METHODS.pop("ssp43")
    fvsolve.tableau("by-hand", SSP43)
    same = fvsolve.run(fvsolve.load(TWO_TANKS, {"numerics.method": "by-hand", "numerics.rtol": 1e-6}))
    assert run.ok and np.array_equal(run["low.level"], same["low.level"])


def test_the_run_directory_keeps_a_copy_and_runs_again_to_the_same_numbers(tmp_path, fvs):
    case = placed(tmp_path / "there", file="methods/ssp43.txt", method="methods/ssp43.txt")
    fvs("run", str(case), "--out", str(tmp_path / "first"))
    assert (tmp_path / "first" / "ssp43.txt").read_text() == SSP43
    assert "ssp43.txt" in json.loads((tmp_path / "first" / "summary.json").read_text())["files"]
    shutil.rmtree(tmp_path / "there")
    fvs("run", str(tmp_path / "first" / "case.toml"), "--out", str(tmp_path / "again"))
    first, again = ((tmp_path / name / "history.csv").read_bytes() for name in ("first", "again"))
    assert first == again


def test_a_file_is_named_on_the_command_line_too(tmp_path, fvs):
    case = placed(tmp_path, method="dormand-prince")
    code, said, _ = fvs("run", case, "--set", "numerics.method=ssp43.txt", "--out", tmp_path / "out")
    assert code == 0 and 'method = "ssp43.txt"' in (tmp_path / "out" / "case.toml").read_text()


@pytest.mark.parametrize(
    "file, tableau, method, said",
    [
        ("ssp43.txt", SSP43, "ssp34.txt", 'numerics.method: "ssp34.txt".*no such file.*ssp43.txt'),
        ("bad.txt", "0 | 1/2\n--+--\n | 1", "bad.txt", "numerics.method.*bad.txt.*row 1 adds up to 1/2"),
        ("rk4.txt", SSP43, "rk4.txt", 'numerics.method.*"rk4" is not free'),
    ],
)
def test_what_a_file_lacks_is_a_fault_of_the_key(tmp_path, file, tableau, method, said):
    refused(placed(tmp_path, tableau, file, method), said)


def test_two_files_of_one_name_are_not_one_method(tmp_path):
    fvsolve.load(placed(tmp_path / "one"))
    fvsolve.load(placed(tmp_path / "copy"))  # with an equal tableau
    refused(placed(tmp_path / "two", HEUN_EULER), "another method already.*rename")


@pytest.mark.parametrize("inside", [True, False])
def test_a_chart_prints_a_line_that_the_case_accepts(tmp_path, inside):
    from fvsolve.cli.app import method_name
    from fvsolve.studies.accuracy.chart import _target_setting, chart

    case = placed(tmp_path / "case", method="dormand-prince")
    file = tmp_path / ("case" if inside else "") / "methods" / "ssp43.txt"
    file.parent.mkdir()
    file.write_text(SSP43)
    made = chart(case, methods=[method_name(str(file))], rtol=[1e-3, 1e-5])
    point = next(one for one in made.points if one.setting.method == "ssp43")  # the cheapest depends on measured times
    (line,) = (one for one in _target_setting(1e-2, point, fvsolve.load(case)).toml_lines() if one.startswith("method"))
    assert line == f'method = "{"methods/ssp43.txt" if inside else file}"'
    METHODS.pop("ssp43")
    case.write_text(case.read_text().replace('method = "dormand-prince"', line))
    assert METHODS[fvsolve.load(case).numerics.method].order == 3


def test_points_are_found_again_only_by_the_same_tableau(tmp_path):
    from fvsolve.studies.result_cache import case_key

    case = fvsolve.load(placed(tmp_path, method="dormand-prince"))
    keys = []
    for tableau in (SSP43, HEUN_EULER, SSP43):
        fvsolve.tableau("mine", tableau)
        keys.append(case_key(case, {"method": "mine"}))
    assert keys[0] == keys[2] != keys[1]


def test_the_picture_of_a_method_has_its_name(tmp_path, fvs, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("ssp43.txt").write_text(SSP43)
    fvs("methods", "ssp43.txt")
    assert Path("ssp43.png").is_file() and not Path("ssp43.txt.png").exists()

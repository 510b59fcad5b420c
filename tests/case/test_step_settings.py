"""Steps that are not possible are refused with the possible settings: in the file, by --set and in integrate.

Methods with a tableau file beside the case: in a case, in a run and its directory, and in a chart.
"""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from reference.refusals import refused
from reference.scenes import chamber, lake, pipe, scene, tank, valve

import fvsolve
from fvsolve import build, load
from fvsolve.case.text import write
from fvsolve.core.steppers import METHODS, integrate
from fvsolve.errors import FvsolveError

ABLE = list(dict.fromkeys(method.name for method in METHODS.values() if method.adaptive))


def piped(**numerics) -> dict:
    nodes = {"lake": lake(10.0), "surge": tank(2.0, 12.0)}
    return scene(nodes, {"main": pipe("lake", "surge", 200.0, 0.4, 1000.0, 20)}, 1.0, numerics)


def cellless(**numerics) -> dict:
    return scene(
        {"lake": lake(10.0), "surge": tank(2.0, 12.0)},
        {"tap": valve("lake", "surge", 0.01)},
        1.0,
        numerics,
    )


FAULTS = {
    "no such method": (
        piped(method="radau5"),
        'numerics.method: no method named "radau5"; did you mean "',
    ),
    "misspelt": (piped(method="esdirk4"), 'no method named "esdirk4"; did you mean "esdirk-4"?'),
    "auto misspelt": (piped(method="atuo"), 'no method named "atuo"; did you mean "auto"?'),
    "no error estimate": (
        piped(method="gauss-4", rtol=1e-6),
        'method "gauss-4" estimates no error; use ',
    ),
    "no estimate by default": (
        cellless(method="gauss-4"),
        'numerics.method: method "gauss-4" estimates no error; use',
    ),
    "rtol below rounding": (
        piped(method="radau-iia-5", rtol=1e-14),
        "numerics.rtol: 1e-14 is below rounding errors; expected",
    ),
    "rtol of no kind": (piped(method="radau-iia-5", rtol="small"), "numerics.rtol"),
    "step that moves nothing": (
        piped(method="gauss-4", step=1e-17),
        "numerics.step: 1e-17 s is below the rounding error of the time",
    ),
    "step of no time": (piped(method="gauss-4", step="1 m"), "numerics.step"),
    "step of zero": (piped(method="gauss-4", step=0.0), "numerics.step"),
    "courant of zero": (piped(method="gauss-4", courant=0.0), "numerics.courant"),
    "courant of text": (piped(method="gauss-4", courant="fast"), "numerics.courant"),
    "courant without cells": (
        cellless(method="gauss-4", courant=20.0),
        "needs cells, and the case has no pipe or basin",
    ),
    "auto by courant": (
        piped(method="auto", courant=0.9),
        'method "auto" controls the error of its steps; give `rtol`',
    ),
    "auto by step": (
        piped(method="auto", step=1e-3),
        'method "auto" controls the error of its steps; give `rtol`',
    ),
    "two settings": (
        piped(method="radau-iia-5", rtol=1e-6, courant=2.0),
        "courant and rtol are given; keep one",
    ),
    "no such algebra": (piped(method="gauss-4", linear_algebra="bandid"), 'did you mean "banded"?'),
}


@pytest.mark.parametrize("case, wanted", FAULTS.values(), ids=FAULTS)
def test_the_file_is_refused(case, wanted):
    assert wanted in str(refused(case))


def test_error_control_by_a_method_without_it_names_methods_with_it():
    error = refused(piped(method="trapezoid", rtol=1e-6))
    assert all(f'"{name}"' in str(error) for name in ABLE)
    with pytest.raises(FvsolveError) as said:
        integrate(lambda t, y: -y, [1.0], [0.0, 1.0], "trapezoid")
    assert all(name in str(said.value) for name in ABLE)


INTEGRATE = {
    "misspelt": (
        dict(method="radau-iia5"),
        'no method named "radau-iia5"; did you mean "radau-iia-5"',
    ),
    "below rounding": (
        dict(method="radau-iia-5", rtol=1e-14),
        "rtol = 1e-14 is below rounding errors; expected 1e-13 or more",
    ),
    "moves nothing": (
        dict(method="gauss-4", step=1e-17),
        "step = 1e-17 is too small to change the time; expected more",
    ),
    "neither": (dict(method="gauss-4"), "gauss-4 has no error estimate; give step, or one of"),
    "rtol without an estimate": (
        dict(method="gauss-4", rtol=1e-6),
        "gauss-4 has no error estimate",
    ),
    "both": (
        dict(method="radau-iia-5", rtol=1e-6, step=0.1),
        "rtol and step both set the step; give only one",
    ),
    "negative": (dict(method="radau-iia-5", rtol=-1e-6), "rtol = -1e-06 is not a positive number"),
    "infinite": (
        dict(method="radau-iia-5", step=float("inf")),
        "step = inf is not a positive number",
    ),
    "text": (dict(rtol="1e-6"), "rtol = '1e-6' is not a positive number"),
    "auto by steps": (dict(method="auto", step=0.1), 'method "auto" uses error control; give rtol'),
    "negative atol": (
        dict(atol=-1.0),
        "atol = -1.0 is not valid; expected a positive number, or a row",
    ),
    "atol of another length": (
        dict(atol=[1e-6, 1e-6]),
        "positive numbers with the length of y0, 1",
    ),
}


@pytest.mark.parametrize("settings, wanted", INTEGRATE.values(), ids=INTEGRATE)
def test_integrate_refuses_it(settings, wanted):
    with pytest.raises(FvsolveError) as caught:
        integrate(lambda t, y: -y, [1.0], [0.0, 1.0], **settings)
    assert wanted in str(caught.value)


WRONG = {
    "too few": (lambda t, y: np.array([y[1]]), [1.0, 0.0], "f(t, y) gives 1 rates for 2 states"),
    "too many": (
        lambda t, y: np.array([y[1], y[0], 0.0]),
        [1.0, 0.0],
        "f(t, y) gives 3 rates for 2 states",
    ),
    "nothing": (lambda t, y: None, [1.0], "f(t, y) gives 0 rates for 1 states"),
    "no function": (5, [1.0], "f = 5 cannot be called"),
    "no numbers": (lambda t, y: -y, ["a"], "y0 = ['a'] is not valid; expected real numbers"),
}


@pytest.mark.parametrize("f, y0, wanted", WRONG.values(), ids=WRONG)
def test_integrate_refuses_invalid_equations(f, y0, wanted):
    with pytest.raises(FvsolveError) as caught:
        integrate(f, y0, [0.0, 1.0])
    assert wanted in str(caught.value)


@pytest.mark.parametrize("name", ["rk4", "gauss-2", "rodas-5p", "auto", "", " spaced "])
def test_no_tableau_takes_the_place_of_a_method_that_is_there(name):
    with pytest.raises(FvsolveError, match="is not free" if name else "expected a name"):
        fvsolve.tableau(name, "0 |\n--+--\n | 1")
    assert name not in METHODS or METHODS[name].order > 1


@pytest.mark.parametrize(
    "numerics, found",
    [
        ({}, ("rk4", "courant", 0.9)),
        ({"rtol": 1e-5}, ("auto", "rtol", 1e-5)),
        ({"method": "radau-iia-5"}, ("radau-iia-5", "rtol", 1e-6)),
        ({"method": "gauss-4"}, ("gauss-4", "courant", 0.9)),
        ({"method": "auto"}, ("auto", "rtol", 1e-6)),
        ({"method": "dormand-prince"}, ("dormand-prince", "courant", 0.9)),
    ],
)
def test_settings_left_out_get_defaults(numerics, found):
    filled = fvsolve.load(piped(**numerics)).numerics
    assert (filled.method, getattr(filled, found[1])) == (found[0], found[2])


def joined(volume: float, **numerics) -> dict:
    """Case of a basin of liquid joined to a chamber by a valve, with flow at the start."""
    pool = {
        "type": "basin",
        "size": [4.0, 2.0],
        "cells": [16, 8],
        "physics": "liquid",
        "pressure": 2e6,
        "thickness": 0.1,
        "patches": {"out": {"side": "east"}},
    }
    nodes = {"pool": pool, "pot": chamber(volume, 1e6)}
    return scene(
        nodes, {"gate": valve("pool.out", "pot", 1e-4)}, 0.02, numerics, ["pot.pressure"], 1e-3
    )


def test_check_states_the_cost_of_explicit_steps_and_not_of_the_remedy(tmp_path, fvs):
    file = tmp_path / "joined.toml"
    file.write_text(write(joined(1e-6)))
    code, out, _ = fvs("check", file, "--json")
    (said,) = [one for one in json.loads(out)["warnings"] if one["kind"] == "cost"]
    assert (
        code == 0
        and said["value"] > 20_000
        and said["value"] > 10 * said["limit"]
        and "links.gate" in said["text"]
    )
    assert 'method = "auto" or "rodas-5p" with rtol = 1e-6' in said["text"]
    for method in ("auto", "rodas-5p"):
        remedy = {"numerics.method": method, "numerics.rtol": 1e-6}
        settings = [f"--set={key}={value}" for key, value in remedy.items()]
        _, out, _ = fvs("check", file, "--json", *settings)
        assert not [one for one in json.loads(out)["warnings"] if one["kind"] == "cost"]


@pytest.mark.parametrize(
    "given", [{"method": "rk4", "courant": 0.8}, {"method": "dormand-prince", "rtol": 1e-6}]
)
def test_the_cost_is_stated_for_all_explicit_control_and_not_where_waves_limit_the_step(given):
    def cost_notices(volume):
        return [
            one
            for one in build(load(joined(volume, **given))).checks["warnings"]
            if one["kind"] == "cost"
        ]

    assert cost_notices(1e-6) and not cost_notices(1.0)


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
    same = fvsolve.run(
        fvsolve.load(TWO_TANKS, {"numerics.method": "by-hand", "numerics.rtol": 1e-6})
    )
    assert run.ok and np.array_equal(run["low.level"], same["low.level"])


def test_the_run_directory_stores_a_copy_that_runs_again_to_the_same_numbers(tmp_path, fvs):
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
    code, said, _ = fvs(
        "run", case, "--set", "numerics.method=ssp43.txt", "--out", tmp_path / "out"
    )
    assert code == 0 and 'method = "ssp43.txt"' in (tmp_path / "out" / "case.toml").read_text()


@pytest.mark.parametrize(
    "file, tableau, method, said",
    [
        ("ssp43.txt", SSP43, "ssp34.txt", 'numerics.method: "ssp34.txt".*no such file.*ssp43.txt'),
        (
            "bad.txt",
            "0 | 1/2\n--+--\n | 1",
            "bad.txt",
            "numerics.method.*bad.txt.*row 1 adds up to 1/2",
        ),
        ("rk4.txt", SSP43, "rk4.txt", 'numerics.method.*"rk4" is not free'),
    ],
)
def test_missing_entries_of_a_file_are_a_fault_of_the_key(tmp_path, file, tableau, method, said):
    refused(placed(tmp_path, tableau, file, method), said)


def test_two_files_of_equal_names_are_different_methods(tmp_path):
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
    # the cheapest depends on measured times
    point = next(one for one in made.points if one.setting.method == "ssp43")
    (line,) = (
        one
        for one in _target_setting(1e-2, point, fvsolve.load(case)).toml_lines()
        if one.startswith("method")
    )
    assert line == f'method = "{"methods/ssp43.txt" if inside else file}"'
    METHODS.pop("ssp43")
    case.write_text(case.read_text().replace('method = "dormand-prince"', line))
    assert METHODS[fvsolve.load(case).numerics.method].order == 3


def test_stored_points_are_reused_only_for_the_same_tableau(tmp_path):
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


def test_keys_of_a_part_that_settings_add_replace_their_alternatives():
    """The type of the part is in no table of the file."""
    nodes = {
        "lake": {"type": "reservoir", "head": 20.0},
        "low": {"type": "reservoir", "head": 10.0},
    }
    main = {
        "type": "pipe",
        "from": "lake",
        "to": "low",
        "length": 100.0,
        "diameter": 0.1,
        "wave_speed": 1000.0,
    }
    case = {
        "schema": 1,
        "fluid": {"name": "Water"},
        "nodes": nodes,
        "links": {"main": main},
        "numerics": {"end": 1.0},
    }
    added = {"type": "orifice", "from": "lake", "to": "low", "diameter": 0.1}
    loaded = fvsolve.load(case, {"links.bypass": added, "links.bypass.area": 0.002})
    assert loaded.links["bypass"].area == 0.002 and "diameter" not in loaded.raw["links"]["bypass"]

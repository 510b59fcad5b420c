"""Observed orders of schemes and methods equal the theory, and `fvsolve order` prints and explains them."""

import csv
import json

import pytest
from pytest import approx
from reference import pulses, scenes
from reference.order_json import call, studies

from fvsolve.studies import order
from fvsolve.studies.outcome import has_diverged

SPACE = {
    "upwind": 1,
    "linear-upwind": 2,
    "fromm": 2,
    "central": 2,
    "upwind3": 3,
    "upwind5": 5,
    "muscl": 2,
    "weno5": 5,
}


@pytest.mark.parametrize(("scheme", "p"), SPACE.items())
def test_every_scheme_shows_its_order_against_the_exact_solution(scheme, p):
    cells = {1: 160, 5: 40}.get(p, 80)
    case = pulses.case(points=pulses.FINE if p == 5 else pulses.FEW)
    found = order(case, schemes=scheme, cells=cells, levels=4).plain()
    assert found["reference"]["kind"] == "exact" and found["scheme"] == scheme
    for variable in ("pressure", "flow"):
        fit = found["fits"][variable]["L1"]
        assert abs(fit["order"] - p) <= max(fit["spread"], 0.05), (variable, fit)
        assert fit["order"] == approx(p, abs=0.2), (variable, fit)


TIME = {
    "euler": 1,
    "ssp-rk2": 2,
    "ssp-rk3": 3,
    "rk4": 4,
    "implicit-euler": 1,
    "trapezoid": 2,
    "gauss-4": 4,
}


@pytest.mark.parametrize(("method", "p"), TIME.items())
def test_every_method_shows_its_order_in_time_on_a_single_grid(method, p):
    points = pulses.FINE if p == 4 else pulses.FEW
    case, levels = pulses.case(20, courant=0.4, points=points), 6 if p == 1 else 4
    found = order(case, methods=method, refine="time", levels=levels).plain()
    # exact only if both are refined
    assert found["reference"]["kind"] == "finer" and found["measure"] == "step [s]"
    fit = found["fits"]["pressure"]["L2"]
    assert fit["order"] == approx(p, abs=0.15) and abs(fit["order"] - p) <= max(fit["spread"], 0.05)
    assert [row["cells"] for row in found["rows"]] == [20] * levels
    steps = [row["step"] for row in found["rows"]]
    assert [a / b for a, b in zip(steps, steps[1:], strict=False)] == approx([2.0] * (levels - 1))


@pytest.mark.parametrize(
    ("scheme", "p"), [("upwind", 1), ("upwind3", 3), ("upwind5", 5), ("weno5", 5)]
)
def test_a_front_shows_p_over_p_plus_1_and_is_called_a_front(scheme, p, capsys, tmp_path):
    [found] = studies(capsys, tmp_path, pulses.front(), "--scheme", scheme, "--levels", "5")
    fits = found["fits"]["pressure"]
    assert fits["L1"]["order"] == approx(p / (p + 1), abs=0.05)
    assert fits["L2"]["order"] == approx(0.5 * p / (p + 1), abs=0.05)
    assert fits["max"]["order"] is None and "hardly fall" in fits["max"]["reason"]
    assert any("fronts" in note and f"{p / (p + 1):.2g} in L1" in note for note in found["notes"])


def test_a_kink_shows_twice_that_and_is_called_a_kink(capsys, tmp_path):
    case = pulses.front(scheme="upwind5")
    case["nodes"]["gate"] = scenes.junction(scenes.ramp(0.02, 0.02, 0.05, 0.0))
    [found] = studies(capsys, tmp_path, case, "--levels", "6")
    assert found["fits"]["pressure"]["L1"]["order"] == approx(10 / 6, abs=0.1)
    # clear only on fine cells
    assert found["fits"]["pressure"]["max"]["order"] == approx(5 / 6, abs=0.2)
    assert any("kinks" in note for note in found["notes"])


def test_a_single_pipe_or_key_can_be_refined_alone():
    found = order("smooth-stop", levels=2, key="links.lower.cells").plain()
    assert [row["cells"] for row in found["rows"]] == [74, 94]
    assert order("smooth-stop", levels=2, key="numerics.courant").plain()["refine"] == "time"


def test_cell_time_is_a_resolution_of_the_pipes_that_state_no_cells(capsys, tmp_path):
    words = (
        "three-way-junction",
        "--out",
        str(tmp_path),
        "--json",
        "--levels",
        "2",
        "--key",
        "numerics.cell_time",
    )
    code, out, _ = call(
        capsys, *words, "--set", "numerics.cell_time=0.02", "--set", "links.lower.cells=7"
    )
    rows = json.loads(out)["studies"][0]["rows"]
    cells = [
        [row["set"][f"links.{name}.cells"] for name in ("supply", "branch", "lower")]
        for row in rows
    ]
    assert code == 0 and cells == [[20, 16, 7], [40, 32, 7]]
    code, _, err = call(capsys, "gradual-closure", "--key", "numerics.cell_time")
    assert code == 2 and "is not a resolution of this case" in err


def test_settings_that_leave_no_exact_solution_are_named(capsys, tmp_path):
    case = pulses.case(points=pulses.FEW)
    words = ("--set", "links.main.minor_loss=2", "--levels", "3", "--scheme", "upwind3")
    [found] = studies(capsys, tmp_path, case, *words)
    assert found["reference"]["kind"] == "finer" and any(
        "[exact]" in note for note in found["notes"]
    )


@pytest.mark.parametrize(
    "key", ["links.main.diameter", "links.mian.cells", "output.every", "numerics.end"]
)
def test_an_invalid_resolution_is_refused_with_the_valid_ones(key, capsys):
    code, out, err = call(capsys, "gradual-closure", "--key", key)
    assert code == 2 and not out
    for one in ("links.main.cells", "numerics.step", "numerics.rtol", "numerics.courant"):
        assert one in err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["gradual-closure", "--refine", "tiem"], 'did you mean "time"'),
        (["gradual-closure", "--levels", "1"], "at least 2"),
        (["gradual-closure", "--levels", "20"], "fewer levels"),
        (["gradual-closure", "--scheme", "upwnd5"], 'did you mean "upwind5"'),
        (["gradual-closure", "--method", "rk5"], "numerics.method"),
        (["gradual-closure", "--scheme", " ,"], "--scheme"),
        (["gradual-closure", "--method", ""], "--method"),
        (["gradual-closure", "--reference", "richardsen"], 'did you mean "richardson"'),
        (["gradual-closure", "--method", "rk4", "--key", "numerics.rtol"], "estimates no error"),
        (["valve-closure", "--reference", "exact"], "names no solution"),
        (["tank-draining", "--refine", "space"], "no pipe"),
        (["tank-draining", "--key", "links.main.cells"], "numerics.rtol"),
    ],
)
def test_impossible_requests_are_refused_by_name(words, told, capsys, tmp_path):
    code, out, err = call(capsys, *words, "--out", str(tmp_path))
    assert code == 2 and not out and told in err


def test_the_table_picture_and_sheet_agree(capsys, tmp_path):
    words = ("smooth-stop", "--levels", "3", "--out", str(tmp_path))
    code, shown, _ = call(capsys, *words)
    assert code == 0 and 'exact solution "rays"' in shown and "fitted order of" in shown
    code, out, _ = call(capsys, *words, "--json")
    told = json.loads(out)
    assert told["reused"] == 4  # three rows and the check of the reference
    [found] = told["studies"]
    for row in found["rows"]:
        assert f"{row['errors']['pressure']['L1']:.4g}" in shown
    fit = found["fits"]["pressure"]["L1"]
    assert f"{fit['order']:.2f} ± {fit['spread']:.2f}" in shown
    with open(tmp_path / "order.csv", encoding="utf-8") as file:
        sheet = [
            row
            for row in csv.DictReader(file)
            if row["variable"] == "pressure" and row["norm"] == "L1"
        ]
    assert [float(row["error"]) for row in sheet] == [
        row["errors"]["pressure"]["L1"] for row in found["rows"]
    ]
    assert {float(row["fitted order"]) for row in sheet} == {fit["order"]}
    assert (tmp_path / "order.png").read_bytes()[:4] == b"\x89PNG"


def test_too_few_rows_give_no_number(capsys, tmp_path):
    [found] = studies(capsys, tmp_path, pulses.case(points=pulses.FEW), "--levels", "2")
    for fits in found["fits"].values():
        assert all(fit["order"] is None and fit["reason"] for fit in fits.values())


def test_a_failed_row_is_a_row_with_its_reason(capsys, tmp_path):
    case = pulses.case(20, method="rk4", step=0.02)
    words = ("--refine", "time", "--levels", "5", "--set", "numerics.end=4")
    [found] = studies(capsys, tmp_path, case, *words)
    assert (
        has_diverged(found["rows"][0]["reason"])
        and found["fits"]["pressure"]["L1"]["marks"][0] == "failed"
    )
    assert found["fits"]["pressure"]["L2"]["order"] == approx(4, abs=0.3)
    assert any("failed" in note for note in found["notes"])


def test_a_name_given_twice_is_studied_once(capsys, tmp_path):
    found = studies(
        capsys,
        tmp_path,
        pulses.case(points=pulses.FEW),
        "--method",
        "rk4,rk4, rk4",
        "--levels",
        "2",
    )
    assert [one["method"] for one in found] == ["rk4"]

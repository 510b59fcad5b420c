"""`fvsolve methods`: table, JSON, a single method with its picture, and errors."""

import json
import math
import re

import pytest
from reference import folders

from fvsolve.core.steppers import METHODS, Facts, analyse

DOCS = folders.page("choosing-a-method")
NAMES = [name for name, method in METHODS.items() if name == method.name]
ASKED = {
    "order",
    "stage_order",
    "stages",
    "explicit",
    "a_stable",
    "l_stable",
    "real_interval",
    "imaginary_interval",
    "ssp_radius",
    "pade",
    "numerator",
    "denominator",
}


@pytest.fixture
def command_in_folder(fvs, monkeypatch, tmp_path):
    """Function that runs a command in an empty folder: (exit code, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)
    return fvs


def test_the_table_names_every_method(command_in_folder):
    code, out, _ = command_in_folder("methods")
    lines = out.splitlines()
    assert code == 0 and lines[0].split()[:3] == ["method", "order", "error"]
    assert [
        name for name in METHODS if not any(line.startswith(f"{name} ") for line in lines)
    ] == []


def test_json_is_a_single_object_with_every_method_and_null_for_infinity(command_in_folder):
    code, out, err = command_in_folder("methods", "--json")
    found = json.loads(out)
    assert code == 0 and err == "" and list(found) == list(METHODS)
    assert all(one.keys() >= ASKED for one in found.values())
    assert all(
        one["denominator"][0] == 1.0 and one["numerator"][0] == 1.0 for one in found.values()
    )
    assert found["radau-iia-5"]["real_interval"] is found["implicit-euler"]["ssp_radius"] is None
    assert found["radau-iia-5"]["pade"] == [2, 3] and found["alexander-2"]["pade"] is None
    assert found["rk4"]["real_interval"] == pytest.approx(2.785293563405282, rel=1e-13)


def test_a_single_method_is_shown_with_tableau_r_and_picture(command_in_folder, tmp_path):
    code, out, _ = command_in_folder("methods", "radau-iia-5")
    assert code == 0 and (tmp_path / "radau-iia-5.png").read_bytes().startswith(b"\x89PNG")
    assert "R(s) = (1 + 2/5 s + 1/20 s^2) / (1 - 3/5 s + 3/20 s^2 - 1/60 s^3)" in out
    assert "(4-sqrt(6))/10 | (88-7sqrt(6))/360" in out and "A-stable: yes; L-stable: yes" in out


def test_the_picture_goes_to_the_stated_place(command_in_folder, tmp_path):
    code, out, _ = command_in_folder("methods", "alexander-3", "--out", "pictures/a.png", "--json")
    found = json.loads(out)
    assert (
        code == 0
        and (tmp_path / "pictures" / "a.png").exists()
        and found["picture"] == "pictures/a.png"
    )
    assert found["a"][0][0] == pytest.approx(0.435866521508459) and len(found["numerator"]) == 3


@pytest.mark.parametrize("name", ["verner-7", "crouzeix-4", "esdirk-5", "rodas-4", "euler"])
def test_long_and_short_tableaux_are_both_shown(command_in_folder, name):
    code, out, _ = command_in_folder("methods", name)
    assert code == 0 and out.startswith(name) and re.search(r"^R\(s\) = ", out, re.MULTILINE)


def test_a_name_that_no_method_has(command_in_folder, tmp_path):
    code, out, err = command_in_folder("methods", "radau-iia-50")
    assert (code, out) == (
        2,
        "",
    ) and 'no method named "radau-iia-50"; did you mean "radau-iia-5"?' in err
    assert not list(tmp_path.iterdir())


def test_a_picture_of_all_methods_is_refused(command_in_folder):
    code, _, err = command_in_folder("methods", "--out", "all.png")
    assert code == 2 and "; add the NAME" in err


def test_a_picture_of_an_unknown_kind_is_refused(command_in_folder):
    code, _, err = command_in_folder("methods", "rk4", "--out", "rk4.xyz")
    assert code == 2 and "rk4.xyz" in err and ".png" in err


@pytest.mark.parametrize("name", NAMES)
def test_the_page_and_the_program_print_the_same(name):
    one = analyse(name)
    pade = f"{one.pade[0]}/{one.pade[1]}" if one.pade else "-"
    row = [
        f"`{name}`",
        one.order,
        one.error_order or "-",
        one.stage_order,
        one.stages,
        one.kind,
        stable(one),
        *map(cell, (one.real_interval, one.imaginary_interval, one.ssp_radius)),
        pade,
        one.source,
    ]
    assert f"| {' | '.join(map(str, row))} |" in DOCS.splitlines()


def stable(one: Facts) -> str:
    return "L" if one.l_stable else "A" if one.a_stable else "-"


def cell(value: float) -> str:
    return "∞" if math.isinf(value) else f"{value:.5g}"


@pytest.mark.usefixtures("own_limiters_removed")
def test_the_page_has_no_other_rows_and_its_examples_run():
    rows = re.findall(r"^\| `([\w-]+)` \| \d", DOCS, re.MULTILINE)
    assert rows == NAMES
    found = {}
    for example in re.findall(r"```python\n(.*?)```", DOCS, re.DOTALL):
        exec(example, found)
    assert found["seen"] == pytest.approx(137.3, abs=0.05)


@pytest.mark.filterwarnings("ignore:short-decimals")
def test_a_tableau_of_few_digits_is_printed_with_its_order_with_exact_numbers(fvs, tmp_path):
    path = tmp_path / "short-decimals.txt"
    path.write_text("0 |\n0.3333 | 0.3333\n0.6667 | 0 0.6667\n--+--\n | 0.25 0 0.75\n")
    code, out, _ = fvs("methods", path, "--out", tmp_path / "region.png")
    assert code == 0 and "order 1, no error estimate" in out
    assert "with exact numbers in place of decimals of 4 digits it has order 3" in out
    data = json.loads(fvs("methods", path, "--out", tmp_path / "region.png", "--json")[1])
    assert (data["order"], data["rounded_order"]) == (1, 3)

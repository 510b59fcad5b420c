"""`fvsolve parts`: overview, types, names of practice, several meanings, unknown words."""

import json
import subprocess
import sys
import tomllib

import fvsolve
from fvsolve.parts import KINDS


def test_without_a_word_all_types_are_listed_with_a_sentence(fvs):
    code, out, err = fvs("parts")
    lines = [line.split() for line in out.splitlines() if line.startswith("  ")]
    assert (
        code == 0 and err == "" and {*KINDS["nodes"], *KINDS["links"]} <= {row[0] for row in lines}
    )
    assert all(len(row) > 2 and row[-1].endswith(".") for row in lines)


def test_a_type_has_its_keys_with_units_required_keys_first_and_an_example(fvs):
    code, out, _ = fvs("parts", "relief-valve")
    rows = [line.split() for line in out.splitlines()]
    keys = [
        row[0]
        for row in rows
        if row and row[0] in fvsolve.parts.KINDS["links"]["relief-valve"].values()
    ]
    assert code == 0 and keys[:4] == ["from", "to", "set_pressure", "overpressure"]
    assert ["set_pressure", "Pa", "required"] in [row[:3] for row in rows]
    assert "[links.relief]" in out and "inlet (junction), downstream (reservoir)" in out


def test_a_name_of_practice_explains_its_composition(fvs):
    code, out, _ = fvs("parts", "one-way tank")
    assert code == 0 and "tank (under [nodes]) and check-valve (under [links])" in out
    assert "[nodes.feed_tank]" in out and "also named one-way surge tank, feed tank" in out


def test_a_word_with_two_meanings_lists_them_and_an_unknown_word_gives_the_nearest(fvs):
    code, out, _ = fvs("parts", "psv")
    assert code == 0 and "relief-valve" in out and "pressure-sustaining" in out
    code, out, err = fvs("parts", "snadpipe")
    assert code == 2 and out == "" and 'unknown part "snadpipe"; did you mean "standpipe"?' in err
    code, _, err = fvs("parts", "qqqqqq")
    assert code == 2 and "fvsolve parts lists all types" in err


def test_json_has_entries_with_keys_and_a_complete_case(fvs):
    entry = json.loads(fvs("parts", "orifice plate", "--json")[1])["entries"][0]
    assert entry["parts"] == ["orifice"] and entry["keys"]["orifice"][0]["default"] == "required"
    assert "plate" in fvsolve.load(tomllib.loads(entry["scene"])).links
    assert {*json.loads(fvs("parts", "--json")[1])} >= {*KINDS["nodes"], *KINDS["links"]}


def test_a_case_without_a_fault_does_not_import_the_names():
    text = """
import sys, fvsolve
fvsolve.load("two-tanks")
sys.exit("fvsolve.case.part_names" in sys.modules)
"""
    assert subprocess.run([sys.executable, "-c", text]).returncode == 0

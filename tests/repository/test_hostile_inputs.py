"""Hostile and unlucky inputs are cases or faults: no other error, at most 5 s and 1 GB, a message of bounded length.

The quick tests draw 300 inputs; `python tests/try_hostile_inputs.py --seed 1 --count 10000` draws more.
"""

import copy
import os
import random
import tomllib
from pathlib import Path

import numpy as np
import pytest
from reference import hostile_inputs
from try_hostile_inputs import MESSAGE, SECONDS, drawn, harm

import fvsolve
from fvsolve.case.load import KEYS
from fvsolve.case.reading import Raw
from fvsolve.case.text import find_long_key
from fvsolve.errors import MOST_FAULTS, CaseError, Fault
from fvsolve.parts import KINDS

SEED = int(os.environ.get("FVSOLVE_HOSTILE_SEED", "59"))
DRAWN, GROUPS = 300, 20


@pytest.mark.parametrize("group", range(GROUPS))
def test_drawn_inputs_do_no_harm(group, tmp_path):
    inputs = drawn(SEED, DRAWN)
    assert len(inputs) == DRAWN
    for item in inputs[group::GROUPS]:
        _, fault = harm(item, tmp_path)
        assert not fault, f"{item.name}: {fault}"


LONG = [
    "dots of a key",
    "quoted dots of a key",
    "dots of a header",
    "dots of an inline key",
    "unknown keys",
    "unknown parts",
    "blanks of a claim",
    "blanks after a claim",
    "blanks of a probe",
    "blanks of a unit",
    "brackets",
    "digits",
    "digits in quotes",
    "empty lines",
    "formula",
    "parentheses",
    "signals",
    "scalars",
    "limits",
    "parts",
    "claims",
]


@pytest.mark.parametrize("name", LONG)
def test_long_texts_do_no_harm(name, tmp_path):
    for size in (20_000, 100_000):
        _, fault = harm(hostile_inputs.repeated(name, size, before=False), tmp_path)
        assert not fault, f"{name} {size}: {fault}"


def test_a_message_lists_fifty_faults_and_counts_the_others(tmp_path):
    (tmp_path / "case.toml").write_text(
        hostile_inputs.SCENE + "".join(f"k{n} = 1\n" for n in range(100_000))
    )
    with pytest.raises(CaseError) as error:
        fvsolve.load(tmp_path / "case.toml")
    lines = str(error.value).splitlines()
    assert lines[0] == "case.toml: 100000 faults" and len(lines) == 2 + MOST_FAULTS
    assert (
        lines[1].startswith("  line 29: numerics.k0: unknown key; keys are")
        and lines[-1] == "  and 99950 further faults"
    )
    (tmp_path / "case.toml").write_text(
        hostile_inputs.SCENE + "".join(f"k{n} = 1\n" for n in range(MOST_FAULTS))
    )
    with pytest.raises(CaseError) as error:
        fvsolve.load(tmp_path / "case.toml")
    assert len(str(error.value).splitlines()) == 1 + MOST_FAULTS


@pytest.mark.parametrize("text, line", [
    ("a = 1\n" + "b." * 40 + "c = 1", 2), ("[" + "b." * 40 + "c]", 1), ("x = { " + "b . " * 40 + "c = 1 }", 1),
    ('"a.b"' + '."a,=".b' * 20 + " = 1", 1), ("# " + "a." * 100 + "\n" + "'b'." * 40 + "c = 1", 2),
    ("a = 1\n" + "b." * 39 + "c = 1", None), ("# " + "a." * 100, None), ("t = '" + "a." * 100 + "'", None),
    ('t = """\n' + "a." * 100 + '\n"""', None), ("x = [" + "1.5, " * 100 + "]", None), ('t = "a' + ".b" * 100, None),
    ('t = "\\"' + ".b" * 100 + '"', None), ("t = '''" + ".b" * 100 + "''''", None), ("", None),
])  # fmt: skip
def test_long_keys_are_detected_before_the_text_is_parsed(text, line):
    assert find_long_key(text, 40) == line


@pytest.mark.parametrize("key, value", [
    ("links.main.length", 5e-324), ("links.main.diameter", 1e-300), ("links.main.diameter", 1e300),
    ("links.valve.area", "1e-300 m2"), ("fluid.density", 1e-200), ("numerics.end", 1e-300),
    ("links.main.friction", {"model": "hazen-williams", "coefficient": 1e-300}),
])  # fmt: skip
def test_impossible_numbers_are_refused_by_name(key, value, tmp_path):
    (tmp_path / "case.toml").write_text(hostile_inputs.SCENE)
    with pytest.raises(
        CaseError, match="has a magnitude (below 1e-30|above 1e\\+30) in SI units"
    ) as error:
        fvsolve.load(tmp_path / "case.toml", set={key: value})
    assert error.value.faults[0].place.startswith(key)


def test_long_overrides_are_refused(tmp_path):
    (tmp_path / "case.toml").write_text(hostile_inputs.SCENE)
    with pytest.raises(CaseError, match="has more than 40 names"):
        fvsolve.load(tmp_path / "case.toml", set={"a." * 20_000 + "a": 1})
    with pytest.raises(CaseError, match="links.main.length"):
        fvsolve.load(
            tmp_path / "case.toml", set={"links.main.length": "{ " + "a." * 20_000 + "a = 1 }"}
        )


def test_zero_and_rounding_errors_are_numbers(tmp_path):
    (tmp_path / "case.toml").write_text(hostile_inputs.SCENE)
    for value in (0.0, -0.0, 5.6e-17, "-1e-16 m"):
        assert fvsolve.load(
            tmp_path / "case.toml", set={"nodes.gate.elevation": value, "nodes.out.elevation": 0}
        )


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes in folders")
def test_devices_and_large_files_are_refused(tmp_path):
    with pytest.raises(CaseError, match="has more than 20 MB"):
        fvsolve.load("/dev/zero")
    (tmp_path / "case.toml").write_text(hostile_inputs.SCENE)
    os.mkfifo(tmp_path / "pipe.csv")  # a process that opens it would wait for ever
    for name in ("/dev/zero", "/dev/stdin", ".", "pipe.csv"):
        with pytest.raises(CaseError, match="there is no such file|is a directory"):
            fvsolve.load(tmp_path / "case.toml", set={"links.valve.opening": {"file": name}})


def test_the_judge_sees_an_error_a_long_time_and_much_memory(tmp_path, monkeypatch):
    item = hostile_inputs.repeated("unknown keys", 1000, before=False)

    def fail(*_):
        raise ZeroDivisionError("planted")

    def allocate(*_):
        kept = np.ones(2 * 10**7)
        raise CaseError([Fault("", f"{kept.sum()}")])

    monkeypatch.setattr(fvsolve, "load", fail)
    assert "ZeroDivisionError: planted" in harm(item, tmp_path)[1]
    monkeypatch.setattr(fvsolve, "load", allocate)
    assert harm(item, tmp_path)[1] == ""
    monkeypatch.setattr("try_hostile_inputs.SECONDS", 1e-9)
    assert harm(item, tmp_path)[1].endswith(" s")
    monkeypatch.setattr("try_hostile_inputs.SECONDS", SECONDS)
    monkeypatch.setattr("try_hostile_inputs.MESSAGE", 10)
    assert harm(item, tmp_path)[1].startswith("message of")
    monkeypatch.setattr("try_hostile_inputs.MESSAGE", MESSAGE)
    monkeypatch.setattr("try_hostile_inputs.MEMORY", -1.0)
    assert harm(item, tmp_path)[1].endswith(" GB")


def test_mutants_change_the_place_of_their_names():
    draw = random.Random(0)
    source, folder = hostile_inputs.tables()["valve-closure"]
    assert isinstance(folder, Path)
    for change in hostile_inputs.changes(source["numerics"]["end"]):
        mutant = hostile_inputs.mutant(source, ("numerics", "end"), change)
        assert mutant != source or change == "renamed", change
    names = [item.name for item in hostile_inputs.mutants(draw, 200)]
    assert (
        len({name.split()[0] for name in names}) > 40
        and len({name.split()[-1] for name in names}) > 30
    )


PARTS = [(group, kind) for group in ("nodes", "links") for kind in KINDS[group]]
TABLES = [*KEYS]
WRONG = [
    5, -5, 5.5, True, "x", "", "5 m", [], [5], [[5]], ["x"], [{}], {}, {"a": 5}, {"a": {}}, {"a": {"type": 5}},
    {"a": []}, {"x": {"side": 5}}, {"time": 5, "value": {}}, {"file": 5}, {"control": 5}, {"signal": []},
]  # fmt: skip
FEW = [5, "x", [5], [], {}, {"a": 5}]


def refused(table, place):
    """Load a table with a wrong value; fail with the place of the value at any error other than a fault."""
    try:
        fvsolve.load(table)
    except CaseError as error:
        assert str(error)
    except Exception as error:
        raise AssertionError(f"{place}: {type(error).__name__}: {error}") from error


@pytest.mark.parametrize("group, kind", PARTS, ids=map("-".join, PARTS))
def test_values_of_a_wrong_type_are_faults_of_every_key_of_a_part(group, kind):
    scene = tomllib.loads(hostile_inputs.SCENE)
    for key in [*KINDS[group][kind].values(), "type", "unknown"]:
        for wrong in WRONG:
            table = {**scene, group: {**scene[group], "x": {"type": kind, key: wrong}}}
            refused(table, f"{group}.x.{key} = {wrong!r} of a {kind}")


@pytest.mark.parametrize("name", TABLES)
def test_values_of_a_wrong_type_are_faults_of_every_table(name):
    scene = tomllib.loads(hostile_inputs.SCENE)
    for wrong in WRONG:
        refused({**scene, name: wrong}, f"{name} = {wrong!r}")
        for inner in WRONG:
            refused(
                {**scene, name: {**scene.get(name, {}), "x": inner}}, f"{name}.x = {inner!r}"
            ) if isinstance(scene.get(name, {}), dict) else None


# one key of each kind : (case, key path)
SHIPPED = [
    (name, paths[0])
    for cases in hostile_inputs.kinds_of_keys(hostile_inputs.tables()).values()
    for name, paths in [next(iter(cases.items()))]
]


@pytest.mark.parametrize("name", sorted({name for name, _ in SHIPPED}))
def test_values_of_a_wrong_type_are_faults_in_shipped_cases(name):
    table, folder = hostile_inputs.tables()[name]
    for path in (path for other, path in SHIPPED if other == name):
        for wrong in FEW:
            copied = copy.deepcopy(table)
            inner = copied
            for key in path[:-1]:
                inner = inner[key]
            inner[path[-1]] = wrong
            refused(Raw(copied, name, None, folder), f"{'.'.join(map(str, path))} = {wrong!r}")

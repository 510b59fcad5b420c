"""TOML on the pages of docs: every block is read, and every block of controls on docs/controls.md makes a model.

Many blocks are parts of a case. They are completed to a case, and only faults may remain that state that the rest of
the case is missing.
"""

import re
import tomllib

import pytest
from reference.folders import CASES, DOCS, page

import fvsolve
from fvsolve.case.declared_tables import DECLARED
from fvsolve.case.load import KEYS
from fvsolve.errors import CaseError

BLOCK = re.compile(r"^```toml ?(\S*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
REST_IS_MISSING = re.compile(
    r"\[(nodes|links)\] is missing|no (place|part|basin|pipe|control|scalar) named|but the case has none"
    r"|unknown part or route|no link touches it|there is no such file|needs cells, and the case has no pipe or basin"
    r"|(is|are) missing$|main: expected one of"
    r"|is missing: |unknown scalar|is not a formula of Cl2|is a study of a case|without a scene"
)
# A part of the reader, pyproject.toml, a case for another package, and forms that
# tests/repository/test_doc_pages.py reads.
OTHER = {
    ("bodies", 1),
    *(("extending", k) for k in range(3)),
    *(("own-parts", k) for k in range(7)),
}
GIVEN_BY_PIPES = re.compile(r"\.(on|at): unknown key")  # a node on a pipe, whose case has the pipe
TYPES = {"nodes": "basin", "links": "pipe"}  # of the parts that blocks continue


def blocks() -> list:
    found = [
        (path, k, text)
        for path in sorted(DOCS.rglob("*.md"))
        for k, (_, text) in enumerate(BLOCK.findall(path.read_text(encoding="utf-8")))
    ]
    return [
        pytest.param(text, id=f"{path.relative_to(DOCS).with_suffix('').as_posix()}-{k}")
        for path, k, text in found
        if (path.stem, k) not in OTHER
    ]


def tables(text: str) -> list[dict]:
    """Tables of a block. Lines that state a key in several forms are tables of their own."""
    try:
        return [tomllib.loads(text)]
    except tomllib.TOMLDecodeError as error:
        assert "Cannot overwrite a value" in str(error)
        return [tomllib.loads(line) for line in text.splitlines() if line]


def completed(table: dict) -> dict:
    """Case that contains a table; keys of a basin stand in a basin, and parts without a type get one."""
    known = (*KEYS, *DECLARED)
    case = {key: value for key, value in table.items() if key in known}
    if rest := {key: value for key, value in table.items() if key not in known}:
        part = {"type": "basin", "size": [100, 100], "cells": [40, 40]}
        if "velocity" in rest:
            part |= {"physics": "transport"}
        elif "start" not in rest:
            part |= {"level": 1.0}
        part = {
            key: value
            for key, value in part.items()
            if not ("mesh" in rest and key in ("size", "cells"))
        }
        case["nodes"] = {"part": part | rest}
    for group, usual in TYPES.items():
        for part in case.get(group, {}).values():
            part.setdefault("type", usual)
    case["fluid"] = {"name": "water"} | case.get("fluid", {})
    case["numerics"] = {"end": 1.0} | case.get("numerics", {})
    return case


@pytest.mark.parametrize("text", blocks())
def test_a_block_has_no_faults_of_its_own(text):
    for table in tables(text):
        if "case" in table or "validation" in table:  # a study, and an addition to a case
            continue
        try:
            fvsolve.load(completed(table))
        except CaseError as error:
            faults = [str(fault) for fault in error.faults]
            assert [
                fault
                for fault in faults
                if not REST_IS_MISSING.search(fault) and not GIVEN_BY_PIPES.search(fault)
            ] == []


def test_faults_of_blocks_are_seen():
    wrong = tomllib.loads('[links.main]\nlenght = 3\n[numerics]\nend = "5 bar"')
    with pytest.raises(CaseError) as caught:
        fvsolve.load(completed(wrong))
    faults = [str(fault) for fault in caught.value.faults if not REST_IS_MISSING.search(str(fault))]
    assert any("lenght" in fault for fault in faults) and any("5 bar" in fault for fault in faults)


LEVEL = tomllib.loads((CASES / "tank-level-pi.toml").read_text(encoding="utf-8"))
COMMON = re.findall(
    r"^\| ([a-z -]+) \| (.*) \|$",
    page("controls").split("## Common blocks")[1].split("## Names")[0],
    re.MULTILINE,
)[2:]


def stated(text: str) -> dict:
    """Keys that a row of the table states in backquotes; of two values of a key the last is taken."""
    table: dict = {}
    for code in re.findall(r"`([^`]+ = [^`]+)`", text):
        table |= tomllib.loads(code)
    return table


@pytest.mark.parametrize("row", COMMON, ids=lambda row: row[0])
def test_a_common_block_of_controls_makes_a_model(row):
    """The block sets the opening of the inlet of cases/tank-level-pi.toml."""
    table = stated(row[1])
    assert table
    names = {*re.findall(r"\b[abx]\b", table.get("formula", ""))}
    controllers = {
        "one": LEVEL["controls"]["level"] | {"initial": 0.16},
        "two": LEVEL["controls"]["level"] | {"initial": 0.5},
    }
    if "controllers" in row[1]:
        table.setdefault("inputs", {"a": "controls.one", "b": "controls.two"})
    if "formula" in table:
        usual = {"type": "function", "inputs": dict.fromkeys(sorted(names), "tower.level")}
    else:
        usual = {"type": "transfer-function", "input": "tower.level", "numerator": [1]}
    controls = {"level": usual | table} | (controllers if "controllers" in row[1] else {})
    model = fvsolve.build(fvsolve.load(LEVEL | {"controls": controls, "expect": {}, "output": {}}))
    assert (
        "controls.level.output" in str(model.checks)
        or model.case.controls.keys() == controls.keys()
    )


def test_a_formula_of_a_control_does_not_compare_for_equality():
    """docs/controls.md: the operators == and != of formulas of x and y are refused."""
    controls = {"level": {"type": "function", "inputs": {"x": "tower.level"}, "formula": "x == 4"}}
    with pytest.raises(CaseError, match="compares for equality"):
        fvsolve.load(LEVEL | {"controls": controls})

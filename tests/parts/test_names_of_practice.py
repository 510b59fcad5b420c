"""Names of practice and examples of parts: each example is valid and runs, and each name has a part."""

import tomllib

import pytest

from fvsolve import load, run
from fvsolve.case import part_names
from fvsolve.data import read_table
from fvsolve.errors import FvsolveError
from fvsolve.parts import KINDS
from fvsolve.parts.control import Control

TYPES = {*KINDS["nodes"], *KINDS["links"], *Control.kinds}
ENTRIES = [*part_names.part_types().values(), *part_names.names_of_practice()]
EXAMPLES = {entry.example: entry for entry in reversed(ENTRIES)}
# notices that a small example cannot avoid
ALLOWED = ("weno5 does not support conduits",)


def scene(entry):
    return tomllib.loads(part_names.scene_of(entry.example, entry.end))


def test_each_type_has_an_example_with_a_part_of_this_type():
    types = part_names.part_types()
    assert types.keys() == TYPES
    for kind, entry in types.items():
        table = tomllib.loads(entry.example)
        found = [
            part["type"] for group in table.values() for part in group.values() if "type" in part
        ]
        assert kind in found and entry.about.endswith(".") and entry.group


def test_each_name_stands_for_types_that_exist_and_its_example_contains_such_a_type():
    for entry in part_names.names_of_practice():
        assert {*entry.parts} <= TYPES, entry.names
        assert {*entry.parts} & scene_types(entry) and entry.about.endswith(".")


def scene_types(entry):
    table = tomllib.loads(entry.example)
    groups = (table.get(group, {}) for group in ("nodes", "links", "controls"))
    return {part["type"] for group in groups for part in group.values()}


def test_no_entry_has_a_name_twice_and_no_name_is_a_type():
    for entry in part_names.names_of_practice():
        folded = [part_names.folded(name) for name in entry.names]
        assert len({*folded}) == len(folded), entry.names
    names = {
        part_names.folded(name) for entry in part_names.names_of_practice() for name in entry.names
    }
    assert len(names) > 150 and names & TYPES == set()


@pytest.mark.parametrize("part", range(3))
def test_each_example_completed_to_a_scene_loads_and_runs_without_notices(part, tmp_path):
    for k, entry in [*enumerate(EXAMPLES.values())][part::3]:
        case = load(scene(entry))
        result = run(case, out=tmp_path / str(k), pictures=False)
        notices = [notice["text"] for notice in result.summary["warnings"]]
        notices = [text for text in notices if not any(word in text for word in ALLOWED)]
        assert result.summary["ok"] and notices == [], (entry.names[0], notices)


@pytest.mark.parametrize(
    "word", ["one-way tank", "ONE_WAY_TANK", " One-Way  Tank ", "one way tanks"]
)
def test_case_blanks_underscores_and_a_plural_do_not_matter(word):
    assert part_names.find_parts(word) == part_names.find_parts("one way tank") != []


def test_a_type_comes_before_names_and_an_abbreviation_may_have_two_meanings():
    assert [entry.parts for entry in part_names.find_parts("tank")] == [("tank",)]
    assert {entry.parts for entry in part_names.find_parts("PRV")} == {
        ("relief-valve",),
        ("pressure-reducing",),
    }
    assert part_names.find_parts("xyzzy") == []


def test_each_entry_is_the_result_for_all_of_its_names():
    for entry in ENTRIES:
        for name in entry.names:
            assert entry in part_names.find_parts(name), name


def test_an_example_with_an_unknown_node_is_refused_by_name():
    text = '[links.a]\ntype = "orifice"\nfrom = "inlte"\nto = "downstream"\ndiameter = "1 cm"'
    with pytest.raises(FvsolveError, match='names "inlte"; did you mean "inlet"'):
        part_names.scene_of(text)


def test_neighbours_are_neither_types_nor_names_twice():
    assert read_table("part_examples")["neighbours"].keys() & TYPES == set()

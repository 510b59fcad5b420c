"""Key tables of pages: each equals the declaration of its part, and has a column of defaults."""

import pytest
from reference.folders import page as page_of

from fvsolve.case.key_tables import key_table, main, page
from fvsolve.errors import FvsolveError


@pytest.mark.parametrize("name", ["structures", "pipe-walls"])
def test_the_tables_of_a_page_are_those_of_the_declarations(name):
    text = page_of(name)
    # to update: python -m fvsolve.case.key_tables docs/structures.md docs/pipe-walls.md
    assert page(text) == text and "<!-- keys: " in text


def test_a_table_has_a_row_for_each_key():
    assert [line.split(" | ")[0] for line in key_table("chamber").splitlines()[2:]] == [
        "| `volume`",
        "| `initial_pressure`",
    ]


def test_defaults_of_keys_have_a_column():
    rows = key_table("accumulator").splitlines()
    assert (
        "| `initial_pressure` | Pa | that of the steady state | profile | gas pressure at the start |"
        in rows
    )
    words = "polytropic exponent n in p V^n: 1 isothermal, 1.4 adiabatic air"
    assert f"| `exponent` | -, at least 1 | 1.2 | profile | {words} |" in rows


def test_writing_a_page_leaves_its_prose_alone(tmp_path):
    path = tmp_path / "page.md"
    path.write_text("Before.\n\n<!-- keys: frame -->\nold\n<!-- end -->\n\nAfter.\n")
    main([str(path)])
    before, table, after = path.read_text().partition(key_table("frame"))
    assert (before, after) == (
        "Before.\n\n<!-- keys: frame -->\n",
        "<!-- end -->\n\nAfter.\n",
    ) and table


def test_parts_without_keys_are_named():
    with pytest.raises(FvsolveError, match='unknown table of keys "vlave"; did you mean "valve"'):
        key_table("vlave")

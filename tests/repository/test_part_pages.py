"""Pages of parts: each type of part has a page with its sentence, symbol, example and keys, and a row of the index."""

import re
import sys

import pytest
from reference.folders import DOCS, page

from fvsolve.case import part_names
from fvsolve.parts import KINDS
from fvsolve.parts.control import Control

sys.path.append(str(DOCS))
import generated_pages  # noqa: E402
import part_pages  # noqa: E402

PLACES = part_pages.page_of_types()
SHARED = {"every node", "every link", "riding", "case", "numerics", "output", "route", "friction"}


@pytest.fixture(autouse=True)
def _places_are_read_again():
    yield
    part_pages.page_of_types.cache_clear()


def filled(name: str) -> str:
    """Text of docs/parts/NAME with its generated contents."""
    return generated_pages.filled(page(f"parts/{name.removesuffix('.md')}"))


def test_each_type_has_a_page_with_its_sentence_its_example_and_its_keys():
    assert PLACES.keys() == {*KINDS["nodes"], *KINDS["links"], *Control.kinds}
    for kind, place in PLACES.items():
        entry, text = part_names.part_types()[kind], filled(place.partition("#")[0])
        assert entry.about in text and entry.example in text, kind
        assert part_pages.keys(kind) in text, kind


def test_the_index_has_each_type_in_its_group():
    text = part_pages.part_index()
    rows = re.findall(r"^\| \[([\w-]+)\]\(([\w-]+\.md)\)", text, re.MULTILINE)
    assert dict(rows) == {kind: place.partition("#")[0] for kind, place in PLACES.items()}
    assert "<!-- generated: part_index -->" in page("parts/index")


def test_a_type_without_a_page_is_refused_with_the_line_that_adds_it(tmp_path, monkeypatch):
    for path in (DOCS / "parts").glob("*.md"):
        text = path.read_text(encoding="utf-8").replace("<!-- generated: part weir -->\n", "")
        (tmp_path / path.name).write_text(text)
    monkeypatch.setattr(part_pages, "FOLDER", tmp_path)
    part_pages.page_of_types.cache_clear()
    with pytest.raises(
        ValueError, match="no page has weir; expected a line <!-- generated: part weir"
    ):
        part_pages.page_of_types()


def test_a_type_with_two_pages_is_refused(tmp_path, monkeypatch):
    for name in ("a.md", "b.md"):
        (tmp_path / name).write_text("<!-- generated: part weir -->\n")
    monkeypatch.setattr(part_pages, "FOLDER", tmp_path)
    part_pages.page_of_types.cache_clear()
    with pytest.raises(ValueError, match=r"b\.md: weir has a second page"):
        part_pages.page_of_types()


def test_each_type_but_pipes_and_blocks_of_controls_has_a_symbol():
    without = {kind for kind in PLACES if not part_pages.symbol(kind)}
    assert without == {"pipe", *Control.kinds}
    # an orifice has a symbol of its own, not that of a valve
    assert part_pages.symbol("orifice") != part_pages.symbol("valve")


def test_each_table_of_keys_stands_on_a_single_page():
    texts = [path.read_text(encoding="utf-8") for path in (DOCS / "parts").glob("*.md")]
    named = [name for text in texts for name in re.findall(r"<!-- generated: keys (.+?) -->", text)]
    assert len(named) == len({*named}) and {*named} >= {*PLACES} | SHARED


def test_links_of_the_tables_of_keys_lead_to_files_of_docs():
    for kind in PLACES:
        for link in re.findall(r"\]\(([^)#]+)", part_pages.keys(kind)):
            assert (DOCS / "parts" / link).is_file(), (kind, link)


def test_pages_of_parts_name_no_file_of_tests_and_stay_short():
    texts = {path.name: path.read_text(encoding="utf-8") for path in (DOCS / "parts").glob("*.md")}
    assert [name for name, text in texts.items() if re.search(r"test_\w+\.py|tests/", text)] == []
    assert sum(len(text.split()) for text in texts.values()) <= 17_000

"""docs/how-to: every page is a job that runs as it stands, and prints what the page shows."""

from __future__ import annotations

import re
import shlex

import pytest
from reference.folders import DOCS

PAGES = sorted(path for path in (DOCS / "how-to").glob("*.md") if path.stem != "index")
BLOCK = re.compile(r"^```(\w*)[ ]?(\S*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
LIBRARIES = {"epanet-to-report": ("wntr", "plotly", "xlsxwriter"), "plastic-main": ("rainflow",)}  # extras
FAILS = (0, 1)  # a limit that does not hold is what some pages are about


def plain(text: str) -> str:
    """Its lines without what columns and the width of a terminal add."""
    return re.sub(r"\s+", " ", text)


def test_every_page_is_in_the_index():
    linked = set(re.findall(r"\((\S+)\.md\)", (DOCS / "how-to/index.md").read_text(encoding="utf-8")))
    assert linked == {path.stem for path in PAGES} and len(PAGES) == 6


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_a_page_does_what_it_says(page, fvs, tmp_path, monkeypatch):
    """A block with the name of a file goes to its end, commands run in order, and the next block without a language is
    what they print."""
    for library in LIBRARIES.get(page.stem, ()):
        pytest.importorskip(library)
    monkeypatch.chdir(tmp_path)
    said, shown = "", 0
    for language, name, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        if name:
            with (tmp_path / name).open("a", encoding="utf-8") as file:
                file.write("\n" + text)
        elif language == "sh":
            said = ""
            for line in text.splitlines():
                status, out, problem = fvs(*shlex.split(line)[1:])
                assert status in FAILS, problem
                said += plain(out)
        elif not language:
            shown += 1
            for line in text.splitlines():
                assert plain(line) in said, line
    assert shown

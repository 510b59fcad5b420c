"""Pages of docs/how-to run as written and print the output that they show."""

from __future__ import annotations

import re
import shlex

import pytest
from reference.folders import DOCS

PAGES = sorted(path for path in (DOCS / "how-to").glob("*.md") if path.stem != "index")
BLOCK = re.compile(r"^```(\w*)[ ]?(\S*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
LIBRARIES = {"epanet-to-report": ("wntr", "plotly", "xlsxwriter"), "plastic-main": ("rainflow",)}  # optional libraries
FAILS = (0, 1)  # exit status 1: some pages show a limit that fails


def plain(text: str) -> str:
    """Text with single blanks, because columns and the width of the terminal change white space."""
    return re.sub(r"\s+", " ", text)


def test_every_page_is_in_the_index():
    linked = set(re.findall(r"\((\S+)\.md\)", (DOCS / "how-to/index.md").read_text(encoding="utf-8")))
    assert linked == {path.stem for path in PAGES} and len(PAGES) == 6


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_a_page_does_what_it_says(page, fvs, tmp_path, monkeypatch):
    """Append blocks with a file name to the file, run the commands in order, and compare their output with the page."""
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

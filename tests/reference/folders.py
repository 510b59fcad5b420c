"""Folders of the shipped cases and of the documentation pages, and the Python examples of a page."""

import doctest
import re
from pathlib import Path

CASES = Path(__file__).parents[2] / "cases"
DOCS = Path(__file__).parents[2] / "docs"


def page(name: str) -> str:
    """Text of docs/NAME.md."""
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def section(name: str, title: str) -> str:
    """Text of the section TITLE of docs/NAME.md, with its subsections."""
    return page(name).split(f"\n## {title}\n", 1)[1].split("\n## ", 1)[0]


def python_of(text: str) -> str:
    """Python blocks of a page or of a part of a page, joined by line breaks."""
    return "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))


def printed_otherwise(python: str) -> str:
    """Report of doctest on output that differs from the page, empty without differences; `...` matches any text."""
    said: list[str] = []
    block = doctest.DocTestParser().get_doctest(python, {}, "page", None, 0)
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(block, out=said.append)
    return "".join(said)

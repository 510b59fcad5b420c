"""Python examples of a Markdown page, and a comparison of their output with the text below them."""

from __future__ import annotations

import doctest
import re


def python_of(text: str) -> str:
    """Python blocks of a page or of a part of a page, joined by line breaks."""
    return "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))


def printed_otherwise(python: str) -> str:
    """Report of doctest on output that differs from the page, empty without differences; `...` matches any text."""
    said: list[str] = []
    block = doctest.DocTestParser().get_doctest(python, {}, "page", None, 0)
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(block, out=said.append)
    return "".join(said)

"""Lines of Python on a page, behind `>>>`, and whether they print what stands below them. Knows Markdown."""

from __future__ import annotations

import doctest
import re


def python_of(text: str) -> str:
    """The blocks of Python of a page, or of a part of one, in a row."""
    return "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))


def printed_otherwise(python: str) -> str:
    """What was printed in place of what stands there; empty if all of it was. `...` stands for anything."""
    said: list[str] = []
    block = doctest.DocTestParser().get_doctest(python, {}, "page", None, 0)
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(block, out=said.append)
    return "".join(said)

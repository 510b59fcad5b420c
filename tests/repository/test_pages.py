"""Each file of tests that a page, a case or a comment names exists."""

from __future__ import annotations

import re

from reference import folders

TOP = folders.DOCS.parent
TEXTS = "README.md CONTRIBUTING.md pyproject.toml docs/**/*.md cases/*.toml fvsolve/**/*.py tests/**/*.py".split()
NAMED = re.compile(r"(?<![\w/])(?:tests/)?(\w+/test_\w+\.py|truth/\w+\.py)")  # with `tests/` or without


def test_every_file_of_tests_that_is_named_is_there():
    texts = {path: path.read_text(encoding="utf-8") for pattern in TEXTS for path in TOP.glob(pattern)}
    named = {(path.relative_to(TOP).as_posix(), name) for path, text in texts.items() for name in NAMED.findall(text)}
    assert len(named) > 50
    assert sorted((path, name) for path, name in named if not (TOP / "tests" / name).is_file()) == []

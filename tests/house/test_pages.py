"""Every test file and every truth that a page, a case or a comment names is there."""

from __future__ import annotations

import re

from truth import folders

TOP = folders.DOCS.parent
NAMED = re.compile(
    r"(?<![\w/])(?:tests/)?((?:\w+/)?test_\w+\.py|truth/\w+\.py)"
)  # parts/test_leak.py, with tests/ or not


def test_every_file_of_tests_that_is_named_is_there():
    named = {
        (path.relative_to(TOP).as_posix(), name)
        for pattern in (
            "README.md",
            "CONTRIBUTING.md",
            "*.toml",
            "docs/**/*.md",
            "cases/*.toml",
            "fvsolve/**/*.py",
            "tests/**/*.py",
        )
        for path in TOP.glob(pattern)
        for name in NAMED.findall(path.read_text(encoding="utf-8"))
    }
    assert len(named) > 50
    assert sorted(one for one in named if not (TOP / "tests" / one[1]).is_file()) == []

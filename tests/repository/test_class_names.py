"""No two classes of the package have equal names, so a search finds one definition."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import fvsolve


def doubles(sources: dict[str, str]) -> dict[str, list[str]]:
    """Names of classes that several sources define, with these sources."""
    homes = defaultdict(list)
    for home, text in sources.items():
        for one in ast.walk(ast.parse(text)):
            if isinstance(one, ast.ClassDef):
                homes[one.name].append(home)
    return {name: found for name, found in homes.items() if len(set(found)) > 1}


def test_a_class_name_is_used_once():
    top = Path(fvsolve.__file__).parent
    found = doubles({str(path.relative_to(top)): path.read_text(encoding="utf-8") for path in top.rglob("*.py")})
    assert not found


def test_a_double_is_seen():
    assert doubles({"a": "class One: pass", "b": "class Two: pass\nclass One: pass"}) == {"One": ["a", "b"]}

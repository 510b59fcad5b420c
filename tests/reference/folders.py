"""Where the shipped cases and the pages lie: said once, so that no test counts the folders above it."""

from __future__ import annotations

from pathlib import Path

CASES = Path(__file__).parents[2] / "cases"
DOCS = Path(__file__).parents[2] / "docs"


def page(name: str) -> str:
    """The text of docs/NAME.md."""
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")

"""Folders of the shipped cases and of the documentation pages."""

from __future__ import annotations

from pathlib import Path

CASES = Path(__file__).parents[2] / "cases"
DOCS = Path(__file__).parents[2] / "docs"


def page(name: str) -> str:
    """Text of docs/NAME.md."""
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")

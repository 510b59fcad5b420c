"""Check that a summary.json has the entries that this version of fvsolve reads."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from fvsolve.errors import Notice, RunError, listing
from fvsolve.run.result import Comparison, Expectation, Extremes, LimitVerdict, ResultMark

EXACT_ROWS = {  # rows with exactly these fields
    "marks": ResultMark._fields, "expectations": Expectation._fields, "verdicts": LimitVerdict._fields,
    "comparisons": Comparison._fields, "warnings": tuple(field.name for field in fields(Notice)),
}  # fmt: skip
ROWS = EXACT_ROWS | {
    "extremes": Extremes._fields, "probes": ("dimension", "unit"), "methods": ("time", "method"),
    "events": ("time", "name", "what"), "cavities": ("place", "distance", "time", "volume", "t_volume"),
    "peaks": ("minimum", "maximum"),
}  # fmt: skip
NESTED_ROWS = {  # rows within rows
    ("verdicts", "worst"): ("place", "chainage", "elevation", "time", "bound", "value", "limit", "margin",
                            "error", "state"),
    ("peaks", "minimum"): ("error",), ("peaks", "maximum"): ("error",),
}  # fmt: skip


def check(summary: dict[str, Any], path: Path) -> None:
    """Raise RunError if the entries of a summary were written by another version; path : its file, for the message."""
    if faults := [*field_faults(summary)]:
        raise RunError(
            f"{path} {'; '.join(faults)}: it was written by another version of fvsolve; run again with --force"
        )


def field_faults(summary: dict[str, Any]) -> Iterator[str]:
    """Yield a text for each key of a summary with missing entries, and for each with unknown entries."""
    for key, expected in ROWS.items():
        rows = as_rows(summary.get(key, []))
        if missing := [name for name in expected if any(name not in entry for entry in rows)]:
            yield f"lacks {listing(missing)} of {key}"
        if key in EXACT_ROWS and (
            unknown := list(dict.fromkeys(name for entry in rows for name in entry if name not in expected))
        ):
            yield f"has {listing(unknown)} of {key}, unknown to this version"
    for (key, part), expected in NESTED_ROWS.items():
        rows = [row for entry in as_rows(summary.get(key, [])) for row in as_rows(entry.get(part, []))]
        if missing := [name for name in expected if any(name not in entry for entry in rows)]:
            yield f"lacks {listing(missing)} of {key}, {part}"


def as_rows(rows: list | dict) -> list[dict]:
    """List of dicts from a list of dicts, from a dict of dicts, or from a single dict."""
    if isinstance(rows, dict):
        return [*rows.values()] if all(isinstance(row, dict) for row in rows.values()) else [rows]
    return rows

"""Whether a summary that is read back has all that is read of it. Knows its rows; reads no file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from fvsolve.errors import Notice, RunError, listing
from fvsolve.run.result import Comparison, Expectation, Extremes, LimitVerdict, ResultMark

WHOLE = {  # rows that have these fields and no others
    "marks": ResultMark._fields, "expectations": Expectation._fields, "verdicts": LimitVerdict._fields,
    "comparisons": Comparison._fields, "warnings": tuple(one.name for one in fields(Notice)),
}  # fmt: skip
ROWS = WHOLE | {
    "extremes": Extremes._fields, "probes": ("dimension", "unit"), "methods": ("time", "method"),
    "events": ("time", "name", "what"), "cavities": ("place", "distance", "time", "volume", "t_volume"),
    "peaks": ("least", "greatest"),
}  # fmt: skip
WITHIN = {  # rows of rows
    ("verdicts", "worst"): ("place", "chainage", "elevation", "time", "bound", "value", "limit", "margin",
                            "error", "state"),
    ("peaks", "least"): ("error",), ("peaks", "greatest"): ("error",),
}  # fmt: skip


def check(summary: dict[str, Any], path: Path) -> None:
    """RunError where rows of a summary are not those of this version."""
    if faults := [*odd(summary)]:
        raise RunError(f"{path} {'; '.join(faults)}: another version of fvsolve wrote it; run again with --force")


def odd(summary: dict[str, Any]) -> Iterator[str]:
    """What is missing, and what is not known, in the rows of each key."""
    for key, wanted in ROWS.items():
        rows = every(summary.get(key, []))
        if lacks := [name for name in wanted if any(name not in one for one in rows)]:
            yield f"lacks {listing(lacks)} of {key}"
        if key in WHOLE and (more := list(dict.fromkeys(name for one in rows for name in one if name not in wanted))):
            yield f"has {listing(more)} of {key}, unknown here"
    for (key, part), wanted in WITHIN.items():
        rows = [row for one in every(summary.get(key, [])) for row in every(one.get(part, []))]
        if lacks := [name for name in wanted if any(name not in one for one in rows)]:
            yield f"lacks {listing(lacks)} of {key}, {part}"


def every(rows: list | dict) -> list[dict]:
    """Rows of a list, or of a table by name; a row itself as one."""
    if isinstance(rows, dict):
        return [*rows.values()] if all(isinstance(one, dict) for one in rows.values()) else [rows]
    return rows

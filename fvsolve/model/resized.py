"""Model tables derived from those of another case that differs only in sizes of restrictions."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from fvsolve.case.case import Case
from fvsolve.model.draft import Draft
from fvsolve.model.lowering import lowering_of

MOVED = ("nodes", "links", "raw", "read")  # fields of a case that differ after a change of numbers of parts


def resized(packed: Draft, case: Case) -> Draft | None:
    """Copy of packed tables with the restrictions of a case; None if the case differs in anything else."""
    before = packed.case
    changed = changed_links(before, case)
    if changed is None or packed.plane_size or not all(name in packed.valve_names for name in changed):
        return None
    draft = packed.copied(case)
    for name in changed:
        link, row = case.links[name], draft.valve_table[draft.valve_names.index(name)]
        if not lowering_of(type(link)).resize(draft, name, before.links[name], link, row):
            return None
    return draft


def changed_links(before: Case, case: Case) -> list[str] | None:
    """Names of links that changed; None if anything else changed."""
    same = all(
        getattr(before, field.name) is getattr(case, field.name) for field in fields(Case) if field.name not in MOVED
    )
    if not same or before.settles or not alike(before.nodes, case.nodes) or before.links.keys() != case.links.keys():
        return None
    changed = [name for name, link in case.links.items() if link is not before.links[name]]
    return changed if all(type(case.links[name]) is type(before.links[name]) for name in changed) else None


def alike(before: dict[str, Any], now: dict[str, Any]) -> bool:
    """True if two tables hold the identical part objects."""
    return before.keys() == now.keys() and all(now[name] is part for name, part in before.items())

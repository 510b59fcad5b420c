"""Model tables derived from those of a similar case, in which only sizes of restrictions differ."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from fvsolve.assembly.lowering import lowering_of
from fvsolve.assembly.model_draft import ModelDraft
from fvsolve.case.case import Case

CHANGING_FIELDS = ("nodes", "links", "raw", "read")  # fields of a case that differ after a change of numbers of parts


def with_new_sizes(packed: ModelDraft, case: Case) -> ModelDraft | None:
    """Copy of packed tables with the restrictions of a case; None if the case differs in more than their sizes.

    The result is also None with basins, and for a change that `Lowering.resize` does not support.
    """
    before = packed.case
    changed = changed_links(before, case)
    if changed is None or packed.plane_size or not all(name in packed.valve_names for name in changed):
        return None
    draft = packed.copy_for(case)
    for name in changed:
        link, row = case.links[name], draft.valve_table[draft.valve_names.index(name)]
        if not lowering_of(type(link)).resize(draft, name, before.links[name], link, row):
            return None
    return draft


def changed_links(before: Case, case: Case) -> list[str] | None:
    """Names of the links that differ between two cases; None if anything else differs, or a link has another type.

    The result is also None if the start of the first case is a static equilibrium.
    """
    same = all(
        getattr(before, field.name) is getattr(case, field.name)
        for field in fields(Case)
        if field.name not in CHANGING_FIELDS
    )
    if (
        not same
        or before.needs_equilibrium
        or not same_parts(before.nodes, case.nodes)
        or before.links.keys() != case.links.keys()
    ):
        return None
    changed = [name for name, link in case.links.items() if link is not before.links[name]]
    return changed if all(type(case.links[name]) is type(before.links[name]) for name in changed) else None


def same_parts(before: dict[str, Any], now: dict[str, Any]) -> bool:
    """True if two tables hold the identical part objects."""
    return before.keys() == now.keys() and all(now[name] is part for name, part in before.items())

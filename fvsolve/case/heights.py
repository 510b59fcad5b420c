"""Elevations and positions that nodes take from the profiles of pipes. Knows parts; knows no file."""

from __future__ import annotations

from typing import Any


def lent(nodes: dict[str, Any], links: dict[str, Any]) -> dict[str, Any]:
    """Nodes, those without an elevation or a position at which a profile begins or ends at that of the first that does.

    Positions are those of profiles by x, y and z.
    """
    found: dict[str, Any] = {}
    for link in links.values():
        profile = getattr(link, "profile", None)
        if profile is None:
            continue
        for name, end in ((link.from_, 0), (link.to, -1)):
            node = found.get(name, nodes.get(name))
            if node is None or getattr(node, "on", None) is not None:
                continue
            given = {"elevation": float(profile.elevation[end])}
            given |= {} if profile.plan is None else {"position": tuple(profile.plan[end].tolist())}
            lacks = {key: one for key, one in given.items() if getattr(node, key, one) is None}
            if lacks:
                found[name] = node.model_copy(update=lacks)
    return {name: found.get(name, node) for name, node in nodes.items()} if found else nodes

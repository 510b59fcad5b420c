"""Elevations and positions of nodes, inherited from the profiles of pipes."""

from __future__ import annotations

from typing import Any


def inherit_elevations(nodes: dict[str, Any], links: dict[str, Any]) -> dict[str, Any]:
    """Nodes with missing elevations and positions filled in from the first pipe profile that begins or ends there.

    The position is that of the first or last profile point, if the profile has x and y. Nodes on bodies are unchanged.
    """
    result: dict[str, Any] = {}
    for link in links.values():
        profile = getattr(link, "profile", None)
        if profile is None:
            continue
        for name, end in ((link.from_, 0), (link.to, -1)):
            node = result.get(name, nodes.get(name))
            if node is None or getattr(node, "on", None) is not None:
                continue
            given = {"elevation": float(profile.elevation[end])}
            given |= {} if profile.plan is None else {"position": tuple(profile.plan[end].tolist())}
            missing = {key: value for key, value in given.items() if getattr(node, key, value) is None}
            if missing:
                result[name] = node.model_copy(update=missing)
    return {name: result.get(name, node) for name, node in nodes.items()} if result else nodes

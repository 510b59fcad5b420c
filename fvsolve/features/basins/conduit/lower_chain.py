"""Steady flows and heads in a chain of conduits: trees of junctions and inflows between one or two nodes of known head.

From a node of known head upward, the profile of each conduit gives the head of its upper node. Flows are sums of the
inflows above. Between two known heads the flow is that at which both climbs give one head where they meet.
"""

from functools import lru_cache
from math import inf, sqrt

import numpy as np

from fvsolve.features.basins.conduit.steady_profile import critical_flow, put_profile
from fvsolve.parts.conduit.law_section import section_of
from fvsolve.parts.conduit.part import Chain, Conduit

HALVINGS = 60  # of an interval that contains a root
MOST_FLOW = 1e3  # greatest flow of a search, over that of the full section at sqrt(g D)
SMALL = 1e-12  # relative rounding of heads


def upper_head(link: Conduit, gravity: float, flow: float, head: float) -> float:
    """Head of the upper node of a conduit [m] with the head of the lower node, for a flow from `from` to `to`."""
    section = section_of(gravity, link.diameter, link.celerity(gravity))
    begin, end = link.inverts if flow >= 0.0 else link.inverts[::-1]
    if flow == 0.0:
        return head if head > max(link.inverts) else min(head, *link.inverts)
    depths, flow = np.zeros(link.cells + 2), abs(flow)
    depth = put_profile(
        section, flow, link.rough(gravity), begin - end, link.length, max(head - end, 0.0), depths
    )
    low, high = depth, depth
    # inflow is at most critical, and at most that of Torricelli
    while critical_flow(section, high) < flow:
        low, high = high, high + section.diameter
    for _ in range(HALVINGS if high > low else 0):
        h = 0.5 * (low + high)
        low, high = (low, h) if critical_flow(section, h) >= flow else (h, high)
    return begin + high


def lower_head(link: Conduit, gravity: float, flow: float, head: float) -> float:
    """Head of the lower node of a conduit [m] at which the upper node has a given head; the lowest if none."""
    low, high = min(link.inverts[1 if flow > 0.0 else 0], head), head
    for _ in range(HALVINGS):
        z = 0.5 * (low + high)
        low, high = (low, z) if upper_head(link, gravity, flow, z) >= head else (z, high)
    return high


def climb(
    chain: Chain, gravity: float, heads: dict[str, float], flows: dict[str, float], both: bool
) -> dict:
    """Heads of all nodes that follow from known heads; both : True to follow flows downward too, else only upward."""
    found, left = dict(heads), list(heads)
    while left:
        node = left.pop()
        for name, link in chain.links.items():
            if node not in (link.from_, link.to):
                continue
            other = link.to if node == link.from_ else link.from_
            rises = flows[name] * (1.0 if node == link.to else -1.0) >= 0.0
            if other not in found and (rises or both):
                found[other] = (upper_head if rises else lower_head)(
                    link, gravity, flows[name], found[node]
                )
                left.append(other)
    return found


def flows_by_inflows(chain: Chain, root: str, inflows: dict[str, float]) -> dict[str, float]:
    """Flows of conduits that carry the inflows of all nodes to one node of a tree [m3/s]."""
    flows = {}
    order = []
    seen = {root}
    left = [root]
    while left:
        node = left.pop()
        for name, link in chain.links.items():
            ends = (link.from_, link.to)
            if node in ends and not seen.issuperset(ends):
                other = ends[1 - ends.index(node)]
                seen.add(other)
                order.append((name, node, other))
                left.append(other)
    total = dict(inflows)
    for name, node, other in reversed(order):
        flows[name] = total.get(other, 0.0) * (1.0 if chain.links[name].to == node else -1.0)
        total[node] = total.get(node, 0.0) + total.get(other, 0.0)
    return flows


@lru_cache
def steady_chain(chain: Chain, gravity: float) -> tuple[dict[str, float], dict[str, float]]:
    """(flow of each conduit [m3/s], head of each node [m]) of a chain; both empty if keys do not give them."""
    roots = list(chain.heads)
    places = {place for link in chain.links.values() for place in link.ports.values()}
    stated = any(
        link.initial_flow is not None or link.initial_depth is not None
        for link in chain.links.values()
    )
    if (
        len(chain.links) != len(places) - 1
        or len(roots) not in (1, 2)
        or (stated and len(places) > 2)
    ):
        return {}, {}
    if len(roots) == 1:
        flows = flows_by_inflows(chain, roots[0], chain.inflows)
        return flows, climb(chain, gravity, chain.heads, flows, True)
    first, second = chain.heads.values()
    if -inf in (first, second) or (first == second and not any(chain.inflows.values())):
        return {}, {}

    def both_climbs(flow):
        flows = flows_by_inflows(chain, roots[0], {**chain.inflows, roots[1]: flow})
        return flows, *(
            climb(chain, gravity, {root: chain.heads[root]}, flows, False) for root in roots
        )

    # of the head where both climbs meet, from that of the second node to that of the first
    def rise(flow):
        _, a, b = both_climbs(flow)
        return next((a[place] - b[place] for place in a if place in b), 0.0)

    from scipy.optimize import brentq

    d = min(link.diameter for link in chain.links.values())
    size = d * d * sqrt(gravity * d)
    most = size * 1e-3
    while rise(most) < 0.0 or rise(-most) > 0.0:
        most *= 2.0
        if most > MOST_FLOW * size:
            return {}, {}
    flows, a, b = both_climbs(brentq(rise, -most, most, xtol=SMALL * size))
    return flows, climb(chain, gravity, a | b, flows, True)

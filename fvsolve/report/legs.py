"""Which pipes make a long section, and which way round. Knows the network of a case; draws nothing.

The one place that chooses: the longest ways through pipes that meet end to end, each pipe in one of them.
"""

from __future__ import annotations

import heapq
from typing import NamedTuple

MOST = 6  # sections of a run


class Leg(NamedTuple):
    """A pipe of a section: the chainage where it begins [m], and whether it is run from its `to` end."""

    pipe: str
    begins: float
    length: float
    backwards: bool


class Way(NamedTuple):
    """A section: its name, its legs in order, and the places where they meet with their chainages [m]."""

    name: str
    legs: list[Leg]
    places: list[tuple[str, float]]


def ways(result) -> list[Way]:
    """The sections of a run, longest first; none of a case without pipes."""
    links = result.case.links
    pipes = {name: (links[name].ports["from"], links[name].ports["to"], links[name].length)
             for name in result.envelope if name in links}  # fmt: skip
    found = []
    while pipes and len(found) < MOST:
        chain = _longest(pipes)
        for pipe, _, _ in chain:
            del pipes[pipe]
        found.append(_way(chain, result))
    return sorted(found, key=lambda one: -one.places[-1][1])


def _way(chain: list[tuple[str, bool, float]], result) -> Way:
    """A chain with its chainages, turned so that the head falls along it at the start."""
    first, last = chain[0], chain[-1]
    begins = _start_head(result, first[0], last=first[1])
    ends = _start_head(result, last[0], last=not last[1])
    if ends > begins + 1e-9 * abs(begins) or (
        ends >= begins and sum(turned for _, turned, _ in chain) * 2 > len(chain)
    ):
        chain = [(pipe, not turned, length) for pipe, turned, length in reversed(chain)]
    at, legs, places = 0.0, [], []
    for pipe, turned, length in chain:
        ports = result.case.links[pipe].ports
        places.append((ports["to" if turned else "from"], at))
        legs.append(Leg(pipe, at, length, turned))
        at += length
        end = ports["from" if turned else "to"]
    names = [leg.pipe for leg in legs]
    name = " \u2013 ".join(names) if len(names) < 4 else f"{places[0][0]} to {end}"
    return Way(name, legs, [*places, (end, at)])


def _start_head(result, pipe: str, last: bool) -> float:
    return float(result.envelope[pipe]["initial_head"][-1 if last else 0])


def _longest(pipes: dict) -> list[tuple[str, bool, float]]:
    """The way between two places that are farthest apart along pipes: (pipe, turned, length) in order.

    Found by going twice to the farthest place, from an end of the longest pipe; exact where there are no loops.
    """
    around: dict[str, list] = {}
    for name, (a, b, length) in pipes.items():
        around.setdefault(a, []).append((b, name, False, length))
        around.setdefault(b, []).append((a, name, True, length))
    start = pipes[max(pipes, key=lambda name: pipes[name][2])][0]
    far = _farthest(around, start)[0]
    end, came = _farthest(around, far)
    chain = []
    while end != far:
        end, name, turned, length = came[end]
        chain.append((name, turned, length))
    return chain[::-1]


def _farthest(around: dict, start: str) -> tuple[str, dict]:
    """The place farthest from `start`, and by which pipe each place was reached (Dijkstra 1959)."""
    distance, came, queue, end = {start: 0.0}, {}, [(0.0, start)], start
    done = set()
    while queue:
        so_far, place = heapq.heappop(queue)
        if place in done:
            continue
        done.add(place)
        end = place
        for other, name, turned, length in around[place]:
            if other != place and so_far + length < distance.get(other, float("inf")):
                distance[other], came[other] = so_far + length, (place, name, turned, length)
                heapq.heappush(queue, (so_far + length, other))
    return end, came

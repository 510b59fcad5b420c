"""Pipes of each long section of a run, in order and direction.

Sections are the routes of the case, then the longest paths through the remaining pipes. No pipe is in two such paths.
A path continues through common nodes and through links other than pipes between two junctions.
"""

import heapq
from typing import NamedTuple

from fvsolve.case.pipe_routes import Leg, is_cut, joined_places, pipe_leg
from fvsolve.case.pipe_routes import legs as legs_of
from fvsolve.run.result import not_valid

MAX_SECTIONS = 6  # greatest number of sections of a run, unless it has more routes


class SectionPath(NamedTuple):
    """Path of a long section.

    legs : pipes in order, with chainages and directions; places : (node, chainage [m]) of the ends of its pipes
    """

    name: str
    legs: list[Leg]
    places: list[tuple[str, float]]

    @property
    def begin(self) -> float:
        """Chainage of the start of the path [m]."""
        return self.legs[0].begin

    @property
    def end(self) -> float:
        """Chainage of the end of the path [m]."""
        return self.legs[-1].end

    @property
    def length(self) -> float:
        """Length of the path from end to end [m]."""
        return self.end - self.begin


def section_paths(result) -> list[SectionPath]:
    """Paths of the long sections of a run: routes of the case, then the longest other paths.

    The list is empty without pipes, or if the run diverged.
    """
    if not_valid(result.summary):
        return []
    links = result.case.links
    paths = [_section_path(name, legs_of(route, links), links) for name, route in result.case.routes.items()]
    paths = list({tuple(leg.pipe for leg in way.legs): way for way in reversed(paths)}.values())[::-1]  # no duplicates
    paths = [way for way in paths if not _is_covered(way, paths)]
    strung = {leg.pipe for way in paths for leg in way.legs}
    merged = joined_places({name: link for name, link in links.items() if _joins_junctions(link, result.case)})
    free = [name for name in result.envelope if name in links and name not in strung]
    pipes = {name: (*(merged.get(end, end) for end in (links[name].from_, links[name].to)), links[name].length)
             for name in free}  # fmt: skip
    others = []
    while pipes and len(paths) + len(others) < MAX_SECTIONS:
        chain = _longest_chain(pipes)
        for pipe, _, _ in chain:
            del pipes[pipe]
        others.append(_path_of_chain(chain, result))
    return [*paths, *sorted(others, key=lambda path: -path.length)]


def _is_covered(way: SectionPath, ways: list[SectionPath]) -> bool:
    """True if a path consists of the pieces of one cut pipe, and all these pieces are on another path."""
    pipes, others = [leg.pipe for leg in way.legs], [other for other in ways if other is not way]
    return is_cut(way.name, pipes) and any(set(pipes) <= {leg.pipe for leg in other.legs} for other in others)


def _joins_junctions(link, case) -> bool:
    """True if a section may continue through a link: all places that it joins are junctions."""
    return all(getattr(case.nodes.get(place), "kind", "") == "junction" for place in link.ports.values())


def _path_of_chain(chain: list[tuple[str, bool, float]], result) -> SectionPath:
    """Section path of a chain of pipes, directed so that the initial head falls along it.

    chain : list of (name of the pipe, True if it is passed backwards, length [m]). A single pipe keeps its direction.
    """
    if len(chain) == 1:
        pipe = chain[0][0]
        return _section_path(pipe, [pipe_leg(pipe, result.case.links)], result.case.links)
    first, last = chain[0], chain[-1]
    begins = _initial_head(result, first[0], last=first[1])
    ends = _initial_head(result, last[0], last=not last[1])
    mostly_turned = sum(turned for _, turned, _ in chain) * 2 > len(chain)
    if ends > begins + 1e-9 * abs(begins) or (ends >= begins and mostly_turned):
        chain = [(pipe, not turned, length) for pipe, turned, length in reversed(chain)]
    at, legs = 0.0, []
    for pipe, turned, length in chain:
        legs.append(Leg(pipe, at, at + length, turned))
        at += length
    way = _section_path("", legs, result.case.links)
    names = [leg.pipe for leg in legs]
    name = " \u2013 ".join(names) if len(names) < 4 else f"{way.places[0][0]} to {way.places[-1][0]}"
    return way._replace(name=name)


def _section_path(name: str, legs: list[Leg], links: dict) -> SectionPath:
    """Section path from legs. Its places are both end nodes of each pipe, so both nodes of a device are included."""
    places = []
    for leg in legs:
        ends = (links[leg.pipe].from_, leg.chainage(0.0)), (links[leg.pipe].to, leg.chainage(links[leg.pipe].length))
        places += ends[::-1] if leg.backwards else ends
    return SectionPath(name, legs, list(dict.fromkeys((place, float(at)) for place, at in places)))


def _initial_head(result, pipe: str, last: bool) -> float:
    return float(result.envelope[pipe]["initial_head"][-1 if last else 0])


def _longest_chain(pipes: dict) -> list[tuple[str, bool, float]]:
    """Pipes between the two nodes that are farthest apart along pipes : list of (pipe, backwards, length [m]).

    pipes : name -> (first node, second node, length); backwards : True if the pipe is passed from second to first node
    The search finds the node farthest from an end of the longest pipe, then the node farthest from this node. It gives
    the exact result for networks without loops.
    """
    around: dict[str, list] = {}
    for name, (a, b, length) in pipes.items():
        around.setdefault(a, []).append((b, name, False, length))
        around.setdefault(b, []).append((a, name, True, length))
    longest = max(pipes, key=lambda name: pipes[name][2])
    if pipes[longest][0] == pipes[longest][1]:  # a link without length connects its ends
        return [(longest, False, pipes[longest][2])]
    far = _farthest(around, pipes[longest][0])[0]
    end, came = _farthest(around, far)
    chain = []
    while end != far:
        end, name, turned, length = came[end]
        chain.append((name, turned, length))
    return chain[::-1]


def _farthest(around: dict, start: str) -> tuple[str, dict]:
    """Node farthest from `start` along pipes, and the shortest way to each node (Dijkstra 1959).

    around : node -> list of (other node, pipe, backwards, length)
    The way is a dict: node -> (previous node, pipe, backwards, length).
    """
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

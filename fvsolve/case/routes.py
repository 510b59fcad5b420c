"""Routes: pipes strung into one chainage. Knows which links meet; knows no flow."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts import KINDS
from fvsolve.parts.table import Table
from fvsolve.parts.value import VALUE, Misfit, Quantity, Setting, Value
from fvsolve.units import show


class PipeNames(Value):
    """A list of names of pipes, in the order in which they follow each other."""

    about = "pipes in their order; the next begins where one ends, or behind links without length between"
    takes = "list of names"
    changes = VALUE

    def read(self, given: Any, setting: Setting) -> tuple[str, ...]:
        if not isinstance(given, (list, tuple)) or not given:
            raise ValueError(f'{show(given)} is no list; wanted one such as ["suction", "main"]')
        faults = [((k,), f"{show(one)} is no name") for k, one in enumerate(given) if not isinstance(one, str)]
        faults += [((k,), f"{show(one)} stands twice") for k, one in enumerate(given) if one in given[:k]]
        if faults:
            raise Misfit(faults)
        return tuple(given)

    def json(self) -> dict[str, Any]:
        return {"type": "array", "items": {"type": "string"}, "minItems": 1}


class Route(Table):
    """`[routes.NAME]`: pipes strung into one chainage."""

    pipes: Annotated[tuple[str, ...], PipeNames()]
    start: Annotated[
        float | None,
        Quantity("length", about="chainage where it begins [m]; that of its first pipe, or 0 if left out",
                 changes=VALUE),
    ] = None  # fmt: skip


@dataclass(frozen=True)
class Leg:
    """A pipe on a route: chainage where the route enters it and where it leaves [m], and whether it runs against it."""

    pipe: str
    begin: float
    end: float
    backwards: bool

    def chainage(self, distance: Any) -> Any:
        """Of places at distances from the pipe's `from` end [m]."""
        return self.end - distance if self.backwards else self.begin + distance

    def distance(self, chainage: Any) -> Any:
        """From the pipe's `from` end [m] of places at chainages."""
        return self.end - chainage if self.backwards else chainage - self.begin


def is_cut(name: str, pipes: Sequence[str]) -> bool:
    """Whether a route is but the way along a pipe that was cut."""
    return list(pipes) == [f"{name}-{k + 1}" for k in range(len(pipes))]


def alone(pipe: str, links: dict[str, Any]) -> Leg:
    """The way along a pipe as it is drawn, by the chainages of its profile where it has one."""
    profile = links[pipe].profile
    begin = 0.0 if profile is None else float(profile.chainage[0])
    return Leg(pipe, begin, begin + links[pipe].length, False)


def spread(route: Route, pieces: dict[str, list[str]], links: dict[str, Any]) -> Route:
    """A route with the pieces of cut pipes in their place, in the order in which it runs through them."""
    cut = [name for name in route.pipes if name in pieces]
    options = []
    for turned in itertools.product((1, -1), repeat=len(cut)):
        ways_of = dict(zip(cut, turned, strict=True))
        whole = [pieces[name][:: ways_of[name]] if name in ways_of else [name] for name in route.pipes]
        options.append(route.model_copy(update={"pipes": tuple(itertools.chain(*whole))}))
        if not cut or (all(pipe in links for pipe in options[-1].pipes) and broken(options[-1], links) is None):
            return options[-1]
    return options[0]


def is_pipe(given: Any) -> bool:
    """Whether a table of a file says that it is a pipe."""
    return isinstance(given, dict) and given.get("type") == "pipe"


def is_known(given: Any) -> bool:
    """Whether a table of a file says a type of link that there is."""
    return isinstance(given, dict) and str(given.get("type")) in KINDS["links"]


def misfits(
    routes: dict[str, Route | None], links: dict[str, Any], named: dict[str, Any], pieces: dict[str, list[str]]
) -> Iterator[tuple]:
    """Faults of routes: what is no pipe, and pipes that do not follow each other.

    named : links as the file has them, those at fault too; pieces : of pipes that are cut
    """
    pipes = [one for one, given in named.items() if one not in links and (is_pipe(given) or not is_known(given))]
    pipes += [one for one, link in links.items() if link.kind == "pipe"]
    for name, route in routes.items():
        if route is None:
            continue
        unknown = False
        for k, pipe in enumerate(route.pipes):
            place = ("routes", name, "pipes", as_said(route, pieces, k))
            if pipe in pipes:
                unknown = unknown or pipe not in links
                continue
            unknown = True
            if pipe in links:
                yield place, f"{show(pipe)} is no pipe but a {links[pipe].kind}; leave it out"
            else:
                known = [*pipes, *pieces]
                near = did_you_mean(pipe, known) or f"; pipes are {listing(known)}"
                yield place, f"no pipe named {show(pipe)}{near}"
        if unknown:
            continue
        k = broken(route, links, named)
        if k is not None:
            pairs = [(pipe, links[pipe]) for pipe in route.pipes[k - 1 : k + 1]]
            ends = " and ".join(f"{pipe} joins {one.from_} and {one.to}" for pipe, one in pairs)
            text = f"{route.pipes[k]} does not follow: {ends}, and no link without length lies between"
            yield ("routes", name, "pipes", as_said(route, pieces, k)), text


def as_said(route: Route, pieces: dict[str, list[str]], k: int) -> int:
    """Which name of the file pipe k of a route came from, pieces of one pipe from the same."""
    whole = {piece: name for name, own in pieces.items() for piece in own}
    names = [whole.get(pipe, pipe) for pipe in route.pipes[: k + 1]]
    return sum(one != before for one, before in itertools.pairwise(names))


def joined(links: dict[str, Any], named: dict[str, Any] = {}) -> dict[str, str]:  # noqa: B006
    """Place -> one that stands for all that links without length join it to, those at fault too."""
    root: dict[str, str] = {}

    def find(name: str) -> str:
        while root.setdefault(name, name) != name:
            name = root[name]
        return name

    pairs = [(link.ports["from"], link.ports["to"]) for link in links.values()
             if link.kind != "pipe" and set(link.ports) == {"from", "to"}]  # fmt: skip
    pairs += [(given.get("from"), given.get("to")) for name, given in named.items()
              if name not in links and isinstance(given, dict) and not is_pipe(given)]  # fmt: skip
    for first, second in pairs:
        if isinstance(first, str) and isinstance(second, str):
            root[find(first)] = find(second)
    return {name: find(name) for name in list(root)}


def ways(route: Route, links: dict[str, Any], named: dict[str, Any] = {}) -> list[list[tuple[int, bool]]]:  # noqa: B006
    """Of every pipe of a route: how it can be run, each with the way before it that leads there."""
    one = joined(links, named)
    ends = [[one.get(place, place) for place in (links[pipe].from_, links[pipe].to)] for pipe in route.pipes]
    found: list[list[tuple[int, bool]]] = [[(-1, False), (-1, True)]]
    for k in range(1, len(ends)):
        now = []
        for backwards in (False, True):
            into = ends[k][1 if backwards else 0]
            before = [j for j, (_, turned) in enumerate(found[-1]) if ends[k - 1][0 if turned else 1] == into]
            now += [(before[0], backwards)] if before else []
        found.append(now)
        if not now:
            break
    return found


def broken(route: Route, links: dict[str, Any], named: dict[str, Any] = {}) -> int | None:  # noqa: B006
    """Number of the first pipe of a route that does not follow the one before it."""
    found = ways(route, links, named)
    return None if found[-1] else len(found) - 1


def legs(route: Route, links: dict[str, Any]) -> list[Leg]:
    """The pipes of a route with their chainages."""
    found = ways(route, links)
    turned, at = [], 0
    for options in reversed(found):
        before, backwards = options[at]
        turned.append(backwards)
        at = before
    begin, made = route.start, []
    for pipe, backwards in zip(route.pipes, reversed(turned), strict=True):
        link = links[pipe]
        if begin is None:
            begin = 0.0 if link.profile is None or backwards else float(link.profile.chainage[0])
        end = begin + link.length
        made.append(Leg(pipe, begin, end, backwards))
        begin = end
    return made

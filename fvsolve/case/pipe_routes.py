"""Routes: consecutive pipes with one running chainage."""

import itertools
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Annotated, Any, NamedTuple

from fvsolve.case.chainage import CutTable, is_pipe
from fvsolve.case.connections import islands, kind_of
from fvsolve.case.probe import ALL
from fvsolve.case.reading import Reading
from fvsolve.errors import article, did_you_mean, listing
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import VALUE, Quantity, ReadContext, Value, ValueFault
from fvsolve.units import show


class PipeNames(Value):
    """Value of a key that lists the names of consecutive pipes."""

    about = (
        "names of consecutive pipes; each begins where the previous pipe ends, or is joined to it by links other than "
        "pipes"
    )
    takes = "list of names"
    changes = VALUE
    schema = {"type": "array", "items": {"type": "string"}, "minItems": 1}

    def read(self, given: Any, setting: ReadContext) -> tuple[str, ...]:
        if not isinstance(given, (list, tuple)) or not given:
            raise ValueError(
                f'{show(given)} is not a list; expected for example ["suction", "main"]'
            )
        faults = [
            ((k,), f"{show(item)} is not a name")
            for k, item in enumerate(given)
            if not isinstance(item, str)
        ]
        faults += [
            ((k,), f"{show(item)} is given twice")
            for k, item in enumerate(given)
            if item in given[:k]
        ]
        if faults:
            raise ValueFault(faults)
        return tuple(given)


class Route(Table):
    """Table `[routes.NAME]`: consecutive pipes with one running chainage."""

    pipes: Annotated[tuple[str, ...], PipeNames()]
    start: Annotated[
        float | None,
        Quantity(
            "length",
            about="chainage of the start of the route [m]; "
            "that of its first pipe (0 if reversed or without `profile`) if left out",
            changes=VALUE,
        ),
    ] = None


class Leg(NamedTuple):
    """Pipe on a route, with its chainages and direction.

    begin, end : chainages where the route enters and leaves the pipe [m]
    backwards : True if the route runs from the `to` end of the pipe to its `from` end
    """

    pipe: str
    begin: float
    end: float
    backwards: bool

    def chainage(self, distance: Any) -> Any:
        """Chainage [m] of points at distances from the `from` end of the pipe [m]."""
        return self.end - distance if self.backwards else self.begin + distance

    def distance(self, chainage: Any) -> Any:
        """Distance from the `from` end of the pipe [m] of points at chainages [m]."""
        return self.end - chainage if self.backwards else chainage - self.begin


def is_cut(name: str, pipes: Sequence[str]) -> bool:
    """True if `pipes` are the pieces of the cut pipe `name`, in order."""
    return list(pipes) == [f"{name}-{k + 1}" for k in range(len(pipes))]


def pipe_leg(pipe: str, links: dict[str, Any]) -> Leg:
    """Leg of a single pipe, from `from` to `to`, with the chainages of its elevation profile, else from 0."""
    profile = links[pipe].profile
    begin = 0.0 if profile is None else float(profile.chainage[0])
    return Leg(pipe, begin, begin + links[pipe].length, False)


def expand_pieces(route: Route, pieces: dict[str, list[str]], links: dict[str, Any]) -> Route:
    """Copy of a route in which cut pipes are replaced by their pieces, in the direction of the route.

    If no directions connect all pipes, the pieces are in the directions of their pipes.
    """
    cut = [name for name in route.pipes if name in pieces]
    options = []
    for turned in itertools.product((1, -1), repeat=len(cut)):
        ways_of = dict(zip(cut, turned, strict=True))
        names = [
            pieces[name][:: ways_of[name]] if name in ways_of else [name] for name in route.pipes
        ]
        options.append(route.model_copy(update={"pipes": tuple(itertools.chain(*names))}))
        if not cut or (
            all(pipe in links for pipe in options[-1].pipes)
            and first_gap(options[-1], links) is None
        ):
            return options[-1]
    return options[0]


def route_faults(
    routes: dict[str, Route | None],
    links: dict[str, Any],
    named: dict[str, Any],
    pieces: dict[str, list[str]],
) -> Iterator[tuple]:
    """Faults (key path, message) of routes: names that are not pipes, and pipes that are not consecutive.

    named : links as in the file, also faulty links; pieces : cut pipe -> names of its pieces
    """
    pipes = [
        item
        for item, given in named.items()
        if item not in links and (is_pipe(given) or kind_of("links", given) is None)
    ]
    pipes += [item for item, link in links.items() if link.kind == "pipe"]
    for name, route in routes.items():
        if route is None:
            continue
        unknown = False
        for k, pipe in enumerate(route.pipes):
            place = ("routes", name, "pipes", index_in_file(route, pieces, k))
            if pipe in pipes:
                unknown = unknown or pipe not in links
                continue
            unknown = True
            if pipe in links:
                yield (
                    place,
                    f"{show(pipe)} is {article(links[pipe].kind)}, not a pipe; leave this name out",
                )
            else:
                known = [*pipes, *pieces]
                near = did_you_mean(pipe, known) or f"; pipes are {listing(known)}"
                yield place, f"no pipe named {show(pipe)}{near}"
        if unknown:
            continue
        k = first_gap(route, links, named)
        if k is not None:
            pairs = [(pipe, links[pipe]) for pipe in route.pipes[k - 1 : k + 1]]
            ends = " and ".join(f"{pipe} joins {item.from_} and {item.to}" for pipe, item in pairs)
            text = f"{route.pipes[k]} does not join the previous pipe: {ends}"
            text += ", and no links of other types join these two pipes"
            yield ("routes", name, "pipes", index_in_file(route, pieces, k)), text


def index_in_file(route: Route, pieces: dict[str, list[str]], k: int) -> int:
    """Index in the list `pipes` of the file for pipe k of a route; all pieces of a cut pipe have the index of its name.

    pieces : cut pipe -> names of its pieces
    """
    cut_pipe = {piece: name for name, own in pieces.items() for piece in own}
    names = [cut_pipe.get(pipe, pipe) for pipe in route.pipes[: k + 1]]
    return sum(following != before for following, before in itertools.pairwise(names))


def joined_places(links: dict[str, Any], named: dict[str, Any] | None = None) -> dict[str, str]:
    """Names of nodes that links other than pipes join : name of a node -> common name of its group of joined nodes.

    Links with other ports than `from` and `to` do not count. links : links by name
    named : links as in the file, also faulty links, which are assumed to join their nodes
    """
    pairs = [
        (link.ports["from"], link.ports["to"])
        for link in links.values()
        if link.kind != "pipe" and set(link.ports) == {"from", "to"}
    ]
    pairs += [
        (given.get("from"), given.get("to"))
        for name, given in (named or {}).items()
        if name not in links and isinstance(given, dict) and not is_pipe(given)
    ]
    known = {
        str(k): [*pair]
        for k, pair in enumerate(pairs)
        if all(isinstance(place, str) for place in pair)
    }
    return {name: group[0] for group in islands(known) for name in group}


def directions(
    route: Route, links: dict[str, Any], named: dict[str, Any] | None = None
) -> list[list[tuple[int, bool]]]:
    """Possible directions of the pipes of a route : for each pipe a list with a pair for each possible direction.

    A pair is (k, True if the pipe is passed backwards); k is the index, in the list of the previous pipe, of a
    direction that leads to this one, -1 for the first pipe. The result ends with an empty list at the first gap.
    named : as for `joined_places`
    """
    root = joined_places(links, named)
    ends = [
        [root.get(place, place) for place in (links[pipe].from_, links[pipe].to)]
        for pipe in route.pipes
    ]
    result: list[list[tuple[int, bool]]] = [[(-1, False), (-1, True)]]
    for k in range(1, len(ends)):
        now = []
        for backwards in (False, True):
            into = ends[k][1 if backwards else 0]
            before = [
                j
                for j, (_, turned) in enumerate(result[-1])
                if ends[k - 1][0 if turned else 1] == into
            ]
            now += [(before[0], backwards)] if before else []
        result.append(now)
        if not now:
            break
    return result


def first_gap(
    route: Route, links: dict[str, Any], named: dict[str, Any] | None = None
) -> int | None:
    """Index of the first pipe of a route that is not connected to the previous pipe; None for a route without gaps.

    named : as for `joined_places`
    """
    result = directions(route, links, named)
    return None if result[-1] else len(result) - 1


def legs(route: Route, links: dict[str, Any]) -> list[Leg]:
    """Legs of a route without gaps: its pipes with chainages and directions."""
    choices = directions(route, links)
    turned, at = [], 0
    for options in reversed(choices):
        before, backwards = options[at]
        turned.append(backwards)
        at = before
    begin, result = route.start, []
    for pipe, backwards in zip(route.pipes, reversed(turned), strict=True):
        link = links[pipe]
        if begin is None:
            begin = 0.0 if link.profile is None or backwards else float(link.profile.chainage[0])
        end = begin + link.length
        result.append(Leg(pipe, begin, end, backwards))
        begin = end
    return result


def read_routes(reading: Reading, cut: CutTable, links: dict[str, Any]) -> dict[str, Route | None]:
    """Routes by name; None for a faulty route. links : links without faults"""
    table, result = cut.table, {}
    named, odd = table.get("links", {}), set()
    for name, given in table.get("routes", {}).items():
        result[name] = None
        if name in table.get("nodes", {}) or name in named or name in ALL:
            text = f"{show(name)} is also the name of a node or link, or a reserved word; expected another name"
            reading.fault(("routes", name), text)
            continue
        with reading.catch("routes", name):
            result[name] = expand_pieces(
                Route.model_validate(given, context=reading.setting), cut.pieces, links
            )
            continue
        odd.add(name)
        with suppress(KeyError, TypeError, ValueError):
            pipes = Route.values()["pipes"].read(given["pipes"], reading.setting)
            result[name] = expand_pieces(Route.model_construct(pipes=pipes), cut.pieces, links)
    faulty = list(route_faults(result, links, named, cut.pieces)) if cut.connections_known else []
    reading.add(faulty)
    lost = odd | {keys[1] for keys, _ in faulty}
    pipes = {name for name, link in links.items() if link.kind == "pipe"}
    lost |= {
        name
        for name, route in result.items()
        if route and (not pipes.issuperset(route.pipes) or first_gap(route, links) is not None)
    }
    return {name: None if name in lost else route for name, route in result.items()}

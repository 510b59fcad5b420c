"""Parts placed on a pipe by chainage; the pipe is cut into pieces between them.

The keys `on = "main", at = "1.84 km"` place a part 1.84 km along the pipe `main`:
a node : the pipe runs through it
a link without `from` and `to` : it lies in the pipe
a link with only `to`, or with one port : it branches off the pipe

Arguments: table : nested dicts of a case as in the file; report : function that takes the key path and the message of a
fault.
"""

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve import units
from fvsolve.case.reading import split_key
from fvsolve.errors import article, did_you_mean, listing
from fvsolve.parts import KINDS, Pipe
from fvsolve.units import show

CHAINAGE_KEYS = ("on", "at")
TIE = 1e-6  # rounding bias [cells]: a pipe drawn in the other direction gets the same cells
# Keys of a pipe that its pieces do not take over.
PIECE_KEYS = (
    "length",
    "cells",
    "minor_loss",
    "fittings",
    "profile",
    "from",
    "to",
    "pieces",
    "bends",
)
Report = Callable[[tuple, str], None]


@dataclass
class Placed:
    """Part placed on a pipe, with its keys as in the file.

    group : "nodes" or "links"; given : keys and values; distance : from the `from` end of the pipe [m]
    """

    group: str
    name: str
    given: dict[str, Any]
    distance: float = 0.0

    @property
    def fits(self) -> bool:
        """True if a part of this type may be placed on a pipe."""
        return (
            kind_of(self.group, self.given) is not None
            and unfit_reason(self.group, self.given) is None
        )

    @property
    def inline(self) -> bool:
        """True if the part is a link that lies in the pipe."""
        kind = kind_of(self.group, self.given)
        return (
            self.fits
            and self.group == "links"
            and "to" in kind.joins
            and "to" not in (*self.given, *kind.may_lack)
        )

    @property
    def joins(self) -> tuple[str, str]:
        """Names (node at the end of the pipe piece before the part, node at the start of the pipe piece after it)."""
        if self.group == "nodes":
            return self.name, self.name
        return (
            (f"{self.name}-in", f"{self.name}-out")
            if self.inline
            else (f"{self.name}-at", f"{self.name}-at")
        )


@dataclass
class CutTable:
    """Case as nested dicts (`table`), in which pipes are replaced by their pieces.

    pieces : cut pipe -> names of its pieces
    origin : (group, name) of an added part -> (group, name) of the part in the file from which it comes
    unreadable : (group, name) of parts that are not read, since they, their pipe or other parts on that pipe are faulty
    uncut : name -> pipe that is not cut, since a part on it is faulty
    connections_known : True if it is known which nodes each link joins
    """

    table: dict[str, Any]
    named: frozenset[str]  # links of the file
    pieces: dict[str, list[str]] = field(default_factory=dict)
    origin: dict[tuple[str, str], tuple[str, str]] = field(default_factory=dict)
    unreadable: set[tuple[str, str]] = field(default_factory=set)
    uncut: dict[str, Pipe] = field(default_factory=dict)
    connections_known: bool = True


def placed(table: dict[str, Any]) -> list[tuple[str, str, dict[str, Any]]]:
    """List of (group, name, keys) of the parts that are placed on a pipe.

    These are parts with a chainage `at`, or with a pipe as `on`; keys : table of the part
    """
    links = table.get("links")
    pipes = (
        [name for name, link in links.items() if is_pipe(link)] if isinstance(links, dict) else []
    )
    bodies = list(table["nodes"]) if isinstance(table.get("nodes"), dict) else []
    result = []
    for group in ("nodes", "links"):
        parts = table.get(group)
        for name, part in parts.items() if isinstance(parts, dict) else ():
            if (
                not isinstance(part, dict)
                or isinstance(part.get("at"), (list, tuple))
                or not part.keys() & {"at", "on"}
            ):
                continue
            kind = KINDS[group].get(str(part.get("type")))
            own = group == "links" and kind is not None and "at" in kind.keys()
            own = own or (part.get("on") in bodies and part.get("on") not in pipes)
            if not own and ("at" in part or part.get("on") in pipes):
                result.append((group, name, part))
    return result


def is_pipe(part: Any) -> bool:
    return isinstance(part, dict) and part.get("type") == "pipe"


def kind_of(group: str, part: dict[str, Any]) -> Any:
    """Class of a part from its keys in the file; None if its type is unknown."""
    return KINDS[group].get(str(part.get("type")))


def unfit_reason(group: str, part: dict[str, Any]) -> str | None:
    """Reason why a part of a known type cannot be placed on a pipe; None if it can."""
    kind = kind_of(group, part)
    if group == "nodes" and (kind.domain != "hydraulic" or kind.own_places(part) is not None):
        return f"{article(kind.kind)} cannot be placed on a pipe; expected a hydraulic node, such as a junction"
    if group == "links" and not set(kind.joins) <= {"from", "to"}:
        text = f"{article(kind.kind)} has other ports than `from` and `to`"
        return f"{text}; place a junction on the pipe and join the part to this junction"
    if kind is Pipe:
        return "a pipe has a length, so it cannot be placed on a pipe; place a junction there and join the pipe to it"
    return None


def add_bends(table: dict[str, Any]) -> dict[str, Any]:
    """Copy of a case, as nested dicts, with a junction added at every bend of a pipe."""
    nodes, links = table.get("nodes"), table.get("links")
    result: dict[str, Any] = {}
    for name, link in links.items() if isinstance(nodes, dict) and isinstance(links, dict) else ():
        bends = link.get("bends") if is_pipe(link) else None
        for k, at in enumerate(bends if isinstance(bends, list) else ()):
            result[f"{name}-bend-{k + 1}"] = {"type": "junction", "on": name, "at": at}
    return {**table, "nodes": {**nodes, **result}} if result else table


def pieces_of(table: dict[str, Any]) -> dict[str, list[str]]:
    """Names of the pieces into which `cut` divides pipes : name of a cut pipe -> names of its pieces."""
    counts: dict[str, int] = {}
    for _, _, part in placed(add_bends(table)):
        if isinstance(part.get("on"), str):
            counts[part["on"]] = counts.get(part["on"], 1) + 1
    return {name: [f"{name}-{k + 1}" for k in range(count)] for name, count in counts.items()}


def settings(table: dict[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Copy of overrides (dotted key -> value) in which keys of pipe pieces are replaced by keys of the file.

    The file states the keys of a piece in the table `pieces` of its pipe.
    given : overrides
    """
    return {
        ".".join(own)
        if (own := original_keys(table, keys := split_key(str(key)))) != keys
        else key: value
        for key, value in given.items()
    }


def original_keys(table: dict[str, Any], keys: tuple[str, ...]) -> tuple[str, ...]:
    """Key path in the file of the key path `keys`, which may be that of a key of a pipe piece.

    The keys of a piece are in the table `pieces` of its pipe; any other key path is returned unchanged.
    """
    match = re.fullmatch(r"(.+)-\d+", keys[1]) if len(keys) > 2 and keys[0] == "links" else None
    if (
        match
        and keys[1] not in table.get("links", {})
        and keys[1] in pieces_of(table).get(match[1], ())
    ):
        return ("links", match[1], "pieces", *keys[1:])
    return keys


def faults(table: dict[str, Any]) -> Iterator[tuple[tuple, str]]:
    """Faults (key path, message) of the keys `on`, `at` and `from` of placed parts, except for the value of `at`."""
    links = table.get("links", {})
    pipes = [name for name, link in links.items() if is_pipe(link)]
    for group, name, part in placed(table):
        on, key = part.get("on"), (group, name)
        if "on" not in part:
            yield (
                key,
                f"`at` is {show(part['at'])}, but `on` is missing; expected the name of the pipe",
            )
        elif on not in pipes:
            near = did_you_mean(str(on), pipes) or f"; pipes are {listing(pipes) or 'none'}"
            yield (*key, "on"), f"no pipe named {show(on)}{near}"
        elif "at" not in part:
            yield key, f"`at` is missing; expected the chainage along {on}"
        if kind_of(group, part) is None:
            continue
        if (reason := unfit_reason(group, part)) is not None:
            yield (*key, "on"), reason
        elif "from" in part:
            text = "`on` and `at` place this link on a pipe, where it starts; remove `from`, or `on` and `at`"
            yield (*key, "from"), text


def cut(
    table: dict[str, Any],
    read_pipes: dict[str, Pipe],
    cells: dict[str, int],
    faulty: set,
    report: Report,
) -> CutTable:
    """Cut the pipes of a case at the parts placed on them; returns the `CutTable`.

    table : nested dicts of the case, with junctions at bends (`add_bends`) and defaults (`fill_parts`)
    read_pipes : pipes without faults, as read; cells : number of cells of each of these pipes
    faulty : (group, name) of parts with a fault from `faults`
    """
    result = CutTable(
        {
            **table,
            "nodes": dict(table["nodes"]),
            "links": {},
            "routes": dict(table.get("routes", {})),
        },
        frozenset(table["links"]),
    )
    pipes = [name for name, item in table["links"].items() if is_pipe(item)]
    by_pipe: dict[str, list[Placed]] = {}
    lost: set[str] = set()  # pipes whose pieces are unknown
    for group, name, part in placed(table):
        item = Placed(group, name, part)
        on = part["on"] if part.get("on") in pipes else next(iter(pipes), None)
        result.connections_known = result.connections_known and on is not None
        stands = "at" in part and read_distance(item, on, read_pipes.get(on), report)
        if (group, name) in faulty or not item.fits or on not in read_pipes or not stands:
            lost.add(on)
        if not item.fits:
            result.unreadable.add((group, name))
        by_pipe.setdefault(on, []).append(item)
        rest = {key: value for key, value in part.items() if key not in CHAINAGE_KEYS}
        if group == "nodes":
            result.table["nodes"][name] = rest
        else:
            first, last = item.joins
            result.table["links"][name] = {
                **rest,
                "from": first,
                **({"to": last} if item.inline else {}),
            }
    links = result.table["links"]
    result.table["links"] = {}
    for name, part in table["links"].items():
        if name not in by_pipe:
            result.table["links"][name] = links.get(name, part)
            continue
        on_it, pipe = by_pipe[name], read_pipes.get(name)
        if pipe is not None and name not in lost and sort_parts(on_it, report):
            cut_pipe(result, name, part, pipe, on_it, cells[name], report)
        else:
            result.uncut |= {} if pipe is None else {name: pipe}
            add_unknown_pieces(result, name, part, on_it, report)
    return result


def add_unknown_pieces(
    result: CutTable, name: str, given: dict[str, Any], parts: list[Placed], report: Report
) -> None:
    """Add the pieces of a pipe that cannot be cut to the table of `result`, with their connections as the only keys.

    name, given : name of the pipe and its keys in the file; parts : parts on it
    """
    names = result.pieces[name] = [f"{name}-{k + 1}" for k in range(len(parts) + 1)]
    name_faults(result, name, given, parts, names, report)
    starts = [given.get("from"), *(part.joins[1] for part in parts)]
    ends = [*(part.joins[0] for part in parts), given.get("to")]
    for own, first, last in zip(names, starts, ends, strict=True):
        # with a profile, since inherited elevations depend on it
        result.table["links"][own] = {"type": "pipe", "from": first, "to": last, "profile": None}
        result.origin["links", own] = ("links", name)
        result.unreadable.add(("links", own))
    for part in parts if result.connections_known else ():
        for place in part.joins if part.group == "links" else ():
            result.table["nodes"][place] = {"type": "junction"}
            result.origin["nodes", place] = ("links", part.name)
    result.table["routes"].setdefault(name, {"pipes": names})


def read_distance(part: Placed, on: str | None, pipe: Pipe | None, report: Report) -> bool:
    """Set the distance of a part along its pipe; return True. If its chainage is faulty, report it and return False.

    on, pipe : name of the pipe, and the pipe as read (None if faulty: the distance is not set)
    """
    key, given = (part.group, part.name, "at"), part.given["at"]
    try:
        chainage = units.parse(given, "length")
    except ValueError as error:
        report(key, str(error))
        return False
    if pipe is None or on != part.given.get("on"):
        return True
    begin = 0.0 if pipe.profile is None else float(pipe.profile.chainage[0])
    part.distance = chainage - begin
    if not 0.0 < part.distance < pipe.length:
        span = f"{on} runs from {begin:.10g} m to {begin + pipe.length:.10g} m"
        end = (
            pipe.from_
            if abs(part.distance) < 1e-9
            else pipe.to
            if abs(part.distance - pipe.length) < 1e-9
            else ""
        )
        reason = (
            f"is the end of {on} at {end}; expected a chainage between its ends"
            if end
            else f"is outside: {span}"
        )
        report(key, f"{show(given)} {reason}")
        return False
    return True


def sort_parts(parts: list[Placed], report: Report) -> bool:
    """Sort the parts on a pipe by distance; return True. If two have the same distance, report it and return False."""
    parts.sort(key=lambda part: part.distance)
    pairs = [
        (part, other)
        for part, other in zip(parts, parts[1:], strict=False)
        if part.distance == other.distance
    ]
    for part, other in pairs:
        text = f"{part.name} has the same place; {remedy_at_equal_chainage(part, other)}, or change `at`"
        report((other.group, other.name, "at"), text)
    return not pairs


def remedy_at_equal_chainage(part: Placed, other: Placed) -> str:
    """Text on how to place two parts at the same chainage."""
    if part.group == other.group == "links":
        return f"place a junction there and join {part.name} and {other.name} to it"
    if part.group == other.group:
        return f"leave out {part.name} or {other.name}"
    link, node = (part, other) if part.group == "links" else (other, part)
    return f"join {link.name} to {node.name}"


def cut_pipe(
    result: CutTable,
    name: str,
    given: dict,
    whole: Pipe,
    parts: list[Placed],
    cells: int,
    report: Report,
) -> None:
    """Add the pieces of a pipe, the nodes between them and the route along them to the table of `result`.

    given, whole : keys of the pipe in the file, and the pipe as read; parts : parts on it, by distance
    cells : number of cells of the pipe
    A piece has its share of these cells by length, rounded, at least 1.
    """
    edges = np.array([0.0, *(part.distance for part in parts), whole.length])
    counts = np.maximum(1, np.floor(np.diff(edges) / whole.length * cells + 0.5 + TIE).astype(int))
    names = result.pieces[name] = [f"{name}-{k + 1}" for k in range(len(parts) + 1)]
    begin = 0.0 if whole.profile is None else float(whole.profile.chainage[0])
    name_faults(result, name, given, parts, names, report)
    write_pieces(result, name, given, whole, parts, edges, counts.tolist())
    result.table["routes"][name] = {"pipes": names, "start": begin}


def name_faults(
    result: CutTable, name: str, given: dict, parts: list[Placed], names: list[str], report: Report
) -> None:
    """Report faults of the names of a cut pipe: names that exist already, and keys of pieces that do not exist.

    The names are those of its pieces (`names`), of nodes between them and of the route along them.
    Other arguments as for `cut_pipe`.
    """
    for item in names:
        if item in result.named:
            result.connections_known = False
            text = f"pipe {name} is cut at the parts and bends on it, and {show(item)} is the name of a piece"
            report(("links", item), f"{text}; rename this link")
    if name in result.table["routes"]:
        text = f"pipe {name} is cut at the parts and bends on it, and the pieces form a route of that name"
        report(("routes", name), f"{text}; rename this route")
    for item in parts:
        for place in dict.fromkeys(item.joins) if item.group == "links" else ():
            if place in result.table["nodes"]:
                result.connections_known = False
                text = f"{item.name} joins {item.given['on']} at a new node {show(place)}, and this name exists already"
                report(("nodes", place), f"{text}; rename this node")
    own = given.get("pieces", {})
    if not isinstance(own, dict) or not all(isinstance(item, dict) for item in own.values()):
        report(
            ("links", name, "pieces"),
            f"{show(own)} is not a table; expected a table for each piece, by its name",
        )
        return
    for item in own:
        if item not in names:
            report(
                ("links", name, "pieces", item),
                f"{name} has no piece of that name; its pieces are {listing(names)}",
            )


def write_pieces(
    result: CutTable,
    name: str,
    given: dict,
    whole: Pipe,
    parts: list[Placed],
    edges: np.ndarray,
    counts: list[int],
):
    """Add the pieces of a pipe and the nodes between them, with their elevations, to the table of `result`.

    edges : float64[k + 1]  distances of the ends of the k pieces from the `from` end [m]; counts : cells of each piece
    Other arguments as for `cut_pipe`.
    """
    links, nodes = result.table["links"], result.table["nodes"]
    rest = {key: value for key, value in given.items() if key not in PIECE_KEYS}
    joins = [item.joins for item in parts]
    starts = [whole.from_, *(last for _, last in joins)]
    ends = [*(first for first, _ in joins), whole.to]
    for k, (low, high) in enumerate(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)):
        piece = {**rest, "from": starts[k], "to": ends[k], "length": high - low, "cells": counts[k]}
        if whole.minor_loss:
            piece["minor_loss"] = whole.minor_loss * (high - low) / whole.length
        if whole.profile is not None:
            part = whole.profile.part(low, high)
            piece["profile"] = part.given
            piece["length"] = part.length
        own = f"{name}-{k + 1}"
        pieces = given.get("pieces")
        keys = pieces.get(own) if isinstance(pieces, dict) else None
        links[own] = piece | (keys if isinstance(keys, dict) else {})
        result.origin["links", own] = ("links", name)
    heights = [stated_elevation(nodes.get(end)) for end in (whole.from_, whole.to)]
    for item, at, (first, last) in zip(parts, edges[1:-1].tolist(), joins, strict=True):
        z = {}
        if whole.profile is None and None not in heights:
            z = {"elevation": heights[0] + (heights[1] - heights[0]) * at / whole.length}
        for place in dict.fromkeys((first, last)):
            if item.group == "nodes":
                nodes[place] = z | nodes[place]
            else:
                nodes[place] = {"type": "junction", **z}
                result.origin["nodes", place] = ("links", item.name)


def stated_elevation(node: Any) -> float | None:
    """Elevation [m] that the keys of a node in the file state; None if it is missing or unreadable."""
    try:
        return float(units.parse(node["elevation"], "length"))
    except (KeyError, TypeError, ValueError):
        return None

"""Parts placed along a pipe by chainage: the pipe is cut into pieces between them. Knows chainages; knows no flow.

`on = "main", at = "1.84 km"` of a node: the pipe runs through it. Of a link without `from` and `to`: it lies in the
pipe. Of one with `to` alone, or with one port: it leaves the pipe there.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fvsolve import units
from fvsolve.case.raw import dotted
from fvsolve.errors import did_you_mean, listing
from fvsolve.parts import KINDS, Pipe
from fvsolve.units import show

WHERE = ("on", "at")
TIE = 1e-6  # of a cell: a piece drawn the other way has as many
OWN = ("length", "cells", "minor_loss", "fittings", "profile", "from", "to", "pieces", "bends")  # keys of each piece
Say = Callable[[tuple, str], None]


@dataclass
class Placed:
    """A part on a pipe, as the file has it, and at which distance from the pipe's `from` end [m]."""

    group: str
    name: str
    said: dict[str, Any]
    distance: float = 0.0

    @property
    def fits(self) -> bool:
        """Whether its kind may stand in a pipe."""
        return kind_of(self.group, self.said) is not None and unfit(self.group, self.said) is None

    @property
    def inline(self) -> bool:
        """Whether it is a link that lies in the pipe."""
        kind = kind_of(self.group, self.said)
        return self.fits and self.group == "links" and "to" in kind.joins and "to" not in (*self.said, *kind.may_lack)

    @property
    def joins(self) -> tuple[str, str]:
        """The places at which the pipe ends and goes on."""
        if self.group == "nodes":
            return self.name, self.name
        return (f"{self.name}-in", f"{self.name}-out") if self.inline else (f"{self.name}-at", f"{self.name}-at")


@dataclass
class Cutting:
    """A case's table with its pipes cut: `pieces` by the name of the whole, `origin` of what was made.

    lost : (group, name) of what cannot be read, as it, its pipe or what stands on that is at fault; wholes : pipes
    that are not cut for that; known : whether it is known what joins what
    """

    table: dict[str, Any]
    named: frozenset[str]  # links of the file
    pieces: dict[str, list[str]] = field(default_factory=dict)
    origin: dict[tuple[str, str], tuple[str, str]] = field(default_factory=dict)
    lost: set[tuple[str, str]] = field(default_factory=set)
    wholes: dict[str, Pipe] = field(default_factory=dict)
    known: bool = True


def placed(table: dict[str, Any]) -> list[tuple[str, str, dict[str, Any]]]:
    """(group, name, part) of what says a chainage, or that it is on a pipe."""
    links = table.get("links")
    pipes = [name for name, one in links.items() if is_pipe(one)] if isinstance(links, dict) else []
    bodies = list(table["nodes"]) if isinstance(table.get("nodes"), dict) else []
    found = []
    for group in ("nodes", "links"):
        parts = table.get(group)
        for name, part in parts.items() if isinstance(parts, dict) else ():
            if not isinstance(part, dict) or isinstance(part.get("at"), (list, tuple)):
                continue
            kind = KINDS[group].get(str(part.get("type")))
            own = group == "links" and kind is not None and "at" in kind.keys()
            own = own or (part.get("on") in bodies and part.get("on") not in pipes)
            if not own and ("at" in part or part.get("on") in pipes):
                found.append((group, name, part))
    return found


def is_pipe(part: Any) -> bool:
    return isinstance(part, dict) and part.get("type") == "pipe"


def kind_of(group: str, part: dict[str, Any]) -> Any:
    """The class of a part of the file; None where its type is at fault."""
    return KINDS[group].get(str(part.get("type")))


def unfit(group: str, part: dict[str, Any]) -> str | None:
    """Why a part of a known kind cannot stand in a pipe."""
    kind = kind_of(group, part)
    if group == "nodes" and (kind.domain != "hydraulic" or kind.own_places(part) is not None):
        return f"a {kind.kind} does not stand in a pipe; wanted a place of the fluid"
    if group == "links" and not set(kind.joins) <= {"from", "to"}:
        return f"a {kind.kind} has other ports than from and to; place a junction, and join that"
    return "a pipe has length; place a junction, and join that" if kind is Pipe else None


def bent(table: dict[str, Any]) -> dict[str, Any]:
    """The same table, a junction at every bend of a pipe."""
    nodes, links = table.get("nodes"), table.get("links")
    found: dict[str, Any] = {}
    for name, one in links.items() if isinstance(nodes, dict) and isinstance(links, dict) else ():
        bends = one.get("bends") if is_pipe(one) else None
        for k, at in enumerate(bends if isinstance(bends, list) else ()):
            found[f"{name}-bend-{k + 1}"] = {"type": "junction", "on": name, "at": at}
    return {**table, "nodes": {**nodes, **found}} if found else table


def pieces_of(table: dict[str, Any]) -> dict[str, list[str]]:
    """Whole pipe -> names of its pieces, as `cut` will make them."""
    many: dict[str, int] = {}
    for _, _, part in placed(bent(table)):
        if isinstance(part.get("on"), str):
            many[part["on"]] = many.get(part["on"], 1) + 1
    return {name: [f"{name}-{k + 1}" for k in range(n)] for name, n in many.items()}


def settings(table: dict[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Settings by dotted keys, those of pieces where a table that is not cut yet has them."""
    return {".".join(own) if (own := own_keys(table, keys := dotted(str(key)))) != keys else key: value
            for key, value in given.items()}  # fmt: skip


def own_keys(table: dict[str, Any], keys: tuple[str, ...]) -> tuple[str, ...]:
    """Where a key of a piece stands in the table of a case that is not cut yet."""
    match = re.fullmatch(r"(.+)-\d+", keys[1]) if len(keys) > 2 and keys[0] == "links" else None
    if match and keys[1] not in table.get("links", {}) and keys[1] in pieces_of(table).get(match[1], ()):
        return ("links", match[1], "pieces", *keys[1:])
    return keys


def faults(table: dict[str, Any]) -> Iterator[tuple[tuple, str]]:
    """What is wrong with the words of placed parts, apart from their chainage."""
    links = table.get("links", {})
    pipes = [name for name, one in links.items() if is_pipe(one)]
    for group, name, part in placed(table):
        on, key = part.get("on"), (group, name)
        if "on" not in part:
            yield key, f"at says {show(part['at'])}; on is missing, the pipe that it counts along"
        elif on not in pipes:
            near = did_you_mean(str(on), pipes) or f"; pipes are {listing(pipes) or 'none'}"
            yield (*key, "on"), f"no pipe named {show(on)}{near}"
        elif "at" not in part:
            yield key, f"at is missing, where along {on} it stands"
        if kind_of(group, part) is None:
            continue
        if (why := unfit(group, part)) is not None:
            yield (*key, "on"), why
        elif "from" in part:
            yield (*key, "from"), "it is on a pipe, which is where it starts from; leave from, or on and at, out"


def cut(table: dict[str, Any], wholes: dict[str, Pipe], cells: dict[str, int], odd: set, say: Say) -> Cutting:
    """The table with pipes cut at what is placed on them.

    wholes : pipes as they are read, those without faults; cells : of each; odd : (group, name) of what says wrongly
    where it stands; say : takes the keys and the text of a fault
    """
    made = Cutting({**table, "nodes": dict(table["nodes"]), "links": {}, "routes": dict(table.get("routes", {}))},
                   frozenset(table["links"]))  # fmt: skip
    pipes = [name for name, one in table["links"].items() if is_pipe(one)]
    by_pipe: dict[str, list[Placed]] = {}
    lost: set[str] = set()  # pipes whose pieces cannot be told
    for group, name, part in placed(table):
        one = Placed(group, name, part)
        on = part["on"] if part.get("on") in pipes else next(iter(pipes), None)
        made.known = made.known and on is not None
        stands = "at" in part and read_distance(one, on, wholes.get(on), say)
        if (group, name) in odd or not one.fits or on not in wholes or not stands:
            lost.add(on)
        if not one.fits:
            made.lost.add((group, name))
        by_pipe.setdefault(on, []).append(one)
        rest = {key: value for key, value in part.items() if key not in WHERE}
        if group == "nodes":
            made.table["nodes"][name] = rest
        else:
            first, last = one.joins
            made.table["links"][name] = {**rest, "from": first, **({"to": last} if one.inline else {})}
    links = made.table["links"]
    made.table["links"] = {}
    for name, part in table["links"].items():
        if name not in by_pipe:
            made.table["links"][name] = links.get(name, part)
            continue
        on_it, whole = by_pipe[name], wholes.get(name)
        if whole is not None and name not in lost and are_apart(on_it, say):
            cut_one(made, name, part, whole, on_it, cells[name], say)
        else:
            made.wholes |= {} if whole is None else {name: whole}
            lose(made, name, part, on_it, say)
    return made


def lose(made: Cutting, name: str, given: dict[str, Any], parts: list[Placed], say: Say) -> None:
    """Put pieces of a pipe into the table of which nothing is known but what they join."""
    names = made.pieces[name] = [f"{name}-{k + 1}" for k in range(len(parts) + 1)]
    taken(made, name, given, parts, names, say)
    starts = [given.get("from"), *(one.joins[1] for one in parts)]
    ends = [*(one.joins[0] for one in parts), given.get("to")]
    for own, first, last in zip(names, starts, ends, strict=True):
        # a profile, for what would lend elevations
        made.table["links"][own] = {"type": "pipe", "from": first, "to": last, "profile": None}
        made.origin["links", own] = ("links", name)
        made.lost.add(("links", own))
    for one in parts if made.known else ():
        for place in one.joins if one.group == "links" else ():
            made.table["nodes"][place] = {"type": "junction"}
            made.origin["nodes", place] = ("links", one.name)
    made.table["routes"].setdefault(name, {"pipes": names})


def read_distance(one: Placed, on: str | None, pipe: Pipe | None, say: Say) -> bool:
    """Fill in how far along its pipe a part stands, where that is in order; False where what it says is at fault."""
    key, given = (one.group, one.name, "at"), one.said["at"]
    try:
        chainage = units.parse(given, "length")
    except ValueError as error:
        say(key, str(error))
        return False
    if pipe is None or on != one.said.get("on"):
        return True
    begin = 0.0 if pipe.profile is None else float(pipe.profile.chainage[0])
    one.distance = chainage - begin
    if not 0.0 < one.distance < pipe.length:
        span = f"{on} runs from {begin:.10g} m to {begin + pipe.length:.10g} m"
        end = pipe.from_ if abs(one.distance) < 1e-9 else pipe.to if abs(one.distance - pipe.length) < 1e-9 else ""
        say(key, f"{show(given)} is not within: {span}" if not end else f"{show(given)} is its end, which is {end}")
        return False
    return True


def are_apart(parts: list[Placed], say: Say) -> bool:
    """Put parts into the order in which they stand; False where two stand at the same place."""
    parts.sort(key=lambda one: one.distance)
    alike = [(one, other) for one, other in zip(parts, parts[1:], strict=False) if one.distance == other.distance]
    for one, other in alike:
        say((other.group, other.name, "at"), f"{one.name} stands there; join it to that, or place it elsewhere")
    return not alike


def cut_one(made: Cutting, name: str, given: dict, whole: Pipe, parts: list[Placed], cells: int, say: Say) -> None:
    """Put the pieces of one pipe and what they need into the table; parts : in their order along it.

    Cells of a piece are as near in size to those of the whole as one at least can be.
    """
    edges = np.array([0.0, *(one.distance for one in parts), whole.length])
    counts = np.maximum(1, np.floor(np.diff(edges) / whole.length * cells + 0.5 + TIE).astype(int))
    names = made.pieces[name] = [f"{name}-{k + 1}" for k in range(len(parts) + 1)]
    begin = 0.0 if whole.profile is None else float(whole.profile.chainage[0])
    taken(made, name, given, parts, names, say)
    lay(made, name, given, whole, parts, edges, counts.tolist())
    made.table["routes"][name] = {"pipes": names, "start": begin}


def taken(made: Cutting, name: str, given: dict, parts: list[Placed], names: list[str], say: Say) -> None:
    """Faults of names that cutting a pipe would give twice, and of keys for pieces that it has not."""
    for one in names:
        if one in made.named:
            made.known = False
            say(("links", one), f"{name} is cut, and {show(one)} is the name of a piece of it; rename one")
    if name in made.table["routes"]:
        say(("routes", name), f"{name} is cut, and so a route by itself; rename this one")
    for one in parts:
        for place in dict.fromkeys(one.joins) if one.group == "links" else ():
            if place in made.table["nodes"]:
                made.known = False
                say(("nodes", place), f"{one.name} joins {one.said['on']} at a place of that name; rename one")
    own = given.get("pieces", {})
    if not isinstance(own, dict) or not all(isinstance(one, dict) for one in own.values()):
        say(("links", name, "pieces"), f"{show(own)} is no table of tables by the names of pieces")
        return
    for one in own:
        if one not in names:
            say(("links", name, "pieces", one), f"no piece of {name} has that name; they are {listing(names)}")


def lay(made: Cutting, name: str, given: dict, whole: Pipe, parts: list[Placed], edges: np.ndarray, counts: list[int]):
    """Write the pieces of a pipe, the nodes between, and how high these lie."""
    links, nodes = made.table["links"], made.table["nodes"]
    rest = {key: value for key, value in given.items() if key not in OWN}
    joins = [one.joins for one in parts]
    starts, ends = [whole.from_, *(last for _, last in joins)], [*(first for first, _ in joins), whole.to]
    for k, (low, high) in enumerate(zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)):
        piece = {**rest, "from": starts[k], "to": ends[k], "length": high - low, "cells": counts[k]}
        if whole.minor_loss:
            piece["minor_loss"] = whole.minor_loss * (high - low) / whole.length
        if whole.profile is not None:
            part = whole.profile.part(low, high)
            piece["profile"] = part.said
            piece["length"] = part.length
        own = f"{name}-{k + 1}"
        links[own] = piece | dict(own_of(given, own))
        made.origin["links", own] = ("links", name)
    heights = [height(nodes.get(end)) for end in (whole.from_, whole.to)]
    for one, at, (first, last) in zip(parts, edges[1:-1].tolist(), joins, strict=True):
        z = {}
        if whole.profile is None and None not in heights:
            z = {"elevation": heights[0] + (heights[1] - heights[0]) * at / whole.length}
        for place in dict.fromkeys((first, last)):
            if one.group == "nodes":
                nodes[place] = z | nodes[place]
            else:
                nodes[place] = {"type": "junction", **z}
                made.origin["nodes", place] = ("links", one.name)


def own_of(given: dict, piece: str) -> Any:
    """What a cut pipe says of one piece alone."""
    own = given.get("pieces")
    found = own.get(piece) if isinstance(own, dict) else None
    return found if isinstance(found, dict) else {}


def height(node: Any) -> float | None:
    """Elevation that a node of the file states [m]; None where it states none that can be read."""
    try:
        return float(units.parse(node["elevation"], "length"))
    except (KeyError, TypeError, ValueError):
        return None

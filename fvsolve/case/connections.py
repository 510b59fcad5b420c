"""Connections of a case: places that links join, unknown names, unconnected nodes, wrong domains.

Arguments of most functions are keys as in the file: nodes, links : name -> keys; node, link : keys of one part.
"""

import functools
from collections.abc import Iterable, Iterator
from typing import Any

from fvsolve.errors import article, did_you_mean, listing
from fvsolve.parts import KINDS, Chamber
from fvsolve.parts.nodes_and_links import NETWORK_DOMAINS
from fvsolve.units import show

Faults = Iterator[tuple[tuple, str]]


WORLD = ""  # root of all bodies; it has no name


def connection_faults(table: dict[str, Any]) -> Faults:
    """Faults (key path, message) of connections of a case: unknown names, unconnected nodes, wrong domains.

    Further faults are separate networks, networks in which no part sets a pressure, and junctions that join only rigid
    columns.
    table : nested dicts of the case as in the file
    """
    nodes, links = (
        {n: p for n, p in _dict(table.get(group)).items()} for group in ("nodes", "links")
    )
    gone = {name: None for name in (*nodes, *links) if has_unknown_places(name, nodes, links)}
    places = _places(nodes, links, gone)
    ends: dict[str, list[str]] = {}
    unjoined = 0  # ports that join no known place
    for name, link in links.items():
        ports = _ports(_dict(link))
        faults = _port_faults(ports, places, nodes, links, _dict(link))
        yield from ((("links", name, *keys), text) for keys, text in faults)
        joined = [place for _, place, _ in ports if isinstance(place, str)]
        unjoined += len(ports) - len({*joined} & places.keys())
        sensed = _sensed_places(_dict(link))
        faults = (
            fault
            for entry in sensed
            for fault in _port_faults([entry], places, nodes, links, _dict(link))
        )
        yield from ((("links", name, *keys), text) for keys, text in faults)
        unjoined += sum(place not in places for _, place, _ in sensed)
        # with ports that the link does not have, such as B of a valve with three
        more = [
            *_dict(_dict(link).get("ports")).values(),
            _dict(link).get("heat_to"),
            *(p for _, p, _ in sensed),
        ]
        joined += [place for place in more if isinstance(place, str) and place not in joined]
        ends[name] = [place for place in [*joined, *_owned_places(name, link)] if place in places]
    yield from _empty_groups(table, nodes)
    tied = {name: _joined_places(name, node, places) for name, node in nodes.items()}
    hanging = _carrier_pairs(nodes, places)
    touched = {place for places in [*ends.values(), *tied.values(), *hanging] for place in places}
    loose = [
        name
        for name, node in nodes.items()
        if name not in gone
        and own_places(name, node) is None
        and not touched & {name, *points_of(name, node)}
    ]
    if len(loose) > unjoined:  # otherwise faulty ports may be those that join them
        yield from ((("nodes", name), "no link touches it") for name in loose)
    if unjoined or gone:
        return  # the connections are not known
    own = {name: [name, *ties] if name in places else ties for name, ties in tied.items() if ties}
    own |= {
        f"{name}.": [name, *points]
        for name, node in nodes.items()
        if (points := points_of(name, node))
    }
    own |= {f"{k}..": group for k, group in enumerate(hanging)}
    held = {
        place
        for name, joined in ends.items()
        for place in joined
        if getattr(kind_of("links", links[name]), "fixes_pressure", False)
    }
    groups = islands(own | {f"links.{name}": places for name, places in ends.items()})
    yield from _island_faults(groups, nodes, places, held)
    yield from _rigid_junctions(nodes, links, ends)


def _empty_groups(table: dict[str, Any], nodes: dict[str, Any]) -> Faults:
    """Faults (key path, message) of empty tables of nodes and links, where no part can stand alone."""
    kinds = [_dict(node).get("type") for node in nodes.values()]
    alone = "body" in kinds or any(
        own_places(name, node) is not None for name, node in nodes.items()
    )
    for group in ("nodes", "links"):
        if table.get(group) == {} and not alone:
            yield (group,), "is empty; expected at least two nodes and a link between them"


def _port_faults(
    ports: list, places: dict[str, Any], nodes: dict[str, Any], links: dict[str, Any], link: Any
) -> Faults:
    """Faults (key path in the link, message) of the ports of a link.

    ports : as from `_ports`; places : names that links can join -> domain
    """
    wrong = []
    for keys, place, domain in ports:
        if isinstance(place, str) and place not in places:
            yield keys, _unknown_place(place, places, nodes, links)
        elif (
            isinstance(place, str)
            and None not in (domain, places[place])
            and not _fits(places[place], domain)
        ):
            wrong.append(keys)
            yield keys, _wrong_domain(place, domain, places, nodes, link)
    sorts = {places.get(place): (keys, place) for keys, place, _ in ports if isinstance(place, str)}
    if not wrong and {"translational", "spatial"} <= set(sorts):
        keys, place = sorts["translational"]
        text = f"{show(place)} is a place on the axis of masses, {show(sorts['spatial'][1])} a place in space"
        yield keys, f"{text}; expected two masses, or two points in space (FRAME.POINT for a frame)"
    sound = [(keys, place) for keys, place, _ in ports if keys not in wrong]
    for k, (keys, place) in enumerate(sound):
        if isinstance(place, str) and place in [other for _, other in sound[:k]]:
            yield keys, f"joins {show(place)} to itself"


def _island_faults(
    groups: list[list[str]], nodes: dict[str, Any], places: dict[str, Any], held: set[str]
) -> Faults:
    """Faults of several islands (groups of connected names), and of islands in which nothing fixes the pressure.

    Islands with a basin may be separate: a reach has its own boundaries.
    places : names that links can join -> domain; held : places at which a link fixes the pressure
    """
    # without fluid; they may be separate, also with masses that they move
    networks = {*NETWORK_DOMAINS}
    connected = []
    for island in groups:
        domains = {places[name] for name in island}
        if not domains & networks or not domains <= networks | {"translational"}:
            connected.append(island)
    groups = connected
    in_basins = {place for name, node in nodes.items() for place in own_places(name, node) or ()}
    if len(groups) > 1 and sum(in_basins.isdisjoint(island) for island in groups) > 1:
        sizes = " | ".join(listing(island, 6) for island in groups)
        text = f"disconnected network of {len(groups)} parts: {sizes}"
        yield ("links",), f"{text}; join these parts, or write a case for each part"
    for island in groups:
        wet = [name for name in island if places[name] in ("hydraulic", None)]
        kinds = [kind_of("nodes", nodes[name]) if name in nodes else Chamber for name in wet]
        if (
            held.isdisjoint(wet)
            and kinds
            and all(kind is not None and not kind.fixes_pressure for kind in kinds)
        ):
            where = "" if len(groups) == 1 else f" of {listing(island, 6)}"
            yield (
                ("nodes",),
                f"nothing fixes the pressure{where}; expected a reservoir, tank or chamber",
            )


def _dict(value: Any) -> dict[str, Any]:
    return value if isinstance(value, dict) else {}


def kind_of(group: str, part: Any) -> Any:
    """Class of a part from its keys in the file, with its variant; None if its type is unknown."""
    kind = KINDS[group].get(str(_dict(part).get("type")))
    return kind and kind.variant(_dict(part))


def _owned_places(name: str, link: Any) -> dict[str, str]:
    """Domains of the nodes that a link contains, such as the chambers of a cylinder : full name -> domain."""
    kind = kind_of("links", link)
    return {f"{name}.{place}": domain for place, domain in kind.owns.items()} if kind else {}


def own_places(name: str, node: Any) -> list[str] | None:
    """Full names of the places of a node that links join, such as the patches of a basin.

    None for a node that links join by its own name.
    """
    kind = kind_of("nodes", node)
    own = kind.own_places(_dict(node)) if kind else None
    return None if own is None else [f"{name}.{place}" for place in own]


def kind_name(part: Any, group: str = "nodes") -> str | None:
    """Type of a part from its keys in the file; None if the type is unknown."""
    kind = kind_of(group, part)
    return None if kind is None else kind.kind


def has_mesh_file(node: Any) -> bool:
    """True if a node is a basin with its mesh in a file, a raster included."""
    return _dict(node).get("type") == "basin" and "mesh" in node


def named_places(name: str, links: dict[str, Any]) -> list[str]:
    """Names of points, patches or chambers of the part `name` that links join, without "NAME." before them."""
    places = [
        place
        for link in links.values()
        for _, place, _ in _ports(_dict(link))
        if isinstance(place, str)
    ]
    return [place.partition(".")[2] for place in places if place.startswith(f"{name}.")]


def ends_of(link: Any) -> list[str]:
    """Values of the keys `from` and `to` of a link in the file, as text."""
    return [str(_dict(link).get(key)) for key in ("from", "to")]


def _joined_places(name: str, node: Any, places: dict[str, Any]) -> list[str]:
    """Names that are connected to a node without a link: its own places (see `own_places`), and bodies in its keys.

    These are the body that carries the node, and bodies that move walls of a basin.
    places : names that links can join
    """
    own, kind = own_places(name, node) or [], kind_of("nodes", node)
    return own + [body for body in (kind.bodies(_dict(node)) if kind else ()) if body in places]


def points_of(name: str, node: Any) -> list[str]:
    """Full names NODE.POINT of the points of a node."""
    kind = kind_of("nodes", node)
    return (
        [f"{name}.{point}" for point in _dict(_dict(node).get("points"))]
        if kind and "points" in kind.keys()
        else []
    )


def _carrier_pairs(nodes: dict[str, Any], places: dict[str, Any]) -> list[list[str]]:
    """Pairs of connected names: each body with its carrier, and one point of each frame with the world.

    places : names that links can join
    """
    pairs = []
    for name, node in nodes.items():
        kind, on = _dict(node).get("type"), _dict(_dict(node).get("joint")).get("on")
        if kind == "body":
            pairs.append([name, on] if isinstance(on, str) and on in places else [name, WORLD])
        elif kind == "frame" and points_of(name, node):
            pairs.append([points_of(name, node)[0], WORLD])
    return pairs


def _fits(domain: str, domains: str) -> bool:
    """True if the domain of a node suits a port; domains : domains that the port accepts, joined by " or "."""
    return domain in domains.split(" or ")


def _places(
    nodes: dict[str, Any], links: dict[str, Any], gone: Iterable[str]
) -> dict[str, str | None]:
    """Domain of every place that links can join, by full name; None if its part is faulty.

    gone : parts whose points, patches or chambers are not known; the names that links use for these are included
    """
    result: dict[str, str | None] = {}
    for name, node in nodes.items():
        kind, own = kind_of("nodes", node), own_places(name, node)
        result |= dict.fromkeys([name] if own is None else own, kind.domain if kind else None)
        result |= dict.fromkeys(points_of(name, node), "spatial")
    result |= {
        place: domain
        for name, link in links.items()
        for place, domain in _owned_places(name, link).items()
    }
    named = [f"{name}.{place}" for name in gone for place in named_places(name, links)]
    return dict.fromkeys(named, None) | result


def has_unknown_places(name: str, nodes: dict[str, Any], links: dict[str, Any]) -> bool:
    """True if the points, patches or chambers of a part are unknown because the part is faulty."""
    for group, parts in (("nodes", nodes), ("links", links)):
        if name in parts and kind_of(group, parts[name]) is None:
            return True
    node = _dict(nodes.get(name))
    return any(not isinstance(node.get(key, {}), dict) for key in ("points", "patches"))


def _ports(link: dict[str, Any]) -> list[tuple[tuple, Any, str | None]]:
    """List of (key path in the link, name that the port joins, required domain) of the ports of a link.

    Ports that may be left out and are not given are omitted; the name of a missing port is None. For a link of unknown
    type the ports are `from` and `to`, with None as domain.
    """
    kind = kind_of("links", link)
    if kind is None:
        return [((key,), link.get(key), None) for key in ("from", "to")]
    keys, found = kind.keys(), []
    for port, domain in kind.joins.items():
        given, below = (
            (_dict(link.get("ports")), ("ports",))
            if "ports" in keys and port not in keys
            else (link, ())
        )
        if port in given or port not in kind.may_lack:
            found.append(((*below, port), given.get(port), domain))
    return found


def _sensed_places(link: dict[str, Any]) -> list[tuple[tuple, str, str]]:
    """List of (key path in the link, name, domain) of the places that a link only senses; entries as of `_ports`."""
    kind, found = kind_of("links", link), []
    for path in kind.sensed_keys if kind is not None else ():
        *tables, key = keys = tuple(path.split("."))
        given = functools.reduce(lambda table, name: _dict(table.get(name)), tables, link).get(key)
        if isinstance(given, str):
            found.append((keys, given, "hydraulic"))
        elif isinstance(given, (list, tuple)):
            found += [
                ((*keys, k), place, "hydraulic")
                for k, place in enumerate(given)
                if isinstance(place, str)
            ]
    return found


def _unknown_place(
    place: str, places: dict[str, Any], nodes: dict[str, Any], links: dict[str, Any]
) -> str:
    if place in links:
        own = [other for other in places if other not in nodes and other.startswith(f"{place}.")]
        if own:
            return f"{show(place)} is {article(_dict(links[place])['type'])}; its places are {listing(own)}"
        text = f"{show(place)} is a link, and links join places, not links; put a junction between the two links"
        return f"{text}; places are {listing(places)}"
    return (
        f"no place named {show(place)}; places are {listing(places)}{did_you_mean(place, places)}"
    )


def joined_shafts(links: Any) -> list[str]:
    """Full names PART.shaft of the shafts of pumps and turbines that links of a network of rotation join."""
    places = [
        place
        for link in links.values()
        for keys, place, domain in _ports(_dict(link))
        if "rotational" in str(domain)
        and isinstance(place, str)
        and is_port_of_network(link, keys[-1])
    ]
    return list(dict.fromkeys(place for place in places if place.endswith(".shaft")))


def is_port_of_network(link: Any, port: Any) -> bool:
    """True if a port of a link, with keys as in the file, is one of a network of rotation, electricity and heat."""
    kind = kind_of("links", link)
    return kind is not None and (kind.in_network or port in kind.network_ports)


def chambers_of(link: Any) -> list[str]:
    """Names of the chambers with fluid that a link contains."""
    return [place for place, domain in link.owns.items() if domain == "hydraulic"]


def _wrong_domain(
    place: str, domain: str, places: dict[str, Any], nodes: dict[str, Any], link: dict[str, Any]
) -> str:
    owned = "shaft" if places[place] == "rotational" else "chamber"
    owned = "point" if places[place] == "spatial" else owned
    state = f"is {article(nodes[place]['type'] if place in nodes else owned)}"
    alike = [name for name, other in places.items() if _fits(other or "", domain)]
    has = f"; {domain} places are {listing(alike)}" if alike else ""
    text = f"{show(place)} {state}, {article(places[place])} place, and this port of {article(link['type'])} needs"
    return f"{text} {article(domain)} place{has}"


def islands(ends: dict[str, list[str]]) -> list[list[str]]:
    """Groups of connected names, in order of appearance; ends : name of a link or node -> names that it connects."""
    root: dict[str, str] = {}

    def find(name: str) -> str:
        while root.setdefault(name, name) != name:
            root[name] = root[root[name]]
            name = root[name]
        return name

    for places in ends.values():
        for place in places:
            root[find(place)] = find(places[0])
    groups: dict[str, list[str]] = {}
    for name in list(root):
        groups.setdefault(find(name), []).append(name)
    return [[name for name in island if name != WORLD] for island in groups.values()]


def _rigid_junctions(
    nodes: dict[str, Any], links: dict[str, Any], ends: dict[str, list[str]]
) -> Faults:
    touching: dict[str, set[str]] = {}
    for link, places in ends.items():
        for place in places:
            touching.setdefault(place, set()).add(str(_dict(links[link]).get("type")))
    for name, node in nodes.items():
        if _dict(node).get("type") in ("junction", "inflow") and touching.get(name) == {
            "rigid-column"
        }:
            fixed = (
                ", since its demand is constant above its required_pressure"
                if "required_pressure" in node
                else ""
            )
            message = f"only rigid columns join this node, so nothing sets its pressure{fixed}"
            yield ("nodes", name), f"{message}; use a chamber with a volume"

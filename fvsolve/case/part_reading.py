"""Stages of the reading of a case: cut pipes, parts, meshes, cells, and the kinds of places that probes may name."""

import functools
from typing import Any, NamedTuple

from fvsolve.case import chainage, connections, resource_checks
from fvsolve.case.case import default_cells
from fvsolve.case.reading import GROUPS, Reading, fill_parts, with_defaults
from fvsolve.case.sections import Numerics
from fvsolve.errors import listing
from fvsolve.parts import KINDS, Chamber, Pipe
from fvsolve.parts.nodes_and_links import is_kind
from fvsolve.parts.pipe.part import MOST_CELLS
from fvsolve.units import show

LINKLESS = ("basin", "body")  # nodes that need no link


class Parts(NamedTuple):
    """Parts without faults, by name, and meshes of basins; lumped : meshes of basins whose water is lumped masses."""

    nodes: dict[str, Any]
    links: dict[str, Any]
    meshes: dict[str, Any]
    lumped: dict[str, Any]


def cut_pipes(reading: Reading, properties: Any, numerics: Numerics | None) -> chainage.CutTable:
    """Case with its pipes cut at their bends and at the parts placed on them.

    properties : properties of the fluid, or None if it is faulty; numerics : table as read, or None if it is faulty
    """
    table = chainage.add_bends(reading.filled)
    tables = (table.get("nodes"), table.get("links"), table.get("routes", {}))
    if not all(isinstance(item, dict) for item in tables) or not chainage.placed(table):
        return chainage.CutTable(reading.filled, frozenset())
    for group, name, part in chainage.placed(table):
        part_kind(reading, group, name, part)
    reading.origin = {
        ("nodes", f"{name}-bend-{k + 1}"): ("links", name, "bends", k)
        for name, item in table["links"].items()
        if chainage.is_pipe(item)
        for k in range(len(item["bends"]) if isinstance(item.get("bends"), list) else 0)
    }
    odd = list(chainage.faults(table))
    reading.add(odd)
    astray = {keys[:2] for keys, _ in odd}
    pipes, table = {}, fill_parts(table)
    for name, given in table["links"].items():
        if chainage.is_pipe(given) and ("links", name) not in astray:
            own = {key: item for key, item in given.items() if key != "pieces"}
            with reading.catch("links", name):
                pipes[name] = read_part(reading, reading.raw.table, Pipe, own)
    if None in (properties, numerics):
        counts = {name: pipe.cells or 1 for name, pipe in pipes.items()}
    else:
        counts = default_cells(pipes, properties, numerics.cell_time)
    result = chainage.cut(table, pipes, counts, astray, reading.fault)
    reading.origin |= result.origin
    return result


def read_parts(reading: Reading, cut: chainage.CutTable) -> Parts:
    """Nodes, links and meshes of basins without faults; nodes with the elevations of the pipe profiles at them."""
    nodes, links = (_read_group(reading, cut, group) for group in ("nodes", "links"))
    nodes = inherit_elevations(nodes, links)
    meshes: dict[str, Any] = {}
    lumped: dict[str, Any] = {}
    for name, node in nodes.items():
        if is_kind(node, "basin"):
            from fvsolve.case import basins

            with reading.catch("nodes", name):
                read_mesh = functools.partial(basins.mesh_of, node, reading.setting)
                (lumped if node.lumped else meshes)[name] = reading.reuse(
                    ("meshes", name), node, read_mesh
                )
    sound = {
        name: node
        for name, node in nodes.items()
        if not is_kind(node, "basin") or name in (*meshes, *lumped)
    }
    return Parts(sound, links, meshes, lumped)


def _read_group(reading: Reading, cut: chainage.CutTable, group: str) -> dict[str, Any]:
    """Nodes or links without faults; group : "nodes" or "links"."""
    table = cut.table
    alone = any(
        connections.kind_name(node) in (*LINKLESS, None) for node in table.get("nodes", {}).values()
    )
    alone = alone or reading.needs_no_fluid
    if group not in table and not (
        group == "links" and alone or "controls" in table and not table.get("links")
    ):
        reading.fault((), f"[{group}] is missing: {GROUPS[group]}")
    result = {}
    for name, part in table.get(group, {}).items():
        reading.add(((group, name), text) for text in resource_checks.name_faults(name))
        if not isinstance(part, dict):
            reading.fault(
                (group, name), f"{show(part)} is not a table; expected a table with a type"
            )
            continue
        kind = part_kind(reading, group, name, part)
        if kind is not None and (group, name) not in cut.unreadable:
            make = functools.partial(read_part, reading, table, kind, part)
            with reading.catch(group, name):
                result[name] = reading.reuse((group, name), reading.own_keys(part), make)
    return result


def part_kind(reading: Reading, group: str, name: str, part: dict[str, Any]) -> Any:
    """Class of a part from its keys in the file; None, with a fault, if its type is missing or unknown."""
    known = KINDS[group]
    if "type" not in part:
        return reading.fault(
            (group, name), f"type is missing; expected one of {listing(sorted(known))}"
        )
    kind = part["type"]
    if isinstance(kind, str) and kind in known:
        return known[kind]
    other = "links" if group == "nodes" else "nodes"
    if isinstance(kind, str) and kind in KINDS[other]:
        hint = f"; types are {listing(known)}; it belongs under [{other}]"
    else:
        from fvsolve.case.part_names import type_hint  # names of practice, only for a fault

        hint = type_hint(str(kind), group)
    return reading.fault((group, name, "type"), f"unknown type {show(kind)}{hint}")


def read_part(reading: Reading, table: dict[str, Any], kind: Any, given: dict[str, Any]) -> Any:
    """Part of the class `kind` from its keys in the file, completed by the defaults of the case `table`."""
    rest = {key: value for key, value in with_defaults(table, given).items() if key != "type"}
    return kind.variant(rest).model_validate(rest, context=reading.setting)


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
            missing = {
                key: value for key, value in given.items() if getattr(node, key, value) is None
            }
            if missing:
                result[name] = node.model_copy(update=missing)
    return {name: result.get(name, node) for name, node in nodes.items()} if result else nodes


def table_kinds(table: dict[str, Any], group: str) -> dict[str, Any]:
    """Class of each node or link of a case by name; None for an unknown type. table : nested dicts as in the file"""
    kinds = {name: connections.kind_of(group, part) for name, part in table.get(group, {}).items()}
    return {
        name: kind and kind.variant(with_defaults(table, table[group][name]))
        for name, kind in kinds.items()
    }


def place_kinds(
    cut: chainage.CutTable, parts: Parts, scalars: dict[str, Any], faulty: bool
) -> dict[str, Any]:
    """Kinds of places and parts that probes may name, as for `read_probe`, without routes.

    faulty : True if faults were found, so that points, patches or pieces of some parts may be unknown
    """
    table = cut.table
    nodes, links = table_kinds(table, "nodes"), table_kinds(table, "links")
    bare = [
        name
        for name, kind in nodes.items()
        if is_kind(kind, "basin") and name not in (*parts.meshes, *parts.lumped)
    ]
    nodes |= {
        f"{name}.{place}": Chamber
        for name, kind in links.items()
        if kind
        for place, domain in kind.owns.items()
        if domain == "hydraulic"
    }
    if shafts := connections.joined_shafts(table.get("links", {})):
        from fvsolve.parts.rotation import ShaftPlace

        nodes |= dict.fromkeys(shafts, ShaftPlace)
    for name, node in parts.nodes.items():
        if is_kind(node, "body"):
            from fvsolve.case.bodies import BodyQuantities

            nodes[name] = BodyQuantities(node)
    for name, node in table.get("nodes", {}).items():  # faulty nodes included
        if points := connections.points_of(name, node):
            from fvsolve.parts.body import BodyPoint

            nodes |= dict.fromkeys(points, BodyPoint)
    nodes |= dict.fromkeys(bare)  # faulty
    for name in (*parts.meshes, *parts.lumped):
        from fvsolve.case import basins

        nodes |= basins.probe_kinds(
            name, parts.nodes[name], parts.meshes.get(name), parts.lumped.get(name), scalars
        )
    pipes = {name: link for name, link in parts.links.items() if getattr(link, "along", None)}
    uncut: list[str] = []
    if faulty:  # pipes with unknown pieces, and parts with unknown points, patches or chambers
        groups = table.get("nodes", {}), table.get("links", {})
        uncut += [
            name
            for name, link in groups[1].items()
            if chainage.is_pipe(link) and not isinstance(link.get("bends", []), list)
        ]
        uncut += [
            name
            for group in groups
            for name in group
            if connections.has_unknown_places(name, *groups)
        ]
    return {
        "nodes": nodes,
        "links": links,
        "scalars": scalars,
        "uncut": dict.fromkeys(uncut),
        "pipes": pipes,
    }


def network_table(cut: chainage.CutTable, parts: Parts) -> dict[str, Any]:
    """Nested dicts of the case for the check of connections, in which basins have all patches of their meshes.

    A basin with a faulty mesh file has the patches that links name. A node that cannot be read is replaced by a
    junction; links that cannot be read are left out, except pipes.
    """
    nodes, links = cut.table.get("nodes", {}), cut.table.get("links", {})
    patches = {}
    for name, mesh in parts.meshes.items():
        from fvsolve.case import basins

        patches[name] = basins.patch_names(mesh)
    lost = [
        name
        for name, part in nodes.items()
        if connections.has_mesh_file(part) and name not in (*parts.meshes, *parts.lumped)
    ]
    patches |= {name: connections.named_places(name, links) for name in lost}
    if not patches and not cut.unreadable:
        return cut.table
    own = {}
    for name, names in patches.items():
        given = nodes[name].get("patches")  # a value of another type is a fault of its own
        own[name] = {
            **nodes[name],
            "patches": dict.fromkeys(names, {}) | (given if isinstance(given, dict) else {}),
        }
    own |= {name: {"type": "junction"} for group, name in cut.unreadable if group == "nodes"}
    unfit = [
        name
        for group, name in cut.unreadable
        if group == "links" and not chainage.is_pipe(links[name])
    ]
    links = {name: part for name, part in links.items() if name not in unfit}
    return {**cut.table, "nodes": {**nodes, **own}, "links": links}


def fill_cells(
    reading: Reading, links: dict[str, Any], properties: Any, numerics: Numerics | None
) -> dict[str, Any]:
    """Links in which pipes have their default number of cells; unchanged if the fluid or numerics are faulty."""
    if properties is None or numerics is None:
        return links
    pipes = {name: link for name, link in links.items() if link.kind == "pipe"}
    counts = default_cells(pipes, properties, numerics.cell_time)
    worst = max(counts, key=counts.get, default=None)
    if worst is not None and counts[worst] > MOST_CELLS:
        text = f"would cut {worst} into {counts[worst]:.3g} cells, more than {MOST_CELLS:.0e}; expected a longer time"
        reading.fault(("numerics", "cell_time"), text)
        return links
    filled = {
        name: links[name].model_copy(update={"cells": count})
        for name, count in counts.items()
        if count != links[name].cells
    }
    return {name: filled.get(name, link) for name, link in links.items()}

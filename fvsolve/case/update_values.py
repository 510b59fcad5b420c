"""Fast reading of a case that differs from an earlier case only in numbers of its parts."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

from fvsolve.case import check, inherited_elevations
from fvsolve.case.case import Case
from fvsolve.case.chainage import add_bends, placed
from fvsolve.parts import KINDS, Basin
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import Quantity

GROUPS = ("nodes", "links")
PRESENCE_KEYS = ("required_pressure",)  # keys whose presence alone changes the case


def update_values(reader: Any) -> Case | None:
    """Copy of the case `reader.before` with new numbers of parts; None if the new case must be read in full.

    It must be read in full if more than numbers of parts may change, and if there is a fault.
    reader : reader of the new case; parts as read and faults are written to it, also if the result is None
    Names, types, connections, probes, expectations and all other tables are kept.
    """
    before, raw = reader.before, reader.raw
    if (
        before is None
        or reader.faults
        or not is_self_contained(before)
        or not all(is_number_key(raw, keys) for keys in raw.overridden)
    ):
        return None
    setting = reader.setting
    setting.ambient, reader.read = before.ambient_pressure, dict(before.read)
    parts = {}
    for group in GROUPS:
        parts[group] = {}
        for name, given in raw.table.get(group, {}).items():
            known = before.read.get((group, name))
            if known is None:
                return None
            if known[0] is not given:
                try:
                    known = given, reader.part(type(known[1]), read_before(given, *known))
                except ValueError:
                    return None
                reader.read[group, name] = known
            parts[group][name] = known[1]
    nodes, numerics = inherited_elevations.inherit_elevations(**parts), before.numerics
    about = before.ambient_pressure, before.gravity, before.properties, raw
    reader.add(check.parts(nodes, parts["links"], *about, numerics.start, {}, {}))
    links = reader.cells(parts["links"], before.properties, numerics)
    if setting.lookups or reader.faults:
        return None
    reader.add(reader.sizes(numerics, before.output, links, {}, before.properties))
    if reader.faults:
        return None
    case = replace(before, nodes=nodes, links=links, raw=raw.table, read=reader.read)
    return case if before.exact is None else reader.exact(case)


def read_before(given: dict[str, Any], before: dict[str, Any], part: Any) -> dict[str, Any]:
    """Keys of a part (`given`) in which unchanged schedules are replaced by the schedules read for the earlier case.

    given, before : keys of the part as in the file, now and earlier; part : part as read earlier
    """
    values = vars(part)
    same = {key: schedule for key, value in given.items() if isinstance(schedule := values.get(key), Schedule)
            and isinstance(value, dict) and before.get(key) is value}  # fmt: skip
    return {**given, **same}


def is_self_contained(case: Case) -> bool:
    """True if a case has no files, measurements, signals, scalars, basins, placed parts or computed equilibrium.

    An exact solution, if the case has one, must also be stated in its file.
    """
    no_outer_input = not (
        placed(add_bends(case.raw))
        or case.signals
        or case.scalars
        or case.compare
        or case.copies
        or case.equilibrium_nodes
    )
    exact_in_file = case.exact is None or "exact" in case.raw
    return no_outer_input and exact_in_file and not any(isinstance(node, Basin) for node in case.nodes.values())


def is_number_key(raw: Any, keys: tuple) -> bool:
    """True if the value at a key path of a case is a number or a schedule of a part, or lies within one.

    Keys in `PRESENCE_KEYS` are excluded. raw : case before its values are read (`Raw`)
    """
    if len(keys) < 3 or keys[0] not in GROUPS or keys[2] in PRESENCE_KEYS:
        return False
    part = raw.get(keys[:2])
    return isinstance(part, dict) and keys[2] in number_keys(KINDS[keys[0]].get(part.get("type")))


@functools.cache
def number_keys(kind: type | None) -> frozenset[str]:
    """Keys of a type of part that are numbers or schedules."""
    values = {} if kind is None else kind.values()
    return frozenset(key for key, value in values.items() if isinstance(value, (Quantity, Scheduled)))

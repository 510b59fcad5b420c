"""A case that was read before, with numbers of its parts moved. Knows what they cannot change; reads nothing else."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

from fvsolve.case import check, heights
from fvsolve.case.case import Case
from fvsolve.case.placing import bent, placed
from fvsolve.parts import KINDS, Basin
from fvsolve.parts.schedule import Schedule, Scheduled
from fvsolve.parts.value import Quantity

GROUPS = ("nodes", "links")
SEEN = ("required_pressure",)  # of which it counts whether they are there


def moved(reader: Any) -> Case | None:
    """The case as it would be read anew; None where more than numbers of parts may be other, or something is wrong.

    Names, kinds, what joins what, and so probes and claims are those of before, and so is every other table.
    """
    before, raw = reader.before, reader.raw
    if before is None or reader.faults or not whole(before) or not all(number(raw, keys) for keys in raw.overridden):
        return None
    setting = reader.setting
    setting.ambient, reader.read = before.ambient_pressure, dict(before.read)
    found = {}
    for group in GROUPS:
        found[group] = {}
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
            found[group][name] = known[1]
    nodes, numerics = heights.lent(**found), before.numerics
    about = before.ambient_pressure, before.gravity, before.properties, raw
    reader.add(check.parts(nodes, found["links"], *about, numerics.start, {}, {}))
    links = reader.cells(found["links"], before.properties, numerics)
    if setting.asked or reader.faults:
        return None
    reader.add(reader.sizes(numerics, before.output, links, {}, before.properties))
    if reader.faults:
        return None
    made = replace(before, nodes=nodes, links=links, raw=raw.table, read=reader.read)
    return made if before.exact is None else reader.exact(made)


def read_before(given: dict[str, Any], before: dict[str, Any], part: Any) -> dict[str, Any]:
    """A part's table with numbers over time as they were read before, where what they were read from stays."""
    said = vars(part)
    same = {key: found for key, value in given.items() if isinstance(found := said.get(key), Schedule)
            and isinstance(value, dict) and before.get(key) is value}  # fmt: skip
    return {**given, **same}


def whole(case: Case) -> bool:
    """Whether nothing of a case comes from files or signals, and nothing looks at numbers of parts but parts."""
    alone = not (placed(bent(case.raw)) or case.signals or case.scalars or case.compare or case.copies or case.found)
    settled = case.exact is None or "exact" in case.raw
    return alone and settled and not any(isinstance(node, Basin) for node in case.nodes.values())


def number(raw: Any, keys: tuple) -> bool:
    """Whether what is set at a place is a number, or one over time, of a part."""
    if len(keys) < 3 or keys[0] not in GROUPS or keys[2] in SEEN:
        return False
    part = raw.get(keys[:2])
    return isinstance(part, dict) and keys[2] in numbers(KINDS[keys[0]].get(part.get("type")))


@functools.cache
def numbers(kind: type | None) -> frozenset[str]:
    """Keys of a kind of part that are numbers, or numbers over time."""
    values = {} if kind is None else kind.values()
    return frozenset(key for key, value in values.items() if isinstance(value, (Quantity, Scheduled)))

"""What a case says beyond what practice knows, probably in another unit. Knows what keys declare; knows no part."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from fvsolve import units
from fvsolve.case import defaults
from fvsolve.errors import Notice
from fvsolve.parts.schedule import Schedule
from fvsolve.parts.table import Table
from fvsolve.parts.value import Quantity, Usual
from fvsolve.units import DIMENSIONS

SHARES = 3.0  # of a class that a limit may plausibly allow
MOST_LOOKED = 10_000  # parts that are remembered
LOOKED: dict[int, tuple[Table, Any, list]] = {}  # id -> part, what its file says, what is odd in it
TWO = (
    "smooth through two entries is a straight line; one more of the same value before the first, and behind the last, "
    "makes it level at both ends"
)
TOP = {  # keys that stand in no table: fields of a case
    "ambient_pressure": Quantity("pressure", usual=Usual(3e4, 2e6, "mountains to deep caissons")),
    "gravity": Quantity("acceleration", usual=Usual(1.0, 30.0, "the Moon to Jupiter")),
}


def notices(case: Any) -> list[Notice]:
    """One notice for every key outside its usual range, and for those that are odd beside one another."""
    parts = {("fluid",): case.fluid}
    parts |= {(group, name): part for group in ("nodes", "links") for name, part in getattr(case, group).items()}
    found = [_notice((), (key,), case, *odd) for key, value in TOP.items()
             if (odd := _beyond(value, getattr(case, key), case.raw.get(key)))]  # fmt: skip
    found += [_notice(place, *odd[:1], case, *odd[1:]) for place, part in parts.items()
              for odd in _of_part(part, _said(case.raw, place))]  # fmt: skip
    found += [_notice(("limits", name), ("share_of_class",), case, limit.share_of_class, SHARES,
                      f"{limit.share_of_class:g} of what the class bears; a share of 1 is all of it")
              for name, limit in case.limits.items() if (limit.share_of_class or 0.0) > SHARES]  # fmt: skip
    found += [_notice(("links", defaults.whole(case.raw, name)), ("wave_speed",), case, *odd)
              for name, link in case.links.items() if (odd := _wave_speed(case, name, link))]  # fmt: skip
    return list({(one.place, one.text): one for one in found}.values())


def _wave_speed(case: Any, name: str, link: Any) -> tuple[float, float, str] | None:
    """(value, limit, text) of a wave speed beside a material that says another."""
    if getattr(link, "wave_speed", None) is None or link.material is None:
        return None
    from fvsolve.case.waves import at_odds  # most pipes say one of them

    return at_odds(case, name)


def _of_part(part: Table, said: Any) -> list[tuple[tuple[Any, ...], float, float, str]]:
    """What is odd in a part, looked for once while it is the same and its file says the same."""
    known = LOOKED.get(id(part))
    if known is None or known[0] is not part or known[1] is not said:
        if len(LOOKED) >= MOST_LOOKED:
            LOOKED.clear()
        known = LOOKED[id(part)] = part, said, [*_of_table(part, said)]
    return known[2]


def _of_table(table: Table, said: Any) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
    """(keys, value, limit, text) of what is odd in a table and in those inside it."""
    for name, info in type(table).model_fields.items():
        key, value = info.alias or name, getattr(table, name)
        given = _said(said, (key,))
        if isinstance(value, Table):
            yield from (((key, *keys), *rest) for keys, *rest in _of_table(value, given))
        for one in info.metadata:
            odd = None if value is None else _beyond(one, value, given)
            if odd:
                yield (key,), *odd
        if isinstance(value, Schedule) and value.kind == "smooth" and len(value.time) == 2:
            yield (key,), 2.0, 3.0, TWO
    yield from table.unusual()


def _beyond(declared: Any, value: Any, given: Any) -> tuple[float, float, str] | None:
    """(value, limit, text) of the number that is outside the usual range; None where all are within."""
    usual = getattr(declared, "usual", None)
    for x in _numbers(value) if usual else ():
        if x == 0.0 or usual.least <= x <= usual.greatest:
            continue
        unit = "" if declared.dimension == "number" else f" {DIMENSIONS[declared.dimension].si}"
        given = f"{x:g}{unit}" if not isinstance(given, str) else given
        span = f"{usual.least:g} to {usual.greatest:g}{unit}, {usual.practice}"
        meant = units.likely(given, declared.dimension, usual.least, usual.greatest)
        return x, usual.least if x < usual.least else usual.greatest, f"{given} is outside {span}{meant}"
    return None


def _numbers(value: Any) -> list[float]:
    """The numbers of a quantity, a schedule or a table of areas."""
    value = getattr(value, "area", getattr(value, "value", value))
    return [float(x) for x in (value if hasattr(value, "__len__") else [value])]


def _said(raw: Any, keys: tuple[Any, ...]) -> Any:
    for key in keys:
        raw = raw.get(key) if isinstance(raw, dict) else None
    return raw


def _notice(place: tuple, keys: tuple, case: Any, value: float, limit: float, text: str) -> Notice:
    whole = defaults.place(case.raw, (*place, *keys))
    where, key = ".".join(whole[: len(place)]), ".".join(map(str, keys))
    return Notice("range", where, f"{f'{where}.{key}' if where else key}: {text}", key, value, limit)

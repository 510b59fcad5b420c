"""Notices of a case: values outside usual ranges, wave speeds that contradict the wall, schedules after the end."""

import functools
import math
import weakref
from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve import units
from fvsolve.case.reading import default_place, pipe_of_piece, raw_link, with_defaults
from fvsolve.errors import Notice
from fvsolve.parts import KINDS, Pipe
from fvsolve.parts.pipe.pipe_wall import elastic_compliance
from fvsolve.parts.schedule import Schedule
from fvsolve.parts.table_model import Table
from fvsolve.parts.value import Quantity, UsualRange
from fvsolve.units import DIMENSIONS

# Allowed ratio. Anchoring changes the wave speed of a plastic pipe by 12 %, the spread of moduli by as much.
ALLOWED_RATIO = 1.2
# keys that define a wall
WALL_KEYS = ("diameter", "nominal", "schedule", "class", "material", "lining")
# entries of a hand-written schedule; longer schedules are records, of which a run may use a part
MAX_ENTRIES = 20
MAX_CLASS_FRACTION = 3.0  # largest plausible limit, as a multiple of the pressure class
SHOWN = {"rainfall": "mm/h"}  # dimension -> unit of its numbers in notices, where SI is not usual
# id -> weak reference to a part, its raw table, its unusual values
CACHE: dict[int, tuple[Any, Any, list]] = {}
TWO_ENTRIES = (
    "smooth through two entries is a straight line; for zero slope at both ends, add an entry with the first value "
    "before the first entry, and an entry with the last value after the last entry"
)
TOP = {  # keys outside tables
    "ambient_pressure": Quantity(
        "pressure", usual=UsualRange(3e4, 2e6, "mountains to deep caissons")
    ),
    "gravity": Quantity("acceleration", usual=UsualRange(1.0, 30.0, "the Moon to Jupiter")),
}


def range_notices(case: Any) -> list[Notice]:
    """Notices of values outside the usual range of their key, and of keys that contradict each other."""
    parts = {("fluid",): case.fluid, ("numerics",): case.numerics}
    parts |= {
        (group, name): part
        for group in ("nodes", "links", "scalars")
        for name, part in getattr(case, group).items()
    }
    parts |= {("controls", name): block.control for name, block in case.controls.items()}
    result = [
        _notice((), (key,), case, *odd)
        for key, value in TOP.items()
        if (odd := _beyond(value, getattr(case, key), case.raw.get(key)))
    ]
    result += [
        _notice(place, *odd[:1], case, *odd[1:])
        for place, part in parts.items()
        for odd in _of_part(part, _raw_part(case.raw, place))
    ]
    result += [
        _notice(
            ("limits", name),
            ("class_fraction",),
            case,
            limit.class_fraction,
            MAX_CLASS_FRACTION,
            f"{limit.class_fraction:g} times the pressure class; 1 is the class itself",
        )
        for name, limit in case.limits.items()
        if (limit.class_fraction or 0.0) > MAX_CLASS_FRACTION
    ]
    result += [
        _notice(("links", pipe_of_piece(case.raw, name)), ("wave_speed",), case, *odd)
        for name, link in case.links.items()
        if (odd := wave_speed_mismatch(case, name, link))
    ]
    return list({(notice.place, notice.text): notice for notice in result}.values())


def wave_speed_mismatch(case: Any, name: str, pipe: Any) -> tuple[float, float, str] | None:
    """Stated wave speed [m/s], wave speed from the wall [m/s] and message, as a tuple; None if they agree.

    A ratio of up to `ALLOWED_RATIO` is allowed. The result is also None for a link that does not state both, and if the
    keys of the wall are incomplete. name, pipe : name of a link, and the link
    """
    if getattr(pipe, "wave_speed", None) is None or pipe.material is None:
        return None
    keys = raw_link(case.raw, name)
    try:
        wall = Pipe.model_validate(
            {"from": "a", "to": "b", "length": 1.0, **{k: keys[k] for k in WALL_KEYS if k in keys}}
        )
    except ValueError:  # a material without a wall thickness
        return None
    speed = math.sqrt(
        1.0
        / (1.0 / case.properties.bulk_modulus + elastic_compliance(wall))
        / case.properties.density
    )
    if speed / ALLOWED_RATIO <= pipe.wave_speed <= speed * ALLOWED_RATIO:
        return None
    size = " ".join(str(keys[key]) for key in ("material", "class", "nominal") if key in keys)
    text = (
        f"{case.amount(pipe.wave_speed, 'velocity')} is stated, but the wall of {size} gives "
        f"{case.amount(speed, 'velocity')}; leave out `wave_speed`, or `material` and `class`"
    )
    return pipe.wave_speed, speed, text


def _of_part(part: Table, raw: Any) -> list[tuple[tuple[Any, ...], float, float, str]]:
    """Result of `_of_table` for a part, cached while `part` and `raw` (its keys in the file) are the same objects.

    The entry is dropped with the part.
    """
    key = id(part)
    known = CACHE.get(key)
    if known is None or known[0]() is not part or known[1] is not raw:
        known = CACHE[key] = (
            weakref.ref(part, lambda _: CACHE.pop(key, None)),
            raw,
            [*_of_table(part, raw)],
        )
    return known[2]


def _of_table(table: Table, raw: Any) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
    """Yield (key path, value [SI], limit [SI], message) for each unusual value of a table and of its inner tables.

    raw : content of the table as in the file
    """
    for name, key, declarations in _fields_of(type(table)):
        if (value := getattr(table, name)) is None:
            continue
        if isinstance(value, Table):
            yield from (
                ((key, *keys), *rest) for keys, *rest in _of_table(value, _raw_value(raw, (key,)))
            )
        for declaration in declarations:
            if odd := _beyond(declaration, value, _raw_value(raw, (key,))):
                yield (key,), *odd
        if isinstance(value, Schedule) and value.kind == "smooth" and len(value.time) == 2:
            yield (key,), 2.0, 3.0, TWO_ENTRIES
    yield from table.unusual()


@functools.cache
def _fields_of(kind: type[Table]) -> list[tuple[str, str, list]]:
    """Fields of a type of tables : (name, key in the file, declarations of its values that state a usual range)."""
    return [
        (name, info.alias or name, [value for value in info.metadata if _states_range(value)])
        for name, info in kind.model_fields.items()
    ]


def _states_range(declared: Any) -> bool:
    return any(
        getattr(value, "usual", None) for value in (declared, getattr(declared, "number", None))
    )


def _beyond(declared: Any, value: Any, given: Any) -> tuple[float, float, str] | None:
    """First number of a key outside its usual range : (number [SI], end of the range [SI], message), else None.

    declared : declaration of the key; value, given : its value as read and as in the file
    """
    if isinstance(value, float):
        declared = getattr(declared, "number", declared)  # a key that is a number or a table
    usual = getattr(declared, "usual", None)
    if not usual:
        return None
    # of a table of areas, a schedule, a quantity
    numbers = getattr(value, "area", getattr(value, "value", value))
    for x in map(float, numbers if hasattr(numbers, "__len__") else [numbers]):
        if x == 0.0 or not math.isfinite(x) or usual.least <= x <= usual.greatest:
            continue
        shown = SHOWN.get(declared.dimension, DIMENSIONS[declared.dimension].si)
        unit = "" if declared.dimension == "number" else f" {shown}"
        per = units.convert(1.0, declared.dimension, shown) if declared.dimension in SHOWN else 1.0
        if not isinstance(given, str) or getattr(value, "kind", "") == "formula":
            given = f"{per * x:g}{unit}"
        span = f"{per * usual.least:g} to {per * usual.greatest:g}{unit}, {usual.source}"
        hint = units.likely(given, declared.dimension, usual.least, usual.greatest)
        return (
            x,
            usual.least if x < usual.least else usual.greatest,
            f"{given} is outside {span}{hint}",
        )
    return None


def _raw_value(raw: Any, keys: tuple[Any, ...]) -> Any:
    for key in keys:
        raw = raw.get(key) if isinstance(raw, dict) else None
    return raw


def _raw_part(raw: Any, place: tuple[Any, ...]) -> Any:
    """Keys of a part in the file, completed by defaults; None for a part that is not in the file."""
    part = _raw_value(raw, place)
    return with_defaults(raw, part) if isinstance(part, dict) and place[0] in KINDS else part


def _notice(place: tuple, keys: tuple, case: Any, value: float, limit: float, text: str) -> Notice:
    path = default_place(case.raw, (*place, *keys))
    where, key = ".".join(path[: len(place)]), ".".join(map(str, keys))
    return Notice(
        "range", where, f"{f'{where}.{key}' if where else key}: {text}", key, value, limit
    )


def end_notices(case: Any) -> list[Notice]:
    """Notices of each schedule that still changes after the end of the run, of each trip, and of samples after it."""
    end, result = case.numerics.end, []
    controls = {name: block.control for name, block in case.controls.items()}
    for group, parts in (("nodes", case.nodes), ("links", case.links), ("controls", controls)):
        for name, part in parts.items():
            for key, time in starts_after_end(part, end):
                place = f"{group}.{name}"
                late, last = (case.moment(t) for t in (time, end))
                verb = "occurs at" if key == "trip" else "continues to"
                text = f"{place}.{key}: {verb} {late}, after the end of the run at {last}"
                result.append(Notice("end", place, text, key, time, end))
    span = end - case.numerics.start
    for name, control in controls.items():
        if control.period is not None and control.offset + control.period > span:
            place = f"controls.{name}"
            period, whole = (case.amount(t, "time", 6) for t in (control.period, span))
            samples = "no sample" if control.offset > span else "one sample"
            text = f"{place}.period: {period} gives {samples} in a run of {whole}"
            result.append(Notice("end", place, text, "period", control.period, span))
    return result


def unread_text(name: str) -> str:
    """Text on a block of `controls` that drives no key."""
    return f'drives no key; write {{ control = "{name}" }} where it acts'


def unread_notices(case: Any) -> list[Notice]:
    """Notices of each block that no key, no other block and no probe reads."""
    # without default probes
    stated = str([case.raw.get(section) for section in ("output", "expect", "compare")])
    return [
        Notice("start", f"controls.{name}", f"controls.{name}: {unread_text(name)}")
        for name in case.controls
        if name in case.unread_blocks and f"controls.{name}." not in stated
    ]


def starts_after_end(part: Any, end: float) -> Iterator[tuple[str, float]]:
    """Yield (key, time [s]) for schedules of a part that change after the time `end` [s], and for a trip after it.

    The time is that of the last entry or of the trip. A periodic schedule counts if its period exceeds `end`; its time
    is then the period. Schedules of more than `MAX_ENTRIES` entries are left out.
    """
    declared = type(part).model_fields
    for name, value in vars(part).items():
        if name == "trip" and value is not None and value > end:
            yield name, float(value)
        if isinstance(value, Schedule) and name in declared and (last := last_change(value)) > end:
            after = value.value[max(np.searchsorted(value.time, end, "right") - 1, 0) :]
            if value.wave or np.ptp(after) > 0.0:
                yield declared[name].alias or name, last


def last_change(schedule: Schedule) -> float:
    """Time of the last entry of a schedule [s], or the period of a wave; -inf for the schedules that do not count."""
    if schedule.wave:
        return float(schedule.wave[2])
    counts = schedule.kind not in ("control", "formula") and 0 < len(schedule.time) <= MAX_ENTRIES
    return float(schedule.time[-1]) if counts else -math.inf

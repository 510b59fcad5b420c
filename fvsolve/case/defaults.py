"""`[defaults.pipe]`: what pipes are that do not say it. Knows which keys stand for others; reads no value."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts import Pipe
from fvsolve.parts.table import at_most_one
from fvsolve.parts.value import Setting, Value
from fvsolve.units import show

KINDS = {"pipe": Pipe}  # of links that may have defaults
OWN = ("from", "to")  # keys that no two parts share
TOGETHER = ("wall", "friction")  # tables that other keys may complete: read with their part alone


def values(kind: str) -> dict[str, Value]:
    """Keys that the defaults of a kind may have."""
    return {key: value for key, value in KINDS[kind].values().items() if key not in OWN}


def defaults_of(table: Mapping[str, Any], kind: Any) -> dict[str, Any]:
    """What a case says of all parts of a kind; nothing where that is no table."""
    found = table.get("defaults")
    found = found.get(kind) if isinstance(found, dict) and isinstance(kind, str) and kind in KINDS else None
    return found if isinstance(found, dict) else {}


def filled(table: Mapping[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """A part's table with the defaults of its kind: its own keys win, and so do their alternatives."""
    found = defaults_of(table, given.get("type"))
    if not found:
        return given
    known = KINDS[given["type"]].keys()  # others are faults of the defaults alone
    stated = {key for group in KINDS[given["type"]].alternatives if any(one in given for one in group) for key in group}
    return {**{key: value for key, value in found.items() if key in known and key not in stated}, **given}


def link_said(table: Mapping[str, Any], name: str) -> dict[str, Any]:
    """What a case says of a link, its defaults among it; of a piece of a cut pipe what is said of the whole."""
    return filled(table, table["links"][whole(table, name)])


def whole(table: Mapping[str, Any], name: str) -> str:
    """The link of a file that a link came from: itself, or a pipe that is cut."""
    return name if name in table.get("links", ()) else name.rpartition("-")[0]


def spread(table: Mapping[str, Any]) -> dict[str, Any]:
    """The same table without defaults, every link as it is with them."""
    links = {name: filled(table, one) if isinstance(one, dict) else one for name, one in table["links"].items()}
    return {**{key: value for key, value in table.items() if key != "defaults"}, "links": links}


def place(table: Mapping[str, Any], keys: tuple) -> tuple:
    """Where the key of a part stands: among its own, or the defaults."""
    if len(keys) < 3 or keys[0] != "links":
        return keys
    links = table.get("links")
    part = links.get(keys[1]) if isinstance(links, dict) else None
    if not isinstance(part, dict) or keys[2] in part or keys[2] not in filled(table, part):
        return keys
    return ("defaults", part["type"], *keys[2:])


def misfits(table: Mapping[str, Any], setting: Setting) -> Iterator[tuple[tuple, str]]:
    """Faults of the tables themselves, and of values that no part may ever take."""
    given = table.get("defaults", {})
    if not isinstance(given, dict):
        yield ("defaults",), f"{show(given)} is no table; wanted [defaults.pipe]"
        return
    for kind, keys in given.items():
        if kind not in KINDS:
            yield ("defaults", kind), f"no defaults of {show(kind)}{did_you_mean(kind, KINDS)}; wanted those of pipe"
        elif not isinstance(keys, dict):
            yield ("defaults", kind), f"{show(keys)} is no table; wanted keys of a {kind}"
        else:
            yield from ((("defaults", kind, *below), text) for below, text in _of_keys(kind, keys, setting))


def _of_keys(kind: str, given: dict[str, Any], setting: Setting) -> Iterator[tuple[tuple, str]]:
    known = values(kind)
    for group in KINDS[kind].alternatives:
        yield from at_most_one(given, group)
    for key, value in given.items():
        if key in known:
            if key not in TOGETHER:
                yield from _of_value(key, known[key], value, setting)
        elif key in (*OWN, "type"):
            yield (key,), f"is each {kind}'s own"
        else:
            hint = KINDS[kind].meant.get(key)
            near = f"; say {hint}" if hint else did_you_mean(key, known) or f"; keys are {listing(list(known))}"
            yield (key,), f"unknown key{near}"


def _of_value(key: str, value: Value, given: Any, setting: Setting) -> Iterator[tuple[tuple, str]]:
    try:
        value.read(given, setting)
    except ValueError as error:
        yield from (((key, *below), text) for below, text in getattr(error, "faults", [((), str(error))]))

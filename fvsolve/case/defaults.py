"""Table `[defaults.pipe]`: values of keys for all pipes that do not state these keys."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts import Pipe
from fvsolve.parts.table_model import exclusive_key_faults
from fvsolve.parts.value import ReadContext, Value
from fvsolve.units import show

KINDS = {"pipe": Pipe}  # types of links that may have defaults
NOT_DEFAULT = ("from", "to")  # keys that each part must state itself
COMPLETED = ("wall", "friction")  # tables that other keys may complete: checked only with their part


def values(kind: str) -> dict[str, Value]:
    """Declarations of the keys that may have a default in a type of part : key -> declaration."""
    return {key: value for key, value in KINDS[kind].values().items() if key not in NOT_DEFAULT}


def defaults_of(table: Mapping[str, Any], kind: Any) -> dict[str, Any]:
    """Keys and values in `[defaults]` for a type of part; empty if there are none or if they are not a table.

    table : nested dicts of a case as in the file
    """
    result = table.get("defaults")
    result = result.get(kind) if isinstance(result, dict) and isinstance(kind, str) and kind in KINDS else None
    return result if isinstance(result, dict) else {}


def with_defaults(table: Mapping[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """Keys of a part in the file (`given`), completed by the defaults for its type.

    A default is left out if the part states the key, or an alternative to the key.
    table : nested dicts of a case as in the file
    """
    general = defaults_of(table, given.get("type"))
    if not general:
        return given
    known = KINDS[given["type"]].keys()  # unknown keys are reported once, as faults of the defaults
    stated = {
        key for group in KINDS[given["type"]].alternatives if any(word in given for word in group) for key in group
    }
    return {**{key: value for key, value in general.items() if key in known and key not in stated}, **given}


def raw_link(table: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Keys of a link in the file, completed by defaults; for a piece of a cut pipe, the keys of the whole pipe."""
    return with_defaults(table, table["links"][pipe_of_piece(table, name)])


def pipe_of_piece(table: Mapping[str, Any], name: str) -> str:
    """Name in the file of the link `name`; for a piece of a cut pipe, the name of the pipe."""
    return name if name in table.get("links", ()) else name.rpartition("-")[0]


def fill_pipes(table: Mapping[str, Any]) -> dict[str, Any]:
    """Copy of a case, as nested dicts, with the defaults written into every pipe and without the table `defaults`."""
    links = {
        name: with_defaults(table, link) if isinstance(link, dict) else link for name, link in table["links"].items()
    }
    return {**{key: value for key, value in table.items() if key != "defaults"}, "links": links}


def default_place(table: Mapping[str, Any], keys: tuple) -> tuple:
    """Key path at which the file states a key: that of the part, or of `[defaults]` if only a default is stated."""
    if len(keys) < 3 or keys[0] != "links":
        return keys
    links = table.get("links")
    part = links.get(keys[1]) if isinstance(links, dict) else None
    if not isinstance(part, dict) or keys[2] in part or keys[2] not in with_defaults(table, part):
        return keys
    return ("defaults", part["type"], *keys[2:])


def find_faults(table: Mapping[str, Any], setting: ReadContext) -> Iterator[tuple[tuple, str]]:
    """Faults (key path, message) of the table `[defaults]`: unknown types or keys, and invalid values."""
    given = table.get("defaults", {})
    if not isinstance(given, dict):
        yield ("defaults",), f"{show(given)} is not a table; expected [defaults.pipe]"
        return
    for kind, keys in given.items():
        if kind not in KINDS:
            text = f"{show(kind)} has no defaults{did_you_mean(kind, KINDS)}; expected defaults of pipe"
            yield ("defaults", kind), text
        elif not isinstance(keys, dict):
            yield ("defaults", kind), f"{show(keys)} is not a table; expected keys of a {kind}"
        else:
            yield from ((("defaults", kind, *below), text) for below, text in _of_keys(kind, keys, setting))


def _of_keys(kind: str, given: dict[str, Any], setting: ReadContext) -> Iterator[tuple[tuple, str]]:
    known = values(kind)
    for group in KINDS[kind].alternatives:
        yield from exclusive_key_faults(given, group)
    for key, value in given.items():
        if key in known:
            if key not in COMPLETED:
                yield from _of_value(key, known[key], value, setting)
        elif key in (*NOT_DEFAULT, "type"):
            yield (key,), f"cannot be a default; each {kind} states its own value"
        else:
            hint = KINDS[kind].synonyms.get(key)
            near = f"; use {hint}" if hint else did_you_mean(key, known) or f"; keys are {listing(list(known))}"
            yield (key,), f"unknown key{near}"


def _of_value(key: str, value: Value, given: Any, setting: ReadContext) -> Iterator[tuple[tuple, str]]:
    try:
        value.read(given, setting)
    except ValueError as error:
        yield from (((key, *below), text) for below, text in getattr(error, "faults", [((), str(error))]))

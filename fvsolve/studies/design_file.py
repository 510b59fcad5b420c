"""The file of a study: sets of overrides by name, and what is wrong of them. Knows cases; runs nothing."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fvsolve.case import load, shipped
from fvsolve.case.lines import key_lines
from fvsolve.case.raw import dotted, syntax_fault
from fvsolve.errors import CaseError, Fault, did_you_mean
from fvsolve.units import show

KEYS = ("case", "title", "error", "events", "protections")
DEEP = ("nodes", "links", "limits", "routes", "scalars", "defaults")  # of named tables whose keys are set one by one
Say = Callable[[tuple, str], None]


@dataclass(frozen=True)
class Design:
    """What a study file says: sets of overrides, dotted key -> value, by the names of events and protections."""

    name: str
    path: Path
    title: str
    case: Path
    error: bool
    events: dict[str, dict[str, Any]]
    protections: dict[str, dict[str, Any]]

    def runs(self) -> Iterator[tuple[str | None, str | None, dict[str, Any]]]:
        """(event, protection, keys) of every run; None where the file has none of a kind."""
        for event, of_event in (self.events or {None: {}}).items():
            for protection, of_protection in (self.protections or {None: {}}).items():
                yield event, protection, {**of_protection, **of_event}


def read_design(path: str | Path) -> Design:
    """The study of a TOML file; CaseError with all that is wrong in it and in its runs, by line."""
    path = Path(path)
    said, lines = read_text(path)
    faults: dict[tuple, Fault] = {}

    def fault(keys: tuple, message: str) -> None:
        place = ".".join(keys)
        at = next((lines[one] for one in spellings(keys) if one in lines), None)
        faults.setdefault((place, message), Fault(place, message, at))

    if {"nodes", "fluid"} & said.keys():
        text = f'is a case, no study; a study names it, case = "{path.name}", beside [events.NAME], [protections.NAME]'
        raise CaseError([Fault("", text)], path.name)
    for key in said:
        if key not in KEYS:
            fault((key,), f"unknown key{did_you_mean(key, KEYS) or '; keys are ' + ', '.join(KEYS)}")
    for key, kind, what in (("title", str, "text"), ("error", bool, "true or false")):
        if not isinstance(said.get(key, kind()), kind):
            fault((key,), f"{show(said[key])} is not {what}")
    sets = {group: read_sets(said.get(group, {}), group, fault) for group in ("events", "protections")}
    if not faults and not any(sets.values()):
        fault((), "nothing is studied; wanted [events.NAME], [protections.NAME] or both")
    for event, protection, key, other in all_clashes(**sets):
        text = f"{key} is set here and {other} by protections.{protection}; a run cannot have both"
        fault(("events", event, key), text)
    place = studied(said.get("case"), path.parent, fault)
    design = Design(path.stem, path, said.get("title", ""), place, said.get("error", False), **sets)
    if place is not None:
        run_faults(design, fault)
    if faults:
        raise CaseError(list(faults.values()), path.name)
    return design


def spellings(keys: tuple) -> Iterator[tuple]:
    """Paths under which a key of a set may stand in the file, the nearest first: as tables, in quotes, its table."""
    below = dotted(keys[2]) if len(keys) > 2 else ()
    for n in range(len(below), 0, -1):
        yield (*keys[:2], *below[:n])
        yield (*keys[:2], ".".join(below[:n]))
    yield from (keys[:n] for n in range(min(len(keys), 2), 0, -1))


def read_text(path: Path) -> tuple[dict[str, Any], dict[tuple, int]]:
    """What a TOML file says, and the lines of its keys; CaseError where it says nothing."""
    text = ""
    try:
        text = path.read_text(encoding="utf-8-sig").replace("\r\n", "\n")
        return tomllib.loads(text), key_lines(text)
    except FileNotFoundError:
        near = [other.name for other in path.parent.glob("*.toml")] if path.parent.is_dir() else []
        raise CaseError([Fault("", f"there is no such file{did_you_mean(path.name, near)}")], str(path)) from None
    except OSError as error:
        raise CaseError([Fault("", f"cannot be read: {error.strerror or error}")], path.name) from None
    except ValueError as error:
        raise CaseError([syntax_fault(error, text)], path.name) from None


def studied(case: Any, folder: Path, fault: Say) -> Path | None:
    """The file of the case; None where it is at fault."""
    if not isinstance(case, str):
        text = "case is missing, the file that is studied" if case is None else f"{show(case)} is no text"
        fault(() if case is None else ("case",), text)
        return None
    place = folder / case
    if not place.is_file() and case in shipped.names():
        return shipped.find(case)
    if not place.is_file():
        near = [one.name for one in place.parent.glob("*.toml")] if place.parent.is_dir() else []
        near = did_you_mean(place.name, [*near, *shipped.names()])
        fault(("case",), f"{show(case)}: there is no such file{near}; a path is relative to the study")
        return None
    return place


def read_sets(given: Any, group: str, fault) -> dict[str, dict[str, Any]]:
    """Sets of overrides by name, as dotted keys."""
    if not isinstance(given, dict):
        fault((group,), f"{show(given)} is no table of tables by name")
        return {}
    found = {}
    for name, one in given.items():
        if not isinstance(one, dict):
            fault((group, name), f'{show(one)} is no table; wanted keys of the case, such as links.pump.trip = "2 s"')
        elif not name.replace("-", "").replace("_", "").isalnum():
            fault((group, name), f"{show(name)} is no name; a name has letters, digits, _ and -")
        else:
            found[name] = dict(keys_of(one))
    return found


def keys_of(table: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Dotted keys of nested tables: those of parts one by one, whatever stands under them whole."""
    for first, inner in table.items():
        if "." in first or not isinstance(inner, dict):
            yield first, inner
            continue
        for second, below in inner.items():
            if first in DEEP and isinstance(below, dict):
                yield from ((path(first, second, third), value) for third, value in below.items())
            else:
                yield path(first, second), below


def path(*keys: str) -> str:
    """Keys as TOML writes them, in quotes where they are not bare."""
    return ".".join(key if key.replace("-", "").replace("_", "").isalnum() else json.dumps(key) for key in keys)


def all_clashes(events: dict, protections: dict) -> Iterator[tuple[str, str, str, str]]:
    """(event, protection, key of the one, key of the other) of all that no run can have both."""
    for event, of_event in events.items():
        for protection, of_protection in protections.items():
            yield from ((event, protection, one, other) for one, other in clashes(of_event, of_protection))


def clashes(one: dict[str, Any], other: dict[str, Any]) -> Iterator[tuple[str, str]]:
    """Keys of both of which one is, or lies within, the other, unless both say the same."""
    for key in one:
        for beside in other:
            a, b = dotted(key), dotted(beside)
            if a[: len(b)] == b[: len(a)] and not (a == b and one[key] == other[beside]):
                yield key, beside


def run_faults(design: Design, fault: Say) -> None:
    """Tell the faults of all runs that could not start: of the key that is to blame, and of which runs, if not of all.

    Runs of sets that clash are left out.
    """
    try:
        base = load(design.case)
    except CaseError as error:
        for one in error.faults:
            fault(("case",), f"{error.file}: {one}")
        return
    clash = {(event, protection) for event, protection, *_ in all_clashes(design.events, design.protections)}
    runs = [(pair, keys) for *pair, keys in design.runs() if tuple(pair) not in clash]
    found: dict[tuple[str, str], list] = {}  # (place, message) -> pairs of event and protection
    for pair, keys in runs:
        try:
            load(base, keys)
        except CaseError as error:
            for one in error.faults:
                found.setdefault((one.place, one.message), []).append(pair)
    for (place, message), failed in found.items():
        of_keys = list(blamed(design, place, failed))
        for keys in of_keys or blamed(design, None, failed):
            at = 0 if keys[0] == "events" else 1
            beside = [pair[1 - at] for pair in failed if pair[at] == keys[1]]
            often = len(beside) == sum(pair[at] == keys[1] for pair, _ in runs)
            said = message if of_keys or not place else f"{place}: {message}"
            fault(keys, said if often else f"{said} (with {', '.join(beside)})")


def blamed(design: Design, place: str | None, failed: list) -> Iterator[tuple]:
    """(group, name, place) of the sets of runs that say what stands there; without a place (group, name) of all."""
    for at, group in enumerate(("events", "protections")):
        for name in dict.fromkeys(pair[at] for pair in failed if pair[at] is not None):
            if place is None:
                yield group, name
            elif any(within(place, key) or within(key, place) for key in getattr(design, group)[name]):
                yield group, name, place
        if place is None and failed[0][at] is not None:
            return


def within(place: str, key: str) -> bool:
    """Whether a place is a key, or lies below it."""
    return place == key or place.startswith((f"{key}.", f"{key}["))

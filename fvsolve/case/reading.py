"""Raw case (before its values are read), and the state of the reading of a case, which its stages share.

A raw case has nested dicts, line numbers, overrides and defaults of parts. The table `[defaults.TYPE]` has values of
keys for all parts of a type that do not state these keys. The argument `table` of functions is a case as nested dicts,
as in the file. The state of the reading holds the faults found, the values read and the origin of added parts.
"""

import functools
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from fvsolve.case import shipped, text
from fvsolve.case.declared_tables import add_declared_parts
from fvsolve.case.text import KeyPath, key_lines
from fvsolve.errors import CaseError, Fault, article, did_you_mean, listing, nearest
from fvsolve.parts import KINDS
from fvsolve.parts.nodes_and_links import NETWORK_DOMAINS
from fvsolve.parts.pipe.part import QUASI_STEADY
from fvsolve.parts.table_model import exclusive_key_faults
from fvsolve.parts.value import ROOT, ReadContext, Value, faults_of
from fvsolve.units import show

WHOLE_BITS = 63  # of a whole number without its sign
KEPT_FAULTS = 1000  # faults of a case that are kept; further faults are counted
LONGEST_LINE = 500  # length of a line above which its names are not examined
DEEPEST = 40  # levels of tables
MOST_BYTES = 20_000_000  # of a TOML file; a network of 10 000 pipes has 2 MB
# keys that each part must state itself
NOT_DEFAULT = ("from", "to", "ports", "on", "at")
# tables that other keys may complete: checked only with their part
COMPLETED = ("wall", "friction")


@dataclass
class Raw:
    """Case before its values are read (raw case), with its source.

    table : nested dicts as in the file; text : text of the file; folder : folder of the file, for other files
    overridden : key paths whose values were replaced by overrides
    """

    table: dict[str, Any]
    name: str = "case"
    path: Path | None = None
    folder: Path | None = None
    text: str = ""
    overridden: list[tuple] = field(default_factory=list)

    @functools.cached_property
    def lines(self) -> dict[tuple, int]:
        """Line numbers in the file : key path -> number. They are computed at first use."""
        return key_lines(self.text)

    @property
    def file(self) -> str:
        """Name of the source in messages."""
        return self.path.name if self.path else self.name

    def line(self, keys: tuple) -> int | None:
        """Line number of a key path, or of the innermost table that contains it; None if unknown."""
        for count in range(len(keys), 0, -1):
            if keys[:count] in self.lines:
                return self.lines[keys[:count]]
        return None

    def is_override(self, keys: tuple) -> bool:
        """True if an override replaced the value at a key path or a table around it, or created the key path."""
        if any(keys[: len(path)] == path for path in self.overridden):
            return True
        created = bool(self.lines) and keys not in self.lines
        return created and any(path[: len(keys)] == keys for path in self.overridden if keys)

    def get(self, keys: tuple) -> Any:
        """Value at a key path; None if the key path does not exist."""
        value: Any = self.table
        for key in keys:
            try:
                value = value[key]
            except (KeyError, IndexError, TypeError):
                return None
        return value


def read_raw(source: Any) -> Raw:
    """Read a case from a TOML file or a dict, without interpretation of its values. Raises CaseError."""
    if isinstance(source, Mapping):
        return Raw(_copy(source))
    if not isinstance(source, (str, Path)):
        raise CaseError(
            [
                Fault(
                    "", f"{article(type(source).__name__)} is not a case; expected a path or a dict"
                )
            ]
        )
    path = Path(source)
    table, content = read_toml(path)
    return Raw(_copy(table), path.stem, path, path.parent.absolute(), content)


def read_toml(path: Path) -> tuple[dict[str, Any], str]:
    """Table and text of a TOML file. Raises CaseError for a file that cannot be read, is too large or is not TOML."""
    content = _read_text(path)
    if (line := text.find_long_key(content, DEEPEST)) is not None:
        message = (
            f"a key has more than {DEEPEST} names; expected at most {DEEPEST} levels of tables"
        )
        raise CaseError([Fault("", message, line)], path.name)
    try:
        return tomllib.loads(content), content
    except RecursionError:
        raise CaseError(
            [Fault("", f"tables or lists are nested too deep; expected at most {DEEPEST} levels")],
            path.name,
        ) from None
    except ValueError as error:
        if re.search(
            r"^[ \t]*\[(JUNCTIONS|RESERVOIRS|PIPES)\]", content, re.MULTILINE | re.IGNORECASE
        ):
            message = f"is an EPANET network, not a case; fvsolve import {path} translates it"
            raise CaseError([Fault("", message)], path.name) from None
        raise CaseError([syntax_fault(error, content)], path.name) from None


def copy_paths(table: dict[str, Any], paths: list[tuple[str, ...]]) -> dict[str, Any]:
    """Copy of a table and of its inner tables along `paths`; all other values are shared with the original."""
    copy = dict(table)
    for key in {path[0] for path in paths}:
        below = [path[1:] for path in paths if path[0] == key and path[1:]]
        if below and isinstance(copy.get(key), dict):
            copy[key] = copy_paths(copy[key], below)
    return copy


def override(raw: Raw, settings: Mapping[str, Any], alternatives_of: Callable) -> list[Fault]:
    """Override values in the table of `raw`; returns the faults of overrides that cannot be applied.

    The key paths are added to `raw.overridden`.
    settings : dotted key -> value; a text is parsed as TOML where possible, unless it replaces the name of a node or
    link and is such a name too, which may consist of digits
    alternatives_of : function from the table to groups of keys of which a table in it may have at most one; an override
    removes the other keys of its group that are not overridden too
    """
    faults = []
    groups = {group: raw.get((group,)) for group in ("nodes", "links")}
    before = {group: list(parts) for group, parts in groups.items() if isinstance(parts, dict)}
    names = {name for parts in before.values() for name in parts}
    for key, value in settings.items():
        keys = split_key(str(key))
        present, text = raw.get(keys), str(value) if isinstance(value, (int, str)) else ""
        is_name = isinstance(present, str) and {present, text} <= names
        try:
            _put(raw.table, keys, text if is_name else _copy(parsed(value)))
            raw.overridden.append(keys)
        except ValueError as error:
            faults.append(Fault(str(key), str(error), override=True))
    alternatives = alternatives_of(raw.table) if settings else []
    for keys in raw.overridden:
        for other in (other for others in alternatives if keys[-1] in others for other in others):
            if (*keys[:-1], other) not in raw.overridden and isinstance(
                table := raw.get(keys[:-1]), dict
            ):
                table.pop(other, None)
    for keys in raw.overridden:
        group, name = (*keys, "", "")[:2]
        if name and name not in before.get(group, [name]):
            part = raw.get((group, name))
            if not isinstance(part, dict) or "type" not in part:
                hint = did_you_mean(name, before[group])
                faults.append(
                    Fault(
                        ".".join(keys), f"no {group[:-1]} named {show(name)}{hint}", override=True
                    )
                )
                raw.table[group].pop(name, None)
    return faults


def locate_faults(error: CaseError, case: Any) -> CaseError:
    """Copy of an error of the case `case`, with the file name and the source of each fault added.

    The source is a line number of the file, or the mark that an override set the key. The error itself is returned if
    the file cannot be read any more; for a case without a file only the name is added.
    """
    if case.path is None:
        return CaseError(error.faults, case.name)
    try:
        source = read_raw(case.path)
        add_declared_parts(source)  # their faults are those of the case
    except CaseError:  # the file has gone since
        return error
    now = Raw(case.raw)
    faults = []
    for fault in error.faults:
        keys = default_place(case.raw, tuple(fault.place.split(".")))
        fault = replace(fault, place=".".join(keys))
        value, before = now.get(keys), source.get(keys)
        # some other key of the part may have been set
        is_part = len(keys) == 2 and isinstance(value, dict)
        if value is not None and (before is None or (value != before and not is_part)):
            faults.append(replace(fault, override=True))
        else:
            faults.append(replace(fault, line=fault.line or source.line(keys)))
    return CaseError(faults, source.file)


def _read_text(path: Path) -> str:
    try:
        with open(path, "rb") as file:
            data = file.read(MOST_BYTES + 1)
        if len(data) > MOST_BYTES:
            message = f"has more than {MOST_BYTES / 1e6:g} MB; expected a TOML file with long tables in their own files"
            raise CaseError([Fault("", message)], str(path))
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except FileNotFoundError:
        near = [other.name for other in path.parent.glob("*.toml")] if path.parent.is_dir() else []
        hint = did_you_mean(path.name, near)
        if not hint and (shipped_case := nearest(path.name.removesuffix(".toml"), shipped.names())):
            hint = f'; did you mean the shipped case "{shipped_case}"?'
        raise CaseError([Fault("", f"there is no such file{hint}")], str(path)) from None
    except IsADirectoryError:
        raise CaseError([Fault("", "is a directory; expected a TOML file")], str(path)) from None
    except UnicodeDecodeError as error:
        line = error.object.count(b"\n", 0, error.start) + 1
        message = f"byte {show(error.object[error.start : error.start + 1])} is not UTF-8 text"
        raise CaseError([Fault("", message, line)], path.name) from None
    except (OSError, ValueError) as error:
        message = getattr(error, "strerror", None) or str(error)
        raise CaseError([Fault("", f"cannot be read: {message}")], str(path)) from None


def syntax_fault(error: ValueError, text: str) -> Fault:
    """Fault of a text that is not valid TOML, with its line; error : error that tomllib raised."""
    message = str(error)
    match = re.search(r"\s*\(at line (\d+), column (\d+)\)", message)
    line = int(match[1]) if match else text.count("\n") + 1
    line_text = text.splitlines()[line - 1].strip() if 0 < line <= len(text.splitlines()) else ""
    message = message.replace(match[0], "") if match else message
    message = message[:1].lower() + message[1:]
    if bare := _bare_name(line_text):
        return Fault("", f"TOML: {bare}: {show(line_text)}", line)
    if message == "cannot overwrite a value":
        message = "this key is given twice"
    elif message.startswith("cannot declare"):
        message = "this table is given twice"
    return Fault(
        "", f"TOML: {message}: {show(line_text)}" if line_text else f"TOML: {message}", line
    )


def _bare_name(line_text: str) -> str:
    """Description of an invalid unquoted name in a line of TOML; "" if all names are valid."""
    if len(line_text) > LONGEST_LINE:
        return ""
    match = re.fullmatch(r"\[+([^\[\]\"']+)\]+\s*(?:#.*)?|([^=\[\]\"'#]+?)\s*=.*", line_text)
    names = [name.strip() for name in (match[1] or match[2]).split(".")] if match else []
    odd = next((name for name in names if name and not re.fullmatch(r"[A-Za-z0-9_-]+", name)), None)
    if odd is None:
        return ""
    if re.fullmatch(r"[\w-]+", odd):
        return f"a name with letters beyond a to z needs quotes: {show(odd)}"
    joined = re.sub(r"\s+", "_", odd)
    if joined != odd:
        return (
            f"an unquoted name has no blank; write {joined} (a quoted key may "
            "have a blank, the name of a part may not)"
        )
    return f"an unquoted name has only letters, digits, _ and -; expected quotes: {show(odd)}"


def _copy(value: Any, keys: KeyPath = ()) -> Any:
    """Copy of a value as plain dicts, lists and scalars, without types of NumPy.

    Raises CaseError for more than `DEEPEST` nested levels, and for whole numbers that TOML does not allow.
    keys : key path of the value
    """
    if len(keys) > DEEPEST:
        raise CaseError(
            [Fault("", f"tables or lists are nested too deep; expected at most {DEEPEST} levels")]
        )
    if isinstance(value, Mapping):
        return {str(key): _copy(item, (*keys, str(key))) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_copy(item, (*keys, n)) for n, item in enumerate(value)]
    if isinstance(value, Path):
        return str(value)
    if type(value).__module__ == "numpy" and hasattr(value, "tolist"):
        return _copy(value.tolist(), keys)
    if type(value) is int and abs(value) >> WHOLE_BITS:
        message = f"{show(value)} is a whole number of more than 64 bits; expected an exponent, for example 1e20"
        raise CaseError([Fault(text.path(keys), message)])
    return value


@functools.lru_cache(maxsize=4096)
def split_key(key: str) -> tuple[str, ...]:
    """Keys of a dotted path as in TOML, such as "links.valve.area"; a text that is not valid is split at its dots.

    Raises CaseError for more than `DEEPEST` keys.
    """
    if key.count(".") >= DEEPEST:
        message = f"has more than {DEEPEST} names; expected at most {DEEPEST} levels of tables"
        raise CaseError([Fault(show(key), message, override=True)])
    try:
        table: Any = tomllib.loads(f"{key} = 0") if "\n" not in key and "=" not in key else None
    except ValueError:
        table = None
    if not table:
        return tuple(key.split("."))
    keys = []
    while isinstance(table, dict):
        name = next(iter(table))
        keys.append(name)
        table = table[name]
    return tuple(keys)


def parsed(value: Any) -> Any:
    if not isinstance(value, str) or text.find_long_key(f"value = {value}", DEEPEST) is not None:
        return value
    try:
        table = tomllib.loads(f"value = {value}")
    except (ValueError, RecursionError):
        return value
    return table["value"] if len(table) == 1 else value


def _put(table: dict[str, Any], keys: tuple[str, ...], value: Any) -> None:
    for key in keys[:-1]:
        inner = table.setdefault(key, {})
        if not isinstance(inner, dict):
            raise ValueError(
                f"{show(key)} is {show(inner)}, not a table; no key can be set below it"
            )
        table = inner
    table[keys[-1]] = value


def class_of_type(kind: Any) -> Any:
    """Class of a type of node or link; None for an unknown type."""
    groups = (group for group in KINDS.values() if isinstance(kind, str) and kind in group)
    return next((group[kind] for group in groups), None)


def default_values(kind: str) -> dict[str, Value]:
    """Declarations of the keys that may have a default in a type of part : key -> declaration."""
    values = class_of_type(kind).values()
    return {key: value for key, value in values.items() if key not in NOT_DEFAULT}


def defaults_of(table: Mapping[str, Any], kind: Any) -> dict[str, Any]:
    """Keys and values in `[defaults]` for a type of part; empty if there are none or if they are not a table."""
    result, numerics = table.get("defaults"), table.get("numerics")
    result = result.get(kind) if isinstance(result, dict) and isinstance(kind, str) else None
    result = result if isinstance(result, dict) and class_of_type(kind) is not None else {}
    if kind == "pipe" and isinstance(numerics, dict) and numerics.get("pipe_model") == QUASI_STEADY:
        return {"pipe_model": QUASI_STEADY, **result}  # a part of its own
    return result


def with_defaults(table: Mapping[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    """Keys of a part in the file (`given`), completed by the defaults for its type.

    A default is left out if the part states the key, or an alternative to the key.
    """
    general = defaults_of(table, given.get("type"))
    if not general:
        return given
    # unknown keys are reported once, as faults of the defaults
    kind = class_of_type(given["type"])
    known = default_values(given["type"])
    groups = kind.alternatives
    stated = {key for group in groups if any(word in given for word in group) for key in group}
    return {
        **{key: value for key, value in general.items() if key in known and key not in stated},
        **given,
    }


def raw_link(table: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Keys of a link in the file, completed by defaults; for a piece of a cut pipe, the keys of the whole pipe."""
    return with_defaults(table, table["links"][pipe_of_piece(table, name)])


def pipe_of_piece(table: Mapping[str, Any], name: str) -> str:
    """Name in the file of the link `name`; for a piece of a cut pipe, the name of the pipe."""
    return name if name in table.get("links", ()) else name.rpartition("-")[0]


def fill_parts(table: Mapping[str, Any]) -> dict[str, Any]:
    """Copy of a case, as nested dicts, with the defaults written into all parts and without the table `defaults`.

    Parts without defaults, and tables that are not dicts, are those of `table`.
    """
    result = {key: value for key, value in table.items() if key != "defaults"}
    for group in KINDS:
        if isinstance(parts := table.get(group), dict):
            result[group] = {
                name: with_defaults(table, part) if isinstance(part, dict) else part
                for name, part in parts.items()
            }
    return result


def default_place(table: Mapping[str, Any], keys: tuple) -> tuple:
    """Key path at which the file states a key: that of the part, or of `[defaults]` if only a default is stated."""
    if len(keys) < 3 or keys[0] not in KINDS:
        return keys
    parts = table.get(keys[0])
    part = parts.get(keys[1]) if isinstance(parts, dict) else None
    if not isinstance(part, dict) or keys[2] in part or keys[2] not in with_defaults(table, part):
        return keys
    return ("defaults", part["type"], *keys[2:])


def default_faults(table: Mapping[str, Any], setting: ReadContext) -> Iterator[tuple[tuple, str]]:
    """Faults (key path, message) of the table `[defaults]`: unknown types or keys, and invalid values."""
    given = table.get("defaults", {})
    if not isinstance(given, dict):
        yield (
            ("defaults",),
            f"{show(given)} is not a table; expected [defaults.TYPE], such as [defaults.pipe]",
        )
        return
    for kind, keys in given.items():
        if class_of_type(kind) is None:
            types = [name for group in KINDS.values() for name in group]
            near = did_you_mean(kind, types) or f"; types are {listing(types)}"
            yield ("defaults", kind), f"{show(kind)} is not a type of part{near}"
        elif not isinstance(keys, dict):
            yield (
                ("defaults", kind),
                f"{show(keys)} is not a table; expected keys of {article(kind)}",
            )
        else:
            yield from (
                (("defaults", kind, *below), text)
                for below, text in _faults_of_keys(kind, keys, setting)
            )


def _faults_of_keys(
    kind: str, given: dict[str, Any], setting: ReadContext
) -> Iterator[tuple[tuple, str]]:
    known, model = default_values(kind), class_of_type(kind)
    for group in model.alternatives:
        yield from exclusive_key_faults(given, group)
    for key, value in given.items():
        if key in known:
            if key in COMPLETED:
                continue
            try:
                known[key].read(value, setting)
            except ValueError as error:
                yield from faults_of(error, key)
        elif key in (*NOT_DEFAULT, "type"):
            yield (key,), f"cannot be a default; each {kind} states its own value"
        else:
            hint = model.synonyms.get(key)
            near = (
                f"; use {hint}"
                if hint
                else did_you_mean(key, known) or f"; keys are {listing(list(known))}"
            )
            yield (key,), f"unknown key{near}"


GROUPS = {
    "fluid": "the fluid",
    "nodes": "places",
    "links": "parts between the places",
    "numerics": "settings of the solver",
}


class Reading:
    """State of the reading of one case: all that its stages change.

    raw : case before its values are read, with all pipes whole; setting : context of the values
    faults : faults found so far; read : key path -> (raw value, value as read), for the next reading
    known : content of `read` of an earlier case, of which values with the same raw value are used again
    origin : key path of a part that the reader adds -> key path in the file from which it comes
    """

    def __init__(self, raw: Raw, faults: Iterable[Fault] = ()) -> None:
        self.raw, self.faults, self.setting = raw, [*faults], ReadContext(folder=raw.folder)
        self.read: dict[tuple, tuple[Any, Any]] = {}
        self.known: dict[tuple, tuple[Any, Any]] = {}
        self.origin: dict[tuple, tuple] = {}
        self.completed: dict[
            int, tuple[Any, Any]
        ] = {}  # id of keys with defaults -> (they, own keys of the part)
        self.further = 0  # number of faults beyond `KEPT_FAULTS`

    @functools.cached_property
    def filled(self) -> dict[str, Any]:
        """Case as nested dicts, with the defaults written into all parts; that of the file without defaults."""
        table = self.raw.table
        if not table.get("defaults"):
            return table
        filled = fill_parts(table)
        for group in KINDS:
            own = table.get(group)
            for name, part in filled[group].items() if isinstance(own, dict) else ():
                if part is not own[name]:
                    self.completed[id(part)] = part, own[name]
        return filled

    def own_keys(self, part: Any) -> Any:
        """Keys of a part as in the file; part : its keys, with defaults or without."""
        return self.completed.get(id(part), (part, part))[1]

    def stop(self) -> None:
        """Raise CaseError if faults were found."""
        if self.faults:
            raise CaseError(dict.fromkeys(self.faults), self.raw.file, self.further)

    def fault(self, keys: tuple, message: str) -> None:
        """Add a fault at a key path of the case; after `ROOT` in the path, it starts at the top of the case."""
        if len(self.faults) >= KEPT_FAULTS:
            self.further += 1
            return
        if ROOT in keys:
            keys = keys[len(keys) - keys[::-1].index(ROOT) :]
        own = (*self.origin.get(keys[:2], keys[:2]), *keys[2:])
        keys = default_place(self.raw.table, own)
        place = text.path(keys)
        if keys != own and any(fault.place == place for fault in self.faults):
            return  # a faulty default, already reported for another part
        if self.raw.is_override(keys):
            self.faults.append(Fault(place, message, override=True))
        else:
            self.faults.append(Fault(place, message, self.raw.line(keys)))

    def add(self, faults: Iterable[tuple[tuple, str]]) -> None:
        """Add faults, each as (key path, message)."""
        for keys, message in faults:
            self.fault(keys, message)

    @contextmanager
    def catch(self, *keys: Any) -> Iterator[None]:
        """Catch a ValueError of the `with` block and add its faults; keys : key path of the value that is read."""
        try:
            yield
        except ValueError as error:
            self.add(faults_of(error, *keys))

    def reuse(self, place: tuple, given: Any, make: Callable[[], Any]) -> Any:
        """Value as read for the earlier case if its raw content is the same object, otherwise the result of `make()`.

        place : key path; given : raw content, as in the file. A value without faults that uses no file and no signal is
        kept in `read` for the next reading.
        """
        before = self.known.get(place)
        if before is not None and before[0] is given:
            self.read[place] = before
            return before[1]
        state = self.setting.lookups, len(self.faults)
        value = make()
        if state == (self.setting.lookups, len(self.faults)):
            self.read[place] = given, value
        return value

    def group(self, name: str) -> dict[str, Any]:
        """Content of the table `name`; empty, with a fault, if it is not a table."""
        table = self.raw.table.get(name, {})
        if isinstance(table, dict):
            return table
        self.fault((name,), f"{show(table)} is not a table")
        return {}

    def table(self, name: str, model: Any) -> Any:
        """Table `name`, read by the class `model`; None if it is faulty."""
        given = self.raw.table.get(name)
        if name == "fluid" and given is None and self.needs_no_fluid:
            given = {"name": "water"}  # no part reads it
        elif name not in self.raw.table and name in GROUPS:
            return self.fault((), f"[{name}] is missing: {GROUPS[name]}")
        with self.catch(name):
            table = {} if given is None and name not in self.raw.table else given
            return self.reuse(
                (name, "table"), given, lambda: model.model_validate(table, context=self.setting)
            )

    @property
    def needs_no_fluid(self) -> bool:
        """True for a case of controls, or of networks of rotation, electricity and heat, without any fluid."""
        table = self.raw.table
        if not {"nodes", "links"} & table.keys():
            return "controls" in table
        nodes, links = (table.get(group) for group in ("nodes", "links"))
        if not (isinstance(nodes, dict) and isinstance(links, dict)):
            return False
        kinds = [
            KINDS["nodes"].get(str(part.get("type")) if isinstance(part, dict) else "")
            for part in nodes.values()
        ]
        # an unknown type is a fault of its own
        domains = {kind.domain for kind in kinds if kind is not None}
        found = [
            KINDS["links"].get(str(part.get("type")) if isinstance(part, dict) else "")
            for part in links.values()
        ]
        dry = all(
            kind is None or "hydraulic" not in {*kind.joins.values(), *kind.owns.values()}
            for kind in found
        )
        return (
            bool(domains & {*NETWORK_DOMAINS})
            and domains <= {*NETWORK_DOMAINS, "translational"}
            and dry
        )

    def valid_keys(self, name: str, model: Any) -> Any:
        """Instance of `model` with the valid keys of the table `name`, without checks of the table.

        Other keys have their defaults; a required key without a valid value is missing.
        """
        values = {}
        for key, value in model.values().items():
            with suppress(KeyError, TypeError, ValueError):
                values[key] = value.read(self.raw.table[name][key], self.setting)
        return model.model_construct(**values)


def driven_keys(table: Any, word: str, name: str = "") -> Iterator[tuple[Any, ...]]:
    """Key paths of all values of a case that follow a signal or a control, outside `[signals]`.

    table : nested dicts of the case as in the file; word : "signal" or "control"
    name : name of the signal or control, "" for any
    """
    return (keys for followed, keys in followers(table, word) if name in ("", followed))


def followers(
    table: Any, word: str, keys: tuple[Any, ...] = ()
) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Name of the signal or control, and key path, of each value that follows one; arguments as in `driven_keys`.

    keys : key path of `table`, which is the case or a part of it
    """
    if isinstance(table, dict):
        if isinstance(table.get(word), str) and keys[:1] != ("signals",):
            yield table[word], keys
    if isinstance(table, (dict, list)):
        for key, inner in table.items() if isinstance(table, dict) else enumerate(table):
            if isinstance(inner, (dict, list)):
                yield from followers(inner, word, (*keys, key))

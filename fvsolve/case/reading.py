"""State of the reading of one case, shared by its stages: faults found, values read, origin of added parts."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from fvsolve.case import text
from fvsolve.case.raw import Raw, default_place
from fvsolve.errors import CaseError, Fault
from fvsolve.parts.value import ROOT, ReadContext, faults_of
from fvsolve.units import show

GROUPS = {
    "fluid": "the fluid",
    "nodes": "places",
    "links": "parts between the places",
    "numerics": "settings of the solver",
}  # fmt: skip


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

    def stop(self) -> None:
        """Raise CaseError if faults were found."""
        if self.faults:
            raise CaseError(dict.fromkeys(self.faults), self.raw.file)

    def fault(self, keys: tuple, message: str) -> None:
        """Add a fault at a key path of the case; after `ROOT` in the path, it starts at the top of the case."""
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
        if name not in self.raw.table and name in GROUPS:
            return self.fault((), f"[{name}] is missing: {GROUPS[name]}")
        with self.catch(name):
            table = {} if name not in self.raw.table else given
            return self.reuse((name, "table"), given, lambda: model.model_validate(table, context=self.setting))

    def valid_keys(self, name: str, model: Any) -> Any:
        """Instance of `model` with the valid keys of the table `name`, without checks of the table.

        Other keys have their defaults; a required key without a valid value is missing.
        """
        values = {}
        for key, value in model.values().items():
            with suppress(KeyError, TypeError, ValueError):
                values[key] = value.read(self.raw.table[name][key], self.setting)
        return model.model_construct(**values)

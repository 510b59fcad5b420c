"""A table of a case file. Knows keys and which of them go together; knows no part and no file."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator

from fvsolve.errors import did_you_mean, listing
from fvsolve.parts.around import Around, Faults
from fvsolve.parts.value import NEEDED, Misfit, Setting, Value, setting_of
from fvsolve.units import show


def read_keys(given: dict[str, Any], keys: dict[str, tuple[Value, Any]], setting: Setting) -> dict[str, Any]:
    """The values of a table whose keys have a value and a default each; Misfit with all that does not fit."""
    found = {key: default for key, (_, default) in keys.items()}
    faults = [((key,), f"unknown key{_near(str(key), list(keys))}") for key in given if key not in keys]
    for key, (value, default) in keys.items():
        try:
            if key in given:
                found[key] = value.read(given[key], setting)
            elif default is NEEDED:
                faults.append(((), f"{key} is missing"))
        except Misfit as error:
            faults += [((key, *below), message) for below, message in error.faults]
        except ValueError as error:
            faults.append(((key,), str(error)))
    if faults:
        raise Misfit(faults)
    return found


def keys_json(keys: dict[str, tuple[Value, Any]]) -> dict[str, Any]:
    """The JSON schema of such a table."""
    return {
        "type": "object",
        "properties": {key: value.json() for key, (value, _) in keys.items()},
        "required": [key for key, (_, default) in keys.items() if default is NEEDED],
        "additionalProperties": False,
    }


def _near(name: str, keys: list[str]) -> str:
    return did_you_mean(name, keys) or f"; keys are {listing(keys)}"


class Table(BaseModel):
    """Base of everything that is a table in a case file: frozen, every key known, all faults at once."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", populate_by_name=False, arbitrary_types_allowed=True,
        defer_build=True,  # what a case has not costs nothing
    )  # fmt: skip

    alternatives: ClassVar[tuple[tuple[str, ...], ...]] = ()  # keys of which one at most is given
    needs: ClassVar[tuple[tuple[str, ...], ...]] = ()  # keys of which one at least is given
    meant: ClassVar[dict[str, str]] = {}  # keys of other programs -> what says it here

    @classmethod
    def key_faults(cls, given: dict[str, Any]) -> list[tuple[tuple[Any, ...], str]]:
        """Faults of keys that do not go together, as pairs of keys and message."""
        too_many = [fault for keys in cls.alternatives for fault in at_most_one(given, keys)]
        return too_many + [fault for keys in cls.needs for fault in at_least_one(given, keys)]

    @classmethod
    def in_numbers(cls, given: dict[str, Any], setting: Setting) -> dict[str, Any]:
        """The same table, keys that stand for others replaced by those; Misfit where one means nothing."""
        return given

    @model_validator(mode="wrap")
    @classmethod
    def _all_at_once(cls, given: Any, handler: Any, info: Any) -> Any:
        if isinstance(given, cls):
            return given
        if not isinstance(given, dict):
            raise Misfit([((), f"{show(given)} is no table; wanted {cls.wanted(given)}")])
        faults = cls.key_faults(given)
        try:
            given = cls.in_numbers(given, setting_of(info))
        except Misfit as error:
            faults += error.faults
            given = given if error.instead is None else error.instead
        try:
            made = handler(given)
        except ValidationError as error:
            raise Misfit(faults + misfits(error, cls.keys(), cls.meant)) from None
        if faults:
            raise Misfit(faults)
        return made

    @classmethod
    def keys(cls) -> list[str]:
        """The keys the file may use."""
        return [info.alias or name for name, info in cls.model_fields.items()]

    @classmethod
    def values(cls) -> dict[str, Value]:
        """What each key may be."""
        said = {info.alias or name: (info.metadata, info.annotation) for name, info in cls.model_fields.items()}
        return {key: next((one for one in metadata if isinstance(one, Value)), Inside(model))
                for key, (metadata, model) in said.items()}  # fmt: skip

    @classmethod
    def wanted(cls, given: Any) -> str:
        """What a value should have been that is no table."""
        return f"keys of {listing(cls.keys())}"

    def faults(self, name: str, around: Around) -> Faults:
        """What is wrong with it beside the rest of its case: (keys, text)."""
        yield from ()

    def unusual(self) -> Iterator[tuple[tuple[Any, ...], float, float, str]]:
        """What is odd of its keys beside one another: (keys, value, limit, text)."""
        yield from ()

    def table(self) -> dict[str, Any]:
        """The table that reads back as this object: SI numbers, defaults filled in, absent keys left out."""
        made = {}
        for name, info in type(self).model_fields.items():
            value = plain(getattr(self, name))
            if value is not None:
                made[info.alias or name] = value
        return made


class Inside(Value):
    """A table of its own."""

    def __init__(self, model: type[Table], about: str = "") -> None:
        self.model, self.about = model, about

    def read(self, given: Any, setting: Setting) -> Table:
        if isinstance(given, list) and len(given) > 1 and all(isinstance(one, dict) for one in given):
            raise ValueError(f"is a list of {len(given)} tables; wanted one{', ' * bool(self.about)}{self.about}")
        return given if isinstance(given, self.model) else self.model.model_validate(given, context=setting)

    def below(self, key: str) -> Value | None:
        return self.model.values()[key]

    @property
    def takes(self) -> str:
        return f"`{{ {', '.join(self.model.keys())} }}`"

    def json(self) -> dict[str, Any]:
        fields = {info.alias or name: info for name, info in self.model.model_fields.items()}
        keys = {
            key: (value, NEEDED if fields[key].is_required() else None) for key, value in self.model.values().items()
        }
        return keys_json(keys)


class Named(Value):
    """Tables of one kind by name."""

    def __init__(self, model: type[Table], about: str) -> None:
        self.model, self.about = model, about

    def read(self, given: Any, setting: Setting) -> dict[str, Any]:
        if not isinstance(given, dict):
            raise ValueError(f"{show(given)} is no table of tables by name; wanted {self.about}")
        found, faults = {}, []
        for name, one in given.items():
            try:
                found[name] = one if isinstance(one, self.model) else self.model.model_validate(one, context=setting)
            except Misfit as error:
                faults += [((name, *below), message) for below, message in error.faults]
            except ValueError as error:
                faults += [((name, *below), message) for below, message in misfits(error, self.model.keys())]
        if faults:
            raise Misfit(faults)
        return found

    def below(self, key: str) -> Value | None:
        return Inside(self.model)

    @property
    def takes(self) -> str:
        return f"`{{ NAME = {{ {', '.join(self.model.keys())} }} }}`"

    def json(self) -> dict[str, Any]:
        return {"type": "object", "additionalProperties": {"type": "object"}}


def plain(value: Any) -> Any:
    """A field's value as the file would say it."""
    if hasattr(value, "table"):
        return value.table()
    if isinstance(value, (list, tuple)):
        return [plain(one) for one in value]
    if isinstance(value, dict):
        return {key: plain(one) for key, one in value.items()}
    return value


def at_most_one(given: dict[str, Any], keys: tuple[str, ...]) -> list[tuple[tuple[Any, ...], str]]:
    """The fault of two of the keys given."""
    found = [key for key in keys if key in given]
    return [((found[1],), f"{' and '.join(found)} are given; keep one")] if len(found) > 1 else []


def at_least_one(given: dict[str, Any], keys: tuple[str, ...]) -> list[tuple[tuple[Any, ...], str]]:
    """The fault of none of the keys given."""
    if any(key in given for key in keys):
        return []
    return [((), f"wanted one of {', '.join(keys)}" if len(keys) > 1 else f"{keys[0]} is missing")]


def misfits(error: ValidationError, keys: list[str], meant: dict[str, str] = {}) -> list[tuple[tuple[Any, ...], str]]:  # noqa: B006
    """Pydantic's errors in our words, with the keys they lie under; `meant` : unknown keys -> what says it here."""
    found = []
    for one in error.errors(include_url=False):
        place, cause = tuple(one["loc"]), one.get("ctx", {}).get("error")
        if isinstance(cause, Misfit):
            found += [(place + below, message) for below, message in cause.faults]
        elif one["type"] == "missing":
            found.append((place[:-1], f"{place[-1]} is missing"))
        elif one["type"] == "extra_forbidden":
            hint = meant.get(str(place[-1]).casefold().replace("-", "_"))
            found.append((place, f"unknown key{f'; say {hint}' if hint else _near(str(place[-1]), keys)}"))
        else:
            found.append((place, str(cause) if cause else one["msg"]))
    return found

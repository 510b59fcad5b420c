"""Effect of a changed key on the model: other numbers, another initial state, or a new model."""

import functools
from dataclasses import dataclass
from typing import Any

from fvsolve.case.case import Case
from fvsolve.case.chainage import original_keys, pieces_of, placed
from fvsolve.case.claims import COMPARE_KEYS, expect_keys, limit_keys
from fvsolve.case.load import TOP
from fvsolve.case.pipe_routes import Route
from fvsolve.case.reading import class_of_type, default_values, driven_keys, raw_link, split_key
from fvsolve.case.sections import ExactSpec, FluidSpec, Numerics, Output
from fvsolve.case.validation_table import KEYS as VALIDATION_KEYS
from fvsolve.errors import FvsolveError
from fvsolve.parts import KINDS, Scalar
from fvsolve.parts.control import Control
from fvsolve.parts.pump.energy_use import EnergyUse
from fvsolve.parts.reaction import Reaction
from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.table_model import Nested
from fvsolve.parts.value import BY_CELLS, PROFILE, SHAPE, VALUE, Quantity, Text, Value
from fvsolve.units import show

TABLES = {
    "fluid": FluidSpec,
    "numerics": Numerics,
    "output": Output,
    "energy": EnergyUse,
    "exact": ExactSpec,
}
CLASSES = (VALUE, PROFILE, SHAPE)
# keys of a part that is placed on a pipe
CHAINAGE = {"on": Text(), "at": Quantity("length", changes=SHAPE)}


def changes(case: Case, key: str) -> str:
    """Effect of changing the value of a key such as "links.gate.area" on the model: "value", "profile" or "shape".

    value : only numbers in the arrays of the model change; the initial state, its flows and pressures do not
    profile : the initial state changes too; the sizes of arrays, the names and the whole numbers in them do not
    shape : the model must be built again
    The result may not hold for a change to or from a special value such as zero demand or zero loss. Raises
    FvsolveError for an unknown key.
    """
    keys = split_key(key)
    own = class_of_key(case, keys)
    if keys[0] != "signals" or not keys[1:]:
        return own
    others = driven_keys(case.raw, "signal", keys[1])
    return max((class_of_key(case, other) for other in others), key=CLASSES.index, default=VALUE)


def class_of_key(case: Case, keys: tuple[Any, ...]) -> str:
    """Effect of changing the value at a key path of a case: "value", "profile" or "shape", see `changes`."""
    result = declaration_of(case.raw, keys).changes
    links = [raw_link(case.raw, name) for name in case.raw.get("links", {})]
    if keys[0] == "links" and keys[2:3] == ("length",) and keys[1] in pieces_of(case.raw):
        return SHAPE  # its pieces between chainages get other cells
    if result == BY_CELLS:
        result = (
            SHAPE
            if any(link["type"] == "pipe" and "cells" not in link for link in links)
            else PROFILE
        )
    unsteady = any(link.get("friction", {}).get("model") == "unsteady" for link in links)
    driven = any(
        name in case.nodes and case.nodes[name].kind == "mass" for name in case.network_places
    )
    if (
        result == VALUE
        and (case.needs_equilibrium or driven)
        and keys[0] in ("nodes", "links", "defaults")
    ):
        # it may change the equilibrium, or the force of a mass on a network at the start
        result = PROFILE
    # the start chooses the terms of unsteady friction
    return SHAPE if result == PROFILE and unsteady else result


def declaration_of(raw: dict[str, Any], keys: tuple[str, ...]) -> Value:
    """Declaration (`Value`) of the key at a key path; raw : nested dicts of a case as in the file.

    For a path that leads into a value, such as an entry of a list, it is the declaration of the whole value.
    """
    result: Value | None = Keys(declarations(raw))
    keys = original_keys(raw, keys)
    for key in (*keys[:2], *keys[4:]) if keys[2:3] == ("pieces",) else keys:
        outer = result
        try:
            result = outer.below(key)
        except KeyError:
            text = f"unknown key {show('.'.join(keys))}; expected a key of the case, such as numerics.end"
            raise FvsolveError(text) from None
        if result is None:
            return outer
    return result


@dataclass(frozen=True)
class Keys(Value):
    """Declaration of a table: key -> declaration of its value."""

    values: dict[str, Value]

    def below(self, key: str) -> Value:
        return self.values[key]


class Defaults(Value):
    """Declaration of the table `[defaults]`: type of part -> keys that may have a default."""

    def below(self, key: str) -> Value:
        if class_of_type(key) is None:
            raise KeyError(key)
        return Keys(default_values(key))


def declarations(raw: dict[str, Any]) -> dict[str, Value]:
    """Declarations of all keys of a case, as nested tables with the names of its parts.

    raw : nested dicts of the case as in the file
    """
    signals = Keys(dict.fromkeys(raw.get("signals", {}), Scheduled("number")))
    result = {**values_of(TOP), "ambient_pressure": Quantity("pressure"), "signals": signals}
    result |= {name: Nested(model) for name, model in TABLES.items()}
    for group, kinds in KINDS.items():
        result[group] = Keys(
            {name: part_keys(kinds[entry["type"]]) for name, entry in raw.get(group, {}).items()}
        )
    blocks = raw.get("controls", {}).items()
    result["controls"] = Keys(
        {name: part_keys(Control.kinds[entry["type"]]) for name, entry in blocks}
    )
    result["defaults"] = Defaults()
    for group, name, _ in placed(raw):
        result[group] = Keys(
            {**result[group].values, name: Keys({**result[group].values[name].values, **CHAINAGE})}
        )
    result["validation"] = Keys(values_of(VALIDATION_KEYS))
    return result | {
        group: Keys(dict.fromkeys(raw.get(group, {}), entry))
        for group, entry in named_tables().items()
    }


@functools.cache
def part_keys(model: type) -> Keys:
    """Declarations of the keys of a part; model : its class."""
    return Keys({"type": Value(), **model.values()})


@functools.cache
def named_tables() -> dict[str, Keys]:
    """Declarations of `expect`, `limits` and other groups of named tables : group -> keys of each of its tables."""
    named = {
        "expect": values_of(expect_keys("number")),
        "compare": values_of(COMPARE_KEYS),
        "scalars": Scalar.values(),
    }
    named |= {"reactions": Reaction.values(), "routes": Route.values()}
    named |= {"limits": values_of(limit_keys("pressure", "pressure"))}
    return {group: Keys(values) for group, values in named.items()}


def values_of(keys: dict[str, tuple[Value, Any]]) -> dict[str, Value]:
    return {key: value for key, (value, _) in keys.items()}

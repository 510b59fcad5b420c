"""What moving a key of a case asks of its model: tables, another start, another model. Knows no model."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from fvsolve.case import defaults
from fvsolve.case.case import Case
from fvsolve.case.claims import COMPARE_KEYS, expect_keys
from fvsolve.case.defaults import link_said
from fvsolve.case.limits import limit_keys
from fvsolve.case.load import TOP
from fvsolve.case.placing import own_keys, pieces_of, placed
from fvsolve.case.raw import dotted
from fvsolve.case.routes import Route
from fvsolve.case.sections import ExactSpec, FluidSpec, Numerics, Output
from fvsolve.errors import FvsolveError
from fvsolve.parts import KINDS, Scalar
from fvsolve.parts.schedule import Scheduled
from fvsolve.parts.table import Inside
from fvsolve.parts.value import COUNTED, PROFILE, SHAPE, VALUE, Quantity, Text, Value
from fvsolve.units import show

TABLES = {"fluid": FluidSpec, "numerics": Numerics, "output": Output, "exact": ExactSpec}
CLASSES = (VALUE, PROFILE, SHAPE)


def changes(case: Case, key: str) -> str:
    """What moving the number or word under a key, such as "links.gate.area", asks: "value", "profile" or "shape".

    value : other numbers in the tables of the model; state, flows and pressures at the start are the same to the bit
    profile : another start too, in tables of the same sizes, names and whole numbers
    shape : another model
    Between numbers that mean the same: no demand and no loss are none of their kind. Raises FvsolveError where the case
    has no such key.
    """
    keys = dotted(key)
    own = classed(case, keys)
    if keys[0] != "signals" or not keys[1:]:
        return own
    return max((classed(case, other) for other in followers(case.raw, keys[1])), key=CLASSES.index, default=VALUE)


def classed(case: Case, keys: tuple[Any, ...]) -> str:
    """The class of a key as this case has it."""
    found, links = declared(case.raw, keys).changes, [link_said(case.raw, name) for name in case.raw.get("links", {})]
    if keys[0] == "links" and keys[2:3] == ("length",) and keys[1] in pieces_of(case.raw):
        return SHAPE  # its pieces by chainage get other cells
    if found == COUNTED:
        found = SHAPE if any(one["type"] == "pipe" and "cells" not in one for one in links) else PROFILE
    unsteady = any(one.get("friction", {}).get("model") == "unsteady" for one in links)
    if found == VALUE and case.settles and keys[0] in ("nodes", "links"):
        found = PROFILE  # it may be what balances
    return SHAPE if found == PROFILE and unsteady else found  # its terms are chosen by the start


def declared(raw: dict[str, Any], keys: tuple[str, ...]) -> Value:
    """What a key may be, as its part declares it; of a key below one that says all, what that one may be."""
    found: Value | None = Keys(known(raw))
    keys = own_keys(raw, keys)
    for key in (*keys[:2], *keys[4:]) if keys[2:3] == ("pieces",) else keys:
        outer = found
        try:
            found = outer.below(key)
        except KeyError:
            raise FvsolveError(f"no key {show('.'.join(keys))}; wanted one of the case, such as numerics.end") from None
        if found is None:
            return outer
    return found


@dataclass(frozen=True)
class Keys(Value):
    """A table of keys with a value each."""

    values: dict[str, Value]

    def below(self, key: str) -> Value:
        return self.values[key]


def known(raw: dict[str, Any]) -> dict[str, Value]:
    """What each key of a case may be; where parts have names of their own, those of this one."""
    signals = Keys(dict.fromkeys(raw.get("signals", {}), Scheduled("number")))
    found = {**values_of(TOP), "ambient_pressure": Quantity("pressure"), "signals": signals}
    found |= {name: Inside(model) for name, model in TABLES.items()}
    for group, kinds in KINDS.items():
        parts = raw.get(group, {}).items()
        found[group] = Keys({name: Keys({"type": Value(), **kinds[one["type"]].values()}) for name, one in parts})
    found["defaults"] = Keys({kind: Keys(defaults.values(kind)) for kind in defaults.KINDS})
    for group, name, _ in placed(raw):
        where = {"on": Text(), "at": Quantity("length", changes=SHAPE)}
        found[group] = Keys({**found[group].values, name: Keys({**found[group].values[name].values, **where})})
    said = {"expect": values_of(expect_keys("number")), "compare": values_of(COMPARE_KEYS), "scalars": Scalar.values()}
    said |= {"routes": Route.values(), "limits": values_of(limit_keys("pressure", "pressure"))}
    return found | {group: Keys(dict.fromkeys(raw.get(group, {}), Keys(one))) for group, one in said.items()}


def values_of(keys: dict[str, tuple[Value, Any]]) -> dict[str, Value]:
    return {key: value for key, (value, _) in keys.items()}


def followers(table: Any, signal: str, keys: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Keys of all that a signal drives."""
    if isinstance(table, dict):
        if table.get("signal") == signal and keys[:1] != ("signals",):
            yield keys
        for key, one in table.items():
            yield from followers(one, signal, (*keys, key))

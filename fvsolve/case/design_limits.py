"""Design limits of a case, from the tables `[limits.NAME]`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from fvsolve.case.extent import OF_PRESSURE, Extent, only_dimension, read_extent
from fvsolve.case.probe import Kinds
from fvsolve.errors import did_you_mean
from fvsolve.parts.table_model import read_keys
from fvsolve.parts.value import (
    NEEDED,
    VALUE,
    Anything,
    Number,
    Quantity,
    ReadContext,
    Text,
    Value,
    ValueFault,
    positive,
)
from fvsolve.units import show

VACUUM, VAPOR = "vacuum", "vapor"
NAMED = {"vacuum": VACUUM, "vapor": VAPOR, "vapour": VAPOR}
BOUNDS = ("minimum", "maximum", "class_fraction")


class Bound(Value):
    """Value of a key that bounds a quantity: a number with the dimension of the quantity, or "vacuum" or "vapor"."""

    changes = VALUE

    def __init__(self, dimension: str, named: bool) -> None:
        self.item, self.named = Quantity(dimension, changes=VALUE), named

    def read(self, given: Any, setting: ReadContext) -> float | str:
        if isinstance(given, str) and given.casefold() in NAMED:
            if self.named:
                return NAMED[given.casefold()]
            raise ValueError(f"{show(given)} is a pressure; expected a {self.item.dimension}")
        try:
            return self.item.read(given, setting)
        except ValueError as error:
            hint = did_you_mean(given, NAMED) if isinstance(given, str) and self.named else ""
            raise ValueError(f"{error}{hint}") from None

    def json(self) -> dict[str, Any]:
        return {"type": ["number", "string"]}


class On(Value):
    """Value of the key `on` of a limit: names of parts or routes, which are looked up when all parts are read."""

    changes = VALUE

    def read(self, given: Any, setting: ReadContext) -> Any:
        return tuple(given) if isinstance(given, list) else given

    def json(self) -> dict[str, Any]:
        return {"type": ["string", "array"], "items": {"type": "string"}}


@dataclass(frozen=True)
class DesignLimit:
    """Lower and upper bound [SI] of a quantity in some parts of a case (the extent), checked after every step.

    minimum, maximum : a number, "vacuum" (ambient pressure), "vapor" (vapour pressure), or None without a bound
    class_fraction : greatest allowed gauge pressure over the allowable pressure of each pipe [-], or None
    """

    name: str
    extent: Extent
    minimum: float | str | None
    maximum: float | str | None
    class_fraction: float | None

    def table(self) -> dict[str, Any]:
        """Keys of the limit as in a file."""
        on = self.extent.on[0] if len(self.extent.on) == 1 else list(self.extent.on)
        result = {"on": on, "quantity": self.extent.quantity}
        return result | {key: bound for key in BOUNDS if (bound := getattr(self, key)) is not None}


def limit_keys(quantity: str, dimension: str) -> dict[str, tuple[Value, Any]]:
    """Keys of a limit on a quantity: name -> (declaration, default)."""
    bound = Bound(dimension, quantity in OF_PRESSURE)
    return {
        "on": (On(), NEEDED),
        "quantity": (Text(changes=VALUE), "pressure"),
        "minimum": (bound, None),
        "maximum": (bound, None),
        "class_fraction": (Number(positive, changes=VALUE), None),
    }


def read_limit(
    name: str, given: Any, kinds: Kinds, routes: Mapping[str, Any], links: Mapping[str, Any], setting: ReadContext
) -> DesignLimit | None:
    """Read one table of `[limits]`; None if the parts that it names are faulty. Raises ValueError, ValueFault.

    name, given : name and content of the table; kinds : as for `read_probe`; routes, links : by name
    """
    if not isinstance(given, dict):
        raise ValueError(f'{show(given)} is not a table; expected for example {{ on = "pipes", maximum = "16 barg" }}')
    quantity = given.get("quantity", "gauge_pressure" if "class_fraction" in given else "pressure")
    faults, extent = [], None
    if not isinstance(quantity, str):
        faults.append((("quantity",), f"{show(quantity)} is not text; expected the name of a quantity"))
    elif "on" in given:
        try:
            extent = read_extent(given["on"], quantity, kinds, routes)
        except ValueError as error:
            key = "quantity" if isinstance(error, ValueFault) and "quantity" in given else "on"
            faults.append(((key,), str(error)))
    dimension = (
        extent.dimension if extent is not None else only_dimension(quantity) if isinstance(quantity, str) else None
    )
    keys = limit_keys(quantity if isinstance(quantity, str) else "", dimension or "number")
    if dimension is None:
        keys |= dict.fromkeys(("minimum", "maximum"), (Anything(), None))
    bounds = dict.fromkeys(BOUNDS)
    try:
        read_keys(given, keys, setting)
    except ValueFault as error:
        faults += error.faults
    for key in BOUNDS:
        with suppress(KeyError, ValueError):
            bounds[key] = keys[key][0].read(given[key], setting)
    if not any(key in given for key in BOUNDS):
        faults.append(((), f"bound is missing; expected at least one of {', '.join(BOUNDS)}"))
    if bounds["maximum"] is not None and bounds["class_fraction"] is not None:
        faults.append((("class_fraction",), "maximum and class_fraction are given; keep one"))
    minimum, maximum = bounds["minimum"], bounds["maximum"]
    if dimension is not None and isinstance(minimum, float) and isinstance(maximum, float) and not minimum < maximum:
        faults.append((("minimum",), f"{show(given['minimum'])} is not below maximum, {show(given['maximum'])}"))
    if extent is not None and bounds["class_fraction"] is not None:
        faults += list(pipes_without_class(extent, links))
    if faults:
        raise ValueFault(faults)
    return None if extent is None else DesignLimit(name, extent, **bounds)


def limit_faults(limit: DesignLimit | None, fluid: Any, gravity: float) -> Iterator[tuple[tuple, str]]:
    """Faults (key path, message) of a limit that depend on the properties of the fluid and on gravity [m/s2]."""
    if limit is None:
        return
    if gravity == 0.0 and limit.extent.quantity in ("head", "pressure_head"):
        yield (
            ("quantity",),
            f"{limit.extent.quantity} does not exist where gravity is 0; expected pressure",
        )
    for key in ("minimum", "maximum"):
        if getattr(limit, key) == VAPOR and fluid is not None and not fluid.vapor_pressure:
            yield (key,), 'the fluid has no vapour pressure; expected vapor_pressure above 0 under [fluid], or "vacuum"'


def pipes_without_class(extent: Extent, links: Mapping[str, Any]):
    """Yield a fault of the key `class_fraction` if the quantity is not a pressure, or a part has no pressure class."""
    if extent.quantity not in OF_PRESSURE or extent.quantity == "head":
        yield ("class_fraction",), f"a pressure class limits the pressure, not {extent.quantity}; leave out `quantity`"
        return
    bare = {name for name, link in links.items() if getattr(link, "allowable_pressure", None) is None}
    parts = [name for group, name in extent.parts if group != "links" or name in bare]
    if parts:
        more = f" and {len(parts) - 1} more" if len(parts) > 1 else ""
        yield (
            ("class_fraction",),
            f"no pressure class is given for {parts[0]}{more}; expected pipes with `class` or `allowable_pressure`",
        )

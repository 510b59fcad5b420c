"""Limits that a design has to hold: `[limits.NAME]`. Knows their wording; knows no result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from fvsolve.case.extent import OF_PRESSURE, Extent, only_dimension, read_extent
from fvsolve.case.probe import Kinds
from fvsolve.errors import did_you_mean
from fvsolve.parts.table import read_keys
from fvsolve.parts.value import NEEDED, VALUE, Anything, Misfit, Number, Quantity, Setting, Text, Value, positive
from fvsolve.units import show

VACUUM, VAPOR = "vacuum", "vapor"
NAMED = {"vacuum": VACUUM, "vapor": VAPOR, "vapour": VAPOR}
BOUNDS = ("least", "greatest", "share_of_class")


class Bound(Value):
    """A number with the unit of the limit's quantity, or a pressure by name."""

    changes = VALUE

    def __init__(self, dimension: str, named: bool) -> None:
        self.item, self.named = Quantity(dimension, changes=VALUE), named

    def read(self, given: Any, setting: Setting) -> float | str:
        if isinstance(given, str) and given.casefold() in NAMED:
            if self.named:
                return NAMED[given.casefold()]
            raise ValueError(f"{show(given)} is a pressure; wanted a {self.item.dimension}")
        try:
            return self.item.read(given, setting)
        except ValueError as error:
            hint = did_you_mean(given, NAMED) if isinstance(given, str) and self.named else ""
            raise ValueError(f"{error}{hint}") from None

    def json(self) -> dict[str, Any]:
        return {"type": ["number", "string"]}


class On(Value):
    """Names of parts or routes, read when these are known."""

    changes = VALUE

    def read(self, given: Any, setting: Setting) -> Any:
        return tuple(given) if isinstance(given, list) else given

    def json(self) -> dict[str, Any]:
        return {"type": ["string", "array"], "items": {"type": "string"}}


@dataclass(frozen=True)
class DesignLimit:
    """What a quantity may be at least and at most, everywhere on its extent and after every step [SI].

    least, greatest : a number, "vacuum" (ambient pressure) or "vapor" (vapour pressure)
    share_of_class : greatest gauge pressure over what the class of each pipe allows
    """

    name: str
    extent: Extent
    least: float | str | None
    greatest: float | str | None
    share_of_class: float | None

    def table(self) -> dict[str, Any]:
        """What the file would say."""
        on = self.extent.on[0] if len(self.extent.on) == 1 else list(self.extent.on)
        said = {"on": on, "quantity": self.extent.quantity}
        return said | {key: one for key in BOUNDS if (one := getattr(self, key)) is not None}


def limit_keys(quantity: str, dimension: str) -> dict[str, tuple[Value, Any]]:
    """Keys of a limit on a quantity."""
    bound = Bound(dimension, quantity in OF_PRESSURE)
    return {
        "on": (On(), NEEDED),
        "quantity": (Text(changes=VALUE), "pressure"),
        "least": (bound, None),
        "greatest": (bound, None),
        "share_of_class": (Number(positive, changes=VALUE), None),
    }


def read_limit(
    name: str, given: Any, kinds: Kinds, routes: Mapping[str, Any], links: Mapping[str, Any], setting: Setting
) -> DesignLimit | None:
    """One table of `[limits]`; None where what it is on is at fault itself. Raises ValueError, Misfit."""
    if not isinstance(given, dict):
        raise ValueError(f'{show(given)} is no table; wanted one such as {{ on = "pipes", greatest = "16 barg" }}')
    asked = given.get("quantity", "gauge_pressure" if "share_of_class" in given else "pressure")
    faults, extent = [], None
    if not isinstance(asked, str):
        faults.append((("quantity",), f"{show(asked)} is no text"))
    elif "on" in given:
        try:
            extent = read_extent(given["on"], asked, kinds, routes)
        except ValueError as error:
            key = "quantity" if isinstance(error, Misfit) and "quantity" in given else "on"
            faults.append(((key,), str(error)))
    dimension = extent.dimension if extent is not None else only_dimension(asked) if isinstance(asked, str) else None
    keys = limit_keys(asked if isinstance(asked, str) else "", dimension or "number")
    if dimension is None:
        keys |= dict.fromkeys(("least", "greatest"), (Anything(), None))
    bounds = dict.fromkeys(BOUNDS)
    try:
        read_keys(given, keys, setting)
    except Misfit as error:
        faults += error.faults
    for key in BOUNDS:
        with suppress(KeyError, ValueError):
            bounds[key] = keys[key][0].read(given[key], setting)
    if not any(key in given for key in BOUNDS):
        faults.append(((), f"nothing is limited; wanted one of {', '.join(BOUNDS)}"))
    if bounds["greatest"] is not None and bounds["share_of_class"] is not None:
        faults.append((("share_of_class",), "greatest and share_of_class are given; keep one"))
    least, greatest = bounds["least"], bounds["greatest"]
    if dimension is not None and isinstance(least, float) and isinstance(greatest, float) and not least < greatest:
        faults.append((("least",), f"{show(given['least'])} is not below greatest, {show(given['greatest'])}"))
    if extent is not None and bounds["share_of_class"] is not None:
        faults += list(unclassed(extent, links))
    if faults:
        raise Misfit(faults)
    return None if extent is None else DesignLimit(name, extent, **bounds)


def limit_faults(limit: DesignLimit | None, fluid: Any, gravity: float) -> Iterator[tuple[tuple, str]]:
    """What a limit asks that the fluid and gravity of its case do not tell."""
    if limit is None:
        return
    if gravity == 0.0 and limit.extent.quantity in ("head", "pressure_head"):
        yield (
            ("quantity",),
            f"nothing weighs where gravity is 0, so there is no {limit.extent.quantity}; wanted pressure",
        )
    for key in ("least", "greatest"):
        if getattr(limit, key) == VAPOR and fluid is not None and not fluid.vapor_pressure:
            yield (key,), 'the fluid has no vapour pressure; wanted vapor_pressure above 0 under [fluid], or "vacuum"'


def unclassed(extent: Extent, links: Mapping[str, Any]):
    """Faults of a share of class on what has none."""
    if extent.quantity not in OF_PRESSURE or extent.quantity == "head":
        yield ("share_of_class",), f"a class limits pressure, not {extent.quantity}; leave quantity out"
        return
    bare = {name for name, link in links.items() if getattr(link, "allowable_pressure", None) is None}
    parts = [name for group, name in extent.parts if group != "links" or name in bare]
    if parts:
        more = f" and {len(parts) - 1} more" if len(parts) > 1 else ""
        yield ("share_of_class",), f"{parts[0]}{more} without a class; give it class or allowable_pressure"

"""Checks of scalars against the rest of a case."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

from fvsolve.case.resource_checks import LONGEST_NAME
from fvsolve.errors import article, did_you_mean, listing
from fvsolve.fluid.laws import LAWS, law_names
from fvsolve.parts import KINDS, Basin
from fvsolve.parts.basin import VELOCITY_FIELDS, Physics
from fvsolve.units import show

Faults = Iterator[tuple[tuple, str]]

RESERVED = {"time", "t", "mass", "energy", "nodes", "pipe", "value", "min_pressure", "max_pressure"}


def reserved_names() -> set[str]:
    """Names that scalars cannot have.

    These are columns of output files, quantities of parts, and fields of basins other than velocities.
    """
    kinds = [kind for group in KINDS.values() for kind in group.values()]
    fields = {name for physics in Physics.kinds.values() for name in physics.fields if name not in VELOCITY_FIELDS}
    return RESERVED | fields | {name for kind in kinds for name in (*kind.quantities, *getattr(kind, "along", {}))}


def find_faults(scalars: dict[str, Any], nodes: dict[str, Any], links: dict[str, Any], fluid: Any) -> Faults:
    """Faults (key path, message) of names of scalars, their values in parts, and parts that do not support them."""
    for name in scalars:
        if len(name) > LONGEST_NAME:
            yield ("scalars", name), f"has {len(name)} letters; expected at most {LONGEST_NAME}"
        if not re.fullmatch(r"[\w-]+", name):
            yield ("scalars", name), f"{show(name)} is not a valid name; a name has only letters, digits, _ and -"
        elif name in reserved_names():
            yield ("scalars", name), f"{show(name)} is a reserved name; expected another name"
    for group, parts in (("nodes", nodes), ("links", links)):
        for name, part in parts.items():
            for scalar, value in getattr(part, "scalars", {}).items():
                if (text := _value_fault(scalar, value, part, scalars)) is not None:
                    yield (group, name, "scalars", scalar), text
            if scalars and isinstance(part, Basin) and not part.physics_type.carries:
                text = f"scalars are not supported with physics {show(part.physics)}; expected a free surface"
                yield (group, name), text
            for patch, patch_options in getattr(part, "patches", {}).items():
                for scalar in patch_options.scalars:
                    place = (group, name, "patches", patch, "scalars", scalar)
                    if scalar not in scalars:
                        yield place, _unknown(scalar, scalars)
                    elif part.physics_type.joined and patch_options.boundary != "open":
                        yield (
                            place,
                            "is not valid here, because the joined links give the value. Remove this key, or set "
                            'boundary = "open"',
                        )
            if scalars and part.no_scalars:
                yield (group, name), f"is {article(part.kind)}; {part.no_scalars}"
    if not scalars:
        return
    if fluid is not None and not LAWS[fluid.law].scalars:
        yield (
            ("fluid", "law"),
            f"{show(fluid.law)} does not support scalars yet; expected {law_names(lambda law: law.scalars)}",
        )


def _value_fault(scalar: str, value: Any, part: Any, scalars: dict[str, Any]) -> str | None:
    """Fault text for the value of a scalar that a part states; None if it is valid."""
    if scalar not in scalars:
        return _unknown(scalar, scalars)
    if isinstance(part, Basin):
        return None
    if part.own_scalars == "start" and not value.constant:
        return "is the value at the start; expected a number, not a schedule"
    if not part.own_scalars:
        return (
            f"{article(part.kind)} has no scalar values; expected an inflow, a reservoir, a tank, a chamber or a pipe"
        )
    return None


def _unknown(scalar: str, scalars: dict[str, Any]) -> str:
    near = did_you_mean(scalar, scalars) or (f"; scalars are {listing(scalars)}" if scalars else "")
    return f"no scalar named {show(scalar)}{near}" + ("" if scalars else f"; declare it as [scalars.{scalar}]")

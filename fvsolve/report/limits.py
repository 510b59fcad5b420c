"""Lines along a section that pressures may not pass: limits and classes as heads. Knows limits; draws nothing."""

from __future__ import annotations

import numpy as np

from fvsolve.case.extent import OF_PRESSURE
from fvsolve.report.heads import head_of, in_units

MOST = 6  # lines of limits in a section


def limit_lines(result, pipe: np.ndarray, elevation: np.ndarray) -> dict[str, np.ndarray]:
    """Name -> head [its unit] float64[n] at places of pipes, nan where it does not hold; classes first.

    pipe : str[n]; elevation : float64[n] in the unit of heads
    """
    case, found = result.case, {}
    classes = {name: getattr(case.links[name], "allowable_pressure", None) for name in np.unique(pipe).tolist()}
    if any(one is not None for one in classes.values()):
        gauge = np.array([np.nan if classes[name] is None else classes[name] for name in pipe.tolist()])
        found["class line"] = _head(result, "gauge_pressure", gauge, elevation)
    for limit in case.limits.values():
        quantity, parts = limit.extent.quantity, [name for group, name in limit.extent.parts if group == "links"]
        held = np.isin(pipe, parts)
        if quantity not in OF_PRESSURE or not held.any():
            continue
        for bound in ("least", "greatest"):
            asked = getattr(limit, bound)
            if asked is None or isinstance(asked, str):
                continue  # the pipe itself is the line of "vacuum", and that of vapour is there
            line = _head(result, quantity, asked, elevation)
            found[f"{limit.name}, {bound}"] = np.where(held, line, np.nan)
        if limit.share_of_class is not None and limit.share_of_class != 1.0:
            gauge = np.array([limit.share_of_class * (classes[name] or np.nan) for name in pipe.tolist()])
            line = _head(result, "gauge_pressure", gauge, elevation)
            found[f"{limit.name}, greatest"] = np.where(held, line, np.nan)
    return dict(list(found.items())[:MOST])


def _head(result, quantity: str, value, elevation: np.ndarray) -> np.ndarray:
    """A value of a quantity of pressure [SI] as head, in its unit."""
    shown = in_units(result, "greatest_head")
    if quantity == "head":
        return shown.from_si(value + 0.0 * elevation)
    if quantity == "pressure_head":
        return elevation + shown.from_si(value)
    ambient = result.case.ambient_pressure if quantity == "gauge_pressure" else 0.0
    return head_of(result, value + ambient, elevation)

"""Lines of design limits and pressure classes along a section, as heads."""

from __future__ import annotations

import numpy as np

from fvsolve.case.probe import OF_PRESSURE
from fvsolve.report.envelope_units import envelope_column, head_of

MAX_LIMIT_LINES = 6  # greatest number of limit lines in a section


def limit_lines(result, pipe: np.ndarray, elevation: np.ndarray) -> dict[str, np.ndarray]:
    """Heads of pressure classes and limits along a section : name -> float64[n], at most `MAX_LIMIT_LINES` lines.

    The line of pressure classes is first; values are NaN where a limit does not apply.
    pipe : str[n]  pipe of each point; elevation : float64[n]; heads and elevations are in the units of the envelope
    """
    case, lines = result.case, {}
    classes = {name: getattr(case.links[name], "allowable_pressure", None) for name in np.unique(pipe).tolist()}
    if any(allowable is not None for allowable in classes.values()):
        gauge = np.array([np.nan if classes[name] is None else classes[name] for name in pipe.tolist()])
        lines["class line"] = _as_head(result, "gauge_pressure", gauge, elevation)
    for limit in case.limits.values():
        quantity, parts = limit.extent.quantity, [name for group, name in limit.extent.parts if group == "links"]
        applies = np.isin(pipe, parts)
        if quantity not in OF_PRESSURE or not applies.any():
            continue
        for bound in ("minimum", "maximum"):
            value = getattr(limit, bound)
            if value is None or isinstance(value, str):
                continue  # "vacuum" is the line of the pipe itself, and the vapour line is drawn anyway
            line = _as_head(result, quantity, value, elevation)
            lines[f"{limit.name}, {bound}"] = np.where(applies, line, np.nan)
        if limit.class_fraction is not None and limit.class_fraction != 1.0:
            gauge = np.array([limit.class_fraction * (classes[name] or np.nan) for name in pipe.tolist()])
            line = _as_head(result, "gauge_pressure", gauge, elevation)
            lines[f"{limit.name}, maximum"] = np.where(applies, line, np.nan)
    return dict(list(lines.items())[:MAX_LIMIT_LINES])


def _as_head(result, quantity: str, value, elevation: np.ndarray) -> np.ndarray:
    """Head that corresponds to a `value` [SI] of pressure, gauge pressure, pressure head or head, in the unit of heads.

    quantity : quantity of the value; elevation : float64[n]  in the unit of heads
    """
    shown = envelope_column(result, "max_head")
    if quantity == "head":
        return shown.from_si(value + 0.0 * elevation)
    if quantity == "pressure_head":
        return elevation + shown.from_si(value)
    ambient = result.case.ambient_pressure if quantity == "gauge_pressure" else 0.0
    return head_of(result, value + ambient, elevation)

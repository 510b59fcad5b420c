"""Selection of the curves of a history picture: constant and duplicate curves are left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

CONSTANT_TOLERANCE = 1e-9  # greatest range of a constant curve, as a fraction of its size
SAME_TOLERANCE = 1e-3  # greatest difference of coinciding curves, as a fraction of the range of their panel
ALIKE_TOLERANCE = (
    1e-6  # greatest residual of a curve after scaling and shifting another to it, as a fraction of its range
)
OF_PRESSURE = ("pressure", "gauge_pressure", "head", "level")  # equivalent quantities at a fixed place


@dataclass
class DrawnLine:
    """Curve of a column of history.csv.

    column : index of the column; names : places (part, and position on it) whose values the curve shows
    alike : other quantities at the same place with an equivalent curve, which are not drawn
    """

    column: int
    names: list[str]
    alike: list[str]

    @property
    def label(self) -> str:
        return ", ".join(self.names) + (f" ({', '.join(self.alike)} alike)" if self.alike else "")


@dataclass
class DrawnPanel:
    """Curves of a panel, which have the same quantity and unit."""

    quantity: str
    unit: str
    lines: list[DrawnLine]


def select_curves(values: np.ndarray, probes, measured=()) -> tuple[list[DrawnPanel], list[tuple[str, str, float]]]:
    """Panels with the curves to draw, and constant probes : (list of `DrawnPanel`, list of (probe, unit, value)).

    values : float64[k, n]; probes : (name, unit) of each column
    measured : names of probes with measurements, which are always drawn
    """
    swings = [_range_of(values[:, k]) for k in range(len(probes))]
    still = [k for k, (name, _) in enumerate(probes) if swings[k] is None and name not in measured]
    if len(still) == len(probes):
        still = []  # if all probes are constant, all are drawn
    panels: dict[tuple[str, str], DrawnPanel] = {}
    leaders: dict[str, list[tuple[int, DrawnLine]]] = {}
    for k, (name, unit) in enumerate(probes):
        if k in still:
            continue
        place, quantity = _place_and_quantity(name)
        line = DrawnLine(k, [place], [])
        if name not in measured and quantity in OF_PRESSURE:
            first = next(
                (leader for j, leader in leaders.get(place, []) if _is_scaled(values[:, j], values[:, k])), None
            )
            if first is not None:
                first.alike.append(quantity.replace("_", " "))
                continue
            leaders.setdefault(place, []).append((k, line))
        panels.setdefault((quantity, unit), DrawnPanel(quantity, unit, [])).lines.append(line)
    for panel in panels.values():
        panel.lines = _without_doubles(panel.lines, values, probes, measured)
    return list(panels.values()), [(*probes[k], float(values[0, k])) for k in still if len(values)]


def _without_doubles(lines: list[DrawnLine], values: np.ndarray, probes, measured) -> list[DrawnLine]:
    """Curves of a panel without duplicates: coinciding curves become one curve, which has the places of all in `names`.

    A curve with measurements, or with quantities in `alike`, does not become part of another curve.
    values, probes, measured : as for `select_curves`
    """
    seen = np.concatenate([values[:, line.column] for line in lines])
    tolerance = SAME_TOLERANCE * np.ptp(seen[np.isfinite(seen)]) if np.isfinite(seen).any() else 0.0
    result: list[DrawnLine] = []
    for line in lines:
        under = None
        if probes[line.column][0] not in measured and not line.alike:
            under = next(
                (other for other in result if _coincide(values[:, other.column], values[:, line.column], tolerance)),
                None,
            )
        if under is None:
            result.append(line)
        else:
            under.names += line.names
    return result


def _place_and_quantity(probe: str) -> tuple[str, str]:
    """Place and quantity of a probe: (`main at 0.5`, `pressure`) for `main.pressure@0.5`."""
    path, _, spot = probe.partition("@")
    place, _, quantity = path.rpartition(".")
    return place + (f" at {spot}" if spot else ""), quantity


def _range_of(values: np.ndarray) -> float | None:
    """Range of a curve; None if it is constant."""
    finite = values[np.isfinite(values)]
    swing = float(np.ptp(finite)) if finite.size else 0.0
    return swing if swing > CONSTANT_TOLERANCE * float(np.abs(finite).max(initial=0.0)) else None


def _coincide(a: np.ndarray, b: np.ndarray, tolerance: float) -> bool:
    return bool(np.array_equal(np.isnan(a), np.isnan(b)) and not (np.abs(a - b) > tolerance).any())


def _is_scaled(a: np.ndarray, b: np.ndarray) -> bool:
    """True if curve b is curve a times a positive factor plus a constant; False if either is constant or not finite."""
    low, high = int(a.argmin()), int(a.argmax())
    if not (np.isfinite(a).all() and np.isfinite(b).all() and a[low] < a[high]):
        return False
    scale = (b[high] - b[low]) / (a[high] - a[low])
    return bool(scale > 0.0 and np.abs(b - b[low] - scale * (a - a[low])).max() <= ALIKE_TOLERANCE * np.ptp(b))

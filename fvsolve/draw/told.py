"""Which curves a picture of histories needs: none twice, none that stands still. Knows columns; draws nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

STILL = 1e-9  # of its size: a curve that moves less is constant
SAME = 1e-3  # of its panel's range: curves that differ by less lie on each other
ALIKE = 1e-6  # of its range: what is left of a curve when another of its place is scaled and moved to it
OF_PRESSURE = ("pressure", "gauge_pressure", "head", "level")  # at a place that stays these tell the same


@dataclass
class DrawnLine:
    """A curve: its column, what it is called, and which other quantities of its place go the same way."""

    column: int
    names: list[str]
    alike: list[str]

    @property
    def label(self) -> str:
        return ", ".join(self.names) + (f" ({', '.join(self.alike)} alike)" if self.alike else "")


@dataclass
class DrawnPanel:
    """Curves of one quantity and unit."""

    quantity: str
    unit: str
    lines: list[DrawnLine]


def told(values: np.ndarray, probes, measured=()) -> tuple[list[DrawnPanel], list[tuple[str, str, float]]]:
    """Panels of curves, and what stands still: (probe, unit, value).

    values : float64[k, n]; probes : their (name, unit); measured : names of probes that are held against something
    """
    swings = [_swing(values[:, k]) for k in range(len(probes))]
    still = [k for k, (name, _) in enumerate(probes) if swings[k] is None and name not in measured]
    if len(still) == len(probes):
        still = []  # a picture of rest
    panels: dict[tuple[str, str], DrawnPanel] = {}
    leaders: dict[str, list[tuple[int, DrawnLine]]] = {}
    for k, (name, unit) in enumerate(probes):
        if k in still:
            continue
        place, what = _parted(name)
        line = DrawnLine(k, [place], [])
        if name not in measured and what in OF_PRESSURE:
            first = next((one for j, one in leaders.get(place, []) if _alike(values[:, j], values[:, k])), None)
            if first is not None:
                first.alike.append(what.replace("_", " "))
                continue
            leaders.setdefault(place, []).append((k, line))
        panels.setdefault((what, unit), DrawnPanel(what, unit, [])).lines.append(line)
    for panel in panels.values():
        panel.lines = _without_doubles(panel.lines, values, probes, measured)
    return list(panels.values()), [(*probes[k], float(values[0, k])) for k in still if len(values)]


def _without_doubles(lines: list[DrawnLine], values: np.ndarray, probes, measured) -> list[DrawnLine]:
    """Curves of a panel, those that would lie on another called beside it."""
    seen = np.concatenate([values[:, one.column] for one in lines])
    room = SAME * np.ptp(seen[np.isfinite(seen)]) if np.isfinite(seen).any() else 0.0
    kept: list[DrawnLine] = []
    for one in lines:
        under = None
        if probes[one.column][0] not in measured and not one.alike:
            under = next((other for other in kept if _near(values[:, other.column], values[:, one.column], room)), None)
        if under is None:
            kept.append(one)
        else:
            under.names += one.names
    return kept


def _parted(probe: str) -> tuple[str, str]:
    """(`main at 0.5`, `pressure`) of `main.pressure@0.5`."""
    whole, _, spot = probe.partition("@")
    place, _, what = whole.rpartition(".")
    return place + (f" at {spot}" if spot else ""), what


def _swing(values: np.ndarray) -> float | None:
    """How far a curve moves; None where it is constant."""
    there = values[np.isfinite(values)]
    swing = float(np.ptp(there)) if there.size else 0.0
    return swing if swing > STILL * float(np.abs(there).max(initial=0.0)) else None


def _near(a: np.ndarray, b: np.ndarray, room: float) -> bool:
    return bool(np.array_equal(np.isnan(a), np.isnan(b)) and not (np.abs(a - b) > room).any())


def _alike(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether b is a, scaled and moved; of nothing that moves."""
    low, high = int(a.argmin()), int(a.argmax())
    if not (np.isfinite(a).all() and np.isfinite(b).all() and a[low] < a[high]):
        return False
    scale = (b[high] - b[low]) / (a[high] - a[low])
    return bool(scale > 0.0 and np.abs(b - b[low] - scale * (a - a[low])).max() <= ALIKE * np.ptp(b))

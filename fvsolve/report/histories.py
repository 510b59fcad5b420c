"""Probes over time as the page shows them: by quantity and unit, long series by least and greatest of bins."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fvsolve.draw.plot import quantity, thinned

LINES = 8  # of a panel that are seen at once: the others are there, and shown when they are clicked at
MOST = 48  # probes of a report; more stand in history.csv
NUMBERS = 40_000  # of all series of a report together


class Series(NamedTuple):
    """A series: what it is of, times and values as they stand in history.csv, and whether it is seen at once."""

    name: str
    t: np.ndarray
    values: np.ndarray
    seen: bool
    measured: bool = False


class HistoryPanel(NamedTuple):
    """Series of one quantity and unit."""

    quantity: str
    unit: str
    lines: list[Series]


def panels(result) -> list[HistoryPanel]:
    """The histories of a run, in the order of its probes; of a panel of many the liveliest are seen."""
    groups: dict[tuple[str, str], list[str]] = {}
    for name in chosen(result):
        groups.setdefault((quantity(name), result.units[name]), []).append(name)
    measured = result.history_drawn().get("measured", {})
    points = max(NUMBERS // max(2 * (len(chosen(result)) + len(measured)), 1), 64)
    found = []
    for (what, unit), names in groups.items():
        seen = names if len(names) <= LINES else _liveliest(result, names)
        lines = [Series(name, *thinned(result.t, result[name], points), name in seen) for name in names]
        lines += [Series(name, *thinned(*measured[name], points), name in seen, True) for name in names
                  if name in measured]  # fmt: skip
        found.append(HistoryPanel(what, unit, lines))
    return found


def chosen(result) -> list[str]:
    """The probes that the report has room for, those that swing most before others."""
    if len(result.probes) <= MOST:
        return result.probes
    groups: dict[tuple[str, str], list[str]] = {}
    for name in result.probes:
        groups.setdefault((quantity(name), result.units[name]), []).append(name)
    share = max(MOST // len(groups), 1)
    kept = {name for names in groups.values() for name in _liveliest(result, names, share)}
    return [name for name in result.probes if name in kept]


def _liveliest(result, names: list[str], many: int = LINES) -> set[str]:
    extremes = result.extremes
    swing = {name: (extremes[name].greatest or 0.0) - (extremes[name].least or 0.0) for name in names}
    return set(sorted(names, key=lambda name: -swing[name])[:many])

"""Probe histories for the report, grouped by quantity and unit; long series keep the extremes of bins."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fvsolve.draw.plot import probe_quantity, thin_series

SHOWN_LINES = 8  # lines of a panel that are visible at first; a click on a name shows the others
MAX_PROBES = 48  # greatest number of probes of a report; history.csv has all
MAX_NUMBERS = 40_000  # greatest number of values of all series of a report together


class Series(NamedTuple):
    """Series of a probe or of a measurement, in the units of history.csv.

    seen : True if it is visible at first; measured : True for a measurement
    """

    name: str
    t: np.ndarray
    values: np.ndarray
    seen: bool
    measured: bool = False


class HistoryPanel(NamedTuple):
    """Panel of series of one quantity and unit."""

    quantity: str
    unit: str
    lines: list[Series]


def history_panels(result) -> list[HistoryPanel]:
    """Panels of histories in the order of the probes.

    In a panel of more than `SHOWN_LINES` series, only those with the widest range are visible at first.
    """
    groups: dict[tuple[str, str], list[str]] = {}
    for name in chosen_probes(result):
        groups.setdefault((probe_quantity(name), result.units[name]), []).append(name)
    measured = result.history_drawn().get("measured", {})
    points = max(MAX_NUMBERS // max(2 * (len(chosen_probes(result)) + len(measured)), 1), 64)
    result_panels = []
    for (kind, unit), names in groups.items():
        seen = names if len(names) <= SHOWN_LINES else _most_varying(result, names)
        lines = [Series(name, *thin_series(result.t, result[name], points), name in seen) for name in names]
        lines += [Series(name, *thin_series(*measured[name], points), name in seen, True) for name in names
                  if name in measured]  # fmt: skip
        result_panels.append(HistoryPanel(kind, unit, lines))
    return result_panels


def chosen_probes(result) -> list[str]:
    """Names of the probes in the report: all, or if they are many, those with the widest range in each panel."""
    if len(result.probes) <= MAX_PROBES:
        return result.probes
    groups: dict[tuple[str, str], list[str]] = {}
    for name in result.probes:
        groups.setdefault((probe_quantity(name), result.units[name]), []).append(name)
    share = max(MAX_PROBES // len(groups), 1)
    selected = {name for names in groups.values() for name in _most_varying(result, names, share)}
    return [name for name in result.probes if name in selected]


def _most_varying(result, names: list[str], count: int = SHOWN_LINES) -> set[str]:
    extremes = result.extremes
    swing = {name: (extremes[name].maximum or 0.0) - (extremes[name].minimum or 0.0) for name in names}
    return set(sorted(names, key=lambda name: -swing[name])[:count])

"""Cycles of pressure that a run puts on its parts, by rainflow counting, and how many a part bears. Starts no run.

Counted by ASTM E1049-85 (the package `rainflow`) over all rows of a probe; half cycles count half. A part that bears
`cycles` of a range R0 bears `cycles (R0 / R)^slope` of a range R (Basquin 1910), and cycles of several ranges use
shares of it that add up (Palmgren 1924, Miner 1945).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.report.libraries import library
from fvsolve.units import span

OF = ("pressure", "gauge_pressure", "head")
SMALL = 1e-3  # of the greatest range: what is less is not counted


@dataclass(frozen=True)
class Strength:
    """What a part bears: so many `cycles` of a `range` of pressure [unit of the probe], by a slope."""

    range: float
    cycles: float
    slope: float

    def allowed(self, range: float) -> float:
        """Cycles of another range that it bears."""
        return self.cycles * (self.range / range) ** self.slope


def counted(values: np.ndarray, bins: int = 10) -> list[tuple[float, float]]:
    """(range, count) of the cycles of a series, the greatest first, in bins named by their upper ends."""
    cycles = list(library("rainflow").extract_cycles(values.tolist()))
    greatest = max((found[0] for found in cycles), default=0.0)
    if not greatest > 0.0:
        return []
    width, sums = greatest / bins, np.zeros(bins)
    for size, _, count, *_ in cycles:
        if size >= SMALL * greatest:
            sums[min(int(np.ceil(size / width * (1.0 - 1e-12))), bins) - 1] += count
    return [((k + 1) * width, float(sums[k])) for k in reversed(range(bins)) if sums[k] > 0.0]


def cycles(result, probes: list[str] | None = None, strength: Strength | None = None) -> list[dict[str, Any]]:
    """Of every probe of pressure or head: its cycles, and the share of what a part bears that one run uses.

    A range counts by the upper end of its bin, so the share is on the safe side. Raises FvsolveError for other probes.
    """
    known = [name for name in result.probes if result.column(name).dimension in OF]
    unknown = [name for name in probes or () if name not in known]
    if unknown:
        raise FvsolveError(f"no probe of pressure or head named {listing(unknown)}{did_you_mean(unknown[0], known)}; "
                           f"there are {listing(known) or 'none'}")  # fmt: skip
    made = []
    for name in probes or known:
        if not np.isfinite(result[name]).all():
            raise FvsolveError(f"{name} is not finite at all times: its cycles cannot be counted")
        found = counted(np.asarray(result[name]))
        row: dict[str, Any] = {"probe": name, "unit": span(result.units[name]), "cycles": found}
        if strength is not None:
            row["share"] = float(sum(count / strength.allowed(size) for size, count in found))
        made.append(row)
    return made

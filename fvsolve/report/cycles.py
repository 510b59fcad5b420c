"""Pressure cycles of a run by rainflow counting, and the fatigue damage that they cause.

Cycles are counted by ASTM E1049-85 (package `rainflow`) over all rows of a probe; half cycles count 0.5. A part that
endures N cycles of a range R0 endures N (R0 / R)^m cycles of a range R (Basquin 1910). The damage of cycles of several
ranges is the sum of counted over endured cycles (Palmgren 1924, Miner 1945).
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.errors import FvsolveError, did_you_mean, listing
from fvsolve.report import import_library
from fvsolve.units import span

PRESSURE_QUANTITIES = ("pressure", "gauge_pressure", "head")
# range of the rows, relative to that of all steps, below which rows are too coarse to be counted
COARSE = 0.98
SMALLEST_RANGE = 1e-3  # smallest range that is counted, as a fraction of the greatest range


@dataclass(frozen=True)
class FatigueStrength:
    """Fatigue strength of a part.

    range : pressure range R0 [unit of the probe]; cycles : endured cycles N of this range; slope : Basquin exponent m
    """

    range: float
    cycles: float
    slope: float

    def allowed(self, range: float) -> float:
        """Number of cycles of the pressure range `range` that the part endures, N (R0 / range)^m."""
        return self.cycles * (self.range / range) ** self.slope


def count_cycles(values: np.ndarray, bins: int = 10) -> list[tuple[float, float]]:
    """Cycles of a series by rainflow counting : list of (range, number of cycles), greatest range first.

    Cycles of a range below `SMALLEST_RANGE` times the greatest range are left out.
    bins : number of equal bins of ranges; each range in the result is the upper end of its bin
    """
    cycles = list(import_library("rainflow").extract_cycles(values.tolist()))
    greatest = max((cycle[0] for cycle in cycles), default=0.0)
    if not greatest > 0.0:
        return []
    width, sums = greatest / bins, np.zeros(bins)
    for size, _, count, *_ in cycles:
        if size >= SMALLEST_RANGE * greatest:
            sums[min(int(np.ceil(size / width * (1.0 - 1e-12))), bins) - 1] += count
    return [((k + 1) * width, float(sums[k])) for k in reversed(range(bins)) if sums[k] > 0.0]


def check_rows(result, name: str) -> None:
    """Raise FvsolveError if the rows of a probe miss a part of its range over all steps: cycles would be too small."""
    extreme = result.extremes.get(name)
    if extreme is None or extreme.maximum is None or extreme.minimum is None:
        return
    whole, rows = extreme.maximum - extreme.minimum, float(np.ptp(result[name]))
    size = max(abs(extreme.maximum), abs(extreme.minimum))
    if rows < COARSE * whole and whole > 1e-9 * size:
        unit = span(result.units[name])
        raise FvsolveError(
            f"{name}: the rows have a range of {rows:.4g} {unit}, all steps one of {whole:.4g} {unit}, so cycles are "
            "not counted. Repeat the run with a shorter output.every, a tenth of the shortest period"
        )


def cycles(
    result, probes: list[str] | None = None, strength: FatigueStrength | None = None
) -> list[dict[str, Any]]:
    """Cycles of pressure or head at the probes `probes` (None for all of these quantities) : a dict for each probe.

    Keys of a dict:
    probe : name of the probe; unit : unit of the ranges; cycles : as from `count_cycles`
    share : fraction of the fatigue life that a run uses, if `strength` is given
    Ranges are upper ends of bins, so that the share is on the safe side. Raises FvsolveError for probes of other
    quantities, for values that are not finite, and for rows that are too coarse for the waves.
    """
    known = [name for name in result.probes if result.column(name).dimension in PRESSURE_QUANTITIES]
    unknown = [name for name in probes or () if name not in known]
    if unknown:
        hint = did_you_mean(unknown[0], known) or f". The run has {listing(known) or 'none'}"
        raise FvsolveError(f"no probe of pressure or head named {listing(unknown)}{hint}")
    rows = []
    for name in probes or known:
        if not len(result[name]):
            raise FvsolveError(
                f"{name} has no rows, so its cycles cannot be counted; run the case to a later time"
            )
        if not np.isfinite(result[name]).all():
            raise FvsolveError(
                f"{name} has values that are not finite, so its cycles cannot be counted"
            )
        check_rows(result, name)
        counts = count_cycles(np.asarray(result[name]))
        row: dict[str, Any] = {"probe": name, "unit": span(result.units[name]), "cycles": counts}
        if strength is not None:
            row["share"] = float(sum(count / strength.allowed(size) for size, count in counts))
        rows.append(row)
    return rows

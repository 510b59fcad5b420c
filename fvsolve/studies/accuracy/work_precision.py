"""Work-precision front: the cheapest setting for each target error, next to the default setting.

A curve has the points (settings with results) of one scheme and method, from coarse to fine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fvsolve.case.case import Case
from fvsolve.studies.accuracy.method_setting import MethodSetting, cells_setting, lumped_setting
from fvsolve.studies.accuracy.pareto import Crossing, find_crossing, interpolate_log

GREATEST_RTOL = 0.1  # results of greater tolerances are meaningless


@dataclass(frozen=True)
class Point:
    """Setting and the results of its run.

    ok : True if the result is usable, otherwise `reason` explains why it is not
    trajectory, greatest, end, overshoot, worst : errors relative to ranges, see `Distance` in `studies/distance.py`
    seconds : CPU time of the steps, the least of several runs [s]; rhs : number of evaluations of the rates
    updates : number of cell updates, see `Outcome.cell_updates`; steps : number of steps
    """

    setting: MethodSetting
    ok: bool
    reason: str
    trajectory: float
    greatest: float
    end: float
    overshoot: float
    worst: str
    seconds: float
    rhs: int
    updates: int
    steps: int


@dataclass(frozen=True)
class FrontRow:
    """Cheapest curve (scheme and method) for a target error, next to the curve of the default scheme and method.

    name, fineness, seconds : curve with the least CPU time, its resolution as text, and the CPU time [s]
    by_updates, updates : curve with the least number of cell updates, and that number
    default_fineness, default_seconds, default_updates : resolution, CPU time and cell updates of the default curve
    If no curve reaches the target, numbers and names are None and the text is empty; likewise for the default curve.
    """

    target: float
    name: str | None
    fineness: str
    seconds: float | None
    by_updates: str | None
    updates: float | None
    default_fineness: str
    default_seconds: float | None
    default_updates: float | None


def curves_by_name(points: Sequence[Point]) -> dict[str, list[Point]]:
    """Points of each scheme and method, in their order : name, such as "weno5 rk4" -> points."""
    points_by_name: dict[str, list[Point]] = {}
    for point in points:
        points_by_name.setdefault(point.setting.name, []).append(point)
    return points_by_name


def front_row(points: Sequence[Point], target: float, floor: float, default: str) -> FrontRow:
    """Cheapest pair of scheme and method that reaches a target error, beside the default pair, as a `FrontRow`.

    target : trajectory error [-]; floor : smaller errors count as this error
    default : name of the default scheme and method, such as "weno5 rk4"
    """
    by_time, by_work = (cheapest_curve(points, target, floor, cost) for cost in ("seconds", "updates"))
    name, best = by_time or (None, None)
    default_time, default_work = (
        target_crossings(points, target, floor, cost).get(default) for cost in ("seconds", "updates")
    )
    return FrontRow(
        target, name, fineness_text(points, name, best), best and best.cost, by_work and by_work[0],
        by_work and by_work[1].cost, fineness_text(points, default, default_time), default_time and default_time.cost,
        default_work and default_work.cost,
    )  # fmt: skip


def good_errors(points: Sequence[Point]) -> list[float]:
    """Trajectory errors of the points that did not fail."""
    return [point.trajectory for point in points if point.ok]


def target_crossings(points: Sequence[Point], target: float, floor: float, cost: str) -> dict[str, Crossing]:
    """Crossing of each curve (scheme and method) with a target error, by name of the curve.

    target : trajectory error [-]; cost : "seconds" or "updates"; errors below the floor count as the floor
    """
    by_name = {}
    for name, curve in curves_by_name(points).items():
        errors = [max(point.trajectory, floor) if point.ok else math.inf for point in curve]
        place = find_crossing(errors, [max(getattr(point, cost), 1e-12) for point in curve], target)
        if place is not None:
            by_name[name] = place
    return by_name


def cheapest_curve(points: Sequence[Point], target: float, floor: float, cost: str) -> tuple[str, Crossing] | None:
    """Name and crossing of the curve with the least cost at a target error; None if no curve reaches the target.

    Arguments as for `target_crossings`.
    """
    return min(target_crossings(points, target, floor, cost).items(), key=lambda item: item[1].cost, default=None)


def interpolated_setting(case: Case, coarse: MethodSetting, fine: MethodSetting, share: float) -> MethodSetting:
    """Setting between two settings of a curve; share : its position in logarithms, 0 at `coarse` and 1 at `fine`."""
    if coarse.cells is not None:
        return cells_setting(
            case, coarse.scheme, coarse.method, math.ceil(interpolate_log(coarse.cells, fine.cells, share))
        )
    return lumped_setting(coarse.method, float(f"{interpolate_log(coarse.size, fine.size, share):.2g}"), coarse.control)


def coarser_setting(case: Case, setting: MethodSetting) -> MethodSetting | None:
    """Next coarser setting of a curve: half the cells, ten times the tolerance, or twice the step.

    None for a single cell, for tolerances above `GREATEST_RTOL`, and for steps above the duration of the run.
    """
    if setting.cells is not None:
        return cells_setting(case, setting.scheme, setting.method, setting.cells // 2) if setting.cells > 1 else None
    size = float(f"{setting.size * (10.0 if setting.control == 'rtol' else 2.0):.6g}")
    most = GREATEST_RTOL if setting.control == "rtol" else case.numerics.end - case.numerics.start
    return lumped_setting(setting.method, size, setting.control) if size <= most else None


def fineness_text(points, name: str | None, where: Crossing | None) -> str:
    """Text of the resolution at a crossing with a target error, such as "200 cells" or "rtol 1e-06".

    name : name of the curve, None without a crossing; where : the crossing; points : points of all curves
    """
    if name is None or where is None:
        return ""
    coarse, fine = (curves_by_name(points)[name][k].setting for k in (where.coarser, where.finer))
    least = "" if where.within or where.finer else ", the coarsest"
    if coarse.cells is not None:
        return f"{math.ceil(interpolate_log(coarse.cells, fine.cells, where.share) - 1e-9)} cells{least}"
    return f"{coarse.control} {interpolate_log(coarse.size, fine.size, where.share):.2g}{least}"

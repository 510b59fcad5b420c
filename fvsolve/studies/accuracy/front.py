"""The front of a chart: what is cheapest for each error, and the default beside it. Knows points; runs none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from fvsolve.case.case import Case
from fvsolve.studies.accuracy.pareto import Crossing, between, crossing
from fvsolve.studies.accuracy.setting import MethodSetting, with_cells, without_cells

COARSEST_RTOL = 0.1  # a tolerance beyond says nothing


@dataclass(frozen=True)
class Point:
    """One setting and what came of it.

    trajectory, greatest, end, overshoot : errors over the range of the worst component (studies/distance.py)
    seconds : CPU time of the steps, the best of several [s]; updates : calls of the rates times cells (states)
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
    """One line of the front: the cheapest curve for a target and the program's default beside it.

    name, by_updates : the cheapest by CPU time and by cell updates; what is None is not reached
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


def curves(points: Sequence[Point]) -> dict[str, list[Point]]:
    """Points by name of scheme and method, in their order."""
    found: dict[str, list[Point]] = {}
    for point in points:
        found.setdefault(point.setting.name, []).append(point)
    return found


def row(points: Sequence[Point], target: float, floor: float, default: str) -> FrontRow:
    """The line of a target; default : name of the default's curve."""
    by_time, by_work = (cheapest(points, target, floor, cost) for cost in ("seconds", "updates"))
    name, where = by_time or (None, None)
    own, work = (crossings(points, target, floor, cost).get(default) for cost in ("seconds", "updates"))
    return FrontRow(
        target, name, fineness(points, name, where), where and where.cost, by_work and by_work[0],
        by_work and by_work[1].cost, fineness(points, default, own), own and own.cost, work and work.cost,
    )  # fmt: skip


def errors_of(points: Sequence[Point]) -> list[float]:
    """Trajectory errors of the points that did not fail."""
    return [point.trajectory for point in points if point.ok]


def crossings(points: Sequence[Point], target: float, floor: float, cost: str) -> dict[str, Crossing]:
    """Where each curve meets a target, by name; cost : "seconds" or "updates". Errors count as the floor at least."""
    found = {}
    for name, curve in curves(points).items():
        errors = [max(one.trajectory, floor) if one.ok else math.inf for one in curve]
        where = crossing(errors, [max(getattr(one, cost), 1e-12) for one in curve], target)
        if where is not None:
            found[name] = where
    return found


def cheapest(points: Sequence[Point], target: float, floor: float, cost: str) -> tuple[str, Crossing] | None:
    """Name and crossing of the curve that costs least at a target, None where none meets it."""
    return min(crossings(points, target, floor, cost).items(), key=lambda one: one[1].cost, default=None)


def setting_between(case: Case, coarse: MethodSetting, fine: MethodSetting, share: float) -> MethodSetting:
    """The setting at a share of the way between two of a curve."""
    if coarse.cells is not None:
        return with_cells(case, coarse.scheme, coarse.method, math.ceil(between(coarse.cells, fine.cells, share)))
    return without_cells(coarse.method, float(f"{between(coarse.size, fine.size, share):.2g}"), coarse.control)


def coarser(case: Case, setting: MethodSetting) -> MethodSetting | None:
    """The next coarser setting of a curve: half the cells, ten times the tolerance, twice the step; None at its end."""
    if setting.cells is not None:
        return with_cells(case, setting.scheme, setting.method, setting.cells // 2) if setting.cells > 1 else None
    size = float(f"{setting.size * (10.0 if setting.control == 'rtol' else 2.0):.6g}")
    most = COARSEST_RTOL if setting.control == "rtol" else case.numerics.end - case.numerics.start
    return without_cells(setting.method, size, setting.control) if size <= most else None


def fineness(points, name: str | None, where: Crossing | None) -> str:
    """What the crossing of a curve stands for: about so many cells, such a tolerance."""
    if name is None or where is None:
        return ""
    coarse, fine = (curves(points)[name][k].setting for k in (where.coarser, where.finer))
    least = "" if where.within or where.finer else ", the coarsest"
    if coarse.cells is not None:
        return f"{math.ceil(between(coarse.cells, fine.cells, where.share) - 1e-9)} cells{least}"
    return f"{coarse.control} {between(coarse.size, fine.size, where.share):.2g}{least}"

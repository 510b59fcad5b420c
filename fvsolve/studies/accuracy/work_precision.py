"""Results of a work-precision study: points, the cheapest setting for each target error, files and pictures.

A curve has the points (settings with results) of one scheme and method, from coarse to fine; failed points have
infinite errors.
"""

import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from fvsolve.case.case import Case
from fvsolve.case.sections import DEFAULT_CELLS, DEFAULT_RTOL
from fvsolve.core.output.result_table import Column, ResultTable, columns
from fvsolve.display import Displayable
from fvsolve.studies.accuracy.chart_settings import MethodSetting, cells_setting, lumped_setting


@dataclass(frozen=True)
class Crossing:
    """Crossing of a curve of errors and costs with a target error.

    cost : cost at the target, interpolated in logarithms between two points, or that of the point of the crossing
    coarser, finer : indices of the two points around the target. Both are the index of a single point if all errors are
    within the target, or if the coarser error is infinite or the finer error is 0.
    share : position of the crossing between the points in logarithms, 0 at the coarser, 1 at the finer or single point
    """

    cost: float
    coarser: int
    finer: int
    share: float

    @property
    def within(self) -> bool:
        """True if the crossing lies between two points; False at a point, whose error may be less than the target."""
        return self.coarser != self.finer


def find_crossing(
    errors: Sequence[float], costs: Sequence[float], target: float
) -> Crossing | None:
    """Crossing of a curve with the target error, such that all finer points have errors of at most `target`.

    errors, costs : of the points of the curve, from coarse to fine. None if the error of the finest point exceeds the
    target.
    """
    good = len(errors)
    while good > 0 and errors[good - 1] <= target:
        good -= 1
    if good == len(errors):
        return None
    if good == 0:
        return Crossing(costs[0], 0, 0, 1.0)
    before, after = errors[good - 1], errors[good]
    if not math.isfinite(before) or after <= 0.0:
        return Crossing(costs[good], good, good, 1.0)
    share = math.log(before / target) / math.log(before / after)
    return Crossing(interpolate_log(costs[good - 1], costs[good], share), good - 1, good, share)


def interpolate_log(low: float, high: float, share: float) -> float:
    """Number at the fraction `share` of the way from low to high, in logarithms."""
    return math.exp((1.0 - share) * math.log(low) + share * math.log(high))


def pareto_front(errors: Sequence[float], costs: Sequence[float]) -> list[int]:
    """Indices of the Pareto-optimal points (error, cost), from cheap to accurate."""
    indices, least = [], math.inf
    for k in sorted(range(len(errors)), key=lambda k: (costs[k], errors[k])):
        if errors[k] < least:
            least = errors[k]
            indices.append(k)
    return indices


def target_powers(errors: Sequence[float], floor: float) -> list[float]:
    """Target errors 1e-1, 1e-2, ..., not below `floor` and not below the least of `errors`."""
    least = max(min((e for e in errors if math.isfinite(e)), default=math.inf), floor)
    powers, exponent = [], -1
    while 10.0**exponent >= least and exponent > -16:
        powers.append(10.0**exponent)
        exponent -= 1
    return powers


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
    by_time, by_work = (
        cheapest_curve(points, target, floor, cost) for cost in ("seconds", "updates")
    )
    name, best = by_time or (None, None)
    by_cost = (target_crossings(points, target, floor, cost) for cost in ("seconds", "updates"))
    default_time, default_work = (crossings.get(default) for crossings in by_cost)
    return FrontRow(
        target,
        name,
        fineness_text(points, name, best),
        best and best.cost,
        by_work and by_work[0],
        by_work and by_work[1].cost,
        fineness_text(points, default, default_time),
        default_time and default_time.cost,
        default_work and default_work.cost,
    )


def good_errors(points: Sequence[Point]) -> list[float]:
    """Trajectory errors of the points that did not fail."""
    return [point.trajectory for point in points if point.ok]


def target_crossings(
    points: Sequence[Point], target: float, floor: float, cost: str
) -> dict[str, Crossing]:
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


def cheapest_curve(
    points: Sequence[Point], target: float, floor: float, cost: str
) -> tuple[str, Crossing] | None:
    """Name and crossing of the curve with the least cost at a target, or None; arguments as for `target_crossings`."""
    return min(
        target_crossings(points, target, floor, cost).items(),
        key=lambda item: item[1].cost,
        default=None,
    )


def interpolated_setting(
    case: Case, coarse: MethodSetting, fine: MethodSetting, share: float
) -> MethodSetting:
    """Setting between two settings of a curve; share : its position in logarithms, 0 at `coarse` and 1 at `fine`."""
    if coarse.cells is not None:
        cells = math.ceil(interpolate_log(coarse.cells, fine.cells, share))
        return cells_setting(case, coarse.scheme, coarse.method, cells)
    return lumped_setting(
        coarse.method,
        float(f"{interpolate_log(coarse.size, fine.size, share):.2g}"),
        coarse.control,
    )


def coarser_setting(case: Case, setting: MethodSetting) -> MethodSetting | None:
    """Next coarser setting of a curve: half the cells, ten times the tolerance, or twice the step.

    None for a single cell, for tolerances above `GREATEST_RTOL`, and for steps above the duration of the run.
    """
    if setting.cells is not None:
        return (
            cells_setting(case, setting.scheme, setting.method, setting.cells // 2)
            if setting.cells > 1
            else None
        )
    size = float(f"{setting.size * (10.0 if setting.control == 'rtol' else 2.0):.6g}")
    most = GREATEST_RTOL if setting.control == "rtol" else case.numerics.end - case.numerics.start
    return lumped_setting(setting.method, size, setting.control) if size <= most else None


def fineness_text(points, name: str | None, where: Crossing | None) -> str:
    """Resolution at the crossing `where` of the curve `name` in words, such as "200 cells"; "" without a crossing."""
    if name is None or where is None:
        return ""
    coarse, fine = (curves_by_name(points)[name][k].setting for k in (where.coarser, where.finer))
    least = "" if where.within or where.finer else ", the coarsest"
    if coarse.cells is not None:
        return f"{math.ceil(interpolate_log(coarse.cells, fine.cells, where.share) - 1e-9)} cells{least}"
    return f"{coarse.control} {interpolate_log(coarse.size, fine.size, where.share):.2g}{least}"


TABLE_COLUMNS = (
    "scheme",
    "method",
    "cells",
    "size",
    "trajectory",
    "greatest",
    "end",
    "overshoot",
    "worst",
    "seconds",
    "updates",
    "steps",
    "ok",
    "reason",
)


@dataclass(frozen=True)
class TargetSetting:
    """Setting (scheme, method and resolution) whose run has at most the target error.

    target : target error, relative to the range of the worst probe [-]; point : the setting and the results of its run
    numerics : overrides under `[numerics]`, key without "numerics." -> value; others : other overrides, dotted key ->
    value
    """

    target: float
    point: Point
    numerics: dict
    others: dict

    def toml_lines(self) -> list[str]:
        """Lines of TOML: keys of `[numerics]`, then the tables of parts whose cells change."""
        toml_lines = [f"{key} = {toml_value(value)}" for key, value in self.numerics.items()]
        for key, value in self.others.items():
            table, _, name = key.rpartition(".")
            toml_lines += ["", f"[{table}]", f"{name} = {toml_value(value)}"]
        return toml_lines


@dataclass(frozen=True, repr=False)
class Chart(Displayable):
    """Errors of a case against their cost, for several schemes, methods and resolutions.

    points : settings with the results of their runs; front : cheapest setting for each target error
    reference, second : descriptions of the two references
    floor : uncertainty of the reference, at least its difference from the second, with the keys of `Distance`; smaller
    errors are not reliable. It also has the descriptions `reference`, `second` and `told`.
    default : names of the default scheme and method, such as "weno5 rk4"; compile_seconds : time of compilation [s]
    reused : number of points from earlier studies; told : reasons of failed references
    left_out : default schemes that do not support the fluid; aim : setting for a target error, None without a target
    """

    case: str
    points: list[Point]
    reference: str
    second: str
    floor: dict
    default: str
    compile_seconds: float
    front: list[FrontRow]
    reused: int = 0
    aim: TargetSetting | None = None
    told: tuple[str, ...] = field(default=())
    left_out: tuple[str, ...] = field(default=())

    picture = "fvsolve.studies.accuracy.work_precision:chart_picture"

    def summary_line(self) -> str:
        return f"of {self.case!r}: {len(self.points)} points, {len(self.failed)} failed; default {self.default}"

    def table_columns(self) -> dict[str, list]:
        """Columns of a table of all points, for a data frame : name in TABLE_COLUMNS -> list of values."""
        return ResultTable([Column(key) for key in TABLE_COLUMNS], self.rows).table_columns()

    @property
    def rows(self) -> list[dict]:
        """All points as dicts, each with the fields of the setting and the results of its run."""
        return [vars(point.setting) | vars(point) for point in self.points]

    def curves(self) -> dict[str, list[Point]]:
        """Points of each scheme and method, from coarse to fine : name, such as "weno5 rk4" -> points."""
        return curves_by_name(self.points)

    @property
    def stands(self) -> Point | None:
        """Point of the default scheme and method with 100 cells or a tolerance of 1e-6; None without such a point."""
        curve = self.curves().get(self.default, [])
        for point in curve:
            if DEFAULT_CELLS == point.setting.cells or point.setting.size == DEFAULT_RTOL:
                return point
        return None

    @property
    def failed(self) -> list[Point]:
        """Points without a usable result."""
        return [point for point in self.points if not point.ok]

    def plain(self) -> dict:
        """Return the chart as plain data, SI; `paste` is the setting for a target error, in TOML for the case file."""
        stands = None if self.stands is None else asdict(self.stands)
        paste = {} if self.aim is None else {"paste": "\n".join(self.aim.toml_lines())}
        return asdict(self) | {"stands": stands} | paste


def toml_value(value) -> str:
    """Text or number in the format of TOML."""
    return f'"{value}"' if isinstance(value, str) else repr(value)


CHART_COLUMNS = columns(
    scheme="scheme",
    method="method",
    control="control",
    size="size",
    cells="cells",
    ok="ok",
    trajectory="trajectory error",
    greatest="greatest error",
    end="end error",
    overshoot="overshoot",
    worst="worst",
    seconds="cpu [s]",
    rhs="rhs",
    updates="cell updates",
    steps="steps",
    below="below floor",
    by_seconds="front by cpu",
    by_updates="front by updates",
    reason="reason",
)
ERROR_LABELS = (
    "mean error over the run [fraction of the range]",
    "error at the end [fraction of the range]",
)


def write_chart(
    chart: Chart, folder: Path, title: str = "", dpi: float | None = None
) -> list[Path]:
    """Write the table and both pictures of a chart; returns their paths."""
    from fvsolve.report.draw.accuracy_pictures import save_picture

    paths = [folder / f"chart.{ending}" for ending in ("csv", "png", "svg")]
    for path in paths:
        path.unlink(missing_ok=True)  # avoids an old picture next to a new table
    write_chart_csv(chart, paths[0])
    picture = chart_picture(chart, title)
    save_picture(picture, paths[1], dpi)
    save_picture(picture, paths[2])
    return paths


def write_chart_csv(chart: Chart, path: Path) -> None:
    """Write a CSV file with a row for each setting, including failed settings."""
    rows, floor = chart.rows, chart.floor["trajectory"]
    good = [row for row in rows if row["ok"]]
    errors = [max(row["trajectory"], floor) for row in good]
    for cost in ("seconds", "updates"):
        best = pareto_front(errors, [row[cost] for row in good])
        for row in rows:
            row[f"by_{cost}"] = int(any(row is good[k] for k in best))
    for row in rows:
        row |= {"ok": int(row["ok"]), "below": int(row["ok"] and row["trajectory"] < floor)}
    ResultTable(CHART_COLUMNS, rows).write(path)


def chart_picture(chart: Chart, title: str = ""):
    """matplotlib Figure of a chart: errors over the trajectory and at the end, against CPU time and cell updates."""
    from fvsolve.report.draw.accuracy_pictures import Curve, chart_figure

    curves = []
    for name, points in chart.curves().items():
        setting = points[0].setting
        errors = [
            np.array([getattr(point, key) for point in points]) for key in ("trajectory", "end")
        ]
        costs = [
            np.array([getattr(point, key) for point in points], float)
            for key in ("seconds", "updates")
        ]
        failed = np.array([not point.ok for point in points])
        first = setting.scheme or setting.method
        curves.append(Curve(first, setting.method, errors, costs, failed, name == chart.default))
    work = (
        "cell updates"
        if any(point.setting.cells for point in chart.points)
        else "rates evaluated x states"
    )
    floors = [chart.floor[key] or 0.0 for key in ("trajectory", "end")]
    title = title or f"{chart.case}: error against cost"
    return chart_figure(curves, ERROR_LABELS, ("CPU time [s]", work), floors, title)

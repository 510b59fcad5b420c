"""A chart as files: chart.csv, chart.png and chart.svg. Knows charts and files; runs nothing."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from fvsolve.studies.accuracy.chart import Chart
from fvsolve.studies.accuracy.pareto import front

COLUMNS = (
    "scheme", "method", "control", "size", "cells", "ok", "trajectory error", "greatest error", "end error",
    "overshoot", "worst", "cpu [s]", "rhs", "cell updates", "steps", "below floor", "front by cpu",
    "front by updates", "reason",
)  # fmt: skip
ERRORS = ("mean error over the run [range]", "error at the end [range]")


def write(found: Chart, folder: Path, title: str = "", dpi: float | None = None) -> list[Path]:
    """Write the table and both pictures of a chart; returns their paths."""
    from fvsolve.draw.chart import save

    paths = [folder / f"chart.{ending}" for ending in ("csv", "png", "svg")]
    write_csv(found, paths[0])
    made = figure(found, title)
    save(made, paths[1], dpi)
    save(made, paths[2])
    return paths


def write_csv(found: Chart, path: Path) -> None:
    """One line per setting, failed ones included."""
    good = [k for k, point in enumerate(found.points) if point.ok]
    errors = [max(found.points[k].trajectory, found.floor["trajectory"]) for k in good]
    fronts = [
        {good[k] for k in front(errors, [getattr(found.points[k], cost) for k in good])}
        for cost in ("seconds", "updates")
    ]
    with open(path, "w", newline="", encoding="utf-8") as file:
        out = csv.writer(file)
        out.writerow(COLUMNS)
        for k, point in enumerate(found.points):
            one = point.setting
            out.writerow([
                one.scheme or "", one.method, one.control, one.size, one.cells or "", int(point.ok), point.trajectory,
                point.greatest, point.end, point.overshoot, point.worst, point.seconds, point.rhs, point.updates,
                point.steps, int(point.ok and point.trajectory < found.floor["trajectory"]),
                *(int(k in one) for one in fronts), point.reason,
            ])  # fmt: skip


def figure(found: Chart, title: str = ""):
    """The picture of a chart, a matplotlib Figure: errors over the trajectory and at the end, by time and by work."""
    from fvsolve.draw.chart import Curve, chart_figure

    curves = []
    for name, points in found.curves().items():
        one = points[0].setting
        curves.append(
            Curve(
                one.scheme or one.method,
                one.method,
                [np.array([getattr(point, key) for point in points]) for key in ("trajectory", "end")],
                [np.array([getattr(point, key) for point in points], float) for key in ("seconds", "updates")],
                np.array([not point.ok for point in points]),
                name == found.default,
            )
        )
    work = "cell updates" if any(point.setting.cells for point in found.points) else "rates evaluated x states"
    floors = [found.floor[key] or 0.0 for key in ("trajectory", "end")]
    return chart_figure(curves, ERRORS, ("CPU time [s]", work), floors, title or f"{found.case}: what accuracy costs")

"""Output files of a chart: chart.csv, chart.png and chart.svg."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fvsolve.studies.accuracy.chart import Chart
from fvsolve.studies.accuracy.pareto import pareto_front
from fvsolve.studies.result_table import ResultTable, columns

CHART_COLUMNS = columns(
    scheme="scheme", method="method", control="control", size="size", cells="cells", ok="ok",
    trajectory="trajectory error", greatest="greatest error", end="end error", overshoot="overshoot", worst="worst",
    seconds="cpu [s]", rhs="rhs", updates="cell updates", steps="steps", below="below floor",
    by_seconds="front by cpu", by_updates="front by updates", reason="reason",
)  # fmt: skip
ERROR_LABELS = ("mean error over the run [fraction of the range]", "error at the end [fraction of the range]")


def write_chart(chart: Chart, folder: Path, title: str = "", dpi: float | None = None) -> list[Path]:
    """Write the table and both pictures of a chart; returns their paths."""
    from fvsolve.draw.accuracy_pictures import save_picture

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
    from fvsolve.draw.accuracy_pictures import Curve, chart_figure

    curves = []
    for name, points in chart.curves().items():
        setting = points[0].setting
        curves.append(
            Curve(
                setting.scheme or setting.method,
                setting.method,
                [np.array([getattr(point, key) for point in points]) for key in ("trajectory", "end")],
                [np.array([getattr(point, key) for point in points], float) for key in ("seconds", "updates")],
                np.array([not point.ok for point in points]),
                name == chart.default,
            )
        )
    work = "cell updates" if any(point.setting.cells for point in chart.points) else "rates evaluated x states"
    floors = [chart.floor[key] or 0.0 for key in ("trajectory", "end")]
    return chart_figure(
        curves, ERROR_LABELS, ("CPU time [s]", work), floors, title or f"{chart.case}: error against cost"
    )

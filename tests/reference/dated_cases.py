"""Cases whose schedule, measurement and rain come from files, for tests of dates and of tables in other forms."""

from pathlib import Path
from typing import Any

from reference.scenes import inflow, lake, scene, stiff_pipe

START = "2026-03-01T06:00:00Z"
TIMES = (0.0, 30.0, 60.0, 90.0)  # [s]
FLOWS = (2.0, 3.5, 1.25, 2.5)  # [l/s]
STAMPS = tuple(f"2026-03-01T06:{t // 60:02.0f}:{t % 60:02.0f}Z" for t in TIMES)


def table(
    path: Path, times: Any = STAMPS, values: Any = FLOWS, head: str = "time;flow [l/s]"
) -> str:
    """Write a table of times and values with semicolons and decimal commas; returns its name."""
    rows = [f"{t};{str(value).replace('.', ',')}" for t, value in zip(times, values, strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path.name


def fed(flow: Any, start_time: Any = START, **top: Any) -> dict:
    """Case of an inflow through a pipe into a lake; start_time : None without one"""
    numerics = {"method": "rk4", "courant": 0.9} | (
        {} if start_time is None else {"start_time": start_time}
    )
    nodes = {"source": inflow(flow), "sea": lake(10.0)}
    case = scene(
        nodes,
        {"main": stiff_pipe("source", "sea", 500.0, 0.1, cells=4)},
        100.0,
        numerics,
        every=10.0,
    )
    case["output"]["fields"] = 2
    return case | top

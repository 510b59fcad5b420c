"""Notices of files of time series whose dates all lie before the start or after the end of a run."""

from collections.abc import Iterator
from typing import Any

from fvsolve.errors import Notice


def outside_notices(case: Any) -> Iterator[Notice]:
    """Yield a notice for each file of a schedule or of rain that lies outside the run, in a case with a start time."""
    start, end = case.numerics.start, case.numerics.end
    for group, parts in (("nodes", case.nodes), ("links", case.links)):
        for name, part in parts.items():
            for key, times in times_of_files(part):
                first, last = float(times[0]), float(times[-1])
                if last > start and first < end:
                    continue
                place = f"{group}.{name}"
                span, run = (
                    f"{case.moment(a)} to {case.moment(b)}"
                    for a, b in ((first, last), (start, end))
                )
                text = (
                    f"{place}.{key}: its file has times from {span}, all outside the run from {run}"
                )
                limit = start if last <= start else end
                worst = last if last <= start else first
                yield Notice("range", place, f"{text}; is start_time right?", key, worst, limit)


def times_of_files(part: Any) -> Iterator[tuple[str, Any]]:
    """Yield (key, times [s]) of schedules of a part from files, and of rasters with several frames."""
    for name, value in vars(part).items():
        origin = getattr(value, "origin", None) or getattr(value, "given", None)
        of_file = isinstance(origin, dict) and ("file" in origin or "raster" in origin)
        times = getattr(value, "time", getattr(value, "times", None)) if of_file else None
        if times is not None and len(times) > 1:
            yield name, times

"""Notices of schedules and trips after the end of the run."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.errors import Notice
from fvsolve.parts.schedule import Schedule

MAX_ENTRIES = 20  # entries of a hand-written schedule; longer schedules are records, of which a run may use a part


def notices(case: Any) -> list[Notice]:
    """Notices of each schedule that still changes after the end of the run, and of each trip after it."""
    end, result = case.numerics.end, []
    for group in ("nodes", "links"):
        for name, part in getattr(case, group).items():
            for key, time in starts_after_end(part, end):
                place = f"{group}.{name}"
                late, last = (case.amount(t, "time", 6) for t in (time, end))
                verb = "occurs at" if key == "trip" else "continues to"
                text = f"{place}.{key}: {verb} {late}, after the end of the run at {last}"
                result.append(Notice("end", place, text, key, time, end))
    return result


def starts_after_end(part: Any, end: float) -> Iterator[tuple[str, float]]:
    """Yield (key, time [s]) for schedules of a part that change after the time `end` [s], and for a trip after it.

    The time is that of the last entry or of the trip. A periodic schedule counts if its period exceeds `end`; its time
    is then the period. Schedules of more than `MAX_ENTRIES` entries are left out.
    """
    for name, info in type(part).model_fields.items():
        value = getattr(part, name)
        if isinstance(value, Schedule) and value.wave:
            if (period := value.wave[2]) > end:
                yield info.alias or name, float(period)
        elif isinstance(value, Schedule):
            changes = len(value.time) and len(value.time) <= MAX_ENTRIES and value.time[-1] > end
            if changes and np.ptp(value.value[max(np.searchsorted(value.time, end, "right") - 1, 0) :]) > 0.0:
                yield info.alias or name, float(value.time[-1])
        elif name == "trip" and value is not None and value > end:
            yield name, float(value)

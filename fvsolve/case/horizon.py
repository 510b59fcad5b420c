"""What a case schedules beyond the end of its run, and which the run does not see. Knows parts and schedules."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.errors import Notice
from fvsolve.parts.schedule import Schedule

MOST = 20  # entries of what somebody drew; longer ones are records, of which a run may take a part


def notices(case: Any) -> list[Notice]:
    """One notice for every schedule that goes on changing, and every trip that comes, after the run."""
    end, found = case.numerics.end, []
    for group in ("nodes", "links"):
        for name, part in getattr(case, group).items():
            for key, time in later(part, end):
                place = f"{group}.{name}"
                late, last = (case.amount(one, "time", 6) for one in (time, end))
                text = f"{place}.{key}: goes on to {late}, after the end of the run at {last}"
                found.append(Notice("end", place, text, key, time, end))
    return found


def later(part: Any, end: float) -> Iterator[tuple[str, float]]:
    """(key, time [s]) of what a part does after a time; of a wave, which has no end, of its first period."""
    for name, info in type(part).model_fields.items():
        value = getattr(part, name)
        if isinstance(value, Schedule) and value.wave:
            if (period := value.wave[2]) > end:
                yield info.alias or name, float(period)
        elif isinstance(value, Schedule):
            changes = len(value.time) and len(value.time) <= MOST and value.time[-1] > end
            if changes and np.ptp(value.value[max(np.searchsorted(value.time, end, "right") - 1, 0) :]) > 0.0:
                yield info.alias or name, float(value.time[-1])
        elif name == "trip" and value is not None and value > end:
            yield name, float(value)

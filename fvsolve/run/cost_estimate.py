"""Estimate of the duration and file sizes of a run, before it starts."""

from __future__ import annotations

from fvsolve.case.resource_checks import byte_text, disk_size

LONG_RUN, LARGE_FILES = 180.0, 1e9  # [s], [B] above which an estimate is printed
UNITS = ((86400.0 * 365.25, "years"), (86400.0, "days"), (3600.0, "hours"), (60.0, "minutes"))


def cost_text(model) -> str:
    """Text on the expected duration and file sizes of a run; "" if both are small."""
    seconds, bytes_ = model.checks["expected_seconds"] or 0.0, disk_size(model.case)
    parts = [duration(seconds)] if seconds > LONG_RUN else []
    parts += [f"{byte_text(bytes_)} on disk"] if bytes_ > LARGE_FILES else []
    return f"{model.case.name} will take about {' and '.join(parts)}" if parts else ""


def duration(seconds: float) -> str:
    """Text of a duration in a suitable unit, such as "2.5 hours"."""
    length, name = next((unit for unit in UNITS if seconds >= 2.0 * unit[0]), (1.0, "s"))
    return f"{seconds / length:.2g} {name}"

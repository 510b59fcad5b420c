"""What a run will take, said before it starts. Knows estimates; starts no run."""

from __future__ import annotations

from fvsolve.case.size import on_disk, size

LONG, LARGE = 180.0, 1e9  # [s], [B] from which a word is due
UNITS = ((86400.0 * 365.25, "years"), (86400.0, "days"), (3600.0, "hours"), (60.0, "minutes"))


def expected(model) -> str:
    """About how long and how large, "" where that is nothing to speak of."""
    seconds, bytes_ = model.checks["expected_seconds"] or 0.0, on_disk(model.case)
    said = [duration(seconds)] if seconds > LONG else []
    said += [f"{size(bytes_)} on disk"] if bytes_ > LARGE else []
    return f"{model.case.name} will take about {' and '.join(said)}" if said else ""


def duration(seconds: float) -> str:
    """A time as people say it."""
    length, name = next((one for one in UNITS if seconds >= 2.0 * one[0]), (1.0, "s"))
    return f"{seconds / length:.2g} {name}"

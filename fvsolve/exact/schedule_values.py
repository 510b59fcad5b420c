"""Values of schedules, computed independently of the compiled functions, so that tests can compare both."""

from __future__ import annotations

import numpy as np


def value(schedule, t: np.ndarray, left: bool = False) -> np.ndarray:
    """Values of a schedule at times t in SI units; at jumps the right limit, or the left limit if `left` is True."""
    t = np.asarray(t, dtype=float)
    times, values = schedule.time, schedule.value
    if schedule.kind == "constant":
        return np.full(t.shape, values[0])
    if schedule.kind == "step":
        side = "left" if left else "right"
        return values[np.clip(np.searchsorted(times, t, side=side) - 1, 0, len(times) - 1)]
    if schedule.kind == "harmonic":
        mean, amplitude, period, phase = schedule.wave
        return mean + amplitude * np.sin(2.0 * np.pi * t / period + phase)
    inside = np.clip(t, times[0], times[-1])
    if schedule.kind == "ramp":
        s = (inside - times[0]) / (times[1] - times[0])
        return values[1] + (values[0] - values[1]) * (1.0 - s) ** schedule.exponent
    if schedule.kind == "linear":
        return np.interp(inside, times, values)
    from scipy.interpolate import PchipInterpolator

    return PchipInterpolator(times, values)(inside)


def kinks(schedule) -> list[float]:
    """Times at which a schedule or its slope jumps; for a smooth schedule only its two ends."""
    if schedule.kind in ("constant", "harmonic"):
        return []
    return [float(t) for t in (schedule.time[[0, -1]] if schedule.kind == "smooth" else schedule.time)]


def constant_from(schedule, t: float) -> bool:
    """True if a schedule is constant from time t on."""
    later = schedule.time > t
    return schedule.constant or not np.any(later) or bool(np.all(schedule.value[later] == value(schedule, t)))

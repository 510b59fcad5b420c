"""Reasons why errors of peaks, from runs at several resolutions, are unknown or wide, with remedies."""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from fvsolve.errors import listing
from fvsolve.model.start_notices import LEAST_CELLS, answering_parts
from fvsolve.parts.schedule import Schedule
from fvsolve.studies.resolution import basins_from_files, cell_counts, delay_lines, pipes_with_cells, scaled

Part = tuple[str, str]  # group and name
MANY_STEPS = 20.0  # accumulated error of steps between jumps of delay lines, in tolerances of a step
SMOOTHED = 0.05  # effect of jumps below a quarter of numerics.delay_tolerance, smoothed over a step, over that key
MIN_CELLS = 4  # cells recommended for a pipe, and for the travel time of a short pipe in its neighbour
MAX_NAMES = 3  # greatest number of names in a text
WIDE_ERROR = 0.05  # error relative to the span of a signal above which a reason is given
SMALL_DIFFERENCE = 0.1  # differences below this fraction of an error are not its cause


def short_pipes(case: Any) -> dict[str, tuple[str, int]]:
    """Pipes that a wave crosses faster than a cell of a neighbouring pipe.

    Returns pipe -> (neighbouring pipe, number of cells that the neighbour needs).
    """
    pipes, short = pipes_with_cells(case), {}
    travel = {name: pipe.length / case.wave_speed(name) for name, pipe in pipes.items()}
    by_node: dict[str, list[str]] = {}
    for name, pipe in pipes.items():
        for node in (pipe.from_, pipe.to):
            by_node.setdefault(node, []).append(name)
    for name, pipe in pipes.items():
        for neighbour in (*by_node[pipe.from_], *by_node[pipe.to]):
            if travel[neighbour] / pipes[neighbour].cells > travel[name]:
                short[name] = neighbour, math.ceil(MIN_CELLS * travel[neighbour] / travel[name])
    return short


def brief_pulses(case: Any) -> list[str]:
    """Keys of schedules with a pulse that is shorter than the longest time in which a wave crosses a cell."""
    pipes = pipes_with_cells(case)
    cell = max((pipe.length / pipe.cells / case.wave_speed(name) for name, pipe in pipes.items()), default=0.0)
    return [f"{group}.{name}.{key}" for group in ("nodes", "links") for name, part in getattr(case, group).items()
            for key, info in type(part).model_fields.items() if pulse_width(getattr(part, key)) < cell]  # fmt: skip


def pulse_width(value: Any) -> float:
    """Shortest time in which a scheduled value rises and falls, or falls and rises [s]; inf if it never does.

    It is also inf for a harmonic schedule, and for a value that is not a `Schedule`.
    """
    if not isinstance(value, Schedule) or value.wave or len(value.time) < 3:
        return np.inf
    changes = np.flatnonzero(np.diff(value.value))
    turns = [(a, b) for a, b in zip(changes, changes[1:], strict=False) if np.prod(np.diff(value.value)[[a, b]]) < 0.0]
    return min((float(value.time[b + 1] - value.time[a]) for a, b in turns), default=np.inf)


class Unresolved:
    """Reasons of unknown or wide errors of the peaks of a case, each with a remedy.

    unknown : (group, name) of a part -> reason for which the errors of its peaks are unknown
    shared : reasons of wide errors that concern all peaks
    tolerance : accumulated error of the steps of delay lines under error control, relative to the range of a signal
    """

    def __init__(self, case: Any, runs: dict[float, Any]) -> None:
        self.case, self.runs = case, runs
        self.unknown = unknown_parts(case)
        self.tolerance = 0.0
        if case.numerics.rtol is not None and delay_lines(case):
            self.tolerance = max(MANY_STEPS * case.numerics.rtol, SMOOTHED * case.numerics.delay_tolerance)
        liquid = ["column separation, so no order is assumed; use more cells"] if has_separation(runs) else []
        self.shared = [*liquid, *differing_events(runs), *coarse_pipes_at_devices(case)]

    def reason(self, part: tuple[str, str], triple: Sequence[float | None], error: float | None, span: float,
               unit: str) -> str | None:  # fmt: skip
        """Reason why the error of a peak is unknown, or wide (above `WIDE_ERROR` times `span`); otherwise None.

        part : (group, name) of the part; triple : peak at half, one and twice the resolution; span : range of the
        signal; unit : unit of all values
        """
        if error is None:
            return self.unknown.get(part) or stopped_runs_text(self.case, self.runs)
        if error <= WIDE_ERROR * span:
            return None
        return "; ".join(self.shared) or difference_text(triple, error, unit, self.case)


def unknown_parts(case: Any) -> dict[Part, str]:
    """Parts with unknown errors of their peaks : (group, name) of a part -> reason.

    With a short pulse in a schedule (`brief_pulses`) these are all parts. Otherwise they are the pipes of `short_pipes`
    and those with a single cell, and their end nodes.
    """
    reasons: dict[Part, str] = {}
    if pulses := brief_pulses(case):
        text = (
            f"{listing(pulses, MAX_NAMES)} {'change' if len(pulses) > 1 else 'changes'} in both directions within the "
            "travel time of a cell; use more cells"
        )
        reasons = {(group, name): text for group in ("nodes", "links") for name in getattr(case, group)}
    texts = {name: f"a wave crosses {name} faster than a cell of {neighbour}; set links.{neighbour}.cells = {cells}"
             for name, (neighbour, cells) in short_pipes(case).items()}  # fmt: skip
    half = scaled(cell_counts(case), 0.5)
    for name, pipe in pipes_with_cells(case).items():
        if half[f"links.{name}.cells"] == (pipe.cells,):  # no coarser cells
            texts[name] = f"{name} has a single cell; set links.{name}.cells = {MIN_CELLS}"
    for name, text in texts.items():
        link = case.links[name]
        for part in (("links", name), ("nodes", link.from_), ("nodes", link.to)):
            reasons.setdefault(part, text)
    return reasons


def stopped_runs_text(case: Any, runs: dict[float, Any]) -> str:
    """Reason why runs at other resolutions give no value of a peak; runs : factor of resolution -> result."""
    ended = [f"{times:g} times the resolution: {run.reason}" for times, run in runs.items() if run.reason != "finished"]
    if len(runs) == 1:
        files = listing(basins_from_files(case), MAX_NAMES)
        return (f"the cells of {files} come from a file, so there is no run at another resolution; run the case with a "
                "file of finer cells, and compare both runs with fvsolve compare")  # fmt: skip
    return "; ".join(ended) or "at another resolution the peak is not a number; use more cells or shorter steps"


def difference_text(triple: Sequence[float | None], error: float, unit: str, case: Any) -> str:
    """Reason of a wide error, from the values of a peak at three resolutions, with a remedy.

    triple : values from coarse to fine; error : error of the middle value; unit : unit of the values and the error
    """
    remedy = "more cells" if cell_counts(case) else "shorter steps"
    peaks = [peak for peak in triple if peak is not None]
    steps = np.diff(peaks)
    if np.abs(steps).max() < SMALL_DIFFERENCE * error:
        return f"another peak of the signal, or a moving peak, may exceed the computed peak; use {remedy}"
    steps_text = " and ".join(f"{abs(peak):.2g}" for peak in steps)
    if len(steps) == 1:
        return f"a difference of {steps_text} {unit} between the only two resolutions; use {remedy}"
    falls = steps[0] * steps[1] > 0.0 and abs(steps[1]) < 0.6 * abs(steps[0])
    order = "decrease, but are large" if falls else "show no order of convergence"
    return f"differences of {steps_text} {unit} between resolutions {order}; use {remedy}"


def has_separation(runs: dict[float, Any]) -> bool:
    """True if column separation occurred in a run."""
    return any(run.summary["cavities"] for run in runs.values())


def coarse_pipes_at_devices(case: Any) -> list[str]:
    """Texts, at most `MAX_NAMES`, on pipes with too few cells next to a check valve or accumulator."""
    pipes, devices = pipes_with_cells(case), answering_parts(case)
    texts = [
        f"{name} has {pipe.cells} cell{'' if pipe.cells == 1 else 's'} beside {listing(devices[name], MAX_NAMES)}; "
        f"set links.{name}.cells = {LEAST_CELLS}"
        for name, pipe in pipes.items()
        if pipe.cells < LEAST_CELLS and devices[name]
    ]
    return texts[:MAX_NAMES]


def differing_events(runs: dict[float, Any]) -> list[str]:
    """List with a text on the devices whose numbers of events differ between resolutions, or an empty list."""
    finished = [runs[times] for times in sorted(runs) if runs[times].reason == "finished"]
    counts = [Counter(event["name"] for event in run.summary["events"]) for run in finished]
    names = sorted(set().union(*counts)) if len(finished) > 1 else []
    by_device = {name: [event[name] for event in counts] for name in names}
    texts = [f"{name} ({', '.join(map(str, values))})" for name, values in by_device.items() if len(set(values)) > 1]
    return [f"numbers of events differ between resolutions: {listing(texts, MAX_NAMES)}"] if texts else []

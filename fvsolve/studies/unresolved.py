"""What runs of half and twice the resolution cannot show of a case, and why their peaks differ. Starts no run."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from fvsolve.errors import listing
from fvsolve.model.resolution import ANSWER, answering
from fvsolve.parts.schedule import Schedule
from fvsolve.studies.accuracy.cells import counts, from_files, in_cells, scaled
from fvsolve.studies.lines import lines

Part = tuple[str, str]  # group and name
MANY_STEPS = 20.0  # tolerances of one step, which those between the jumps of delay lines add up to
SMOOTHED = 0.05  # of numerics.accuracy: what jumps below a quarter of it come to, which lines smooth over a step
FEW = 4  # cells that differ at half and twice the resolution
NAMED = 3  # of what is listed
WIDE = 0.05  # of the span of a signal: errors from which on their reason is said
SMALL = 0.1  # of an error: differences that are not what makes it


def uncut(case: Any) -> list[str]:
    """Pipes of one cell, which half the resolution does not change."""
    found = counts(case)
    half = scaled(found, 0.5)
    return [name for name in in_cells(case) if half[f"links.{name}.cells"] == found[f"links.{name}.cells"]]


def passed_at_once(case: Any) -> dict[str, tuple[str, int]]:
    """Pipes that a wave passes sooner than a cell of a pipe beside them -> that pipe, and the cells that it needs."""
    pipes, found = in_cells(case), {}
    travel = {name: pipe.length / case.wave_speed(name) for name, pipe in pipes.items()}
    joined: dict[str, list[str]] = {}
    for name, pipe in pipes.items():
        for node in (pipe.from_, pipe.to):
            joined.setdefault(node, []).append(name)
    for name, pipe in pipes.items():
        for other in (*joined[pipe.from_], *joined[pipe.to]):
            if travel[other] / pipes[other].cells > travel[name]:
                found[name] = other, math.ceil(FEW * travel[other] / travel[name])
    return found


def brief_pulses(case: Any) -> list[str]:
    """Scheduled keys that go to and fro within the time that a wave takes to pass a cell."""
    pipes = in_cells(case)
    cell = max((pipe.length / pipe.cells / case.wave_speed(name) for name, pipe in pipes.items()), default=0.0)
    return [f"{group}.{name}.{key}" for group in ("nodes", "links") for name, part in getattr(case, group).items()
            for key, info in type(part).model_fields.items() if pulse(getattr(part, key)) < cell]  # fmt: skip


def pulse(value: Any) -> float:
    """Shortest time in which a schedule goes to and fro [s]; inf of what does not."""
    if not isinstance(value, Schedule) or value.wave or len(value.time) < 3:
        return np.inf
    moves = np.flatnonzero(np.diff(value.value))
    turns = [(a, b) for a, b in zip(moves, moves[1:], strict=False) if np.prod(np.diff(value.value)[[a, b]]) < 0.0]
    return min((float(value.time[b + 1] - value.time[a]) for a, b in turns), default=np.inf)


class Unresolved:
    """Why peaks of a case are not known or their errors wide, each with its remedy.

    unknown : part -> why its peaks are not known; shared : what makes the errors of all peaks wide; tolerance : of the
    span of a signal, what the steps of delay lines add up to under error control
    """

    def __init__(self, case: Any, runs: dict[float, Any]) -> None:
        self.case, self.runs = case, runs
        self.unknown = unknown_parts(case)
        self.tolerance = 0.0
        if case.numerics.rtol is not None and lines(case):
            self.tolerance = max(MANY_STEPS * case.numerics.rtol, SMOOTHED * case.numerics.accuracy)
        liquid = ["liquid parts, so no order is believed; give more cells"] if parted(runs) else []
        self.shared = [*liquid, *differing(runs), *few_beside_answers(case)]

    def reason(self, part: tuple[str, str], triple: Sequence[float | None], error: float | None, span: float,
               unit: str) -> str | None:  # fmt: skip
        """Why the error of a peak is not known, or more than a share of the span of its signal; None if it is neither.

        triple : the peak at half, one and twice the resolution, in its unit
        """
        if error is None:
            return self.unknown.get(part) or stopped(self.case, self.runs)
        if error <= WIDE * span:
            return None
        return "; ".join(self.shared) or differences(triple, error, unit, self.case)


def unknown_parts(case: Any) -> dict[Part, str]:
    """Part -> why its peaks are not known: all under a brief pulse, else pipes that are too short and the nodes at
    their ends."""
    found: dict[Part, str] = {}
    if pulses := brief_pulses(case):
        text = f"{listing(pulses, NAMED)} goes to and fro before a wave has passed a cell; give pipes more cells"
        found = {(group, name): text for group in ("nodes", "links") for name in getattr(case, group)}
    texts = {name: f"{name} is shorter than a cell of {other}; give links.{other}.cells = {cells}"
             for name, (other, cells) in passed_at_once(case).items()}  # fmt: skip
    texts |= {name: f"the one cell of {name} cannot be halved; give links.{name}.cells = {FEW}" for name in uncut(case)}
    for name, text in texts.items():
        link = case.links[name]
        for part in (("links", name), ("nodes", link.from_), ("nodes", link.to)):
            found.setdefault(part, text)
    return found


def stopped(case: Any, runs: dict[float, Any]) -> str:
    """Why other resolutions say nothing of a peak."""
    ended = [f"{times:g} times the resolution: {run.reason}" for times, run in runs.items() if run.reason != "finished"]
    if len(runs) == 1:
        ended = [f"cells of {listing(from_files(case), NAMED)} come from a file; give one with finer cells"]
    return "; ".join(ended) or "at another resolution it is no number; give more cells or shorter steps"


def differences(triple: Sequence[float | None], error: float, unit: str, case: Any) -> str:
    """How peaks at three resolutions differ, where their error is wide."""
    remedy = "more cells" if counts(case) else "shorter steps"
    known = [one for one in triple if one is not None]
    steps = np.diff(known)
    if np.abs(steps).max() < SMALL * error:
        return f"another peak of the signal, or one that moves, may come to exceed it; give {remedy}"
    found = " and ".join(f"{abs(one):.2g}" for one in steps)
    if len(steps) == 1:
        return f"a difference of {found} {unit} between the only two resolutions; give {remedy}"
    falls = steps[0] * steps[1] > 0.0 and abs(steps[1]) < 0.6 * abs(steps[0])
    order = "fall, but are large" if falls else "show no order yet"
    return f"differences of {found} {unit} between resolutions {order}; give {remedy}"


def parted(runs: dict[float, Any]) -> bool:
    """True if liquid parted in a run."""
    return any(run.summary["cavities"] for run in runs.values())


def few_beside_answers(case: Any) -> list[str]:
    """Pipes of few cells beside what answers to their waves."""
    pipes, beside = in_cells(case), answering(case)
    found = [f"{name} has {pipe.cells} cell{'' if pipe.cells == 1 else 's'} beside {listing(beside[name], NAMED)}; "
             f"give links.{name}.cells = {ANSWER}"
             for name, pipe in pipes.items() if pipe.cells < ANSWER and beside[name]]  # fmt: skip
    return found[:NAMED]


def differing(runs: dict[float, Any]) -> list[str]:
    """Devices whose numbers of events differ between resolutions."""
    done = [runs[times] for times in sorted(runs) if runs[times].reason == "finished"]
    numbers = [Counter(one["name"] for one in run.summary["events"]) for run in done]
    names = sorted(set().union(*numbers)) if len(done) > 1 else []
    apart = {name: [one[name] for one in numbers] for name in names}
    texts = [f"{name} ({', '.join(map(str, many))})" for name, many in apart.items() if len(set(many)) > 1]
    return [f"events differ between resolutions: {listing(texts, NAMED)}"] if texts else []

"""What runs of half and twice the resolution cannot show of a case, and why their peaks differ. Starts no run."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any

import numpy as np

from fvsolve.errors import listing
from fvsolve.parts.schedule import Schedule
from fvsolve.studies.accuracy.cells import counts, in_cells, scaled

Parts = set[tuple[str, str]]  # group and name
FEW = 4  # cells that differ at half and twice the resolution
NAMED = 3  # of what is listed


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


def unknown_parts(case: Any) -> Parts:
    """Parts whose peaks are not known: all under a brief pulse, else pipes that are too short and the nodes at their
    ends."""
    if brief_pulses(case):
        return {(group, name) for group in ("nodes", "links") for name in getattr(case, group)}
    found: Parts = set()
    for name in (*uncut(case), *passed_at_once(case)):
        link = case.links[name]
        found |= {("links", name), ("nodes", link.from_), ("nodes", link.to)}
    return found


def reasons(case: Any, runs: dict[float, Any]) -> list[str]:
    """Why errors are not known or wide, each with its remedy."""
    found = []
    if pulses := brief_pulses(case):
        found.append(f"{listing(pulses, NAMED)}: goes to and fro before a wave has passed a cell, so peaks are not "
                     "known; give pipes more cells")  # fmt: skip
    if pipes := uncut(case):
        keys = [f"links.{name}.cells" for name in pipes]
        found.append(f"one cell cannot be halved, so peaks there are not known; give {listing(keys, NAMED)} = {FEW} "
                     "or more")  # fmt: skip
    for name, (other, cells) in [*passed_at_once(case).items()][:NAMED]:
        found.append(f"{name} is shorter than a cell of {other}, so peaks there are not known; give "
                     f"links.{other}.cells = {cells}")  # fmt: skip
    return found + differing(runs)


def differing(runs: dict[float, Any]) -> list[str]:
    """Devices whose numbers of events differ between resolutions."""
    done = [runs[times] for times in sorted(runs) if runs[times].reason == "finished"]
    numbers = [Counter(one["name"] for one in run.summary["events"]) for run in done]
    names = sorted(set().union(*numbers)) if len(done) > 1 else []
    apart = {name: [one[name] for one in numbers] for name in names}
    texts = [f"{name} ({', '.join(map(str, many))})" for name, many in apart.items() if len(set(many)) > 1]
    return [f"events differ between resolutions: {listing(texts, NAMED)}"] if texts else []

"""Pipes that have too few cells for what happens in a case. Knows pipes and schedules; knows no flow."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.case.routes import is_cut
from fvsolve.errors import Notice, listing
from fvsolve.parts.schedule import Schedule

# Cells from which on peaks behind a valve that closes, at once or within five travel times, are within a tenth of what
# they rise (tests/model/test_resolution.py); `fromm` and `central` overshoot jumps by more, whatever the cells.
FEWEST, ENOUGH = {"upwind": 40, "weno5": 6}, 10  # by the scheme, and of all others
SLOW = 100.0  # travel times: behind what takes longer, liquid is as good as rigid
SHORT = 0.1  # of the longest travel time: shorter pipes count only beside what moves within
QUICK = 4.0  # of their own
ANSWER = 3  # cells of a piece beside what answers to its waves
DEAR = 10.0  # times the steps that the other cells of a pipe ask for


def too_few_cells(draft: Any) -> list[Notice]:
    """A notice of pipes behind an event, and one of a piece beside a check valve or a vessel, or that is dear."""
    table = draft.pipe_table
    if not len(table):
        return []
    cells = np.where(table["delay"] < 0, table["cells"], np.inf)  # delay lines need none
    return [*_behind_events(draft, cells), *(_beside_answers(draft, cells) or _dear(draft, cells))]


def events(case: Any) -> Iterator[tuple[str, float]]:
    """(dotted key, duration [s]) of what a case says to change within the run; 0 of what changes at once."""
    span = case.numerics.start, case.numerics.end
    for group in ("nodes", "links"):
        for name, part in getattr(case, group).items():
            for key, value in vars(part).items():
                time = duration(value, *span) if isinstance(value, Schedule) else math.inf
                if time < math.inf:
                    yield f"{group}.{name}.{key}", time
            if getattr(part, "trip", None) is not None:
                yield f"{group}.{name}.trip", 0.0


def duration(schedule: Schedule, start: float, end: float) -> float:
    """Time that a schedule would take for all it changes at its steepest between two times [s]; inf where it stays."""
    if schedule.kind == "harmonic":
        return schedule.wave[2] / math.pi
    t, moved = schedule.time, np.abs(np.diff(schedule.value))
    if schedule.kind == "step":
        return 0.0 if ((moved > 0.0) & (t[1:] >= start) & (t[1:] <= end)).any() else math.inf
    steep = np.where((t[1:] > start) & (t[:-1] < end), moved / np.diff(t), 0.0).max(initial=0.0)
    return float(np.ptp(schedule.value)) / steep / max(schedule.exponent, 1.0) if steep > 0.0 else math.inf


def _behind_events(draft: Any, cells: np.ndarray) -> list[Notice]:
    """Pipes whose waves their cells flatten, of those that pass on what the quickest event sends."""
    case, scheme = draft.case, draft.case.numerics.scheme
    needed = FEWEST.get(scheme, ENOUGH) * _flattened(draft)
    few = cells < needed
    if not few.any():
        return []
    found = dict(events(case)) or {"what devices do": 0.0}
    found |= {"numerics.initial": 0.0} if case.numerics.initial == "rest" else {}
    key = min(found, key=found.get)
    cell = draft.pipe_table["dx"] / draft.pipe_table["speed"]
    travel = cell * draft.pipe_table["cells"]
    few &= ((travel > SHORT * travel.max()) & (found[key] < SLOW * travel)) | _beside_events(draft, found, travel)
    if not few.any():
        return []
    worst = int(np.argmax(np.where(few, cell, 0.0)))
    least, name = math.ceil(needed[worst]), draft.pipe_names[worst]
    took, passed = (case.amount(one, "time") for one in (found[key], cell[worst]))
    text = (
        f"{name}: {_cells(cells[worst])} with a travel time of {passed} each, too few behind {key}, {took} long; with "
        f"{scheme} peaks are right to a tenth from links.{name}.cells = {least} on{_others(draft, few, worst)}"
    )
    return [Notice("range", f"links.{name}", text, "cells", float(cells[worst]), float(least))]


def _flattened(draft: Any) -> np.ndarray:
    """Share of what upwind flattens that Euler's method leaves, 1 - Courant number; 1 of all else."""
    numerics, rate = draft.case.numerics, draft.pipe_table["speed"] / draft.pipe_table["dx"]
    if numerics.scheme != "upwind" or numerics.method != "euler" or numerics.rtol is not None:
        return np.ones(len(rate))
    return 1.0 - np.minimum(rate * (numerics.step or numerics.courant / rate.max()), 1.0)


def _beside_events(draft: Any, found: dict[str, float], travel: np.ndarray) -> np.ndarray:
    """Pipes at whose ends a schedule moves something in less than a few of their travel times : bool[pipes]."""
    case, quickest = draft.case, {}
    for key, time in found.items():
        group, name, what = (*key.split("."), "", "")[:3]
        for node in (name,) if group == "nodes" else case.links[name].ports.values() if group == "links" else ():
            quickest[node] = min(quickest.get(node, math.inf), math.inf if what == "trip" else time)
    ends = [[quickest.get(end, math.inf) for end in _ends(case, name)] for name in draft.pipe_names]
    return np.min(np.array(ends).reshape(-1, 2), axis=1) < QUICK * travel


def _beside_answers(draft: Any, cells: np.ndarray) -> list[Notice]:
    """Pipes and pieces so short that a check valve or a vessel beside them gets no wave of theirs."""
    if not (cells < ANSWER).any():
        return []
    case, beside = draft.case, answering(draft.case)
    near = [beside.get(name, []) for name in draft.pipe_names]
    few = (cells < ANSWER) & np.array([bool(one) for one in near])
    if not few.any():
        return []
    worst = int(np.argmin(np.where(few, draft.pipe_table["dx"] * draft.pipe_table["cells"], np.inf)))
    name, cost = draft.pipe_names[worst], "".join(f"; {one.text}" for one in _dear(draft, cells))
    text = (f"{_where(case, name)}: {_cells(cells[worst])}, too few for its waves to reach {listing(near[worst], 3)}; "
            f"expected {_remedy(case, name)}{_others(draft, few, worst)}{cost}")  # fmt: skip
    return [Notice("cells", f"links.{name}", text, "cells", float(cells[worst]), float(ANSWER))]


def answering(case: Any) -> dict[str, list[str]]:
    """Pipe -> check valves and vessels at its ends."""
    beside: dict[str, list[str]] = {name: [name] for name, node in case.nodes.items() if node.kind == "accumulator"}
    for name, link in case.links.items():
        for node in link.ports.values() if link.kind == "check-valve" else ():
            beside.setdefault(node, []).append(name)
    pipes = [name for name, link in case.links.items() if link.kind == "pipe"]
    return {name: [one for end in _ends(case, name) for one in beside.get(end, ())] for name in pipes}


def _dear(draft: Any, cells: np.ndarray) -> list[Notice]:
    """The piece of a cut pipe that asks for far shorter steps than the others."""
    case, numerics = draft.case, draft.case.numerics
    if numerics.courant is None:
        return []
    rate = np.where(np.isfinite(cells), draft.pipe_table["speed"] / draft.pipe_table["dx"], 0.0)
    worst = int(np.argmax(rate))
    name = draft.pipe_names[worst]
    whole = _whole(case, name)
    if whole is None:
        return []
    times = rate[worst] / min(rate[draft.pipe_names.index(one)] or math.inf for one in case.routes[whole].pipes)
    if times <= DEAR:
        return []
    text = f"{_where(case, name)}: steps are {times:.3g} times shorter than other pieces of {whole} need"
    return [Notice("cost", f"links.{name}", text, "length", float(times), DEAR)]


def _whole(case: Any, piece: str) -> str | None:
    """The cut pipe that a piece is of; None of a whole pipe."""
    name = piece.rpartition("-")[0]
    route = case.routes.get(name)
    return name if route is not None and piece in route.pipes and is_cut(name, route.pipes) else None


def _where(case: Any, name: str) -> str:
    """A pipe by its name, a piece also by the chainages that it spans."""
    whole = _whole(case, name)
    if whole is None:
        return name
    route, lengths = case.routes[whole], [case.links[one].length for one in case.routes[whole].pipes]
    at = (route.start or 0.0) + sum(lengths[: route.pipes.index(name)])
    span = " to ".join(case.amount(one, "length", 10) for one in (at, at + case.links[name].length))
    return f"{name} (chainage {span} of {whole})"


def _remedy(case: Any, name: str) -> str:
    """Keys that give a pipe cells enough to send waves to what is beside it."""
    own, whole = f"links.{name}.cells = {ANSWER}", _whole(case, name)
    if whole is None:
        return own
    length = sum(case.links[one].length for one in case.routes[whole].pipes)
    return f"links.{whole}.cells = {math.ceil((ANSWER - 0.5) * length / case.links[name].length)}, or {own}"


def _ends(case: Any, name: str) -> tuple[str, str]:
    return case.links[name].from_, case.links[name].to


def _cells(count: float) -> str:
    return f"{count:.0f} cell{'' if count == 1 else 's'}"


def _others(draft: Any, few: np.ndarray, worst: int) -> str:
    names = [name for k, name in enumerate(draft.pipe_names) if few[k] and k != worst]
    return f"; too few also in {listing(names, 6)}" if names else ""

"""Notices about the start of a model: few cells for cavities or waves, and unusual flows."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from fvsolve.case.pipe_routes import is_cut
from fvsolve.errors import Notice, listing
from fvsolve.parts.schedule import Schedule

# Number of cells from which peaks at a valve are accurate to a tenth of their rise, for closures at once or within
# five travel times (tests/model/test_resolution.py); `fromm` and `central` overshoot jumps by more, with any number.
SCHEME_CELLS, OTHER_CELLS = {"upwind": 40, "weno5": 6}, 10  # for these schemes, and for all others
SLOW_EVENT = 100.0  # travel times: for longer events the liquid is practically rigid
SHORT_PIPE = 0.1  # of the longest travel time: shorter pipes count only next to fast events
FAST_EVENT = 4.0  # of a pipe's own travel times: events next to it that are shorter count as fast
LEAST_CELLS = 3  # least cells of a piece next to a check valve or vessel
# steps shorter by this factor than those of other pieces of a pipe are reported
COSTLY_RATIO = 10.0


def start_notices(draft: Any) -> list[Notice]:
    """All notices of this module on the start of a model."""
    return [*coarse_for_cavities(draft), *flow_notices(draft), *too_few_cells(draft)]


def too_few_cells(draft: Any) -> list[Notice]:
    """Notices of pipes with too few cells for waves of an event, or next to a check valve or accumulator.

    If there are no notices of the second kind, a piece of a cut pipe with far shorter steps than other pieces gives
    one.
    """
    table = draft.pipe_table
    if not len(table):
        return []
    cells = np.where(table["cells"] > 0, table["cells"], np.inf)
    return [
        *_behind_events(draft, cells),
        *(_near_answering(draft, cells) or _costly_piece(draft, cells)),
    ]


def events(case: Any) -> Iterator[tuple[str, float]]:
    """Yield (dotted key, duration [s]) of each change that a case states within its run; 0 for a sudden change.

    Trips are included at any time.
    """
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
    """Time that a schedule needs to cross its whole range at its steepest slope between `start` and `end` [s].

    It is inf if the schedule does not change between `start` and `end`, and if it follows a control.
    """
    if schedule.kind == "control":
        return math.inf
    if schedule.kind == "formula":
        times, values = schedule.program.samples(start, end)
        spans = np.diff(times)
        if np.any(np.diff(values)[spans == 0.0]):
            return 0.0
        steep = float(
            np.max(np.abs(np.diff(values)[spans > 0.0]) / spans[spans > 0.0], initial=0.0)
        )
        return float(np.ptp(values)) / steep if steep > 0.0 else math.inf
    if schedule.kind == "harmonic":
        return schedule.wave[2] / math.pi
    t, changes = schedule.time, np.abs(np.diff(schedule.value))
    if schedule.kind == "step":
        return 0.0 if ((changes > 0.0) & (t[1:] >= start) & (t[1:] <= end)).any() else math.inf
    steep = np.where((t[1:] > start) & (t[:-1] < end), changes / np.diff(t), 0.0).max(initial=0.0)
    return (
        float(np.ptp(schedule.value)) / steep / max(schedule.exponent, 1.0)
        if steep > 0.0
        else math.inf
    )


def _behind_events(draft: Any, cells: np.ndarray) -> list[Notice]:
    """List with a notice of pipes with too few cells for the waves of the fastest event; empty without such pipes."""
    case, scheme = draft.case, draft.case.numerics.scheme
    needed = SCHEME_CELLS.get(scheme, OTHER_CELLS) * _diffusion(draft)
    few = cells < needed
    if not few.any():
        return []
    durations = dict(events(case)) or {"the action of devices": 0.0}
    durations |= {"numerics.initial": 0.0} if case.numerics.initial == "rest" else {}
    key = min(durations, key=durations.get)
    cell = draft.pipe_table["dx"] / draft.pipe_table["speed"]
    travel = cell * draft.pipe_table["cells"]
    slow = (travel > SHORT_PIPE * travel.max()) & (durations[key] < SLOW_EVENT * travel)
    few &= slow | _near_events(draft, durations, travel)
    if not few.any():
        return []
    worst = int(np.argmax(np.where(few, cell, 0.0)))
    least, name = math.ceil(needed[worst]), draft.pipe_names[worst]
    took, passed = (case.amount(time, "time") for time in (durations[key], cell[worst]))
    text = (
        f"{name}: {_cells(cells[worst])} with a travel time of {passed} each, too few for the waves of {key}, a change "
        f"within {took}; for peaks accurate to 10 % with {scheme}, give "
        f"links.{name}.cells = {least} or more{_others(draft, few, worst)}"
    )
    return [Notice("range", f"links.{name}", text, "cells", float(cells[worst]), float(least))]


def _diffusion(draft: Any) -> np.ndarray:
    """Numerical diffusion in each pipe, relative to that of its scheme with small steps : float64[pipes].

    It is 1 - Courant number for `upwind` with `euler` and given steps, else 1.
    """
    numerics, rate = draft.case.numerics, draft.pipe_table["speed"] / draft.pipe_table["dx"]
    if numerics.scheme != "upwind" or numerics.method != "euler" or numerics.rtol is not None:
        return np.ones(len(rate))
    return 1.0 - np.minimum(rate * (numerics.step or numerics.courant / rate.max()), 1.0)


def _near_events(draft: Any, durations: dict[str, float], travel: np.ndarray) -> np.ndarray:
    """True for each pipe with a fast change of a node or link at one of its ends : bool[pipes]; trips are left out.

    A change is fast if it is shorter than FAST_EVENT travel times of the pipe.
    durations : key of a schedule -> duration of its change [s]; travel : travel times of the pipes [s]
    """
    case, shortest = draft.case, {}
    for key, time in durations.items():
        group, name, key_name = (*key.split("."), "", "")[:3]
        for node in (
            (name,)
            if group == "nodes"
            else case.links[name].ports.values()
            if group == "links"
            else ()
        ):
            shortest[node] = min(
                shortest.get(node, math.inf), math.inf if key_name == "trip" else time
            )
    ends = [[shortest.get(end, math.inf) for end in _ends(case, name)] for name in draft.pipe_names]
    return np.min(np.array(ends).reshape(-1, 2), axis=1) < FAST_EVENT * travel


def _near_answering(draft: Any, cells: np.ndarray) -> list[Notice]:
    """List with a notice of pipes with too few cells to resolve the waves at a check valve or accumulator next to them.

    It is empty without such pipes.
    """
    if not (cells < LEAST_CELLS).any():
        return []
    case, parts_at = draft.case, answering_parts(draft.case)
    adjacent = [parts_at.get(name, []) for name in draft.pipe_names]
    few = (cells < LEAST_CELLS) & np.array([bool(notice) for notice in adjacent])
    if not few.any():
        return []
    worst = int(
        np.argmin(np.where(few, draft.pipe_table["dx"] * draft.pipe_table["cells"], np.inf))
    )
    name = draft.pipe_names[worst]
    cost = "".join(f"; {notice.text}" for notice in _costly_piece(draft, cells))
    text = (
        f"{_location(case, name)}: {_cells(cells[worst])}, too few to resolve the waves at "
        f"{listing(adjacent[worst], 3)}; next to a check valve or accumulator give {_advice(case, name)} or more"
        f"{_others(draft, few, worst)}{cost}"
    )
    return [
        Notice("cells", f"links.{name}", text, "cells", float(cells[worst]), float(LEAST_CELLS))
    ]


def answering_parts(case: Any) -> dict[str, list[str]]:
    """Check valves and accumulators at the ends of each pipe : pipe -> names."""
    parts_at: dict[str, list[str]] = {
        name: [name] for name, node in case.nodes.items() if node.kind == "accumulator"
    }
    for name, link in case.links.items():
        for node in link.ports.values() if link.kind == "check-valve" else ():
            parts_at.setdefault(node, []).append(name)
    pipes = [name for name, link in case.links.items() if link.kind == "pipe"]
    return {
        name: [part for end in _ends(case, name) for part in parts_at.get(end, ())]
        for name in pipes
    }


def _costly_piece(draft: Any, cells: np.ndarray) -> list[Notice]:
    """List with a notice of a piece of a cut pipe that needs far shorter steps than its other pieces; else empty."""
    case, numerics = draft.case, draft.case.numerics
    if numerics.courant is None:
        return []
    rate = np.where(np.isfinite(cells), draft.pipe_table["speed"] / draft.pipe_table["dx"], 0.0)
    worst = int(np.argmax(rate))
    name = draft.pipe_names[worst]
    pipe = _cut_pipe(case, name)
    if pipe is None:
        return []
    ratio = rate[worst] / min(
        rate[draft.pipe_names.index(piece)] or math.inf for piece in case.routes[pipe].pipes
    )
    if ratio <= COSTLY_RATIO:
        return []
    text = (
        f"{_location(case, name)}: because of this short piece, steps are {ratio:.3g} times shorter than other "
        f"pieces of {pipe} need; a longer piece allows longer steps"
    )
    return [Notice("cost", f"links.{name}", text, "length", float(ratio), COSTLY_RATIO)]


def _cut_pipe(case: Any, piece: str) -> str | None:
    """Name of the cut pipe to which a piece belongs; None for a pipe that is not cut."""
    name = piece.rpartition("-")[0]
    route = case.routes.get(name)
    return (
        name if route is not None and piece in route.pipes and is_cut(name, route.pipes) else None
    )


def _location(case: Any, name: str) -> str:
    """Name of a pipe; for a piece also the chainages of its ends."""
    pipe = _cut_pipe(case, name)
    if pipe is None:
        return name
    route = case.routes[pipe]
    lengths = [case.links[value].length for value in case.routes[pipe].pipes]
    at = (route.start or 0.0) + sum(lengths[: route.pipes.index(name)])
    span = " to ".join(
        case.amount(value, "length", 10) for value in (at, at + case.links[name].length)
    )
    return f"{name} (chainage {span} of {pipe})"


def _advice(case: Any, name: str) -> str:
    """Text of keys and values that give a pipe enough cells."""
    own, pipe = f"links.{name}.cells = {LEAST_CELLS}", _cut_pipe(case, name)
    if pipe is None:
        return own
    length = sum(case.links[piece].length for piece in case.routes[pipe].pipes)
    return f"links.{pipe}.cells = {math.ceil((LEAST_CELLS - 0.5) * length / case.links[name].length)}, or {own}"


def _ends(case: Any, name: str) -> tuple[str, str]:
    return case.links[name].from_, case.links[name].to


def _cells(count: float) -> str:
    return f"{count:.0f} cell{'' if count == 1 else 's'}"


def _others(draft: Any, few: np.ndarray, worst: int) -> str:
    names = [name for k, name in enumerate(draft.pipe_names) if few[k] and k != worst]
    return f"; too few also in {listing(names, 6)}" if names else ""


# relative error of the duration of a first cavity: DURATION cells^-RATE (docs/fluids.md)
DURATION, RATE = 1.03, 0.7
ENOUGH = 200  # number of cells from which on there is no notice


def coarse_for_cavities(draft) -> list[Notice]:
    """List with a notice if cavities can form, but the pipe with the longest travel time has few cells; else empty.

    The notice states the error of the duration of a first cavity. It is made below ENOUGH cells.
    """
    pipes = draft.meshes
    if not draft.case.law.cavitates or not pipes:
        return []
    longest = max(pipes, key=lambda pipe: (pipe.length / pipe.wave_speed, -pipe.cells))
    if longest.cells >= ENOUGH:
        return []
    error = DURATION * longest.cells**-RATE
    better = DURATION * ENOUGH**-RATE
    text = (
        f"{longest.name}: with {longest.cells} cell{'s' if longest.cells > 1 else ''} the duration of a first "
        f"cavity is about {100.0 * error:.2g} % too short if damping is low; "
        f"{ENOUGH} cells reduce this error to {100.0 * better:.2g} %"
    )
    return [
        Notice("cells", f"links.{longest.name}", text, "cells", float(longest.cells), float(ENOUGH))
    ]


MAX_VELOCITY = 60.0  # of pipe flow [m/s]: penstocks are below 10, jets of 180 m of head reach it
LAMINAR, NO_FLOW = 2000.0, 1.0  # Reynolds numbers below which a flow is laminar, or negligible
# pipes [m] and liquids [kg/m3] with normally turbulent flow: water mains, not oil hydraulics
WIDE_PIPE, WATER_DENSITIES = 0.05, (950.0, 1050.0)


def flow_notices(draft: Any) -> list[Notice]:
    """Notices of high velocity and of laminar flow of water, at most one of each kind, for the worst pipe or column."""
    moving = _flows(draft)
    return [*_fast_flow(draft, *moving), *_laminar_flow(draft, *moving)]


def _flows(draft: Any) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Pipes and rigid columns of the case file : (names, flows at the start [kg/s], areas [m2])."""
    tables = ((draft.pipe_names, draft.pipe_table), (draft.column_names, draft.column_table))
    rows = [
        (name, row["flow"], row["area"])
        for names, table in tables
        for name, row in zip(names, table, strict=True)
        if name in draft.case.links
    ]
    return [row[0] for row in rows], *np.array([row[1:] for row in rows]).reshape(-1, 2).T


def _fast_flow(draft: Any, names: list[str], flow: np.ndarray, area: np.ndarray) -> list[Notice]:
    speed = np.abs(flow) / (draft.fluid.density * area)
    if not (speed > MAX_VELOCITY).any():
        return []
    worst = int(np.argmax(speed))
    fastest, limit = (
        draft.case.amount(velocity, "velocity") for velocity in (speed[worst], MAX_VELOCITY)
    )
    text = (
        f"{_listed(names, speed > MAX_VELOCITY)}: {fastest} at the start in {names[worst]}, above "
        f"{limit}; check the units of flow and diameter"
    )
    return [
        Notice("range", f"links.{names[worst]}", text, "flow", float(speed[worst]), MAX_VELOCITY)
    ]


def _laminar_flow(draft: Any, names: list[str], flow: np.ndarray, area: np.ndarray) -> list[Notice]:
    """List with a notice if water flows in wide pipes with laminar Reynolds numbers only; else empty.

    The probable cause is a wrong unit of flow or viscosity.
    """
    fluid = draft.fluid
    if (
        not names
        or not fluid.viscosity
        or not WATER_DENSITIES[0] <= fluid.density <= WATER_DENSITIES[1]
    ):
        return []
    bore = np.sqrt(4.0 / np.pi * area)
    reynolds = np.where(bore >= WIDE_PIPE, np.abs(flow) * bore / (area * fluid.viscosity), 0.0)
    worst = int(np.argmax(reynolds))
    if not NO_FLOW < reynolds[worst] < LAMINAR:
        return []
    text = (
        f"{names[worst]}: Reynolds number {reynolds[worst]:.4g} at the start, laminar, which is unusual for "
        f"water in pipes this wide; check the flow, {draft.case.amount(abs(flow[worst]) / fluid.density, 'flow')}, "
        f"and the viscosity, {fluid.viscosity:.4g} Pa s"
    )
    return [
        Notice("range", f"links.{names[worst]}", text, "reynolds", float(reynolds[worst]), LAMINAR)
    ]


def _listed(names: list[str], chosen: np.ndarray) -> str:
    return listing([name for name, included in zip(names, chosen, strict=True) if included], 6)

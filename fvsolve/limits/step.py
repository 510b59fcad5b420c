"""A model's step against the limits of its scheme and method: a notice for each room beyond. Knows no run.

Proved, for linear schemes where waves do not depend on the state: von Neumann's limit. Limited schemes count as what
they are where all is smooth, and waves that depend on the state by the quickest one: these are estimates. So is the
limit of a pipe of few cells, whose ends bring it down; there growth in the run decides, by what its own ends reflect.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fvsolve.errors import FvsolveError, Notice
from fvsolve.kernels import records as rec
from fvsolve.limits.ends import LONG, pipe_growth, pipe_limit
from fvsolve.limits.grid import advection_limit, growth_of
from fvsolve.limits.lines import line_growth
from fvsolve.limits.lumped import GROWS, Mode, lumped_modes, times
from fvsolve.limits.plane import holds_well, plane_limit
from fvsolve.limits.swings import swings
from fvsolve.limits.symbol import weights_of
from fvsolve.model.slate import Slate
from fvsolve.schemes import ROOM, SCHEMES
from fvsolve.steppers import automatic
from fvsolve.steppers.tableau import method_named

SLACK = 1e-9  # by which a Courant number may exceed its limit through rounding
SHARE = 0.05  # of an estimate: up to here beyond it a step is doubtful, from there on wrong
SMOOTH = 1e6  # times that deviations of cells must grow to be wrong where no schedule jumps: there are hardly any
STILL, DOUBTFUL, WRONG = 1e-9, 0.005, 0.05  # of its range by which a step leaves what is no wave astray, on average
LIMITED = 0.3  # the same of limiters between few cells: they hold by up to so much more (tests/limits/test_ends.py)


class Room(NamedTuple):
    """A pipe or a basin: its Courant number, and up to which it holds, both as `numerics.courant` counts."""

    place: str
    courant: float
    limit: float
    scheme: str  # that the limit is of
    proved: bool
    where: str
    share: float = SHARE  # of an estimate, beyond which it is wrong
    grows: float = math.inf  # times in the run, where that is what makes it wrong


def step_limits(
    model, rates: dict[str, float] | None = None, step_error: float | None = None, run_data: Slate | None = None
) -> list[Notice]:
    """A notice for the pipe, for every basin, and for what is no wave, whose step is beyond its limit.

    rates : of basins by name, the greatest in a run so far [1/s]; those of the start by default. astray : share of
    its range by which steps of a run went astray where they did most (`solve.halves`); None before a run; slate : one
    to look on, which is blank again. Nothing under error control.
    """
    numerics = model.case.numerics
    method = method_named(automatic.first_method(numerics.method))
    if numerics.rtol is not None:
        return []
    lines = line_growth(model, method, given_step(model), span(model)) if len(model.tables.delays) else []
    if not method.explicit:
        return lines
    try:
        checks = [*pipe_rooms(model, method.name), *basin_rooms(model, method.name, rates or {})]
        h = first_step(model, run_data)
        modes = lumped_modes(model, method.name, h) if h > 0.0 else []
        growing = swings(model, method.name, h, span(model)) if h > 0.0 else []
    except FvsolveError:  # a method whose stability function is not to be had
        return lines
    notices = [notice(model, check, method.name) for check in checks if check.courant > check.limit * (1.0 + SLACK)]
    jumps = any(jump for _, jump in model.breaks)
    modes = [mode for mode in modes if mode.own or not notices]  # of cells those that waves bring with them are known
    return notices + [of_mode(model.case, h, mode, method.name, step_error, jumps) for mode in modes] + growing + lines


def first_step(model, run_data: Slate | None = None) -> float:
    """The step of a run, by Courant number that of its start; 0 where none is known [s]."""
    numerics = model.case.numerics
    if numerics.step is not None:
        return numerics.step
    if run_data is None or model.basins:  # which keep more on a slate than flags
        rate = float(model.evaluate(numerics.start, model.start)[1][rec.RATE])
    else:
        rate = float(run_data.evaluate(numerics.start, model.start, math.inf)[1][rec.RATE])
        run_data.blank()
    return numerics.courant / rate if rate > 0.0 else 0.0


def given_step(model) -> float:
    """The step that delay lines go by [s]."""
    numerics = model.case.numerics
    return numerics.step if numerics.step is not None else numerics.courant / model.wave_rate


def of_mode(case, h: float, mode: Mode, method: str, step_error: float | None, jumps: bool) -> Notice:
    """What is to be said of what is no wave alone: before a run that it grows, after it whether that was seen."""
    numerics = case.numerics
    seen = step_error is None or not mode.own or step_error >= WRONG or (mode.followed and step_error > STILL)
    enough = (GROWS if mode.followed else GROWS**2) if mode.own else GROWS**2 if jumps else SMOOTH
    wrong = seen and mode.grows >= enough
    doubt = "it may be wrong" if seen or step_error >= DOUBTFUL else "this run shows none"
    ends = "the numbers are not to be trusted" if wrong else doubt
    key, unit = ("step", " s") if numerics.step is not None else ("courant", "")
    size = rounded_down(getattr(numerics, key) * mode.limit / h)
    text = (f"{mode.place}: deviations grow {mode.grows:.3g} times in the run with {method} and steps of "
            f"{case.step_amount(h)}, as the start has it; {case.step_amount(mode.limit)} is the limit (an estimate); "
            f"{ends}; give numerics.{key} = {size:.4g}{unit} or less")  # fmt: skip
    return Notice("step-limit", mode.place, text, key, h, mode.limit, not wrong)


def pipe_rooms(model, method: str) -> list[Room]:
    """The pipe that is farthest beyond its limit, if there are any."""
    own = model.tables.pipes["delay"] < 0  # whose waves cells carry
    if not own.any():
        return []
    numerics, waves = model.case.numerics, model.wave_rates
    if numerics.step is not None:
        courant = numerics.step * waves
    else:
        courant = numerics.courant * waves / (waves * model.tables.pipes["quicker"]).max()
    cells, scheme = np.array([pipe.cells for pipe in model.pipes]), SCHEMES[numerics.scheme]
    long = cells >= (
        ROOM if scheme.limited and scheme.shorter else LONG
    )  # at whose ends it is of a lower order where rough
    short = np.flatnonzero(own & ~long)
    checks = [check for k in short if (check := short_pipe(model, method, int(k), float(courant[k])))]
    inner = own & (cells >= ROOM if proved(model) else long)  # what grows between the ends does so in few cells, too
    if inner.any():
        k = int(np.argmax(np.where(inner, courant, -1.0)))
        checks += long_pipe(model, method, k, float(courant[k]))
    return sorted(checks, key=lambda check: (not sound(check), check.courant / max(check.limit, 1e-300)))[-1:]


def long_pipe(model, method: str, k: int, courant: float) -> list[Room]:
    """Pipe k, if a wave grows on a grid without ends."""
    scheme = frozen(model.case.numerics.scheme)[0]
    if holds_well(scheme, method, courant):
        return []
    result = advection_limit(scheme, method)
    grows = math.inf if result.limit > 0.0 else growth(scheme, method, courant, span(model) * model.wave_rates[k])
    sure = result.proved and proved(model)
    check = Room(f"links.{model.pipes[k].name}", courant, result.limit, scheme, sure, "on a long pipe", grows=grows)
    return [check] if grows >= GROWS else []


def proved(model) -> bool:
    """Whether von Neumann's limit is one of its pipes, by proof: a linear scheme, and waves that no state changes."""
    return not frozen(model.case.numerics.scheme)[1] and model.case.law.linear


def short_pipe(model, method: str, k: int, courant: float) -> Room | None:
    """Pipe k of few cells, where its ends make its waves grow within the run: surely by what its own ends reflect."""
    cells, own_scheme = model.pipes[k].cells, SCHEMES[model.case.numerics.scheme]
    scheme, limited = frozen(own_scheme.shorter if own_scheme.limited and own_scheme.shorter else own_scheme.name)
    steps = span(model) * model.wave_rates[k] / courant
    grows = times(pipe_growth(scheme, method, cells, courant), steps)
    if grows < GROWS:
        return None
    if not limited:
        grows = times(pipe_growth(scheme, method, cells, courant, returned(model, k)), steps)
    where = f"between the ends of {cells} cell{'s' if cells > 1 else ''}"
    limit, share = pipe_limit(scheme, method, cells), LIMITED if limited else 0.0
    return Room(f"links.{model.pipes[k].name}", courant, limit, scheme, False, where, share, grows)


def returned(model, k: int) -> tuple[float, ...]:
    """Products of what both ends of pipe k reflect of a pressure; with what else joins them unknown, two for each."""
    row, nodes, valves = model.tables.pipes[k], model.tables.nodes, model.tables.valves
    ends = []
    for i in (row["from_node"], row["to_node"]):
        plain = nodes[i]["kind"] == rec.JUNCTION
        alone = plain and not np.any((valves["from_node"] == i) | (valves["to_node"] == i))
        of_pipes = 2.0 * row["admittance"] / nodes[i]["admittance"] - 1.0 if plain else -1.0
        ends.append({round(float(of_pipes), 3)} | (set() if alone else {-1.0}))
    return tuple(sorted({p * q for p in ends[0] for q in ends[1]}))


def basin_rooms(model, method: str, rates: dict[str, float]) -> list[Room]:
    """All basins, water's Courant numbers by parts of a cell as its steps count them."""
    numerics, checks = model.case.numerics, []
    for basin, row in zip(model.basins, model.tables.basins, strict=True):
        rate, share = basin.pace(model.start)
        parts = float(row["unsplit"]) or 1.0
        rate = max(rate, rates.get(basin.name, 0.0))
        if numerics.step is not None:
            courant = numerics.step * rate * parts
        else:
            courant = numerics.courant
        scheme, limited = frozen(basin.scheme)
        share = round(share, 2) if basin.is_grid else 1.0
        if holds_well(scheme, method, courant / parts, share, basin.is_grid and basin.waving):
            continue
        if basin.is_grid:
            limit = plane_limit(scheme, method, share, basin.waving)
        else:
            limit = advection_limit(scheme, method).limit
        fixed = basin.is_grid and basin.even_paced
        grows = math.inf if limit > 0.0 else growth(scheme, method, courant / parts, span(model) * rate)
        if grows >= GROWS:
            checks.append(Room(f"nodes.{basin.name}", courant, limit * parts, scheme, fixed and not limited,
                              "in a wide basin", grows=grows))  # fmt: skip
    return checks


def span(model) -> float:
    """How long the run is [s]."""
    return model.case.numerics.end - model.case.numerics.start


def frozen(scheme: str) -> tuple[str, bool]:
    """The linear scheme that a scheme is where all is smooth, and whether it is another."""
    return SCHEMES[scheme].smooth.name, SCHEMES[scheme].limited


def sound(check: Room) -> bool:
    """Whether a room beyond its limit is but doubtful: an estimate, hardly passed, or growth that is hardly seen."""
    return not check.proved and (check.courant <= check.limit * (1.0 + check.share) or check.grows < GROWS**2)


def notice(model, check: Room, method: str) -> Notice:
    """What is to be said of a room beyond its limit."""
    numerics = model.case.numerics
    scheme = model.case.numerics.scheme
    about = f", where it is {check.scheme}," if check.scheme != scheme else ""
    known = "proved" if check.proved else "an estimate"
    size = numerics.step if numerics.step is not None else numerics.courant
    key, unit = ("step", " s") if numerics.step is not None else ("courant", "")
    if check.limit > 0.0:
        limit = f"{check.limit:.6g} is the limit {check.where} ({known})"
        remedy = f"give numerics.{key} = {rounded_down(size * check.limit / check.courant):.4g}{unit} or less"
    else:
        limit = f"there is none that does not grow {check.where} ({known})"
        remedy = f"{check.scheme} wants another method, ssp-rk3 for example"
    text = (f"{check.place}: Courant number {check.courant:.6g}: with {scheme}{about} and {method} {limit}; "
            f"{'it may be wrong' if sound(check) else 'the numbers are not to be trusted'}; {remedy}")  # fmt: skip
    return Notice("step-limit", check.place, text, key, check.courant, check.limit, sound(check))


def growth(scheme: str, method: str, courant: float, crossed: float) -> float:
    """By how much the fastest wave of a uniform grid grows while waves cross so many cells."""
    return times(growth_of(weights_of(scheme), method, courant)[0], crossed / courant)


def rounded_down(x: float) -> float:
    """A number to four digits, never above it."""
    scale = 10.0 ** (3 - math.floor(math.log10(x)))
    return math.floor(x * scale * (1.0 + 1e-12)) / scale

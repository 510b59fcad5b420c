"""Which settings a chart runs: schemes, methods, and how fine. Knows cases and what is telling; measures nothing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fvsolve.case import load
from fvsolve.case.case import Case
from fvsolve.case.sections import DEFAULT_COURANT, DEFAULT_METHOD, DEFAULT_METHOD_RTOL, DEFAULT_SCHEME
from fvsolve.errors import CaseError, FvsolveError, did_you_mean, listing
from fvsolve.model.checks import rhs_seconds
from fvsolve.schemes import SCHEMES
from fvsolve.steppers.methods import AUTO, METHODS
from fvsolve.studies.accuracy.cells import counts, greatest_rate, pipes, total
from fvsolve.studies.accuracy.setting import (
    MethodSetting,
    adaptive,
    cell_keys,
    longest,
    own_cells,
    with_cells,
    without_cells,
)
from fvsolve.studies.accuracy.timing import capped, compile_seconds, finished
from fvsolve.studies.lines import lines
from fvsolve.studies.outcome import prepared

CHART_SCHEMES = ("upwind", "muscl", "upwind5", "weno5")
EXPLICIT, IMPLICIT, IMPLICIT_SCHEME = ("ssp-rk3", "rk4", "dormand-prince"), "rodas-5p", "upwind5"
LUMPED = ("rk4", "bogacki-shampine", "dormand-prince", "radau-iia-5", "rodas-5p", AUTO)
DELAYED = ("euler", "trapezoid", "ssp-rk3", "rk4")
PARTS = tuple(4 * 2**k for k in range(8))  # of the time in which a wave crosses the slowest delay line, about
TOLERANCES = tuple(float(f"1e-{k}") for k in range(2, 11))
STEPS = tuple(32 * 4**k for k in range(7))  # of methods that estimate no error
LEVELS, MOST_CELLS = 5, 400
MOST_WORK = 1e7  # cells times steps of the finest run
STIFF = 3.0  # times the steps that waves ask for
CELL = 1e-8  # [s] that a call of the rates usually takes for a cell


@dataclass(frozen=True)
class Coarse:
    """A coarse run of a case with pipes: its cells, the steps that its waves ask for, and the steps it took.

    works : cells times steps of runs with MOST_CELLS, half as many, a quarter ..., where pipes of one cell keep it
    compile_seconds : what it took beyond a second run [s]; dearness : of its rates, a cell, in usual ones
    sizes : numbers of cells that a basin may have and their works, halved and doubled, so that its patches and holes
    lie on lines; None where a pipe counts
    """

    cells: int
    waves: float
    steps: int
    works: list[float]
    compile_seconds: float
    dearness: float = 1.0
    sizes: list[tuple[int, float]] | None = None

    @property
    def stiff(self) -> bool:
        """Whether something else than waves, a small chamber say, holds explicit steps back."""
        return self.steps > STIFF * self.waves

    @property
    def levels(self) -> list[int]:
        """Five numbers of cells, each twice the one before, the finest as fine as a minute allows."""
        if self.sizes is not None:
            return [n for n, work in self.sizes if self.dearness * work <= MOST_WORK][-LEVELS:] or [self.sizes[0][0]]
        finest = MOST_CELLS
        for work in self.works:
            stiff = self.steps * self.cells * 16 * finest / MOST_CELLS if self.stiff else 0.0
            if self.dearness * max(work, stiff / 10) <= MOST_WORK:
                break
            finest //= 2
        return [finest // 2**k for k in range(LEVELS - 1, -1, -1)]


def coarse(case: Case) -> Coarse:
    """Run a case with pipes by the program's default on few cells."""
    few = own_cells(case) or MOST_CELLS // 16
    model = prepared(case, with_cells(case, default_scheme(case), DEFAULT_METHOD, few).keys)
    span = case.numerics.end - case.numerics.start
    waves, spent = span * float(model.wave_rate) / DEFAULT_COURANT, compile_seconds(model)
    found = finished(model, capped)
    done = (found.t - case.numerics.start) / span  # less than 1 where it was given up
    twice = prepared(case, with_cells(case, default_scheme(case), DEFAULT_METHOD, 2 * few).keys)
    more = (rhs_seconds(twice) - rhs_seconds(model)) / max(1, twice.all_cells - model.all_cells)  # nodes cost too
    dearness = max(1.0, more / CELL)
    sizes = None if own_cells(case) is None else basin_sizes(case)
    works = [] if sizes else [work(case, MOST_CELLS >> k) for k in range(MOST_CELLS.bit_length() - LEVELS)]
    steps = round(found.counts["steps"] / done) if done > 0.0 else 0
    return Coarse(model.all_cells, waves, steps, works, spent, dearness, sizes)


def basin_sizes(case: Case) -> list[tuple[int, float]]:
    """Numbers of cells that the basin that counts may have, halves and doubles of its own, and their works."""
    own, found = own_cells(case), []
    for n in (own * 2**k // 2**LEVELS for k in range(2 * LEVELS)):
        try:
            found += [(n, work(case, n))] if n > 0 and n * 2**LEVELS % own == 0 else []
        except CaseError:
            continue  # patches or holes off its lines
    return found


def work(case: Case, cells: int) -> float:
    """Cells times steps of a run with so many in the pipe that a wave crosses last."""
    made = load(case, cell_keys(case, cells))
    own = counts(made)
    return total(made, own) * (case.numerics.end - case.numerics.start) * greatest_rate(made, own)


def default_scheme(case: Case) -> str:
    """The program's default, or what stands in for it where that does not follow the fluid."""
    return DEFAULT_SCHEME if DEFAULT_SCHEME in case.schemes else case.schemes[-1]


def default_curve(case: Case) -> str:
    """Name of the curve that the program's defaults lie on."""
    if longest(case):
        return f"{default_scheme(case)} {DEFAULT_METHOD}"
    return DEFAULT_METHOD if lines(case) else DEFAULT_METHOD_RTOL


def left_out(case: Case, schemes: Sequence[str] | None) -> list[str]:
    """Schemes that a chart usually tries and that do not follow the fluid of this case."""
    return [] if schemes or not longest(case) else [name for name in CHART_SCHEMES if name not in case.schemes]


def settings(case: Case, found: Coarse | None, schemes, methods, cells, rtol, step) -> list[MethodSetting]:
    """All settings, curve by curve from coarse to fine; the default's curve is always there.

    found : the coarse run of a case with pipes, None of one without. Raises FvsolveError for what the case has not.
    """
    if not longest(case) and lines(case):
        return _delayed(case, schemes, methods, cells, rtol, step)
    if found is None:
        return _lumped(case, schemes, methods, cells, rtol, step)
    if rtol or step:
        raise FvsolveError(f"{case.name} has pipes, so its resolution is cells: use --cells, not a tolerance")
    pairs, levels = chosen(case, schemes, methods, found.stiff), sorted({*(cells or found.levels)})
    return [with_cells(case, *pair, level) for pair in pairs for level in levels]


def _lumped(case: Case, schemes, methods, cells, rtol, step) -> list[MethodSetting]:
    if schemes or cells:
        asked = "scheme" if schemes else "cells"
        raise FvsolveError(f"{case.name} has no pipe, so no {asked} to choose; its resolution is rtol or step")
    span = case.numerics.end - case.numerics.start
    steps = sorted(step or [span / n for n in STEPS], reverse=True)
    found = []
    for method in dict.fromkeys([*(methods or LUMPED), DEFAULT_METHOD_RTOL]):
        sizes = sorted(rtol or TOLERANCES, reverse=True) if adaptive(method) else steps
        found += [without_cells(method, size) for size in sizes]
    return found


def _delayed(case: Case, schemes, methods, cells, rtol, step) -> list[MethodSetting]:
    """Of delay lines, whose resolution is the step: the error of a step does not see what is read between steps."""
    if schemes or cells or rtol:
        asked = "scheme" if schemes else "cells" if cells else "rtol"
        raise FvsolveError(f"{case.name} has delay lines alone, so no {asked} to choose; their resolution is step")
    travel = max(one.length / case.wave_speed(name) for name, one in pipes(case).items())
    steps = sorted(step or [float(f"{travel / n:.2g}") for n in PARTS], reverse=True)
    return [without_cells(method, size, "step")
            for method in dict.fromkeys([*(methods or DELAYED), DEFAULT_METHOD]) for size in steps]  # fmt: skip


def chosen(
    case: Case, schemes: Sequence[str] | None, methods: Sequence[str] | None, stiff: bool = False
) -> list[tuple[str, str]]:
    """Pairs of scheme and method: all of those asked for, else a telling set; the default's pair always."""
    taken = list(schemes or [name for name in CHART_SCHEMES if name in case.schemes])
    if methods:
        found = [(scheme, method) for scheme in taken for method in methods]
    else:
        found = [("upwind", "euler")] if "upwind" in taken else []
        explicit = EXPLICIT[:1] if stiff else EXPLICIT  # what holds them back is the same for all
        found += [(scheme, method) for scheme in taken for method in explicit]
        implicit = taken if stiff else [IMPLICIT_SCHEME] if IMPLICIT_SCHEME in taken else taken[:1]
        found += [(scheme, IMPLICIT) for scheme in implicit]
    return list(dict.fromkeys([*found, (default_scheme(case), DEFAULT_METHOD)]))


def known(schemes: Sequence[str] | None, methods: Sequence[str] | None) -> None:
    """Raises FvsolveError for a name that is none, with the nearest."""
    for what, asked, names in (("scheme", schemes, tuple(SCHEMES)), ("method", methods, (AUTO, *METHODS))):
        for name in asked or ():
            if name not in names:
                raise FvsolveError(f"no {what} {name}{did_you_mean(name, names)}; {what}s are {listing(names, 60)}")

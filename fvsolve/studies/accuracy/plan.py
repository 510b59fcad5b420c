"""Settings that a chart runs: schemes, methods and resolutions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from fvsolve.case import load
from fvsolve.case.case import Case
from fvsolve.case.sections import DEFAULT_COURANT, DEFAULT_METHOD, DEFAULT_METHOD_RTOL, DEFAULT_SCHEME
from fvsolve.errors import CaseError, FvsolveError, did_you_mean, listing
from fvsolve.model.model_facts import rhs_seconds
from fvsolve.schemes import SCHEMES
from fvsolve.steppers.built_in_methods import AUTO, METHODS
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
PARTS = tuple(4 * 2**k for k in range(8))  # steps, about, per travel time of the slowest delay line
TOLERANCES = tuple(float(f"1e-{k}") for k in range(2, 11))
STEPS = tuple(32 * 4**k for k in range(7))  # numbers of steps of methods without an error estimate
LEVELS, MOST_CELLS = 5, 400
MOST_WORK = 1e7  # greatest number of cells times steps of the finest run
STIFF = 3.0  # a case is stiff above this ratio of its steps to those for Courant number 0.9
CELL = 1e-8  # usual time of one call of the rates for one cell [s]


@dataclass(frozen=True)
class Coarse:
    """Coarse run of a case with cells: its cells, the steps for Courant number 0.9, and the steps that it took.

    works : cells times steps of runs with MAX_CELLS, half as many, a quarter ..., while pipes have at least one cell
    compile_seconds : time of a first run less that of a second run [s]
    dearness : time of the rates for one cell, in units of CELL_TIME
    sizes : possible numbers of cells of a basin and their works, halved and doubled so that patches and holes end on
    grid lines; None if the main part is a pipe
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
        """True if a time scale other than waves limits explicit steps, for example a small chamber."""
        return self.steps > STIFF * self.waves

    @property
    def levels(self) -> list[int]:
        """Five numbers of cells, each twice the number before; the finest run takes about a minute."""
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
    """Run a case with cells on few cells, by the program's defaults."""
    cells = own_cells(case) or MOST_CELLS // 16
    model = prepared(case, with_cells(case, default_scheme(case), DEFAULT_METHOD, cells).keys)
    span = case.numerics.end - case.numerics.start
    waves, compile_time = span * float(model.wave_rate) / DEFAULT_COURANT, compile_seconds(model)
    result = finished(model, capped)
    fraction = (result.t - case.numerics.start) / span  # less than 1 if the run was stopped
    finer_model = prepared(case, with_cells(case, default_scheme(case), DEFAULT_METHOD, 2 * cells).keys)
    cell_time = (rhs_seconds(finer_model) - rhs_seconds(model)) / max(
        1, finer_model.all_cells - model.all_cells
    )  # nodes also cost time
    dearness = max(1.0, cell_time / CELL)
    sizes = None if own_cells(case) is None else basin_sizes(case)
    works = [] if sizes else [work(case, MOST_CELLS >> k) for k in range(MOST_CELLS.bit_length() - LEVELS)]
    steps = round(result.counts["steps"] / fraction) if fraction > 0.0 else 0
    return Coarse(model.all_cells, waves, steps, works, compile_time, dearness, sizes)


def basin_sizes(case: Case) -> list[tuple[int, float]]:
    """Possible numbers of cells of the main basin, its own halved and doubled, and their works."""
    main_cells, sizes = own_cells(case), []
    for n in (main_cells * 2**k // 2**LEVELS for k in range(2 * LEVELS)):
        try:
            sizes += [(n, work(case, n))] if n > 0 and n * 2**LEVELS % main_cells == 0 else []
        except CaseError:
            continue  # patches or holes do not end on grid lines
    return sizes


def work(case: Case, cells: int) -> float:
    """Cells times steps of a run with this number of cells in the main part."""
    changed = load(case, cell_keys(case, cells))
    cells_by_key = counts(changed)
    return (
        total(changed, cells_by_key) * (case.numerics.end - case.numerics.start) * greatest_rate(changed, cells_by_key)
    )


def default_scheme(case: Case) -> str:
    """The program's default scheme, or the last scheme of the fluid if the default does not support the fluid."""
    return DEFAULT_SCHEME if DEFAULT_SCHEME in case.schemes else case.schemes[-1]


def default_curve(case: Case) -> str:
    """Name of the curve of the program's defaults."""
    if longest(case):
        return f"{default_scheme(case)} {DEFAULT_METHOD}"
    return DEFAULT_METHOD if lines(case) else DEFAULT_METHOD_RTOL


def left_out(case: Case, schemes: Sequence[str] | None) -> list[str]:
    """Usual schemes of a chart that do not support the fluid of this case."""
    return [] if schemes or not longest(case) else [name for name in CHART_SCHEMES if name not in case.schemes]


def settings(case: Case, coarse_run: Coarse | None, schemes, methods, cells, rtol, step) -> list[MethodSetting]:
    """All settings, curve by curve from coarse to fine; the default's curve is always included.

    coarse_run : coarse run of a case with cells, None for other cases
    Raises FvsolveError for options that the case does not support.
    """
    if not longest(case) and lines(case):
        return _delayed(case, schemes, methods, cells, rtol, step)
    if coarse_run is None:
        return _lumped(case, schemes, methods, cells, rtol, step)
    if rtol or step:
        raise FvsolveError(
            f"{case.name} has cells, so its resolution is their number: use --cells, not --rtol or --step"
        )
    pairs, levels = chosen(case, schemes, methods, coarse_run.stiff), sorted({*(cells or coarse_run.levels)})
    return [with_cells(case, *pair, level) for pair in pairs for level in levels]


def _lumped(case: Case, schemes, methods, cells, rtol, step) -> list[MethodSetting]:
    if schemes or cells:
        option = "scheme" if schemes else "cells"
        raise FvsolveError(
            f"{case.name} has no pipe, so there is no {option} to choose. Its resolution is rtol or step"
        )
    span = case.numerics.end - case.numerics.start
    steps = sorted(step or [span / n for n in STEPS], reverse=True)
    settings_of_methods = []
    for method in dict.fromkeys([*(methods or LUMPED), DEFAULT_METHOD_RTOL]):
        sizes = sorted(rtol or TOLERANCES, reverse=True) if adaptive(method) else steps
        settings_of_methods += [without_cells(method, size) for size in sizes]
    return settings_of_methods


def _delayed(case: Case, schemes, methods, cells, rtol, step) -> list[MethodSetting]:
    """Settings of a case with delay lines alone, whose resolution is the step.

    A tolerance is no resolution here: the error of a step does not include the interpolation between steps.
    """
    if schemes or cells or rtol:
        option = "scheme" if schemes else "cells" if cells else "rtol"
        raise FvsolveError(
            f"{case.name} has only delay lines, so there is no {option} to choose. Their resolution is step"
        )
    travel = max(pipe.length / case.wave_speed(name) for name, pipe in pipes(case).items())
    steps = sorted(step or [float(f"{travel / n:.2g}") for n in PARTS], reverse=True)
    return [without_cells(method, size, "step")
            for method in dict.fromkeys([*(methods or DELAYED), DEFAULT_METHOD]) for size in steps]  # fmt: skip


def chosen(
    case: Case, schemes: Sequence[str] | None, methods: Sequence[str] | None, stiff: bool = False
) -> list[tuple[str, str]]:
    """Pairs of scheme and method: all requested pairs, else a representative selection; always the default pair."""
    names = list(schemes or [name for name in CHART_SCHEMES if name in case.schemes])
    if methods:
        pairs = [(scheme, method) for scheme in names for method in methods]
    else:
        pairs = [("upwind", "euler")] if "upwind" in names else []
        explicit = EXPLICIT[:1] if stiff else EXPLICIT  # stiffness limits all explicit methods alike
        pairs += [(scheme, method) for scheme in names for method in explicit]
        implicit = names if stiff else [IMPLICIT_SCHEME] if IMPLICIT_SCHEME in names else names[:1]
        pairs += [(scheme, IMPLICIT) for scheme in implicit]
    return list(dict.fromkeys([*pairs, (default_scheme(case), DEFAULT_METHOD)]))


def known(schemes: Sequence[str] | None, methods: Sequence[str] | None) -> None:
    """Raises FvsolveError for an unknown name, with the nearest known names."""
    for kind, given, names in (("scheme", schemes, tuple(SCHEMES)), ("method", methods, (AUTO, *METHODS))):
        for name in given or ():
            if name not in names:
                raise FvsolveError(f"unknown {kind} {name}{did_you_mean(name, names)}. Expected {listing(names, 60)}")

"""Settings of a work-precision study: schemes, methods and resolutions. A curve has one scheme and method.

Arguments of several functions : schemes, methods, cells, rtol, step as for `chart`; a single number `cells` is that of
the main part, see `main_part_name`
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

from fvsolve.case import load
from fvsolve.case.case import Case
from fvsolve.case.reading import raw_link
from fvsolve.case.sections import (
    DEFAULT_COURANT,
    DEFAULT_METHOD,
    DEFAULT_METHOD_RTOL,
    DEFAULT_SCHEME,
    uses_error_control,
)
from fvsolve.core.model.model_facts import rhs_seconds
from fvsolve.core.schemes import SCHEMES
from fvsolve.core.steppers.tableau import AUTO, METHODS
from fvsolve.errors import CaseError, FvsolveError, did_you_mean, listing
from fvsolve.features.delay_lines.choice import slowest_pipe
from fvsolve.studies.outcome import best_run, compile_seconds, study_model
from fvsolve.studies.resolution import (
    basins,
    cell_counts,
    cell_keys_of,
    delay_lines,
    greatest_wave_rate,
    pipes,
    pipes_with_cells,
    scaled,
    total_cells,
)

# rtol of implicit methods with cells: their steps follow the solution, not the cell size
IMPLICIT_RTOL = 1e-4


@dataclass(frozen=True)
class MethodSetting:
    """Scheme, method and resolution of a run.

    scheme : None without cells; control : key "courant", "rtol" or "step" that sets the steps; size : its value, the
    step in s
    cells : number of cells of the main part (see `main_part_name`), None without cells; keys : overrides, dotted key ->
    value
    """

    scheme: str | None
    method: str
    control: str
    size: float
    cells: int | None = None
    keys: dict = field(default_factory=dict, compare=False)

    @property
    def curve(self) -> tuple:
        """(scheme, method, step control), which all settings of a curve in a work-precision chart have in common."""
        return self.scheme, self.method, "courant" if self.control == "courant" else self.control

    @property
    def name(self) -> str:
        """Name of scheme and method, such as `upwind5 rk4`."""
        return f"{self.scheme} {self.method}" if self.scheme else self.method

    @property
    def fineness(self) -> str:
        """Resolution in words, such as `200 cells` or `rtol 1e-06`."""
        return (
            f"{self.cells} cells" if self.cells is not None else f"{self.control} {self.size:.3g}"
        )


def main_part_name(case: Case) -> str | None:
    """Name of the main part, whose number of cells is the resolution; None if the case has no cells that can change.

    The main part is the basin with most cells along a side, else the pipe with the longest travel time of a wave.
    """
    sizes = {name: max(basin.cells) for name, basin in basins(case).items() if basin.cells}
    if sizes:
        return max(sizes, key=sizes.get)
    pipes = pipes_with_cells(case)
    return slowest_pipe(case, pipes) if pipes else None


def basin_cells(case: Case) -> int | None:
    """Greatest number of cells along a side of the main part; None if it is not a basin."""
    basin = basins(case).get(main_part_name(case) or "")
    return None if basin is None else max(basin.cells)


def cell_keys(case: Case, cells: int) -> dict:
    """Overrides that set the number of cells of the main part, and scale those of other parts.

    They set `cells` of the pipes that state it in the case; for other pipes they set `numerics.cell_time`. With basins
    they set `cells` of all parts.
    """
    main_part, main_cells = main_part_name(case), basin_cells(case)
    if main_cells is not None:
        return cell_keys_of(scaled(cell_counts(case), cells / main_cells))
    pipes = pipes_with_cells(case)
    stated = {name for name in pipes if raw_link(case.raw, name).get("cells") is not None}
    factor = cells / pipes[main_part].cells
    changed = {f"links.{name}.cells": max(1, round(pipes[name].cells * factor)) for name in stated}
    if main_part not in stated:
        changed["numerics.cell_time"] = pipes[main_part].length / case.wave_speed(main_part) / cells
    elif len(stated) < len(pipes):
        unstated = [pipe for name, pipe in pipes.items() if name not in stated]
        travel = max(
            pipe.length / case.wave_speed(name)
            for name, pipe in pipes.items()
            if name not in stated
        )
        changed["numerics.cell_time"] = travel / (max(pipe.cells for pipe in unstated) * factor)
    return changed


def cells_setting(case: Case, scheme: str, method: str, cells: int) -> MethodSetting:
    """Setting of a case with cells: Courant number 0.9, 1 for upwind with Euler, or a tolerance with error control."""
    by_error = uses_error_control(method)
    control = "rtol" if by_error else "courant"
    size = (
        IMPLICIT_RTOL
        if by_error
        else 1.0
        if (scheme, method) == ("upwind", "euler")
        else DEFAULT_COURANT
    )
    settings = {"numerics.scheme": scheme, "numerics.method": method, f"numerics.{control}": size}
    return MethodSetting(scheme, method, control, size, cells, settings | cell_keys(case, cells))


def lumped_setting(method: str, size: float, control: str | None = None) -> MethodSetting:
    """Setting of a case without cells, which consists of ordinary differential equations or delay lines.

    size : tolerance [-] or step [s]
    control : "rtol" or "step"; if None a tolerance, or a step for methods without an error estimate
    """
    control = control or ("rtol" if is_adaptive(method) else "step")
    return MethodSetting(
        None, method, control, size, None, {"numerics.method": method, f"numerics.{control}": size}
    )


def is_adaptive(method: str) -> bool:
    """True if a method can keep the error of its steps within a tolerance."""
    return method == AUTO or METHODS[method].adaptive


DEFAULT_SCHEMES = ("upwind", "muscl", "upwind5", "weno5")
EXPLICIT_METHODS = ("ssp-rk3", "rk4", "dormand-prince")
IMPLICIT_METHOD = "rodas-5p"
IMPLICIT_SCHEME = "upwind5"
LUMPED_METHODS = ("rk4", "bogacki-shampine", "dormand-prince", "radau-iia-5", "rodas-5p", AUTO)
DELAY_LINE_METHODS = ("euler", "trapezoid", "ssp-rk3", "rk4")
# steps, about, per travel time of the slowest delay line
TRAVEL_PARTS = tuple(4 * 2**k for k in range(8))
TOLERANCES = tuple(float(f"1e-{k}") for k in range(2, 11))
# numbers of steps of methods without an error estimate
STEP_COUNTS = tuple(32 * 4**k for k in range(7))
LEVEL_COUNT, MAX_CELLS = 5, 400
MAX_WORK = 1e7  # greatest number of cells times steps of the finest run
# a case is stiff above this ratio of its steps to those for Courant number 0.9
STIFFNESS_RATIO = 3.0
CELL_TIME = 1e-8  # usual time of one call of the rates for one cell [s]


@dataclass(frozen=True)
class CoarseRun:
    """Results of a coarse run of a case with cells, from which the numbers of cells of a study are chosen.

    cells : number of cells; waves : number of steps at Courant number 0.9
    steps : number of steps of the run, extrapolated to its end if it was stopped
    works : estimated work (cells times steps) of runs with MAX_CELLS cells, half as many, a quarter ...; empty if the
    main part (`main_part_name`) is a basin
    compile_seconds : wall time of a first run minus that of a second run [s]
    dearness : time to evaluate the rates of one cell, as a multiple of CELL_TIME, at least 1
    sizes : (number of cells, work) of the main basin, as from `basin_sizes`; None if the main part is a pipe
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
        return self.steps > STIFFNESS_RATIO * self.waves

    @property
    def levels(self) -> list[int]:
        """Numbers of cells of the study, at most five, from coarse to fine, for a pipe each twice the previous.

        If possible, the work of the finest run, times `dearness`, is at most `MAX_WORK`.
        """
        if self.sizes is not None:
            within = [n for n, work in self.sizes if self.dearness * work <= MAX_WORK]
            return within[-LEVEL_COUNT:] or [self.sizes[0][0]]
        finest = MAX_CELLS
        for work in self.works:
            stiff = self.steps * self.cells * 16 * finest / MAX_CELLS if self.stiff else 0.0
            if self.dearness * max(work, stiff / 10) <= MAX_WORK:
                break
            finest //= 2
        return [finest // 2**k for k in range(LEVEL_COUNT - 1, -1, -1)]


def run_coarse(case: Case) -> CoarseRun:
    """Run a case with few cells and the default scheme and method."""
    cells = basin_cells(case) or MAX_CELLS // 16
    model = study_model(case, cells_setting(case, default_scheme(case), DEFAULT_METHOD, cells).keys)
    span = case.numerics.end - case.numerics.start
    waves, compile_time = span * float(model.wave_rate) / DEFAULT_COURANT, compile_seconds(model)
    result = best_run(model, most=1)
    fraction = (result.t - case.numerics.start) / span  # less than 1 if the run was stopped
    finer_model = study_model(
        case, cells_setting(case, default_scheme(case), DEFAULT_METHOD, 2 * cells).keys
    )
    more_cells = max(1, finer_model.all_cells - model.all_cells)
    # a difference: nodes also cost time
    cell_time = (rhs_seconds(finer_model) - rhs_seconds(model)) / more_cells
    dearness = max(1.0, cell_time / CELL_TIME)
    sizes = None if basin_cells(case) is None else basin_sizes(case)
    works = (
        []
        if sizes
        else [run_work(case, MAX_CELLS >> k) for k in range(MAX_CELLS.bit_length() - LEVEL_COUNT)]
    )
    steps = round(result.counts["steps"] / fraction) if fraction > 0.0 else 0
    return CoarseRun(model.all_cells, waves, steps, works, compile_time, dearness, sizes)


def basin_sizes(case: Case) -> list[tuple[int, float]]:
    """(greatest number of cells along a side, work) of the main basin, for all possible numbers of cells.

    The numbers are the number of the case times powers of 2 from 1/32 to 16. Numbers are left out if patches or holes
    would not end on grid lines. Work is cells times steps. The main basin is that of `main_part_name`.
    """
    main_cells, sizes = basin_cells(case), []
    for n in (main_cells * 2**k // 2**LEVEL_COUNT for k in range(2 * LEVEL_COUNT)):
        try:
            sizes += (
                [(n, run_work(case, n))] if n > 0 and n * 2**LEVEL_COUNT % main_cells == 0 else []
            )
        except CaseError:
            continue  # patches or holes do not end on grid lines
    return sizes


def run_work(case: Case, cells: int) -> float:
    """Cells times steps of a run at Courant number 1, with `cells` cells in the main part."""
    changed = load(case, cell_keys(case, cells))
    cells_by_key = cell_counts(changed)
    span = case.numerics.end - case.numerics.start
    return total_cells(changed, cells_by_key) * span * greatest_wave_rate(changed, cells_by_key)


def default_scheme(case: Case) -> str:
    """Name of the default scheme, or of the last scheme that the case supports if the default is not supported."""
    return DEFAULT_SCHEME if DEFAULT_SCHEME in case.schemes else case.schemes[-1]


def default_curve(case: Case) -> str:
    """Names of the default scheme and method of a case, such as "weno5 rk4"; without cells only the method."""
    if main_part_name(case):
        return f"{default_scheme(case)} {DEFAULT_METHOD}"
    return DEFAULT_METHOD if delay_lines(case) else DEFAULT_METHOD_RTOL


def unsupported_schemes(case: Case, schemes: Sequence[str] | None) -> list[str]:
    """Names of default schemes of a chart that do not support the fluid of this case; none if `schemes` is given."""
    return (
        []
        if schemes or not main_part_name(case)
        else [name for name in DEFAULT_SCHEMES if name not in case.schemes]
    )


def chart_settings(
    case: Case, coarse_run: CoarseRun | None, schemes, methods, cells, rtol, step
) -> list[MethodSetting]:
    """Settings of a study: for each scheme and method its resolutions, from coarse to fine.

    The default scheme and method are always included.
    coarse_run : results of a coarse run, None for a case without pipes and basins
    Raises FvsolveError for options that the case does not support.
    """
    if not main_part_name(case) and delay_lines(case):
        return _delay_line_settings(case, schemes, methods, cells, rtol, step)
    if coarse_run is None:
        return _lumped_settings(case, schemes, methods, cells, rtol, step)
    if rtol or step:
        text = f"{case.name} has cells, so its resolution is the number of cells"
        raise FvsolveError(f"{text}; use --cells instead of --rtol and --step")
    pairs = scheme_method_pairs(case, schemes, methods, coarse_run.stiff)
    levels = sorted({*(cells or coarse_run.levels)})
    return [cells_setting(case, *pair, level) for pair in pairs for level in levels]


def _lumped_settings(case: Case, schemes, methods, cells, rtol, step) -> list[MethodSetting]:
    if schemes or cells:
        option = "scheme" if schemes else "cells"
        text = f"{case.name} has no pipe, so the option {option} does not apply"
        raise FvsolveError(f"{text}; use rtol or step for its resolution")
    span = case.numerics.end - case.numerics.start
    steps = sorted(step or [span / n for n in STEP_COUNTS], reverse=True)
    settings_of_methods = []
    for method in dict.fromkeys([*(methods or LUMPED_METHODS), DEFAULT_METHOD_RTOL]):
        sizes = sorted(rtol or TOLERANCES, reverse=True) if is_adaptive(method) else steps
        settings_of_methods += [lumped_setting(method, size) for size in sizes]
    return settings_of_methods


def _delay_line_settings(case: Case, schemes, methods, cells, rtol, step) -> list[MethodSetting]:
    """Settings of a case of delay lines alone, by steps: error estimates of steps do not include the interpolation."""
    if schemes or cells or rtol:
        option = "scheme" if schemes else "cells" if cells else "rtol"
        text = f"{case.name} has only delay lines, so the option {option} does not apply"
        raise FvsolveError(f"{text}; use step for their resolution")
    travel = max(pipe.length / case.wave_speed(name) for name, pipe in pipes(case).items())
    steps = sorted(step or [float(f"{travel / n:.2g}") for n in TRAVEL_PARTS], reverse=True)
    chosen = dict.fromkeys([*(methods or DELAY_LINE_METHODS), DEFAULT_METHOD])
    return [lumped_setting(method, size, "step") for method in chosen for size in steps]


def scheme_method_pairs(
    case: Case, schemes: Sequence[str] | None, methods: Sequence[str] | None, stiff: bool = False
) -> list[tuple[str, str]]:
    """Pairs (scheme, method) of a study: all combinations of the given names, and the default pair.

    If no schemes are given, all default schemes that the case supports are combined. If no methods are given, the pairs
    are a selection.
    stiff : True if a time scale other than waves limits explicit steps
    """
    names = list(schemes or [name for name in DEFAULT_SCHEMES if name in case.schemes])
    if methods:
        pairs = [(scheme, method) for scheme in names for method in methods]
    else:
        pairs = [("upwind", "euler")] if "upwind" in names else []
        # stiffness limits all explicit methods alike
        explicit = EXPLICIT_METHODS[:1] if stiff else EXPLICIT_METHODS
        pairs += [(scheme, method) for scheme in names for method in explicit]
        implicit = names if stiff else [IMPLICIT_SCHEME] if IMPLICIT_SCHEME in names else names[:1]
        pairs += [(scheme, IMPLICIT_METHOD) for scheme in implicit]
    return list(dict.fromkeys([*pairs, (default_scheme(case), DEFAULT_METHOD)]))


def check_names(schemes: Sequence[str] | None, methods: Sequence[str] | None) -> None:
    """Raise FvsolveError for an unknown scheme or method, with the nearest known names."""
    for kind, given, names in (
        ("scheme", schemes, tuple(SCHEMES)),
        ("method", methods, (AUTO, *METHODS)),
    ):
        for name in given or ():
            if name not in names:
                hint = did_you_mean(name, names) or f"; expected {listing(names, 60)}"
                raise FvsolveError(f"unknown {kind} {name}{hint}")

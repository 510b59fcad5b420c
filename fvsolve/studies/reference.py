"""Reference solutions for errors: an exact solution, or finer runs with other schemes and methods.

`find_reference(case, finest)` finds the most accurate reference for runs with the keys `finest` or coarser. A
`Reference` gives averages over any cells at the end, values of probes at the rows of a run, and its own error.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from fvsolve import exact as room
from fvsolve.core.steppers.tableau import METHODS
from fvsolve.errors import FvsolveError
from fvsolve.studies.distance import (
    Distance,
    cell_averages,
    distance,
    error_norms,
    extremes_distance,
    fields,
    pressure_ranges,
    variable_size,
    wave_sums,
)
from fvsolve.studies.outcome import (
    PROBE_STEPS,
    REFERENCE_CPU_LIMIT,
    Outcome,
    capped,
    outcome,
    study_model,
)
from fvsolve.studies.parallel import RunQueue, RunRequest
from fvsolve.studies.resolution import (
    basin_fields,
    basins,
    cell_counts,
    cell_keys_of,
    greatest_wave_rate,
    pipes_with_cells,
    project_to,
    scaled,
    total_cells,
)
from fvsolve.studies.resolution import delay_lines as delayed

REFINEMENT = 4  # ratio of cells to those of the finest run under study
# ratio of cells for characteristics at Courant number 1, whose steps are cheap
CHARACTERISTICS_REFINEMENT = 16
# (scheme, method, step control, its value, ratio of cells, limiter) for each kind of case, the best first.
WAVES = (
    ("upwind5", "rk4", "courant", 0.8, REFINEMENT),
    ("weno5", "ssp-rk3", "courant", 0.9, REFINEMENT),
    ("upwind", "euler", "courant", 1.0, CHARACTERISTICS_REFINEMENT),
)
# only one scheme is above first order with cavities, so the references differ by limiters
SEPARATION = (
    ("muscl", "ssp-rk3", "courant", 0.5, REFINEMENT, "van-leer"),
    ("muscl", "rk4", "courant", 0.5, REFINEMENT, "minmod"),
)
STIFF = (
    ("upwind5", "rodas-5p", "rtol", 1e-8, REFINEMENT),
    ("weno5", "radau-iia-5", "rtol", 1e-8, REFINEMENT),
)
LUMPED = ((None, "radau-iia-9", "rtol", 1e-12, 1), (None, "rodas-5p", "rtol", 1e-11, 1))
# explicit -> methods of high order
ALTERNATIVES = {True: ("dormand-prince", "tsitouras"), False: ("radau-iia-5", "esdirk-5")}
TOLERANCE_FRACTION = 0.01  # greatest ratio of the tolerance of a reference to that under study
LEAST_RTOL = 1e-13
# ratio of tolerances of successive refinements, equal to halving steps at order 5
TOLERANCE_RATIO = 10.0**1.5
ORDERS = 0.5, 5.0  # limits of the observed order
SAFETY = 1.5  # safety factor on the extrapolated error
MEASURES = ("trajectory", "greatest", "end", "overshoot")
ROUNDING = 1e-15  # relative to the size of a quantity


@dataclass(frozen=True)
class Reference:
    """Reference solution of a study.

    kind : "exact" | "finer" | "function"; words : description of the reference
    fields : fields(model) -> averages over the cells of `model` at the end, {pipe: (pressure [Pa], flow [m3/s]),
    ("basin", name): float64[quantities, cells]}
    rows : rows(run) -> float64[k, probes]  reference values of the probes of a run at its rows; NaN if not known
    spans : pipe -> range of its pressure over the run [Pa], as far as known
    own_error : variable -> {"L1", "L2", "max"}  error of the reference [SI]
    uncertainty : error of the reference relative to ranges, with that of extremes (`extremes_distance`) as `overshoot`.
    Both errors are at least the error from refinements, and the difference to the second reference if there is one.
    second : description of the second reference; failures : reasons of reference runs that did not finish
    run : the run that is the reference, or the most accurate run if the reference is an exact solution; None if no run
    was made
    """

    kind: str
    words: str
    fields: Callable
    rows: Callable
    spans: dict[str, float] = field(default_factory=dict)
    own_error: dict[str, dict[str, float]] = field(default_factory=dict)
    uncertainty: Distance = field(default_factory=lambda: Distance(0.0, 0.0, 0.0, 0.0))
    second: str = ""
    failures: tuple[str, ...] = ()
    run: Outcome | None = None


def capped_outcome(case, keys: Mapping) -> Outcome:
    """Outcome of a case with changed keys; its run is stopped after REFERENCE_CPU_LIMIT seconds of CPU time."""
    return outcome(case, keys, run=capped(REFERENCE_CPU_LIMIT))


def find_reference(
    case,
    finest: Mapping | None = None,
    *,
    opinions: int | None = None,
    exclude_own: bool = False,
    way: str = "both",
    stiff: bool = False,
    exact: bool = True,
    lines: bool = False,
    run: Callable = capped_outcome,
    progress: Callable[[str], None] = lambda text: None,
    queue: RunQueue | None = None,
    stages: tuple[dict, ...] = (),
) -> Reference:
    """Find the most accurate reference for runs of a case with the keys `finest` or coarser ones.

    finest : overrides with the resolution of the finest run under study
    opinions : number of kinds of reference runs (default all); a second kind shows errors that the first kind hides
    exclude_own : True if scheme and method of the case are under study, so that references with others are preferred
    way : "both", or "time" if only the step is under study, so that the reference has the cells and scheme of the case
    lines : True if delay lines are under study, so that the reference has cells, with any scheme and method
    stiff : True if a time scale other than waves limits explicit steps
    exact : True to use the solution named in [exact] of the case, if it applies
    run : run(case, keys) -> `Outcome`; queue : `RunQueue` that makes the runs instead of `run`
    stages : overrides that turn the case of the queue into `case`, in order; progress : called with a text
    Raises FvsolveError if too few references remain: none, or only one unless `opinions` is 1. An exact solution counts
    if at least one kind of runs reaches the end.
    """
    from fvsolve.case import load

    case = load(case, finest or {})
    use_exact = exact and case.exact is not None and not (way == "time" and pipes_with_cells(case))
    exact_result = exact_reference(case) if use_exact else None
    if exact_result is not None and opinions == 1:
        return exact_result
    kinds = candidates(case, exclude_own, way, stiff, lines)
    references = []
    failures = []
    first = list(itertools.islice(kinds, opinions))
    if queue is not None:
        run = submit_ahead(queue, (*stages, dict(finest or {})), first, progress)
    for name, trials in itertools.chain(first, kinds):
        if len(references) == opinions:
            break
        progress(name)
        runs = []
        while len(runs) < len(trials) and all(outcome_of_trial.ok for outcome_of_trial in runs):
            runs.append(run(case, trials[len(runs)]))
        if runs[-1].ok:
            references.append(reference_of_refinements(name, runs))
        else:
            failures.append(f"{name}: {runs[-1].reason}")
    if exact_result is not None and references:
        nearest_run = min(references, key=_uncertainty)
        references.insert(0, replace(exact_result, spans=nearest_run.spans, run=nearest_run.run))
    if len(references) < min(2, opinions or 2):
        text = f"the reference run failed, so no error is known ({'; '.join(failures)})"
        raise FvsolveError(
            f"{text}; try another method, an earlier end of the run, or [exact] in the case"
        )
    return best_reference(references, tuple(failures))


def submit_ahead(
    queue: RunQueue, stages: tuple[dict, ...], kinds: Sequence, report: Callable[[str], None]
) -> Callable:
    """Compute all runs of some kinds ahead (see `RunQueue.run_ahead`); returns run(case, keys), which gives outcomes.

    kinds : kinds of reference runs as from `candidates`; stages : overrides that turn the case of the queue into that
    of the study, in order; report : called with the descriptions of the kinds
    """
    report(", ".join(name for name, _ in kinds))
    by_level = zip(*(trials for _, trials in kinds), strict=True)
    for _ in queue.run_ahead(
        [RunRequest(capped_outcome, trial, stages) for level in by_level for trial in level]
    ):
        pass
    return lambda case, keys: queue(case, RunRequest(capped_outcome, keys, stages))


def best_reference(references: Sequence[Reference], failures: tuple[str, ...] = ()) -> Reference:
    """Reference with the least uncertainty of the trajectory error.

    Its uncertainty and own error are raised to its difference from the second best reference where that is larger.
    failures : reasons of reference runs that did not finish
    """
    first, *later = sorted(references, key=_uncertainty)
    if not later:
        return replace(first, failures=failures)
    second_reference, doubt = later[0], asdict(first.uncertainty)
    difference = asdict(distance(second_reference.run, first))
    difference["overshoot"] = extremes_distance(second_reference.run, first)
    doubt |= {key: float(np.nanmax([0.0, difference[key], doubt[key]])) for key in MEASURES}
    own = {
        name: {
            norm: max(error, first.own_error.get(name, {}).get(norm, 0.0))
            for norm, error in norms.items()
        }
        for name, norms in error_norms(second_reference.run, first).items()
    }
    uncertainty = Distance(**doubt | {"worst": difference["worst"]})
    return replace(
        first,
        own_error=own,
        uncertainty=uncertainty,
        second=second_reference.words,
        failures=failures,
    )


def _uncertainty(reference: Reference) -> float:
    """Uncertainty of a reference for the trajectory error (mean over time, see `Distance`); infinite if not known."""
    return (
        reference.uncertainty.trajectory
        if math.isfinite(reference.uncertainty.trajectory)
        else math.inf
    )


# exact ------------------------------------------------------------------------------------------------------------


def exact_reference(case) -> Reference:
    """Reference from the solution named in [exact] of a case. Raises FvsolveError if its values overflow."""
    from fvsolve.core.run import model_of

    model = model_of(case)
    try:
        solution = room.solution(case, initial_values(model))
    except OverflowError as error:
        raise FvsolveError(f'[exact] name = "{case.exact.name}": {error}') from None
    return reference_of_solution(solution, "exact", f'exact solution "{case.exact.name}"')


def reference_of_solution(solution: room.Solution, kind: str, words: str) -> Reference:
    """Reference from a solution, evaluated (and cached) on cells and times of runs; kind, words : as in `Reference`."""
    cells, times = {}, {}

    def fields_of(model) -> dict:
        for pipe in model.pipes:
            if (pipe.name, pipe.cells) not in cells:
                cells[pipe.name, pipe.cells] = solution.averages(
                    pipe.name, pipe.edges, model.case.numerics.end
                )
        return {pipe.name: cells[pipe.name, pipe.cells] for pipe in model.pipes}

    def rows_of(run: Outcome) -> np.ndarray:
        t, probes = run.rows[:, 0].copy(), run.model.case.probes
        # two equal times, before and after a jump, are moved apart
        offset = 1e-12 * max(1e-300, float(np.ptp(t)))
        repeated = np.flatnonzero(np.diff(t) == 0.0)
        t[repeated] -= offset
        t[repeated + 1] += offset
        at = t.tobytes(), run.probes
        if at not in times:
            times[at] = np.column_stack([solution.probe(probe, t) for probe in probes] or [[]])
        return times[at]

    return Reference(kind, words, fields_of, rows_of)


def initial_values(model) -> room.ExactStart:
    """Initial pressures of the nodes [Pa] and initial flows of the links [m3/s] of a model."""
    rho, tables = model.case.properties.density, model.tables
    flows = {pipe.name: row["flow"] for pipe, row in zip(model.pipes, tables.pipes, strict=True)}
    flows |= {
        name: row["flow"] for name, row in zip(model.column_names, tables.columns, strict=True)
    }
    flows |= {name: row["flow"] for name, row in zip(model.valve_names, tables.valves, strict=True)}
    pressures = zip(model.node_names, tables.nodes["pressure"], strict=True)
    return room.ExactStart(
        {n: float(p) for n, p in pressures}, {n: float(m) / rho for n, m in flows.items()}
    )


# finer runs -------------------------------------------------------------------------------------------------------


def candidates(
    case, judged: bool, way: str, stiff: bool, lines: bool = False
) -> Iterator[tuple[str, list[dict]]]:
    """Kinds of reference runs, best first: (description, overrides of three runs from coarse to fine).

    judged : True if scheme and method of the case are under study; way, stiff, lines : as in `find_reference`
    """
    numerics, cells = case.numerics, cell_counts(case)
    if way == "time" and (cells or basins(case) or delayed(case)):
        yield smaller_steps(case)
        return
    has_all = {scheme for scheme, *_ in WAVES} <= {*case.schemes}
    table = LUMPED if not cells else SEPARATION if not has_all else STIFF if stiff else WAVES
    # prefer other schemes or methods; without characteristics, which may equal the scheme under study
    if judged:
        is_own = [
            numerics.scheme == entry[0] if cells else numerics.method == entry[1] for entry in table
        ]
        ordered = sorted(zip(is_own, table, strict=True), key=lambda pair: pair[0])
        table = [entry for _, entry in ordered if entry[4] != CHARACTERISTICS_REFINEMENT]
    # in cells, only characteristics carry jumps without error
    if lines and has_all and any(jump for _, jump in study_model(case).breaks):
        table = sorted(WAVES, key=lambda entry: entry[4] != CHARACTERISTICS_REFINEMENT)
    for scheme, method, control, size, factor, *limiters in table:
        if judged and cells and not lines:
            method = alternative_method(METHODS[method].explicit, numerics.method)
        if control == "rtol" and numerics.rtol is not None:
            size = max(LEAST_RTOL, min(size, TOLERANCE_FRACTION * numerics.rtol))
        fixed = {"numerics.scheme": scheme} if cells else {}
        fixed |= {"numerics.method": method} | dict(
            zip(["numerics.limiter"], limiters, strict=False)
        )
        trials = [
            fixed
            | {f"numerics.{control}": size if cells else size * TOLERANCE_RATIO**k}
            | cell_keys_of(scaled(cells, factor / 2**k))
            for k in (2, 1, 0)
        ]
        if factor != CHARACTERISTICS_REFINEMENT or _is_characteristic(case, trials[0]):
            names = " ".join([scheme or "", *limiters])
            yield run_text(case, names, scaled(cells, factor), method, control, size), trials


def smaller_steps(case) -> tuple[str, list[dict]]:
    """Reference runs with smaller steps or tolerances: (description, overrides of three runs from coarse to fine).

    Cells and scheme are those of the case; the method is another one, explicit or implicit like the method of the case
    (implicit for `auto`).
    """
    numerics, cells = case.numerics, cell_counts(case)
    judged = METHODS.get(numerics.method)
    method = alternative_method(judged is not None and judged.explicit, numerics.method)
    if numerics.rtol is not None:
        control, finest = "rtol", TOLERANCE_FRACTION * numerics.rtol
        sizes = [max(LEAST_RTOL, finest * TOLERANCE_RATIO ** (k - 2)) for k in (2, 1, 0)]
    else:
        rate = greatest_wave_rate(case, cells)
        step = min(numerics.step or numerics.courant / rate, 1.0 / rate)
        control, sizes = "step", [step / share for share in (1, 2, 4)]
    words = run_text(case, numerics.scheme, cells, method, control, sizes[-1])
    return words, [{"numerics.method": method, f"numerics.{control}": size} for size in sizes]


def alternative_method(explicit: bool, judged: str) -> str:
    """Name of a method of high order other than `judged`; explicit : True for an explicit method."""
    return next(name for name in ALTERNATIVES[explicit] if name != judged)


def run_text(case, scheme: str, cells, method: str, control: str, size: float) -> str:
    """Description such as "upwind5 on 800 cells with rk4 at courant 0.8"; cells : as from `cell_counts`."""
    where = f"{scheme} on {total_cells(case, cells)} cells with " if cells else ""
    return f"{where}{method} at {control} {size:.4g}"


def _is_characteristic(case, keys: dict) -> bool:
    """True if waves cross exactly one cell in nearly every step (Courant number 1), without numerical diffusion.

    The number of steps is that of a run of at most about `PROBE_STEPS` steps. keys : overrides of the case
    """
    model = study_model(case, keys)
    if model.meshed:
        return False
    rates, span = model.wave_rates, case.numerics.end - case.numerics.start
    if np.ptp(rates) > 1e-9 * rates.max():
        return False
    steps = outcome(model, run=capped(steps=PROBE_STEPS)).counts["steps"]
    return steps <= 1.01 * span * rates.max() + 2 * len(model.breaks) + 2


def reference_of_refinements(words: str, runs: Sequence[Outcome]) -> Reference:
    """Reference `words` from the finest of three runs; its own error is extrapolated from their differences."""
    coarse, middle, fine = runs
    fine_reference = reference_of_run(fine, words)
    middle_reference = reference_of_run(middle, words)
    coarse_errors = error_norms(coarse, middle_reference)
    fine_errors = error_norms(middle, fine_reference)
    own = {
        name: {
            norm: SAFETY
            * extrapolated_error(coarse_errors[name][norm], d, ROUNDING * variable_size(fine, name))
            for norm, d in norms.items()
        }
        for name, norms in fine_errors.items()
    }
    coarse_errors = asdict(distance(coarse, middle_reference))
    fine_errors = asdict(distance(middle, fine_reference))
    doubt = {
        key: SAFETY * extrapolated_error(coarse_errors[key], fine_errors[key])
        for key in MEASURES[:3]
    }
    uncertainty = Distance(**doubt, overshoot=SAFETY * extremes_distance(middle, fine_reference))
    return replace(fine_reference, own_error=own, uncertainty=uncertainty)


def reference_of_run(run: Outcome, words: str = "") -> Reference:
    """Reference from a run, without an estimate of the error of the run; words : description.

    Its function `rows` raises FvsolveError if the rows of both runs are at different times.
    """

    def fields_of(model) -> dict:
        sums = wave_sums(run)
        cells = {pipe.name: pipe.cells for pipe in model.pipes}
        averages = {
            name: tuple(cell_averages(entry, cells[name]) for entry in pair)
            for name, pair in sums.items()
        }
        by_pipe = fields(model, averages)
        pairs = zip(run.model.meshed, model.meshed, strict=True)
        return by_pipe | {
            ("basin", other.name): project_to(entry, [*basin_fields(entry, run.y).values()], other)
            for entry, other in pairs
        }

    def rows_of(other: Outcome) -> np.ndarray:
        t = run.rows[:, 0]
        if other.rows.shape[0] != t.size or not np.allclose(
            other.rows[:, 0], t, rtol=1e-12, atol=1e-300
        ):
            raise FvsolveError(
                "rows of two runs are at different times; set the key output.every in the case"
            )
        by_probe = {name: run.rows[:, 1 + k] for k, name in enumerate(run.probes)}
        missing = np.full(t.size, np.nan)
        return np.column_stack(
            [by_probe.get(name, missing) for name in other.probes] or [np.zeros((t.size, 0))]
        )

    return Reference("finer", words, fields_of, rows_of, pressure_ranges(run.envelope), run=run)


def extrapolated_error(before: float, after: float, least: float = 0.0) -> float:
    """Error of the finest of three runs, each with twice the resolution of the previous: after / (2^p - 1).

    before : difference of the first two runs; after : difference of the last two runs
    p : order from the ratio of both differences, limited to `ORDERS`; least : least error, from rounding
    """
    if after <= least:
        return least
    order = min(max(math.log2(max(before, after) / after), ORDERS[0]), ORDERS[1])
    return max(least, after / (2.0**order - 1.0))

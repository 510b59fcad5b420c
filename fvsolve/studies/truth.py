"""What errors are measured against, found once: an exact solution, or runs that are finer and made otherwise.

`truth(case, finest)` finds the best there is for rows up to the keys `finest`. A `Truth` says end fields as cell
averages on any cells, probe rows at the rows of a run, and how far off it is itself. Knows no order and no cost.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from fvsolve import exact as room
from fvsolve.errors import FvsolveError
from fvsolve.steppers.methods import METHODS
from fvsolve.studies.accuracy.cells import basins, counts, greatest_rate, in_cells, keys, scaled, total
from fvsolve.studies.accuracy.plane import contents, lowered
from fvsolve.studies.accuracy.timing import finished, lasting, tasted
from fvsolve.studies.distance import (
    Distance,
    averaged,
    differences,
    distance,
    extremes_apart,
    fields,
    size_of,
    spans_of,
    waves,
)
from fvsolve.studies.errands import Errand, Errands
from fvsolve.studies.lines import lines as delayed
from fvsolve.studies.outcome import Outcome, outcome, prepared

FINER = 4  # times the cells of the finest run that is judged
SHARP = 16  # the same for characteristics at Courant 1, whose steps cost next to nothing
# Scheme, method, step control and its size, times the cells, limiter: by what the scene is, the best first.
WAVES = (
    ("upwind5", "rk4", "courant", 0.8, FINER),
    ("weno5", "ssp-rk3", "courant", 0.9, FINER),
    ("upwind", "euler", "courant", 1.0, SHARP),
)
CAVITIES = (  # where one scheme alone is above first order, limiters make the difference
    ("muscl", "ssp-rk3", "courant", 0.5, FINER, "van-leer"),
    ("muscl", "rk4", "courant", 0.5, FINER, "minmod"),
)
STIFF = (("upwind5", "rodas-5p", "rtol", 1e-8, FINER), ("weno5", "radau-iia-5", "rtol", 1e-8, FINER))
LUMPED = ((None, "radau-iia-9", "rtol", 1e-12, 1), (None, "rodas-5p", "rtol", 1e-11, 1))
HIGH = {True: ("dormand-prince", "tsitouras"), False: ("radau-iia-5", "esdirk-5")}  # beside one method; explicit: True
SHARE = 0.01  # of a tolerance that is judged, at most
LEAST_RTOL = 1e-13
HALVED = 10.0**1.5  # times the tolerance of the next finer run: what halving does to an error of order 5
ORDERS = 0.5, 5.0  # between which the order is that halvings show
SURE = 1.5  # times what they show is the least that a truth may be off
MEASURES = ("trajectory", "greatest", "end", "overshoot")
ROUNDING = 1e-15  # of the size of a quantity


@dataclass(frozen=True)
class Truth:
    """What a study measures against.

    kind : "exact" | "finer" | "function"; words : what it is, for a table
    fields : fields(model) -> {pipe: (pressure [Pa], flow [m3/s]), ("basin", name): float64[quantities, n]}, averages
    over that model's cells at the end
    rows : rows(run) -> float64[k, probes], what the probes of a run should show at its rows; NaN: not known
    spans : pipe -> range of its pressure over the run [Pa], as far as known
    own : variable -> {"L1", "L2", "max"}, how far off it is [SI]; doubt : the same in ranges, of the worst component;
    both no less than what halvings show and, where there is a second opinion, how far that is apart
    second : the second opinion; told : what became of runs that did not finish
    run : the run that it is, or that stands beside an exact solution
    """

    kind: str
    words: str
    fields: Callable
    rows: Callable
    spans: dict[str, float] = field(default_factory=dict)
    own: dict[str, dict[str, float]] = field(default_factory=dict)
    doubt: Distance = field(default_factory=lambda: Distance(0.0, 0.0, 0.0, 0.0))
    second: str = ""
    told: tuple[str, ...] = ()
    run: Outcome | None = None


def once(case, keys: Mapping) -> Outcome:
    """A run that is given up where it costs too much."""
    return outcome(case, keys, run=lasting)


def truth(
    case, finest: Mapping | None = None, *, opinions: int | None = None, judged: bool = False, way: str = "both",
    stiff: bool = False, exact: bool = True, lines: bool = False, run: Callable = once,
    tell: Callable[[str], None] = lambda what: None, errands: Errands | None = None, stages: tuple[dict, ...] = (),
) -> Truth:  # fmt: skip
    """The best truth for runs of a case with the keys `finest` or coarser ones.

    opinions : how many kinds of runs there are to be, two at least to know what kinds share; all if None
    judged : whether the case's own scheme and method are what is judged, so that others are to find it
    way : "both", or "time": the same cells and scheme, where what is judged is the step alone
    lines : whether it is delay lines that are judged, by the same case in cells: any way to follow these will do
    stiff : whether something else than waves holds explicit steps back
    exact : whether the solution that the case names under [exact] is used, where it says what is judged
    errands : who makes the runs, in place of `run`; stages : what was set on their case to make this one
    Raises FvsolveError where no run, or of several none but one, reaches the end.
    """
    from fvsolve.case import load

    case = load(case, finest or {})
    known = exact_truth(case) if exact and case.exact is not None and not (way == "time" and in_cells(case)) else None
    if known is not None and opinions == 1:
        return known
    kinds, found, told = candidates(case, judged, way, stiff, lines), [], []
    first = list(itertools.islice(kinds, opinions))
    if errands is not None:
        run = sent_ahead(errands, (*stages, dict(finest or {})), first, tell)
    for name, trials in itertools.chain(first, kinds):
        if len(found) == opinions:
            break
        tell(name)
        runs = []
        while len(runs) < len(trials) and all(one.ok for one in runs):
            runs.append(run(case, trials[len(runs)]))
        if runs[-1].ok:
            found.append(of_halvings(name, runs))
        else:
            told.append(f"{name}: {runs[-1].reason}")
    if known is not None and found:
        beside = min(found, key=_doubt)
        found.insert(0, replace(known, spans=beside.spans, run=beside.run))
    if len(found) < min(2, opinions or 2):
        text = f"the reference run failed, so no error is known ({'; '.join(told)})"
        raise FvsolveError(f"{text}; state another method, a run that ends earlier, or [exact] in the case")
    return judge(found, tuple(told))


def sent_ahead(errands: Errands, stages: tuple[dict, ...], kinds: Sequence, tell: Callable[[str], None]) -> Callable:
    """run(case, keys) by those who make errands, who have been given all runs of these kinds, the coarse ones first."""
    tell(", ".join(name for name, _ in kinds))
    by_level = zip(*(trials for _, trials in kinds), strict=True)
    for _ in errands.ahead([Errand(once, trial, stages) for level in by_level for trial in level]):
        pass
    return lambda case, keys: errands(case, Errand(once, keys, stages))


def judge(found: Sequence[Truth], told: tuple[str, ...] = ()) -> Truth:
    """The truth with the least doubt, which is no less than how far the next one is apart."""
    first, *others = sorted(found, key=_doubt)
    if not others:
        return replace(first, told=told)
    second, doubt = others[0], asdict(first.doubt)
    apart = asdict(distance(second.run, first)) | {"overshoot": extremes_apart(second.run, first)}
    doubt |= {key: float(np.nanmax([0.0, apart[key], doubt[key]])) for key in MEASURES}
    own = {name: {norm: max(one, first.own.get(name, {}).get(norm, 0.0)) for norm, one in norms.items()}
           for name, norms in differences(second.run, first).items()}  # fmt: skip
    return replace(first, own=own, doubt=Distance(**doubt | {"worst": apart["worst"]}), second=second.words, told=told)


def _doubt(one: Truth) -> float:
    """How far off one may be over the trajectory, without end where that is not known."""
    return one.doubt.trajectory if math.isfinite(one.doubt.trajectory) else math.inf


# exact ------------------------------------------------------------------------------------------------------------


def exact_truth(case) -> Truth:
    """The solution that a case names under [exact]."""
    from fvsolve.run import model_of

    model = model_of(case)
    try:
        known = room.solution(case, start_of(model))
    except OverflowError as error:
        raise FvsolveError(f'[exact] name = "{case.exact.name}": {error}') from None
    return of_solution(known, "exact", f'exact solution "{case.exact.name}"')


def of_solution(known: room.Solution, kind: str, words: str) -> Truth:
    """A solution read where runs are; what was found is remembered by cells and by times."""
    cells, times = {}, {}

    def fields_of(model) -> dict:
        for pipe in model.pipes:
            if (pipe.name, pipe.cells) not in cells:
                cells[pipe.name, pipe.cells] = known.averages(pipe.name, pipe.edges, model.case.numerics.end)
        return {pipe.name: cells[pipe.name, pipe.cells] for pipe in model.pipes}

    def rows_of(run: Outcome) -> np.ndarray:
        t, probes = sided(run.rows[:, 0]), run.model.case.probes
        at = t.tobytes(), run.probes
        if at not in times:
            times[at] = np.column_stack([known.probe(probe, t) for probe in probes] or [[]])
        return times[at]

    return Truth(kind, words, fields_of, rows_of)


def sided(t: np.ndarray) -> np.ndarray:
    """Times of rows, moved by a hair to the left for the first and to the right for the second row of a jump."""
    moved, hair = t.copy(), 1e-12 * max(1e-300, float(np.ptp(t)))
    twice = np.flatnonzero(np.diff(t) == 0.0)
    moved[twice] -= hair
    moved[twice + 1] += hair
    return moved


def start_of(model) -> room.ExactStart:
    """Pressures and flows that a model starts from."""
    rho, tables = model.case.properties.density, model.tables
    flows = {pipe.name: row["flow"] for pipe, row in zip(model.pipes, tables.pipes, strict=True)}
    flows |= {name: row["flow"] for name, row in zip(model.column_names, tables.columns, strict=True)}
    flows |= {name: row["flow"] for name, row in zip(model.valve_names, tables.valves, strict=True)}
    pressures = zip(model.node_names, tables.nodes["pressure"], strict=True)
    return room.ExactStart({n: float(p) for n, p in pressures}, {n: float(m) / rho for n, m in flows.items()})


# finer runs -------------------------------------------------------------------------------------------------------


def candidates(case, judged: bool, way: str, stiff: bool, lines: bool = False) -> Iterator[tuple[str, list[dict]]]:
    """(what a kind of run is in words, the keys of three of it from coarse to fine), the best kind first."""
    numerics, cells = case.numerics, counts(case)
    if way == "time" and (cells or basins(case) or delayed(case)):
        yield of_steps(case)
        return
    able = {scheme for scheme, *_ in WAVES} <= {*case.schemes}
    table = LUMPED if not cells else CAVITIES if not able else STIFF if stiff else WAVES
    if judged:  # by others, and not by characteristics, which the schemes that they are judged with may be
        own = [numerics.scheme == one[0] if cells else numerics.method == one[1] for one in table]
        table = [one for _, one in sorted(zip(own, table, strict=True), key=lambda pair: pair[0]) if one[4] != SHARP]
    if lines and able and any(jump for _, jump in prepared(case).breaks):  # which nothing else in cells carries
        table = sorted(WAVES, key=lambda one: one[4] != SHARP)
    for scheme, method, control, size, factor, *limiters in table:
        if judged and cells and not lines:
            method = other_method(METHODS[method].explicit, numerics.method)
        if control == "rtol" and numerics.rtol is not None:
            size = max(LEAST_RTOL, min(size, SHARE * numerics.rtol))
        fixed = {"numerics.scheme": scheme} if cells else {}
        fixed |= {"numerics.method": method} | dict(zip(["numerics.limiter"], limiters, strict=False))
        trials = [fixed | {f"numerics.{control}": size if cells else size * HALVED**k}
                  | keys(scaled(cells, factor / 2**k)) for k in (2, 1, 0)]  # fmt: skip
        if factor != SHARP or _sharp(case, trials[0]):
            yield (
                worded(case, " ".join([scheme or "", *limiters]), scaled(cells, factor), method, control, size),
                trials,
            )


def of_steps(case) -> tuple[str, list[dict]]:
    """The same cells and scheme, steps or a tolerance much smaller by another method of its kind."""
    numerics, cells = case.numerics, counts(case)
    judged = METHODS.get(numerics.method)
    method = other_method(judged is not None and judged.explicit, numerics.method)
    if numerics.rtol is not None:
        control, sizes = "rtol", [max(LEAST_RTOL, SHARE * numerics.rtol * HALVED ** (k - 2)) for k in (2, 1, 0)]
    else:
        rate = greatest_rate(case, cells)
        step = min(numerics.step or numerics.courant / rate, 1.0 / rate)
        control, sizes = "step", [step / share for share in (1, 2, 4)]
    words = worded(case, numerics.scheme, cells, method, control, sizes[-1])
    return words, [{"numerics.method": method, f"numerics.{control}": size} for size in sizes]


def other_method(explicit: bool, judged: str) -> str:
    """A method of high order that is not the one judged."""
    return next(name for name in HIGH[explicit] if name != judged)


def worded(case, scheme: str, cells, method: str, control: str, size: float) -> str:
    """A run in words."""
    where = f"{scheme} on {total(case, cells)} cells with " if cells else ""
    return f"{where}{method} at {control} {size:.4g}"


def _sharp(case, keys: dict) -> bool:
    """Whether nearly every step carries a wave through just one cell, so that nothing blurs it."""
    model = prepared(case, keys)
    if model.basins:
        return False
    rates, span = model.wave_rates, case.numerics.end - case.numerics.start
    if np.ptp(rates) > 1e-9 * rates.max():
        return False
    return finished(model, tasted).counts["steps"] <= 1.01 * span * rates.max() + 2 * len(model.breaks) + 2


def of_halvings(words: str, runs: Sequence[Outcome]) -> Truth:
    """The last and finest of three runs, with its own error from how far they lie apart."""
    first, middle, last = runs
    found, between = of_run(last, words), of_run(middle, words)
    before, after = differences(first, between), differences(middle, found)
    own = {name: {norm: SURE * remaining(before[name][norm], d, ROUNDING * size_of(last, name))
                  for norm, d in norms.items()} for name, norms in after.items()}  # fmt: skip
    before, after = asdict(distance(first, between)), asdict(distance(middle, found))
    doubt = {key: SURE * remaining(before[key], after[key]) for key in ("trajectory", "greatest", "end")}
    return replace(found, own=own, doubt=Distance(**doubt, overshoot=SURE * extremes_apart(middle, found)))


def of_run(run: Outcome, words: str = "") -> Truth:
    """A run as what others are measured against."""

    def fields_of(model) -> dict:
        fine = waves(run)
        cells = {pipe.name: pipe.cells for pipe in model.pipes}
        found = fields(model, {name: tuple(averaged(one, cells[name]) for one in pair) for name, pair in fine.items()})
        pairs = zip(run.model.basins, model.basins, strict=True)
        return found | {("basin", other.name): lowered(one, [*contents(one, run.y).values()], other)
                        for one, other in pairs}  # fmt: skip

    def rows_of(other: Outcome) -> np.ndarray:
        t = run.rows[:, 0]
        if other.rows.shape[0] != t.size or not np.allclose(other.rows[:, 0], t, rtol=1e-12, atol=1e-300):
            raise FvsolveError("rows of two runs are not at the same times; state [output] every")
        known = {name: run.rows[:, 1 + k] for k, name in enumerate(run.probes)}
        missing = np.full(t.size, np.nan)
        return np.column_stack([known.get(name, missing) for name in other.probes] or [np.zeros((t.size, 0))])

    return Truth("finer", words, fields_of, rows_of, spans_of(run.envelope), run=run)


def remaining(before: float, after: float, least: float = 0.0) -> float:
    """Error of the finest of three runs, each twice as fine as the one before: d / (2^p - 1), the order p of both d."""
    if after <= least:
        return least
    order = min(max(math.log2(max(before, after) / after), ORDERS[0]), ORDERS[1])
    return max(least, after / (2.0**order - 1.0))

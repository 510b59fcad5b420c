"""What judges the runs of a chart: an exact solution and far finer runs of other kinds. Knows runs; draws nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass

import numpy as np

from fvsolve.case.case import Case
from fvsolve.errors import FvsolveError
from fvsolve.studies.accuracy.distance import Distance, Track, distance, extremes_apart, ranges, track
from fvsolve.studies.accuracy.reference import exact_reference
from fvsolve.studies.accuracy.setting import cell_keys
from fvsolve.studies.accuracy.timing import finished, lasting, tasted
from fvsolve.studies.outcome import Outcome, prepared

FINER = 4  # times the cells of the finest run that is judged
SHARP = 16  # the same for characteristics at Courant 1, whose steps cost next to nothing
PIPES = (
    ("upwind", "euler", "courant", 1.0, SHARP),
    ("upwind5", "rk4", "courant", 0.8, FINER),
    ("weno5", "ssp-rk3", "courant", 0.9, FINER),
)
CAVITIES = (  # where one scheme alone is above first order, limiters make the difference
    ("muscl", "ssp-rk3", "courant", 0.5, FINER, "van-leer"),
    ("muscl", "rk4", "courant", 0.5, FINER, "minmod"),
)
STIFF = (("upwind5", "rodas-5p", "rtol", 1e-7, FINER), ("weno5", "radau-iia-5", "rtol", 1e-6, FINER))
TIGHT = (("radau-iia-9", 1e-12), ("rodas-5p", 1e-11))  # without cells
ORDERS = 0.5, 5.0  # between which the order is that halvings show
SURE = 1.5  # times what they show is the least that a floor can be


@dataclass(frozen=True)
class Witness:
    """A candidate: what it is called, its last and finest run, and its own error as its halvings tell."""

    name: str
    track: Track
    own: Distance
    run: Outcome | None = None


@dataclass(frozen=True)
class Witnesses:
    """The run that errors are measured against, the second one, and the floor: how far the two disagree.

    The floor is no less than half as much again as the judge's own error.
    told : what became of candidates that did not finish
    """

    name: str
    second: str
    judge: Track
    floor: Distance
    told: tuple[str, ...] = ()


def witnesses(
    case: Case, finest: int | None, stiff: bool = False, progress: Callable[[str], None] = lambda name: None
) -> Witnesses:
    """Runs all candidates; the one with the least own error judges, the exact solution if the case names one.

    finest : cells of the finest run that is to be judged, of the pipe a wave takes longest to cross
    stiff : whether something else than waves holds explicit steps back: the references are implicit then
    """
    found, told = [], []
    for name, runs in candidates(case, finest, stiff).items():
        progress(name)
        try:
            found.append(_witness(case, name, runs))
        except FvsolveError as error:
            told.append(str(error))
    if case.exact is not None and found:
        found.append(exact(case, min(found, key=_doubt)))
    if len(found) < 2:
        raise FvsolveError("no two references reached the end, so no error is known; " + "; ".join(told))
    chosen = judged(found, tuple(told))
    if np.isnan(ranges(chosen.judge.rows)).all():
        told = "every probe stands still, so an error has no range; probe what moves, or run longer"
        raise FvsolveError(f"{case.name}: {told}")
    return chosen


def judged(found: Sequence[Witness], told: tuple[str, ...] = ()) -> Witnesses:
    """The witness with the least own error, the next one, and the floor between them."""
    first, second = sorted(found, key=_doubt)[:2]
    apart = distance(second.track, first.track)
    errors = ("trajectory", "greatest", "end")
    floor = {key: float(np.nanmax([0.0, getattr(apart, key), SURE * getattr(first.own, key)])) for key in errors}
    spread = extremes_apart(second.track, first.track)
    floor["overshoot"] = float(np.nanmax([0.0, spread, SURE * first.own.overshoot]))
    return Witnesses(first.name, second.name, first.track, Distance(**floor, worst=apart.worst), told)


def exact(case: Case, numeric: Witness) -> Witness:
    """The exact solution that a case names under [exact], read where a run is."""
    model = numeric.run.model
    truth = exact_reference(case)
    rows = np.column_stack([numeric.run.rows[:, 0], truth.rows(numeric.run)])
    waves = {}
    for k, (name, (pressure, flow)) in enumerate(truth.fields(model).items()):
        row = model.tables.pipes[k]
        total = (pressure - model.profiles[k]) * row["admittance"]
        difference = case.properties.density * flow - row["flow"]
        waves[name] = np.array([total + difference, total - difference]) / 2.0
    found = Track(numeric.track.probes, rows, waves, numeric.track.spans)
    return Witness(truth.words, found, Distance(0.0, 0.0, 0.0, 0.0))


def own_error(coarse: Track, middle: Track, fine: Track) -> Distance:
    """Error of the finest of three runs, each on half the cells of the next: d / (2^p - 1), the order p from both d."""
    before, last = asdict(distance(coarse, middle)), asdict(distance(middle, fine))
    found = {}
    for key in ("trajectory", "greatest", "end"):
        rate = math.log2(before[key] / last[key]) if before[key] > 0.0 and last[key] > 0.0 else ORDERS[1]
        found[key] = last[key] / (2.0 ** min(max(rate, ORDERS[0]), ORDERS[1]) - 1.0)
    found["overshoot"] = extremes_apart(middle, fine)
    return Distance(**found, worst=last["worst"])


def _doubt(one: Witness) -> float:
    """How far off it may be; without halvings, that is by a tolerance, its place in the list decides."""
    return one.own.trajectory if math.isfinite(one.own.trajectory) else math.inf


def candidates(case: Case, finest: int | None, stiff: bool) -> dict[str, list[dict]]:
    """Name -> keys of its runs, from coarse to fine; with equal cell times characteristics at Courant 1 too."""
    if finest is None:
        return {
            f"{method}, rtol {rtol:g}": [{"numerics.method": method, "numerics.rtol": rtol}] for method, rtol in TIGHT
        }
    found = {}
    able = {scheme for scheme, *_ in PIPES} <= {*case.schemes}
    for scheme, method, control, size, factor, *limiters in (STIFF if stiff else PIPES) if able else CAVITIES:
        keys = {"numerics.scheme": scheme, "numerics.method": method, f"numerics.{control}": size}
        keys |= dict(zip(["numerics.limiter"], limiters, strict=False))
        runs = [keys | cell_keys(case, finest * factor // 2**k) for k in (2, 1, 0)]
        if factor == FINER or _sharp(case, runs[0]):
            found[" ".join([scheme, *limiters, method, f"on {factor * finest} cells"])] = runs
    return found


def _sharp(case: Case, keys: dict) -> bool:
    """Whether nearly every step carries a wave through just one cell, so that nothing blurs it."""
    model = prepared(case, keys)
    if model.basins:
        return False
    rates, span = model.wave_rates, case.numerics.end - case.numerics.start
    if np.ptp(rates) > 1e-9 * rates.max():
        return False
    return finished(model, tasted).counts["steps"] <= 1.01 * span * rates.max() + 2 * len(model.breaks) + 2


def _witness(case: Case, name: str, runs: list[dict]) -> Witness:
    """A candidate, run; FvsolveError says why it did not finish."""
    tracks = []
    for keys in runs:
        found = finished(prepared(case, keys), lasting)
        if not found.ok:
            raise FvsolveError(f"{name}: {found.reason}")
        tracks.append(track(found))
    own = own_error(*tracks) if len(tracks) == 3 else Distance(math.nan, math.nan, math.nan)
    return Witness(name, tracks[-1], own, found)

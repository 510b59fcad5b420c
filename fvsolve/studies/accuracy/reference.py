"""What errors are measured against: an exact solution, or runs that are finer and made otherwise. Knows no order.

`reference(case, finest)` finds the best there is for rows up to the keys `finest`; a `Reference` says end fields as
cell averages on any cells, probe rows at the rows of a run, and how far off it is itself.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from fvsolve import exact as room
from fvsolve.errors import FvsolveError
from fvsolve.steppers.methods import METHODS
from fvsolve.studies.accuracy.apart import NORMS, averaged, differences, fields, recorded, size_of, waves
from fvsolve.studies.accuracy.cells import basins, counts, greatest_rate, keys, pipes, scaled, total
from fvsolve.studies.accuracy.plane import contents, lowered
from fvsolve.studies.accuracy.timing import lasting
from fvsolve.studies.outcome import Outcome, outcome

SCHEMES = ("upwind5", "weno5", "upwind3", "fromm", "muscl")  # of references, in this order; with cavities the last
EXPLICIT, IMPLICIT = ("dormand-prince", "tsitouras"), ("radau-iia-5", "esdirk-5")  # methods of references
FINER = 4  # two levels
COURANT = 0.8
SURE = 1.25  # times what halving shows
WORTH = 10.0  # times the reference's own error that an error must be to mean anything
ROUNDING = 1e-15  # of the size of a quantity


@dataclass(frozen=True)
class Reference:
    """What a study measures against.

    kind : "exact" | "finer" | "function"; words : what it is, for a table
    fields : fields(model) -> {pipe: (pressure [Pa], flow [m3/s]), ("basin", name): float64[quantities, n]}, averages
    over that model's cells at the end
    rows : rows(run) -> float64[k, probes], what the probes of a run should show at its rows; NaN: not known
    own : variable -> {"L1", "L2", "max"}, its own error as far as it is known; empty for an exact solution
    """

    kind: str
    words: str
    fields: Callable
    rows: Callable
    own: dict[str, dict[str, float]] = field(default_factory=dict)
    doubt: str = ""

    def floor(self, variable: str, norm: str) -> float:
        """Error below which, times ten, a comparison in a variable says nothing."""
        return self.own.get(variable, {}).get(norm, 0.0)


def reference(
    case, finest: Mapping | None = None, avoid: tuple[str, ...] = (), way: str = "both", exact: bool = True,
    finer: int = FINER,
) -> Reference:  # fmt: skip
    """The best reference for runs of a case with the keys `finest` or coarser ones.

    finest : keys of the finest row, as `outcome` takes them; avoid : schemes that are judged, which it does not use
    way : "both" or "space": cells that are `finer` times as many, by another scheme and method. "time": the same cells
    and scheme, steps or a tolerance much smaller by another method: what is judged is the step alone.
    exact : whether the solution that the case names under [exact] is used, where it says what is judged
    Raises FvsolveError where the finer run fails.
    """
    from fvsolve.case import load

    case = load(case, recorded(case, dict(finest or {})))
    if exact and case.exact is not None and not (way == "time" and pipes(case)):
        return exact_reference(case)
    return finer_reference(case, avoid or (case.numerics.scheme,), way, finer)


# exact ------------------------------------------------------------------------------------------------------------


def exact_reference(case) -> Reference:
    """The solution that a case names under [exact]."""
    from fvsolve.run import model_of

    model = model_of(case)
    try:
        truth = room.solution(case, start_of(model))
    except OverflowError as error:
        raise FvsolveError(f'[exact] name = "{case.exact.name}": {error}') from None
    return Reference("exact", f'exact solution "{case.exact.name}"', ExactFields(truth), ExactRows(truth))


@dataclass(frozen=True)
class ExactFields:
    """Cell averages of an exact solution, remembered by their cells."""

    truth: room.Solution
    known: dict = field(default_factory=dict)

    def __call__(self, model) -> dict:
        t = model.case.numerics.end
        for pipe in model.pipes:
            if (pipe.name, pipe.cells) not in self.known:
                self.known[pipe.name, pipe.cells] = self.truth.averages(pipe.name, pipe.edges, t)
        return {pipe.name: self.known[pipe.name, pipe.cells] for pipe in model.pipes}


@dataclass(frozen=True)
class ExactRows:
    """Probe values of an exact solution, remembered by their times."""

    truth: room.Solution
    known: dict = field(default_factory=dict)

    def __call__(self, run: Outcome) -> np.ndarray:
        t = sided(run.rows[:, 0])
        if t.tobytes() not in self.known:
            probes = run.model.case.probes
            self.known[t.tobytes()] = np.column_stack([self.truth.probe(probe, t) for probe in probes] or [[]])
        return self.known[t.tobytes()]


def sided(t: np.ndarray) -> np.ndarray:
    """Times of rows, moved by a hair to the left for the first and to the right for the second row of a jump."""
    moved, hair = t.copy(), 1e-12 * max(1e-300, float(np.ptp(t)))
    twice = np.flatnonzero(np.diff(t) == 0.0)
    moved[twice] -= hair
    moved[twice + 1] += hair
    return moved


def start_of(model) -> room.Start:
    """Pressures and flows that a model starts from."""
    rho, tables = model.case.properties.density, model.tables
    flows = {pipe.name: row["flow"] for pipe, row in zip(model.pipes, tables.pipes, strict=True)}
    flows |= {name: row["flow"] for name, row in zip(model.column_names, tables.columns, strict=True)}
    flows |= {name: row["flow"] for name, row in zip(model.valve_names, tables.valves, strict=True)}
    pressures = zip(model.node_names, tables.nodes["pressure"], strict=True)
    return room.Start({n: float(p) for n, p in pressures}, {n: float(m) / rho for n, m in flows.items()})


# finer runs -------------------------------------------------------------------------------------------------------


def once(case, keys: Mapping) -> Outcome:
    """A run that is given up where it costs too much."""
    return outcome(case, keys, run=lasting)


def finer_reference(case, avoid: tuple[str, ...], way: str, finer: int = FINER, run: Callable = once) -> Reference:
    """A run that is finer and made otherwise, with its own error from two coarser ones of its kind."""
    runs = [run(case, otherwise(case, avoid, way, share * finer / FINER)) for share in (1, 2, 4)]
    bad = next((one for one in runs if not one.ok), None)
    if bad is not None:
        raise FvsolveError(f"the reference run failed ({bad.reason}); state another method, or [exact] in the case")
    last = of_run(runs[2])
    first_step, second_step = differences(runs[0], of_run(runs[1])), differences(runs[1], last)
    own = {name: {norm: remaining(first_step[name][norm], second_step[name][norm], size_of(runs[2], name))
                  for norm in NORMS} for name in second_step}  # fmt: skip
    return Reference("finer", words_of(runs[2]), last.fields, last.rows, own)


def otherwise(case, avoid, way: str, share: float) -> dict:
    """Keys that make a case `share` times as fine, by another method and, in space, another scheme."""
    numerics, cells = case.numerics, counts(case)
    method = other_method(case)
    found: dict = {"numerics.method": method}
    if way != "time" and cells:
        cells = scaled(cells, share)
        able = [name for name in SCHEMES if name in case.schemes]
        found["numerics.scheme"] = next((name for name in able if name not in avoid), able[0])
        found |= keys(cells)
        if numerics.rtol is not None and not METHODS[method].explicit:
            return found | {"numerics.rtol": max(1e-13, min(1e-8, 0.01 * numerics.rtol))}
        if basins(case):  # whose waves may run quicker than at the start
            return found | {"numerics.courant": COURANT}
        return found | {"numerics.step": COURANT / greatest_rate(case, cells)}
    if numerics.rtol is not None:
        return found | {"numerics.rtol": max(1e-13, numerics.rtol * 0.1 ** (2.0 + 1.5 * math.log2(share)))}
    there = bool(cells or basins(case))
    step = numerics.step or numerics.courant / greatest_rate(case, cells)
    return found | {"numerics.step": (min(step, 1.0 / greatest_rate(case, cells)) if there else step) / share}


def other_method(case) -> str:
    """A method of high order that is not the one judged, of its kind: explicit, or implicit."""
    judged = METHODS.get(case.numerics.method)
    kind = EXPLICIT if judged is not None and judged.explicit else IMPLICIT
    return next(name for name in kind if name != case.numerics.method)


def of_run(run: Outcome) -> Reference:
    """A run as what others are measured against."""

    def fields_of(model) -> dict:
        fine = waves(run.model, run.y)
        cells = {pipe.name: pipe.cells for pipe in model.pipes}
        found = fields(model, {name: tuple(averaged(one, cells[name]) for one in pair) for name, pair in fine.items()})
        pairs = zip(run.model.basins, model.basins, strict=True)
        return found | {
            ("basin", other.name): lowered(one, list(contents(one, run.y).values()), other) for one, other in pairs
        }

    def rows_of(other: Outcome) -> np.ndarray:
        t = run.rows[:, 0]
        if other.rows.shape[0] != t.size or not np.allclose(other.rows[:, 0], t, rtol=1e-12, atol=1e-300):
            raise FvsolveError("rows of two runs are not at the same times; state [output] every")
        known = {name: run.rows[:, 1 + k] for k, name in enumerate(run.probes)}
        missing = np.full(t.size, np.nan)
        return np.column_stack([known.get(name, missing) for name in other.probes] or [np.zeros((t.size, 0))])

    return Reference("finer", words_of(run), fields_of, rows_of)


def words_of(run: Outcome) -> str:
    """A run in words."""
    numerics = run.model.case.numerics
    many = total(run.model.case, counts(run.model.case))
    cells = f"{many} cells, {numerics.scheme}, " if many else ""
    name = next(key for key in ("rtol", "step", "courant") if getattr(numerics, key) is not None)
    steps = f"{name} = {getattr(numerics, name):.4g}{' s' * (name == 'step')}"
    return f"reference run: {cells}{numerics.method}, {steps}"


def remaining(first: float, second: float, size: float) -> float:
    """Error of the finest of three runs, each twice as fine as the one before, from how far they lie apart."""
    least = ROUNDING * size
    if second <= least:
        return least
    order = min(max(math.log2(max(first, second) / second), 0.5), 6.0)
    return max(least, SURE * second / (2.0**order - 1.0))

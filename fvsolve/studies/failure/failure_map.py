"""A failure map: methods against steps, or against a key, each square run for real. Knows cases; leaves the verdict."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from fvsolve.case import load
from fvsolve.doors import CALL, COUNT, NAMES, NUMBER, NUMBERS, ROW, TABLE, TEXT, Kind, door, is_row
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.schemes import LIMITED
from fvsolve.studies.errands import Errand, Errands
from fvsolve.studies.failure.columns import Columns, as_cells, columns, default_schemes
from fvsolve.studies.failure.eigen_limit import greatest_step, spectrum
from fvsolve.studies.failure.lines_limit import LinesLimit
from fvsolve.studies.failure.verdict import SKIPPED, Measures, measured, verdict
from fvsolve.studies.failure.watched import watched
from fvsolve.studies.lines import lines, settled
from fvsolve.studies.outcome import Progress, names, without_basins
from fvsolve.studies.points import OUT, Points, kept_in
from fvsolve.studies.truth import Truth, truth

METHODS = ("euler", "ssp-rk3", "rk4", "implicit-euler", "trapezoid", "gauss-4", "radau-iia-5")
TOLERANCE = 0.02  # mean error over the range of a probe
MOST_IMPLICIT = 50_000  # steps
ROWS = 1000


@dataclass(frozen=True)
class Square:
    """One run of the map; `limit` is the greatest stable step [s] by eigenvalues, None where there was no spectrum."""

    scheme: str
    method: str
    column: int
    step: float | None
    courant: float | None
    verdict: str
    measures: Measures
    halved_error: float | None
    limit: float | None


@dataclass(frozen=True)
class FailureMap:
    """key : what changes along the columns ("step" [s] or a key of the case); values : the columns.

    squares : schemes x methods x columns, in that order; reference : what errors are measured against; doubt : how
    far its check is from it; limited : the schemes whose limits are those of their weights in smooth flow; lines :
    whether there are delay lines
    """

    case: str
    key: str
    values: tuple
    schemes: tuple[str, ...]
    methods: tuple[str, ...]
    squares: tuple[Square, ...]
    tolerance: float
    reference: str
    doubt: float
    wave_rate: float | None
    limited: tuple[str, ...]
    lines: bool = False

    def row(self, scheme: str, method: str) -> list[Square]:
        """The squares of a method under a scheme, by column."""
        return [one for one in self.squares if (one.scheme, one.method) == (scheme, method)]

    def plain(self) -> dict:
        """As JSON says it: SI, None where there is no number."""
        said = {one.name: getattr(self, one.name) for one in fields(self) if one.name != "squares"}
        return said | {"squares": [_plain(one) for one in self.squares]}


KEY = Kind(
    lambda given: is_row(given, lambda one: True) and len(given) == 2 and TEXT.holds(given[0]) and ROW.holds(given[1]),
    'a key and its values, for example ("links.main.cells", [20, 40])',
)


@door(
    schemes=NAMES,
    methods=NAMES,
    courants=NUMBERS,
    steps=NUMBERS,
    key=KEY,
    tolerance=NUMBER,
    out=OUT,
    progress=CALL,
    set=TABLE,
    jobs=COUNT,
    dask=TEXT,
)
def failures(
    case, schemes: Sequence[str] | None = None, methods: Sequence[str] | None = None,
    courants: Sequence[float] | None = None, steps: Sequence[float] | None = None,
    key: tuple[str, Sequence] | None = None, tolerance: float = TOLERANCE, out: str | Path | Points | None = None,
    progress: Progress | None = None, set: Mapping | None = None, jobs: int = 1, dask: str | None = None,
) -> FailureMap:  # fmt: skip
    """Run every method, under every scheme, at every step (or value of a key), and say what became of each run.

    case : what `load` takes; schemes, methods : see `default_schemes` and METHODS; courants or steps [s] : the
    columns; with key = (NAME, values) these are the columns, and one step, one Courant number, or else the case's own
    control holds.
    out : folder where finished squares are kept and found again; progress(done, total, next)
    tolerance : mean error over the range of a probe; jobs, dask : who makes the runs, as in `sweep`
    Raises FvsolveError for names and numbers that are none, and where the reference is no better than the tolerance
    asks.
    """
    case = load(case, dict(set or {}))
    without_basins(case, "map")
    case = load(case, settled(case))
    if not (math.isfinite(tolerance) and tolerance > 0):
        raise FvsolveError(f"--tolerance {tolerance} is none; wanted a positive number, for example 0.02")
    base = {"output.every": (case.numerics.end - case.numerics.start) / ROWS}
    across = columns(case, base, courants, steps, key)
    schemes, methods = _known(names(schemes) or default_schemes(case, across), names(methods) or METHODS)
    asked = [(scheme, method, k) for scheme in schemes for method in methods for k in range(len(across.sets))]
    squares, tell = [], progress or (lambda *_: None)
    with kept_in(out) as points, Errands(case, jobs, dask) as errands:
        trials = Trials(case, base, across, tolerance, points, errands)
        if not errands.alone:
            trials.ahead(asked, tell)
        for scheme, method, k in asked:
            tell(len(squares), len(asked), f"{scheme}, {method}, {across.label(k)}")
            squares.append(trials.square(scheme, method, k))
        found = trials.reference(0)
        words = f"{found.words}, checked by {found.second}"
    limited = tuple(name for name in schemes if name in LIMITED and across.wave_rate)
    return FailureMap(
        case.name, across.name, tuple(across.values), schemes, methods, tuple(squares), tolerance,
        words, trials.doubt, across.wave_rate, limited, bool(lines(case)),
    )  # fmt: skip


class Trials:
    """Runs of one map: what they are measured against, and what becomes of them."""

    def __init__(self, case, base: dict, across: Columns, tolerance: float, points: Points, errands: Errands) -> None:
        self.case, self.base, self.across, self.tolerance, self.points = case, base, across, tolerance, points
        self.errands, self.looking = errands, False
        self.span = across.span
        self._references: dict[int, Truth] = {}
        self._spectra: dict[tuple, np.ndarray | None] = {}
        self._limits: dict[tuple, float | None] = {}
        self._of_lines: dict[int, LinesLimit] = {}

    @property
    def doubt(self) -> float:
        """The greatest of all references."""
        return max(one.doubt.trajectory for one in self._references.values())

    def reference(self, k: int) -> Truth:
        """Of column k; one for all where only the step changes. FvsolveError where it is worth too little."""
        at = k if self.across.keys(k) else 0
        if at not in self._references:
            finest, stiff = {**self.base, **self.across.keys(k)}, self.across.stiff(k)
            finest |= as_cells(self.case, finest)
            found = truth(self.case, finest, stiff=stiff, errands=self.errands)
            doubt = found.doubt.trajectory
            if doubt > self.tolerance / 2:
                raise FvsolveError(
                    "the reference is no better than the runs it judges: it may be off by "
                    f"{doubt:.2g} of the range of {found.doubt.worst or 'a probe'}, the tolerance is "
                    f"{self.tolerance:g}; give --tolerance {4 * doubt:.1g}, or more cells; or leave it out of "
                    "output.probes, if what it shows is rounding"
                )
            self._references[at] = found
        return self._references[at]

    def limit(self, scheme: str, method: str, k: int) -> float | None:
        """The predicted greatest step [s], by eigenvalues and by what stores give back to delay lines; None where there
        is no spectrum."""
        at = scheme, k if self.across.keys(k) else 0
        if at not in self._spectra:
            self._spectra[at] = spectrum(self.case, {**self.base, **self.across.keys(k), "numerics.scheme": scheme})
        found = self._spectra[at]
        if (method, *at) not in self._limits:
            both = None if found is None else greatest_step(method, found, self.span), self.lines_limit(method, *at)
            self._limits[method, *at] = None if None in both else min(both)
        return self._limits[method, *at]

    def lines_limit(self, method: str, scheme: str, k: int) -> float | None:
        """The same by waves between stores and delay lines; inf where there are no lines, or no fixed steps."""
        set = {**self.base, **self.across.keys(k), "numerics.scheme": scheme}
        steps = [one["numerics.step"] for one in self.across.sets if "numerics.step" in one]
        if not steps or not lines(load(self.case, set)):
            return math.inf
        if k not in self._of_lines:
            self._of_lines[k] = LinesLimit(self.case, set, steps)
        return self._of_lines[k](method)

    def square(self, scheme: str, method: str, k: int) -> Square:
        """One run, and where its error is too great the same by shorter steps."""
        trial = {**self.base, **self.across.sets[k], "numerics.scheme": scheme, "numerics.method": method}
        step, waves = trial.get("numerics.step"), self.across.wave_rate
        limit, errors = self.limit(scheme, method, k), []

        def shorter() -> Measures:
            found = self.measure({**trial, **_shorter(self.case, trial, 2 ** (len(errors) + 1))}, k)
            errors.append(found.error)
            return found

        if step and self.span / step > MOST_IMPLICIT and not _explicit(method):
            one, word = Measures(f"{self.span / step:.0f} implicit steps", False), SKIPPED
        else:
            one = self.measure(trial, k)
            word = verdict(one, shorter, self.tolerance)
        courant = step * waves if step and waves else None
        return Square(scheme, method, k, step, courant, word, one, errors[0] if errors else None, limit)

    def ahead(self, asked: Sequence[tuple[str, str, int]], tell: Progress) -> None:
        """Have others make the runs that squares ask for: all that is known to be wanted, then by what came of these
        the same with shorter steps."""
        while wanted := self.wanted(asked):
            wanted.sort(key=lambda one: -one.trial.get("numerics.step", 0.0))  # the dearest last
            errands = [Errand(watched, one.keys) for one in wanted]
            for count, at in enumerate(self.errands.ahead(errands), 1):
                self.measure(wanted[at].trial, wanted[at].column)
                tell(count, len(wanted), f"{len(asked)} squares")

    def wanted(self, asked: Sequence[tuple[str, str, int]]) -> list[Wanted]:
        """Runs that are not known and that squares want next, each once."""
        found, self.looking = {}, True
        for one in asked:
            try:
                self.square(*one)
            except Wanted as run:
                found[repr(run.trial)] = run
        self.looking = False
        return [*found.values()]

    def measure(self, trial: dict, k: int) -> Measures:
        """A run against its reference, or what was found of it before; `Wanted` where that is to be made first."""
        every = max(trial["output.every"], trial.get("numerics.step", 0.0))  # not what is read between two steps
        reference, run = self.reference(k), {**trial, "output.every": every}
        extra = {"study": "map", "set": trial, "reference": reference.words}
        if self.looking and self.points.find(self.case, extra) is None:
            raise Wanted(trial, run, k)

        def make() -> dict:
            return asdict(measured(*self.errands(self.case, Errand(watched, run)), reference))

        found = self.points.get(self.case, extra, make)
        return Measures(**{name: math.nan if value is None else value for name, value in found.items()})


class Wanted(Exception):
    """A trial whose run, with these keys, is to be made first; column : whose reference it is measured against."""

    def __init__(self, trial: dict, keys: dict, column: int) -> None:
        super().__init__(repr(trial))
        self.trial, self.keys, self.column = trial, keys, column


def _shorter(case, trial: dict, times: int) -> dict:
    """The same, with steps `times` shorter; where the error rules, with as much less of it, squared."""
    numerics = case.numerics
    for name, factor in (("step", times), ("courant", times), ("rtol", times**2)):
        if f"numerics.{name}" in trial:
            return {f"numerics.{name}": trial[f"numerics.{name}"] / factor}
    for name, factor in (("step", times), ("courant", times), ("rtol", times**2)):
        if getattr(numerics, name) is not None:
            return {f"numerics.{name}": getattr(numerics, name) / factor}
    return {}


def _explicit(method: str) -> bool:
    from fvsolve.steppers import METHODS as KNOWN

    return method not in KNOWN or KNOWN[method].explicit


def _known(*asked: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    from fvsolve.case.sections import MethodNames
    from fvsolve.schemes import SCHEMES

    for what, given, known in zip(("scheme", "method"), asked, (tuple(SCHEMES), tuple(MethodNames())), strict=True):
        for name in given:
            if name not in known:
                raise FvsolveError(f'no {what} named "{name}"{did_you_mean(name, known)}')
    return tuple(dict.fromkeys(asked[0])), tuple(dict.fromkeys(asked[1]))


def _plain(one: Square) -> dict:
    said = asdict(one)
    said |= said.pop("measures")
    limit = one.limit
    said["limit"] = None if limit is None or math.isinf(limit) else limit
    return said

"""How fast the error of a case falls with refinement, row by row. Knows rows and errors; draws and prints nothing."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from fvsolve.doors import CALL, COUNT, NAMES, TABLE, TEXT, door
from fvsolve.errors import FvsolveError, did_you_mean
from fvsolve.shown import Shown
from fvsolve.studies.accuracy.afford import affordable
from fvsolve.studies.accuracy.fit import Fit
from fvsolve.studies.accuracy.refine import Level, Plan
from fvsolve.studies.outcome import Progress, names, without_basins
from fvsolve.studies.points import OUT, Points, kept_in

REFERENCES = ("auto", "exact", "finer", "richardson")


@dataclass(frozen=True)
class Row:
    """One row: its level, its errors by variable and norm, and what it cost; a failed run has its reason."""

    level: Level
    errors: dict[str, dict[str, float]]
    seconds: float
    rhs: int
    cell_updates: int
    steps: int
    reason: str = ""

    def plain(self) -> dict:
        """As plain data."""
        said = {"cells": self.level.cells, "size": self.level.size, "step": self.level.step, "set": self.level.set}
        cost = {"seconds": self.seconds, "rhs": self.rhs, "cell_updates": self.cell_updates, "steps": self.steps}
        return {**said, **cost, "reason": self.reason, "errors": self.errors}


@dataclass(frozen=True, repr=False)
class Order(Shown):
    """An order study of one scheme and method.

    fits : variable -> {"L1" | "L2" | "max": Fit}; own : variable -> norm -> the reference's own error
    units : of variables that are no probe's
    kind : of the reference, "exact" | "finer" | "richardson" | "function"; notes : what must be said of the numbers
    """

    case: str
    scheme: str
    method: str
    plan: Plan
    kind: str
    words: str
    rows: tuple[Row, ...]
    fits: dict[str, dict[str, Fit]]
    own: dict[str, dict[str, float]]
    notes: tuple[str, ...] = ()
    units: dict[str, str] = field(default_factory=dict)

    picture = "fvsolve.studies.accuracy.picture:order_picture"

    def said(self) -> str:
        return f"of {self.case!r}: {self.scheme}, {self.method}, {len(self.rows)} rows against {self.kind}"

    def listed(self) -> dict[str, list]:
        """Of every row: cells, step [s], cost, and errors by variable and norm, SI."""
        found: dict[str, list] = {"cells": [row.level.cells for row in self.rows]}
        found |= {"size": [row.level.size for row in self.rows], "step": [row.level.step for row in self.rows]}
        for name, norms in self.fits.items():
            for norm in norms:
                key = f"{name} {norm}"
                found[key] = [row.errors.get(name, {}).get(norm, math.nan) for row in self.rows]
        return found | {"rhs": [row.rhs for row in self.rows], "seconds": [row.seconds for row in self.rows]}

    @property
    def variables(self) -> tuple[str, ...]:
        """What was compared."""
        return tuple(self.fits)

    def plain(self) -> dict:
        """As plain data, SI."""
        return {
            "case": self.case, "scheme": self.scheme, "method": self.method, "refine": self.plan.way,
            "measure": self.plan.measure, "how": self.plan.words, "reference": {"kind": self.kind, "words": self.words,
            "own_error": self.own}, "rows": [row.plain() for row in self.rows],
            "fits": {name: {norm: one.plain() for norm, one in found.items()} for name, found in self.fits.items()},
            "notes": list(self.notes),
        }  # fmt: skip


@door(
    set=TABLE,
    refine=TEXT,
    key=TEXT,
    levels=COUNT,
    cells=COUNT,
    schemes=NAMES,
    methods=NAMES,
    against=TEXT,
    initial=CALL,
    source=CALL,
    exact=CALL,
    out=OUT,
    progress=CALL,
)
def order(
    case, set: Mapping | None = None, *, refine: str | None = None, key: str | None = None, levels: int | None = None,
    cells: int | None = None, schemes: str | Sequence[str] | None = None, methods: str | Sequence[str] | None = None,
    against: str = "auto", initial: Callable | None = None, source: Callable | None = None,
    exact: Callable | None = None, out: str | Path | Points | None = None, progress: Progress | None = None,
) -> Order | list[Order]:  # fmt: skip
    """Errors of a case over a refinement and the order at which they fall; a list where several are asked for.

    case, set : as `run` takes them; refine, key, levels, cells : as `studies.refine.plan` takes them
    schemes, methods : in place of the case's, names or lists of them
    against : "auto" (exact if the case names one, else finer, with basins richardson), "exact", "finer" (two levels
    finer by another scheme and method) or "richardson" (each row against the next)
    initial : initial(pipe, x) -> pressure [Pa], flow [m3/s] at the start, x float64[k] [m]
    source : source(pipe, x, t) -> mass [kg/s/m] and momentum [kg/s2] fed per length; both are averaged over cells
    exact : exact(pipe, x, t) -> pressure [Pa], flow [m3/s]; the reference, and the start where `initial` is left out
    out : folder where finished rows are kept and found again; progress(done, total, next)
    Raises CaseError, FvsolveError.
    """
    if against not in REFERENCES:
        raise FvsolveError(
            f'against = "{against}" is unknown{did_you_mean(against, REFERENCES)}; wanted {", ".join(REFERENCES)}'
        )
    tell, found = progress or (lambda *_: None), []
    pairs = [(scheme, method) for scheme in names(schemes) or [None] for method in names(methods) or [None]]
    with kept_in(out) as points:
        for scheme, method in pairs:
            given = {"numerics.scheme": scheme, "numerics.method": method}
            settings = {**(set or {}), **{name: value for name, value in given.items() if value is not None}}
            found.append(
                _order(case, settings, refine, key, levels, cells, against, (initial, source, exact), points, tell)
            )
    return found[0] if len(found) == 1 else found


def _order(case, settings: Mapping, refine, key, levels, cells, against, given, points, progress) -> Order:
    """The study of one scheme and method; given : initial, source and exact solution, or None for each."""
    from fvsolve.case import load

    case = load(case, settings)
    made = affordable(case, refine, key, levels, cells, against, points)
    if given == (None, None, None):
        from fvsolve.studies.accuracy.judge import Judge

        return Judge(case, made, against).study(points, progress)
    from fvsolve.studies.accuracy.manufactured import Manufactured

    without_basins(case, "order by functions of pipes")
    return Manufactured(case, made, against, *given).study(points, progress)

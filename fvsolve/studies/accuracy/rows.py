"""What a study of order found: its rows, the orders fitted to them, and what they say. Knows numbers; runs nothing."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fvsolve.shown import Shown
from fvsolve.studies.accuracy.fit import Fit
from fvsolve.studies.accuracy.refine import Level, Plan


@dataclass(frozen=True)
class OrderRow:
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
    units : of variables that are no probe's; shown : variable, or "length" -> (size of 1 SI, unit) of its errors as a
    person reads them, SI if it is not there
    kind : of the reference, "exact" | "finer" | "richardson" | "function"; notes : what must be said of the numbers
    """

    case: str
    scheme: str
    method: str
    plan: Plan
    kind: str
    words: str
    rows: tuple[OrderRow, ...]
    fits: dict[str, dict[str, Fit]]
    own: dict[str, dict[str, float]]
    notes: tuple[str, ...] = ()
    units: dict[str, str] = field(default_factory=dict)
    shown: dict[str, tuple[float, str]] = field(default_factory=dict)

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

    def told(self, variable: str) -> tuple[float, str]:
        """(size of 1 SI, unit) of errors of a variable as a person reads them."""
        from fvsolve.studies.accuracy.picture import unit

        return self.shown.get(variable) or (1.0, unit(variable, self.units))

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

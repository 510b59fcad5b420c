"""Results of an order study: rows, fitted orders and notes."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from fvsolve.display import Displayable
from fvsolve.studies.accuracy.fit import Fit
from fvsolve.studies.accuracy.refine import Level, Plan


@dataclass(frozen=True)
class OrderRow:
    """Row of an order study: a refinement level with its errors and cost.

    errors : variable -> {"L1" | "L2" | "max": error [SI]}; seconds : time of the run [s]
    rhs : number of evaluations of the rates; reason : reason of a failed run, else empty
    """

    level: Level
    errors: dict[str, dict[str, float]]
    seconds: float
    rhs: int
    cell_updates: int
    steps: int
    reason: str = ""

    def plain(self) -> dict:
        """Return the row as plain data."""
        level = {"cells": self.level.cells, "size": self.level.size, "step": self.level.step, "set": self.level.set}
        cost = {"seconds": self.seconds, "rhs": self.rhs, "cell_updates": self.cell_updates, "steps": self.steps}
        return {**level, **cost, "reason": self.reason, "errors": self.errors}


@dataclass(frozen=True, repr=False)
class Order(Displayable):
    """Order study of one scheme and method.

    rows : refinement levels with errors, from coarse to fine; fits : variable -> {"L1" | "L2" | "max": Fit}
    kind : kind of the reference, "exact" | "finer" | "richardson" | "function"; words : description of the reference
    own_error : variable -> {"L1" | "L2" | "max": error of the reference itself [SI]}; notes : remarks on the numbers
    units : SI units of the variables of basins
    shown : variable -> (factor from SI, unit) of its printed errors, and "length" -> that of printed cell sizes; errors
    of variables without an entry are printed in SI
    """

    case: str
    scheme: str
    method: str
    plan: Plan
    kind: str
    words: str
    rows: tuple[OrderRow, ...]
    fits: dict[str, dict[str, Fit]]
    own_error: dict[str, dict[str, float]]
    notes: tuple[str, ...] = ()
    units: dict[str, str] = field(default_factory=dict)
    shown: dict[str, tuple[float, str]] = field(default_factory=dict)

    picture = "fvsolve.studies.accuracy.order_picture:order_picture"

    def summary_line(self) -> str:
        return f"of {self.case!r}: {self.scheme}, {self.method}, {len(self.rows)} rows against {self.kind}"

    def table_columns(self) -> dict[str, list]:
        """Columns of the table, header -> value of each row: cells, size, step [s], errors in SI, and cost."""
        columns: dict[str, list] = {"cells": [row.level.cells for row in self.rows]}
        columns |= {"size": [row.level.size for row in self.rows], "step": [row.level.step for row in self.rows]}
        for name, norms in self.fits.items():
            for norm in norms:
                key = f"{name} {norm}"
                columns[key] = [row.errors.get(name, {}).get(norm, math.nan) for row in self.rows]
        return columns | {"rhs": [row.rhs for row in self.rows], "seconds": [row.seconds for row in self.rows]}

    def error_unit(self, variable: str) -> tuple[float, str]:
        """(factor from SI, unit) of the printed errors of a variable."""
        from fvsolve.studies.accuracy.order_picture import variable_unit

        return self.shown.get(variable) or (1.0, variable_unit(variable, self.units))

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the compared variables."""
        return tuple(self.fits)

    def plain(self) -> dict:
        """Return the study as plain data, SI."""
        return {
            "case": self.case, "scheme": self.scheme, "method": self.method, "refine": self.plan.way,
            "measure": self.plan.measure, "how": self.plan.words, "reference": {"kind": self.kind, "words": self.words,
            "own_error": self.own_error}, "rows": [row.plain() for row in self.rows],
            "fits": {name: {norm: fit.plain() for norm, fit in fits.items()} for name, fits in self.fits.items()},
            "notes": list(self.notes),
        }  # fmt: skip

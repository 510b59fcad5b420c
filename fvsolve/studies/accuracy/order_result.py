"""Results of an order study: rows, fitted orders and notes."""

import math
from dataclasses import dataclass, field

from fvsolve.display import Displayable
from fvsolve.studies.accuracy.fit import Fit
from fvsolve.studies.accuracy.order_picture import variable_unit
from fvsolve.studies.accuracy.refine import Level, Plan
from fvsolve.studies.result_table import PlainData


@dataclass(frozen=True)
class OrderRow(PlainData):
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

    json = """cells=level.cells size=level.size step=level.step set=level.set
              seconds rhs cell_updates steps reason errors"""


@dataclass(frozen=True, repr=False)
class Order(Displayable, PlainData):
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
    json = "case scheme method refine=plan.way measure=plan.measure how=plan.words reference rows fits notes"

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
        return self.shown.get(variable) or (1.0, variable_unit(variable, self.units))

    @property
    def variables(self) -> tuple[str, ...]:
        """Names of the compared variables."""
        return tuple(self.fits)

    @property
    def reference(self) -> dict:
        """Kind, description and error of the reference."""
        return {"kind": self.kind, "words": self.words, "own_error": self.own_error}

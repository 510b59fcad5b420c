"""The picture of an order study, and the words and units in it. Knows studies; leaves the drawing to `draw`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

SHOWN = 3  # variables with a table of their own on the terminal; all are in order.csv
NORMS = ("L1", "L2", "max")
CELLS = "cell size [m]"  # a measure; others, steps and tolerances, are told as they are


def order_picture(one):
    """Errors over the size of cells or steps, a panel a variable, a line a norm: a matplotlib Figure."""
    from fvsolve.draw.order import order_figure

    longer, length = one.shown.get("length", (1.0, "m")) if one.plan.measure == CELLS else (1.0, "")
    measure = CELLS.replace("[m]", f"[{length}]") if length else one.plan.measure
    curves = {}
    for variable, fits in list(one.fits.items())[: 2 * SHOWN]:
        size, own = one.told(variable)
        curves[f"{variable} [{own}]"] = {
            norm: ([size * row.errors.get(variable, {}).get(norm, math.nan) for row in one.rows],
                   replace(fit, constant=size * fit.constant / longer**fit.order)) for norm, fit in fits.items()
        }  # fmt: skip
    sizes = [longer * row.level.size for row in one.rows]
    return order_figure(sizes, curves, measure, f"{one.case}: {title(one)}; {one.words}")


def title(one) -> str:
    """Scheme, method and how it is refined."""
    scheme = f"{one.scheme}, " if one.rows[0].level.cells else ""
    return f"{scheme}{one.method}, {one.plan.words}"


def unit(variable: str, known: Mapping[str, str] = {}) -> str:  # noqa: B006
    """SI unit of a variable, as `known` of a study or its part has it; of a scalar, a label of the case's, none."""
    from fvsolve.units import DIMENSIONS

    return known[variable] if variable in known else DIMENSIONS[dimension_of(variable)].si


def dimension_of(variable: str) -> str:
    """What a variable of pipes, nodes and links is; a number if it is none of theirs."""
    from fvsolve.parts import KINDS

    quantity = variable.split("@")[0].rsplit(".", 1)[-1].rsplit(" ", 1)[-1]
    kinds = [kind for group in KINDS.values() for kind in group.values()]
    return next((own[quantity] for kind in kinds
                 for own in (kind.quantities, getattr(kind, "along", {})) if quantity in own), "number")  # fmt: skip


def differences_in(case, variable: str) -> tuple[float, str]:
    """(size of 1 SI, unit) of differences of a variable, or of lengths, as `[output]` has them."""
    from fvsolve.output.column import column

    own = column("", variable if variable == "length" else dimension_of(variable), case)
    return own.span_from_si(1.0), own.span_unit

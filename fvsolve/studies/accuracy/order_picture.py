"""Picture of an order study, and names and units of its variables."""

import math
from collections.abc import Mapping
from dataclasses import replace

SHOWN_VARIABLES = 3  # variables with a table on the terminal; order.csv contains all
NORMS = ("L1", "L2", "max")
CELLS = "cell size [m]"  # measure that is printed in the units of the case; steps and tolerances are SI


def order_picture(study):
    """matplotlib Figure of errors against cell size or step: a panel for each variable, a line for each norm.

    study : an `Order`; at most twice `SHOWN_VARIABLES` of its variables are drawn
    """
    from fvsolve.draw.accuracy_pictures import order_figure

    length_factor, length = study.shown.get("length", (1.0, "m")) if study.plan.measure == CELLS else (1.0, "")
    measure = CELLS.replace("[m]", f"[{length}]") if length else study.plan.measure
    curves = {}
    for variable, fits in list(study.fits.items())[: 2 * SHOWN_VARIABLES]:
        size, error_unit = study.error_unit(variable)
        curves[f"{variable} [{error_unit}]"] = {
            norm: ([size * row.errors.get(variable, {}).get(norm, math.nan) for row in study.rows],
                   replace(fit, constant=size * fit.constant / length_factor**fit.order)) for norm, fit in fits.items()
        }  # fmt: skip
    sizes = [length_factor * row.level.size for row in study.rows]
    return order_figure(sizes, curves, measure, f"{study.case}: {study_title(study)}; {study.words}")


def study_title(study) -> str:
    """Title of an `Order` study: scheme, method and description of the refinement."""
    scheme = f"{study.scheme}, " if study.rows[0].level.cells else ""
    return f"{scheme}{study.method}, {study.plan.words}"


def variable_unit(variable: str, known: Mapping[str, str] = {}) -> str:  # noqa: B006
    """SI unit of a variable of an order study: from `known` (variable -> unit), otherwise from its dimension."""
    from fvsolve.units import DIMENSIONS

    return known[variable] if variable in known else DIMENSIONS[variable_dimension(variable)].si


def variable_dimension(variable: str) -> str:
    """Dimension of a variable of pipes, nodes or links, such as "pressure"; "number" for other variables."""
    from fvsolve.parts import KINDS

    quantity = variable.split("@")[0].rsplit(".", 1)[-1].rsplit(" ", 1)[-1]
    kinds = [kind for group in KINDS.values() for kind in group.values()]
    return next((quantities[quantity] for kind in kinds
                 for quantities in (kind.quantities, getattr(kind, "along", {}))
                 if quantity in quantities), "number")  # fmt: skip


def error_scale(case, variable: str) -> tuple[float, str]:
    """(factor from SI, unit) of errors of a variable in the units of `[output]`, or of lengths for "length"."""
    from fvsolve.output.unit_columns import column

    result = column("", variable if variable == "length" else variable_dimension(variable), case)
    return result.span_from_si(1.0), result.span_unit

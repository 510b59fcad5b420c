"""Energy created or removed by the numerical method in runs of a case with several schemes and methods."""

from __future__ import annotations

import functools

import numpy as np

from fvsolve.errors import CaseError
from fvsolve.schemes import SCHEMES
from fvsolve.studies.energy.energy_balance import ROUNDING, check_port, energy
from fvsolve.studies.energy.passivity import AUTO, check_names, method_names
from fvsolve.studies.outcome import refusal_text
from fvsolve.studies.result_cache import ResultCache
from fvsolve.studies.result_table import Column

PAIR_COLUMNS = (  # columns of a row
    Column("scheme"),
    Column("method"),
    Column("remainder", words=".4g", head="remainder [J]"),
    Column("scheme_loss", words=".4g", head="by the scheme [J]"),
    Column("step_loss", words=".4g", head="by the step [J]"),
    Column("newton_loss", words=".4g", head="by Newton residuals [J]"),
    Column("least", words=".4g", head="least remainder [J]"),
    Column("relative", words=".4g", head="over throughput"),
    Column("creates", head="creates energy"),
    Column("margin", words=".4g", head="margin at the port [J]"),
    Column("reason", words=lambda row: row["reason"].partition(":")[0], head="run"),
)


def measure_pairs(
    case, schemes=None, methods=None, port: str | None = None, progress=None, points=None, watch=None
) -> list[dict]:
    """Run a case with every pair of scheme and method; returns a row (dict) with the energy remainders of each pair.

    Entries of a row are those of `PAIR_COLUMNS`. remainder, scheme_loss, step_loss, newton_loss : energies at the end
    [J], see `Energy`; least : least value over time of the remainder without Newton residuals [J]
    creates : True if `least` is below zero by more than rounding, or if the run failed; None if it was refused
    margin : least margin of the passivity at the port [J], see `Port`; None without a port
    If the pair was refused, all entries except scheme, method and reason are None.

    schemes, methods : names (default those of the case); progress : called as progress(done, total, next)
    points : `ResultCache` of earlier rows; watch : called as watch(t, seconds, steps) during every run
    A pair that is refused or diverges gives a row with its reason. Raises FvsolveError for unknown names and for a case
    whose energy is not computed (see `Accounts`), and KeyboardInterrupt if a run is interrupted.
    """
    check_port(case, port)
    points = points or ResultCache()
    schemes = check_names(schemes or [case.numerics.scheme], list(SCHEMES), "scheme")
    methods = check_names(methods or [case.numerics.method], [*method_names(), AUTO], "method")
    rows, total = [], len(schemes) * len(methods)
    for scheme in schemes:
        for method in methods:
            if progress is not None:
                progress(len(rows), total, f"{scheme} with {method}")
            pair = {"scheme": scheme, "method": method}
            make = functools.partial(pair_result, case, scheme, method, port, watch)
            rows.append(pair | points.get(case, pair | {"study": "energy", "port": port}, make))
    return rows


def pair_result(case, scheme: str, method: str, port: str | None, watch=None) -> dict:
    """Row of a pair: energy remainders of a run of the case with this scheme and method, see `measure_pairs`."""
    missing = dict.fromkeys(
        ("remainder", "scheme_loss", "step_loss", "newton_loss", "least", "relative", "creates", "margin")
    )
    try:
        result = energy(case, {"numerics.scheme": scheme, "numerics.method": method}, port, watch)
    except CaseError as error:
        return missing | {"reason": refusal_text(error)}
    if result.reason == "interrupted":  # a run ends cleanly at Ctrl-C; the study must end too
        raise KeyboardInterrupt
    losses = [float(values[-1]) for values in result.scheme.values()]
    sound = result.ok and bool(np.all(np.isfinite(result.remainder)))
    least = float(np.min(result.numerical_remainder))
    return missing | {
        "remainder": float(result.remainder[-1]), "scheme_loss": sum(losses), "step_loss": float(result.step[-1]),
        "newton_loss": float(result.newton[-1]),
        "least": least, "relative": result.relative, "creates": not sound or least < -ROUNDING * result.throughput,
        "margin": None if result.port is None else result.port.margin, "reason": result.reason,
    }  # fmt: skip

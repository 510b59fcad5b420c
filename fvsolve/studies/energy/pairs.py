"""A case run by several schemes and methods: what each makes of its energy. Knows runs; prints nothing."""

from __future__ import annotations

import functools

import numpy as np

from fvsolve.errors import CaseError
from fvsolve.schemes import SCHEMES
from fvsolve.studies.energy.energy import ROUNDING, check_port, energy
from fvsolve.studies.energy.passivity import AUTO, checked, method_names
from fvsolve.studies.outcome import refusal
from fvsolve.studies.points import Points
from fvsolve.studies.sheet import Column

PAIR = (  # of a row that was measured
    Column("scheme"),
    Column("method"),
    Column("remainder", words=".4g", head="remainder [J]"),
    Column("scheme_loss", words=".4g", head="by the scheme [J]"),
    Column("step_loss", words=".4g", head="by the step [J]"),
    Column("newton_loss", words=".4g", head="left by Newton [J]"),
    Column("least", words=".4g", head="least on the way [J]"),
    Column("relative", words=".4g", head="of what passed"),
    Column("creates", head="creates energy"),
    Column("margin", words=".4g", head="margin at the port [J]"),
    Column("reason", words=lambda row: row["reason"].partition(":")[0], head="run"),
)


def measured(
    case, schemes=None, methods=None, port: str | None = None, progress=None, points=None, watch=None
) -> list[dict]:
    """One row per scheme and method of a case that is run with them: what they make of its energy.

    creates : whether the remainder, less what Newton leaves, is below zero by more than rounding at any row, None where
    it did not run; least : the least of that [J]; margin : least of E0 + what came in at the port and elsewhere [J],
    None without a port. progress(done, total, next); points : rows found before (`Points`); watch(t, seconds, steps) is
    called during every run. Raises FvsolveError for unknown names; a pair that is refused or blows up is a row with its
    reason.
    """
    check_port(case, port)
    points = points or Points()
    schemes = checked(schemes or [case.numerics.scheme], list(SCHEMES), "scheme")
    methods = checked(methods or [case.numerics.method], [*method_names(), AUTO], "method")
    rows, total = [], len(schemes) * len(methods)
    for scheme in schemes:
        for method in methods:
            if progress is not None:
                progress(len(rows), total, f"{scheme} with {method}")
            pair = {"scheme": scheme, "method": method}
            make = functools.partial(one_run, case, scheme, method, port, watch)
            rows.append(pair | points.get(case, pair | {"study": "energy", "port": port}, make))
    return rows


def one_run(case, scheme: str, method: str, port: str | None, watch=None) -> dict:
    """The ledger of a case run by a scheme and a method, in short."""
    none = dict.fromkeys(
        ("remainder", "scheme_loss", "step_loss", "newton_loss", "least", "relative", "creates", "margin")
    )
    try:
        one = energy(case, {"numerics.scheme": scheme, "numerics.method": method}, port, watch)
    except CaseError as error:
        return none | {"reason": refusal(error)}
    if one.reason == "interrupted":  # a run ends cleanly at Ctrl-C; a study ends with it
        raise KeyboardInterrupt
    losses = [float(values[-1]) for values in one.scheme.values()]
    sound = one.ok and bool(np.all(np.isfinite(one.remainder)))
    least = float(np.min(one.made))
    return none | {
        "remainder": float(one.remainder[-1]), "scheme_loss": sum(losses), "step_loss": float(one.step[-1]),
        "newton_loss": float(one.newton[-1]),
        "least": least, "relative": one.relative, "creates": not sound or least < -ROUNDING * one.through,
        "margin": None if one.port is None else one.port.margin, "reason": one.reason,
    }  # fmt: skip

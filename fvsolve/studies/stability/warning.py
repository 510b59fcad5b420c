"""A word of warning before a run: its Courant number against the limit of its scheme and method. Runs nothing."""

from __future__ import annotations

from fvsolve.errors import Notice
from fvsolve.steppers import automatic
from fvsolve.steppers.tableau import method_named
from fvsolve.studies.linear.frozen import FROZEN_AS
from fvsolve.studies.stability.grid import advection_limit

SLACK = 1e-9  # by which a Courant number may exceed its limit through rounding


def beyond_courant(model) -> Notice | None:
    """What to expect of a case whose step on pipes is beyond the limit of advection on a long pipe; None within it.

    A limited scheme is taken for the linear one that it is where all is smooth.
    """
    numerics = model.case.numerics
    if not model.cells or numerics.rtol is not None:
        return None
    method = method_named(automatic.first_method(numerics.method))
    courant = numerics.step * model.wave_rates.max() if numerics.step is not None else numerics.courant
    if not method.explicit:
        return None
    scheme = FROZEN_AS.get(numerics.scheme, numerics.scheme)
    one = advection_limit(scheme, method.name)
    if courant <= one.limit * (1.0 + SLACK):
        return None
    about = f", where it is {scheme}," if scheme != numerics.scheme else ""
    limit = f"{one.limit:.6g} is the limit" if one.limit > 0.0 else "there is none that does not grow"
    text = (
        f"Courant number {courant:.6g}: with {numerics.scheme}{about} and {method.name} {limit} on a long pipe; "
        "expect it to blow up (fvsolve stability says how soon)"
    )
    key = "courant" if numerics.step is None else "step"
    return Notice("step-limit", "numerics", text, key, float(courant), float(one.limit))

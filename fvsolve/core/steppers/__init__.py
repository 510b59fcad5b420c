"""Runge-Kutta methods as data, their properties, and the compiled time loop that steps them."""

from fvsolve.core.steppers import explicit  # noqa: F401  (declares the explicit methods)
from fvsolve.core.steppers.tableau import METHODS
from fvsolve.lazy_exports import lazy_names

_HOMES = {
    "Facts": "analysis.stability_properties",
    "Method": "tableau",
    "StabilityFunction": "analysis.stability_function",
    "analyse": "analysis.stability_properties",
    "global_error": "analysis.stability_properties",
    "integrate": "ode",
    "local_error": "analysis.stability_properties",
    "method_named": "tableau",
    "pade": "analysis.stability_function",
    "seen_frequency": "analysis.stability_properties",
    "stability_function": "analysis.stability_function",
}

METHODS.further = "fvsolve.core.steppers.implicit"
__all__ = ["METHODS", *lazy_names(__name__, _HOMES)]  # noqa: PLE0604

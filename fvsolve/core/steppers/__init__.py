"""Runge-Kutta methods as data, their properties, and the compiled time loop that steps them."""

from fvsolve.core.steppers import explicit, implicit  # noqa: F401  (declare the built-in methods)
from fvsolve.lazy_exports import lazy_names

_HOMES = {
    "Facts": "analysis.stability_properties",
    "METHODS": "tableau",
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

__all__ = lazy_names(__name__, _HOMES)  # noqa: PLE0605

"""Runge-Kutta methods as data, their properties, and the compiled time loop that steps them."""

from fvsolve.lazy_exports import lazy_names
from fvsolve.steppers import explicit, implicit, rosenbrock  # noqa: F401  (declare the built-in methods)

_HOMES = {
    "Facts": "analysis.method_facts",
    "METHODS": "tableau",
    "Method": "tableau",
    "StabilityFunction": "analysis.stability_function",
    "analyse": "analysis.method_facts",
    "global_error": "analysis.method_facts",
    "integrate": "ode",
    "local_error": "analysis.method_facts",
    "method_named": "tableau",
    "pade": "analysis.stability_function",
    "seen_frequency": "analysis.method_facts",
    "stability_function": "analysis.stability_function",
}

__all__ = lazy_names(__name__, _HOMES)  # noqa: PLE0605

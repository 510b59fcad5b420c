"""Runge-Kutta methods as data, their properties, and the compiled time loop that steps them."""

from fvsolve.lazy_exports import lazy_names
from fvsolve.steppers import built_in_methods  # noqa: F401  (declares them)

_HOMES = {
    "Facts": "analysis.method_facts",
    "METHODS": "tableau",
    "Method": "tableau",
    "StabilityFunction": "analysis.stability_function",
    "analyse": "analysis.method_facts",
    "global_error": "analysis.test_equation_errors",
    "integrate": "ode",
    "local_error": "analysis.test_equation_errors",
    "method_named": "tableau",
    "pade": "analysis.pade",
    "seen_frequency": "analysis.test_equation_errors",
    "stability_function": "analysis.stability_function",
}

__all__ = lazy_names(__name__, _HOMES)  # noqa: PLE0605

"""Runge-Kutta methods as data, their properties, and the compiled time loop that steps them."""

from fvsolve.lazy_exports import lazy_names
from fvsolve.steppers import methods  # noqa: F401  (declares them)

_HOMES = {
    "Facts": "analysis.facts",
    "METHODS": "tableau",
    "Method": "tableau",
    "StabilityFunction": "analysis.stability_function",
    "analyse": "analysis.facts",
    "global_error": "analysis.scalar",
    "integrate": "ode",
    "local_error": "analysis.scalar",
    "method_named": "tableau",
    "pade": "analysis.pade",
    "seen_frequency": "analysis.scalar",
    "stability_function": "analysis.stability_function",
}

__all__ = lazy_names(__name__, _HOMES)  # noqa: PLE0605

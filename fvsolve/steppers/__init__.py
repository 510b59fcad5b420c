"""Runge-Kutta methods as data, what is known of them, the loops that step them. Knows arrays and time; no physics."""

from importlib import import_module

from fvsolve.steppers import methods  # noqa: F401  (declares them)

_HOMES = {
    "Facts": "analysis.facts",
    "METHODS": "tableau",
    "Method": "tableau",
    "StabilityFunction": "analysis.stability_function",
    "analyse": "analysis.facts",
    "by_determinants": "analysis.stability_function",
    "by_resolvent": "analysis.stability_function",
    "global_error": "analysis.scalar",
    "integrate": "ode",
    "local_error": "analysis.scalar",
    "method_named": "tableau",
    "pade": "analysis.pade",
    "seen_frequency": "analysis.scalar",
    "stability_function": "analysis.stability_function",
}

__all__ = sorted(_HOMES)  # noqa: PLE0605


def __getattr__(name: str) -> object:
    """Public names, imported where they are first used: a run wants none of the analysis."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)

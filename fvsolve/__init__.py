"""Hydraulic transients by finite volumes. Knows the public names and where they live; imports none of them."""

from fvsolve.names import offer

_HOMES = {
    "Case": "case",
    "CaseError": "errors",
    "FluidError": "errors",
    "FvsolveError": "errors",
    "Model": "model",
    "Result": "run",
    "RunError": "errors",
    "State": "model",
    "advance": "solve",
    "build": "model",
    "initial_state": "solve",
    "integrate": "steppers.ode",
    "load": "case",
    "open_run": "run",
    "register": "parts.outside",
    "run": "run",
    "solve": "solve",
    "tableau": "steppers.tableau",
    "vary": "model",
}

__version__ = "0.1.0"
__all__ = offer(__name__, _HOMES)  # noqa: PLE0605

"""Hydraulic transients by finite volumes; public names, each imported from its module on first use."""

import sys

OLDEST_PYTHON = 3, 11  # oldest supported version of Python
if sys.version_info < OLDEST_PYTHON:
    raise ImportError(
        f"fvsolve needs Python {OLDEST_PYTHON[0]}.{OLDEST_PYTHON[1]} or later; {sys.executable} is "
        f"{sys.version.split()[0]}. Create the environment with a later version: python3.12 -m venv .venv"
    )

from fvsolve.lazy_exports import lazy_names  # noqa: E402

_MODULES = {
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
    "register_limiter": "parts.own_limiters",
    "register_part": "parts.plugins",
    "run": "run",
    "solve": "solve",
    "tableau": "steppers.tableau",
    "vary": "model",
}

__version__ = "0.2.0"
__all__ = lazy_names(__name__, _MODULES)  # noqa: PLE0605

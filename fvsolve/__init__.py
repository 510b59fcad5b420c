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
    "Model": "core.model",
    "Result": "core.run",
    "RunError": "errors",
    "State": "core.model",
    "advance": "core.solve",
    "build": "core.model",
    "initial_state": "core.solve",
    "integrate": "core.steppers.ode",
    "load": "case",
    "open_run": "core.run",
    "register_limiter": "parts.own_limiters",
    "register_part": "parts.plugins",
    "run": "core.run",
    "solve": "core.solve",
    "tableau": "core.steppers.tableau",
    "vary": "core.model",
}

__version__ = "0.2.0"
__all__ = lazy_names(__name__, _MODULES)  # noqa: PLE0605

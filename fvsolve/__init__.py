"""Hydraulic transients by finite volumes; public names, each imported from its module on first use."""

import sys

LEAST = 3, 11  # oldest supported version of Python
if sys.version_info < LEAST:
    raise ImportError(
        f"fvsolve needs Python {LEAST[0]}.{LEAST[1]} or later; {sys.executable} is {sys.version.split()[0]}. Create "
        "the environment with a later version: python3.12 -m venv .venv"
    )

from fvsolve.names import offer  # noqa: E402

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
    "register_part": "parts.outside",
    "run": "run",
    "solve": "solve",
    "tableau": "steppers.tableau",
    "vary": "model",
}

__version__ = "0.1.0"
__all__ = offer(__name__, _HOMES)  # noqa: PLE0605

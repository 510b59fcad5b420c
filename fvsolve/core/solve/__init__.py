"""Runs of a model from an initial state: rows and frames of results go to an output sink; a summary is returned."""

from fvsolve.lazy_exports import lazy_names

MODULES = {
    "Mark": "run_summary",
    "Summary": "run_summary",
    "advance": "advance",
    "initial_state": "solve",
    "solve": "solve",
}
__all__ = lazy_names(__name__, MODULES)  # noqa: PLE0605

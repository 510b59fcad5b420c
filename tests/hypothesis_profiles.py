"""Settings of tests that draw their input by hypothesis: every commit draws the same input.

Hypothesis uses a seed from the source of a test, and constants of loaded modules, so each edit of the package would
change the input. Here the seed is the name of the test, and no constant of a module is used. FVSOLVE_EXAMPLES=1000
draws that many new inputs per test, for a long run. Store an input that fails: paste the arguments that hypothesis
prints, as a dictionary, into the list in `tests/failing_examples/MODULE.TEST.txt`.
"""

import ast
import os
from collections.abc import Callable
from pathlib import Path

from hypothesis import HealthCheck, example, settings
from hypothesis.internal.conjecture import providers

KEPT = Path(__file__).parent / "failing_examples"
NEW = int(os.environ.get("FVSOLVE_EXAMPLES", "0"))
COMMON = {
    "deadline": None,
    "database": None,
    "print_blob": True,
    "suppress_health_check": list(HealthCheck),
}
settings.register_profile("full", max_examples=100, derandomize=not NEW, **COMMON)
settings.register_profile("quick", max_examples=5, derandomize=not NEW, **COMMON)


def fix_constants() -> None:
    """Prevent hypothesis from drawing constants of the modules that are loaded."""
    providers.is_local_module_file = lambda path: False


def examples(number: int, **more) -> Callable[[Callable], Callable]:
    """Draw this many inputs for a test, at most five in the quick tests, after the inputs that once failed."""

    def decorated(test: Callable) -> Callable:
        for arguments in failing_examples(test):
            test = example(**arguments)(test)
        return settings(max_examples=NEW or min(number, settings.default.max_examples), **more)(
            test
        )

    return decorated


def failing_examples(test: Callable) -> list[dict]:
    """Arguments with which a test once failed."""
    path = KEPT / f"{test.__module__.rsplit('.', 1)[-1]}.{test.__name__}.txt"
    return ast.literal_eval(path.read_text(encoding="utf-8")) if path.exists() else []

"""Built-in methods by name: explicit, implicit and linearly implicit."""

from fvsolve.steppers import explicit, implicit, rosenbrock  # noqa: F401  (declare them)
from fvsolve.steppers.tableau import METHODS

AUTO = "auto"  # in place of a method name: `automatic.py` chooses the method

__all__ = ["AUTO", "METHODS"]

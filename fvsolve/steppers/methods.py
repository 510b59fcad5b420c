"""The package's own methods by name, explicit, implicit and linearly implicit. Knows no time loop."""

from fvsolve.steppers import explicit, implicit, rosenbrock  # noqa: F401  (declare them)
from fvsolve.steppers.tableau import METHODS

__all__ = ["METHODS"]

"""Public names of the methods that step a model, and of their properties, each imported on first use."""

from fvsolve.core import steppers
from fvsolve.lazy_exports import lazy_attributes

__all__ = steppers.__all__

lazy_attributes(__name__, __all__, lambda name: getattr(steppers, name))

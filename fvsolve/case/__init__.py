"""Reading of case files: sections, references, faults; may import `parts`, `exact`, fluids and methods of `core`."""

from fvsolve.lazy_exports import lazy_names

_MODULES = {
    "Case": "case",
    "Compare": "claims",
    "Expect": "claims",
    "FluidSpec": "sections",
    "Numerics": "sections",
    "Output": "sections",
    "Probe": "probe",
    "load": "load",
    "locate_faults": "reading",
    "schema": "schema",
}

__all__ = lazy_names(__name__, _MODULES)  # noqa: PLE0605

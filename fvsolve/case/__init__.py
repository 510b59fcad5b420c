"""Reading of case files: keys, units, and checks between the parts of a case."""

from fvsolve.case.case import Case
from fvsolve.case.claims import Compare, Expect
from fvsolve.case.load import load
from fvsolve.case.probe import Probe
from fvsolve.case.reading import locate_faults
from fvsolve.case.schema import schema
from fvsolve.case.sections import FluidSpec, Numerics, Output

__all__ = ["Case", "Compare", "Expect", "FluidSpec", "Numerics", "Output", "Probe", "load", "locate_faults", "schema"]

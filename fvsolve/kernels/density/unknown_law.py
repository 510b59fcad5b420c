"""Results for an unknown density law code: NaN."""

from math import nan

from fvsolve.jit import inline


@inline
def not_a_number(st, floats, *arguments):
    return nan


@inline
def two_not_a_number(st, floats, *arguments):
    return nan, nan

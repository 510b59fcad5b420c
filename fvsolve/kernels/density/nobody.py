"""Results for an unknown density law code: NaN."""

from math import nan

from fvsolve.jit import inner


@inner
def number(st, floats, *arguments):
    return nan


@inner
def numbers(st, floats, *arguments):
    return nan, nan

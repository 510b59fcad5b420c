"""What a code says that is no law's: nothing that is a number."""

from math import nan

from fvsolve.jit import inner


@inner
def number(st, floats, *given):
    return nan


@inner
def numbers(st, floats, *given):
    return nan, nan

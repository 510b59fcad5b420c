"""Schemes and limiters as the numbers that kernels read. Knows codes and weights; knows no fields."""

import functools

from fvsolve.kernels import records as rec
from fvsolve.kernels.ends import difference_rows
from fvsolve.schemes import LIMITERS, SCHEMES

FAMILIES = {"upwind": rec.UPWIND, "linear": rec.LINEAR, "muscl": rec.MUSCL, "weno5": rec.WENO5}
CODES = {name: code for code, name in enumerate(LIMITERS)}  # of limiters


def family(scheme: str) -> int:
    """The code of the kernel that computes a scheme."""
    return FAMILIES[SCHEMES[scheme].family]


def scheme_settings(settings, scheme: str, limiter: str) -> None:
    """Write family, weights, degree and limiter into the settings record."""
    one, settings["limiter"] = SCHEMES[scheme], CODES[limiter]
    settings["scheme"], settings["degree"] = family(scheme), one.degree
    if settings["scheme"] == rec.LINEAR:
        for k, weight in enumerate(one.weights):
            settings[f"w{k}"] = float(weight)
        settings["inside"], settings["enter"], settings["leave"] = differences(scheme)


@functools.cache
def differences(scheme: str) -> tuple:
    """What a linear scheme makes of the difference of two faces, see `records.SETTINGS`."""
    one = SCHEMES[scheme]
    return difference_rows([float(w) for w in one.weights], one.degree)

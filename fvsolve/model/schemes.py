"""Schemes and limiters as the numbers that kernels read. Knows codes and weights; knows no fields."""

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
        weights = [float(w) for w in one.weights]
        for k, weight in enumerate(weights):
            settings[f"w{k}"] = weight
        settings["inside"], settings["enter"], settings["leave"] = difference_rows(weights, one.degree)

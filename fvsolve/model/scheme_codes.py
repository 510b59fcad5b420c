"""Schemes and limiters as the codes and weights that kernels read."""

import functools

from fvsolve.kernels import dtypes as rec
from fvsolve.kernels.ghost_cells import difference_rows
from fvsolve.schemes import LIMITERS, SCHEMES

FAMILIES = {"upwind": rec.UPWIND, "linear": rec.LINEAR, "muscl": rec.MUSCL, "weno5": rec.WENO5}
CODES = {name: code for code, name in enumerate(LIMITERS)}  # codes of limiters


def family(scheme: str) -> int:
    """Code of the kernel that computes a scheme."""
    return FAMILIES[SCHEMES[scheme].family]


def scheme_settings(settings, scheme: str, limiter: str) -> None:
    """Write family, weights, degree and limiter into the settings record."""
    row, settings["limiter"] = SCHEMES[scheme], CODES[limiter]
    settings["scheme"], settings["degree"] = family(scheme), row.degree
    if settings["scheme"] == rec.LINEAR:
        for k, weight in enumerate(row.weights):
            settings[f"w{k}"] = float(weight)
        settings["inside"], settings["enter"], settings["leave"] = face_differences(scheme)


@functools.cache
def face_differences(scheme: str) -> tuple:
    """Weights of a linear scheme for the difference of two faces, see `records.SETTINGS`."""
    row = SCHEMES[scheme]
    return difference_rows([float(w) for w in row.weights], row.degree)

"""Codes and weights of schemes and limiters that kernels read."""

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
    """Write the code and degree of a scheme, the weights of a linear scheme, and the code of a limiter to `settings`.

    settings : record of the type `kernels.dtypes.SETTINGS`
    """
    row, settings["limiter"] = SCHEMES[scheme], CODES[limiter]
    settings["scheme"], settings["degree"] = family(scheme), row.degree
    if settings["scheme"] == rec.LINEAR:
        for k, weight in enumerate(row.weights):
            settings[f"w{k}"] = float(weight)
        settings["inside"], settings["enter"], settings["leave"] = face_differences(scheme)


@functools.cache
def face_differences(scheme: str) -> tuple:
    """Weights of cells in the difference of a linear scheme's values at two faces : (inside, enter, leave).

    They are fields of `kernels.dtypes.SETTINGS`: inside a pipe, at the end where a wave enters, where it leaves.
    """
    row = SCHEMES[scheme]
    return difference_rows([float(w) for w in row.weights], row.degree)

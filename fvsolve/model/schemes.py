"""Schemes as data: the family that computes them and, for linear ones, their weights. Knows no fields."""

from typing import NamedTuple

from fvsolve.kernels import records as rec
from fvsolve.kernels.ends import difference_rows

# Value at the face after cell u from cells u-2 .. u+2, and the degree of polynomial it is exact for.
LINEAR = {
    "linear-upwind": ((0, -1 / 2, 3 / 2, 0, 0), 1),
    "fromm": ((0, -1 / 4, 1, 1 / 4, 0), 1),
    "central": ((0, 0, 1 / 2, 1 / 2, 0), 1),
    "upwind3": ((0, -1 / 6, 5 / 6, 1 / 3, 0), 2),
    "upwind5": ((2 / 60, -13 / 60, 47 / 60, 27 / 60, -3 / 60), 4),
}
FAMILIES = {"upwind": (rec.UPWIND, 0), "muscl": (rec.MUSCL, 1), "weno5": (rec.WENO5, 4)}


class Limiter(NamedTuple):
    """A function of `kernels.limiters` by its code, and what stands for it on meshes of any cells.

    wide : how far values at sides may go beyond those around, where slopes are least squares: 1 for not at all, or as
    linear fields want on shaken meshes
    """

    code: int
    wide: float


LIMITERS = {
    "minmod": Limiter(rec.MINMOD, 1.0),
    "van-leer": Limiter(rec.VAN_LEER, 2.0),
    "monotonized-central": Limiter(rec.MONOTONIZED_CENTRAL, 2.0),
}
FROZEN_AS = {"muscl": "fromm", "weno5": "upwind5"}  # what limited schemes are where all is smooth
FIFTH = {"upwind5": rec.LINEAR, "weno5": rec.WENO5}  # on grids; other schemes of pipes are `muscl` in the plane
ORDER = {name: degree + 1 for name, (_, degree) in (LINEAR | FAMILIES).items()}


def scheme_settings(settings, scheme: str, limiter: str) -> None:
    """Write family, weights, degree and limiter into the settings record."""
    settings["limiter"] = LIMITERS[limiter].code
    if scheme in LINEAR:
        weights, settings["degree"] = LINEAR[scheme]
        settings["scheme"] = rec.LINEAR
        for k, weight in enumerate(weights):
            settings[f"w{k}"] = weight
        rows = difference_rows(weights, settings["degree"])
        settings["inside"], settings["enter"], settings["leave"] = rows
    else:
        settings["scheme"], settings["degree"] = FAMILIES[scheme]


# How much quicker than its inside a pipe of 1, 2, 3, ... cells is, for its ends: 0.9, or 0.9 times the limit on a long
# pipe where that is less, over the Courant number at which ssp-rk3 grows in it between open and shut ends
# (tests/test_ends.py), where that is more than one.
QUICKER = {
    "linear-upwind": (1.0, 1.38, 1.21, 1.11, 1.07, 1.03, 1.01),
    "fromm": (1.0, 1.46, 1.19, 1.08),
    "upwind3": (1.0, 1.46, 1.61, 1.22, 1.03),
    "upwind5": (1.0, 1.46, 1.61, 1.22, 1.88, 1.46, 1.25, 1.08),
}
QUICKER |= {"muscl": QUICKER["fromm"], "weno5": QUICKER["upwind5"]}


def quicker(scheme: str, cells: int) -> float:
    """Factor on the rate of a pipe's cells that its ends ask for; 1 where the pipe is long."""
    factors = QUICKER.get(scheme, ())
    return factors[cells - 1] if cells <= len(factors) else 1.0

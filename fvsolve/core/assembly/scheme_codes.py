"""Codes of schemes and limiters for kernels, and weights of a probe between cells."""

import functools

import numpy as np

from fvsolve.core.kernels import dtypes as rec
from fvsolve.core.kernels.ghost_cells import difference_rows
from fvsolve.core.kernels.own_limiters import limiter_code
from fvsolve.core.schemes import LIMITERS, SCHEMES
from fvsolve.errors import FvsolveError, Notice

FAMILIES = {"upwind": rec.UPWIND, "linear": rec.LINEAR, "muscl": rec.MUSCL, "weno5": rec.WENO5}
# Codes of built-in limiters.
CODES = {name: code for code, (name, limiter) in enumerate(LIMITERS.items()) if limiter.own is None}


def family(scheme: str) -> int:
    """Code of the kernel that computes a scheme."""
    return FAMILIES[SCHEMES[scheme].family]


def code_of_limiter(limiter: str, user: str = "") -> int:
    """Code of a limiter for kernels; that of a user is compiled here if no code is stored.

    user : module that calls the loops, see `own_limiters.loops_of`. Raises FvsolveError if it cannot be compiled.
    """
    own = LIMITERS[limiter].own
    if own is None:
        return CODES[limiter]
    try:
        return limiter_code(own.phi, own.symmetric, own.digest, user)
    except Exception as error:
        if not type(error).__module__.startswith("numba."):
            raise
        reason = next(
            (line.strip() for line in str(error).splitlines()[1:] if line.strip()), str(error)
        )
        raise FvsolveError(
            f"numerics.limiter: the function of {limiter} cannot be compiled: {reason.rstrip('.')}; expected a "
            "function of a float that returns a float, and uses numbers, math and numpy only"
        ) from error


def limiter_notices(scheme: str, limiter: str) -> list[Notice]:
    """Notice of a user's limiter outside the region of total variation diminishing limiters, without order 2, ..."""
    own = LIMITERS[limiter].own if scheme == "muscl" else None
    if own is None or not own.departures + own.costs:
        return []
    region = "; ".join(own.departures)
    head = f"it leaves the region 0 <= phi <= min(2, 2 r) of Sweby (1984), so total variation may grow: {region}"
    texts = [head] * bool(region) + list(own.costs)
    return [Notice("limiter", "numerics", f"limiter {limiter}: {'; '.join(texts)}", "limiter")]


def scheme_settings(settings, scheme: str, limiter: str) -> None:
    """Write the code and degree of a scheme, the weights of a linear scheme, and the code of a limiter to `settings`.

    settings : record of the type `kernels.dtypes.SETTINGS`
    """
    row, settings["limiter"] = SCHEMES[scheme], code_of_limiter(limiter)
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


TIE_TOLERANCE = 1e-6  # in cells; two sets of cells that differ by less count as equally near


def lower_position(draft, row, fraction: float, degree: int | None = None) -> None:
    """Set the position of a probe along its pipe: an end, or cells and weights of a polynomial through their means.

    degree : degree of the polynomial, at most cells - 1; if None, that of the scheme, at least 1
    """
    if fraction in (0.0, 1.0):
        row["side"] = -1 if fraction == 0.0 else 1
        return
    n = int(draft.pipe_table[row["index"]]["cells"])
    degree = min(degree or max(SCHEMES[draft.case.numerics.scheme].degree, 1), n - 1)
    first, weights = cells_around(fraction * n, degree, n)
    row["cell"], row["count"], row["weights"] = first, weights.size, len(draft.floats)
    draft.floats += weights.tolist()


@functools.lru_cache(maxsize=4096)
def cells_around(x: float, degree: int, n: int) -> tuple[int, np.ndarray]:
    """First cell that a probe reads, and weights of this and the following cells.

    x : position in cells from the `from` end; n : number of cells. The nearest degree + 1 cells are read. If two such
    sets are equally near, as at a face for an even degree, the result is the mean of both, so that a pipe drawn in the
    opposite direction reads the same value.
    """
    middle = x - 0.5 * (degree + 1)
    firsts = sorted(
        {
            int(np.clip(round(middle + side), 0, n - degree - 1))
            for side in (-TIE_TOLERANCE, TIE_TOLERANCE)
        }
    )
    weights = np.zeros(firsts[-1] - firsts[0] + degree + 1)
    for first in firsts:
        weights[first - firsts[0] :][: degree + 1] += reading_weights(x - first, degree) / len(
            firsts
        )
    return firsts[0], weights


def reading_weights(x: float, degree: int) -> np.ndarray:
    """Weights of the means of degree + 1 cells in the value at x, exact for polynomials up to `degree`.

    Cell k lies between k and k + 1.
    """
    powers = np.arange(degree + 1)
    cells = np.arange(degree + 1)[:, None]
    averages = ((cells + 1.0) ** (powers + 1) - cells ** (powers + 1.0)) / (powers + 1)
    return np.linalg.solve(averages.T, float(x) ** powers)

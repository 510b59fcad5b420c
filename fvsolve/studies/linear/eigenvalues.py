"""Eigenvalues (poles) of a linearised case, computed in the energy norm."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from fvsolve.errors import FvsolveError
from fvsolve.model.energy_norm import EnergyForm
from fvsolve.studies.result_table import Column

MAX_DENSE = 1500  # greatest number of states for which all eigenvalues are computed; above, some by ARPACK
ARPACK_COUNT = 20  # eigenvalues that ARPACK computes at each place
RIM_PLACES = 5  # places on the spectral circle, from i to -1: the lower half plane mirrors the upper one
RESTARTS, TIME_LIMIT = 12, 10.0  # restarts of ARPACK at each place; time limit of all places [s]
POLES = (
    Column("real", "real [1/s]", ".6g"),
    Column("imaginary", "imaginary [1/s]", lambda pole: f"±{pole['imaginary']:.6g}" if pole["pair"] else "-"),
    Column("pair"),
    Column("frequency", "frequency [Hz]", ".6g"),
    Column("damping", words=".4f"),
    Column("time_constant", "time constant [s]", ".4g"),
)
ZERO_TOLERANCE = 1e-10  # of the greatest modulus: smaller eigenvalues and real or imaginary parts are round-off


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Eigenvalues `values` of a case [1/s], by rising modulus.

    complete : True if these are all eigenvalues; description : text on which eigenvalues these are
    """

    values: np.ndarray
    complete: bool
    description: str

    def poles(self) -> list[dict]:
        """Dict for each real pole s and each complex pair: parts of s, frequency, damping ratio and time constant.

        The frequency is |s| / 2 pi [Hz], the damping ratio -Re s / |s| (None for s = 0), and the time constant
        1 / |Re s| [s] (None for Re s = 0).
        """
        rows = []
        for s in self.values[self.values.imag >= 0.0]:
            size = abs(s)
            rows.append({
                "real": float(s.real), "imaginary": float(s.imag), "pair": bool(s.imag > 0.0),
                "frequency": float(size / (2.0 * np.pi)), "damping": float(0.0 - s.real / size) if size > 0.0 else None,
                "time_constant": float(1.0 / abs(s.real)) if s.real != 0.0 else None,
            })  # fmt: skip
        return rows


def poles_of(a: Any, form: EnergyForm) -> Spectrum:
    """Eigenvalues of the matrix A of a linearised case, computed in coordinates of the energy norm `form`.

    Motions that store no energy, such as free translation, have eigenvalues too, which are included.
    """
    form = form.suited_to(a)
    moving = find_eigenvalues(form.seen(a))
    if form.idle.shape[1] == 0:
        return moving
    idle = np.linalg.eigvals(form.idle_rows @ (a @ form.idle))
    values = sort_eigenvalues(np.concatenate([moving.values, idle]))
    some = f"{moving.description}; and {idle.size} of motions that store no energy"
    text = f"all {values.size}" if moving.complete else some
    return Spectrum(values, moving.complete, text)


def find_eigenvalues(e: Any) -> Spectrum:
    """Eigenvalues of a matrix e : float64[n, n] or sparse; all for up to 1500 states, else some, by ARPACK in 10 s.

    Raises FvsolveError if ARPACK finds no eigenvalue.
    """
    n = e.shape[0]
    if n <= MAX_DENSE:
        from scipy.linalg import eigvals

        values = eigvals(e if isinstance(e, np.ndarray) else e.toarray(), check_finite=False)
        return Spectrum(sort_eigenvalues(values), True, f"all {n}")
    rim_radius = spectral_radius(e)
    rim = [rim_radius * np.exp(1j * angle) for angle in np.linspace(0.5 * np.pi, np.pi, RIM_PLACES)]
    latest = time.monotonic() + TIME_LIMIT
    by_place = [eigenvalues_near(e, place, latest) for place in (1e-6 * rim_radius, *rim)]
    values = np.concatenate(by_place)
    if not values.size:
        raise FvsolveError(
            f"ARPACK found no eigenvalue of {n} states in time; all eigenvalues are computed for up to {MAX_DENSE} "
            "states: use fewer cells, --set links.NAME.cells=100"
        )
    digits = 9 - int(np.log10(np.abs(values).max()))
    distinct = sort_eigenvalues(np.unique(np.round(np.concatenate([values, values.conj()]), digits)))
    on_rim = sum(part.size > 0 for part in by_place[1:])
    zero = "eigenvalues nearest 0" if by_place[0].size else "none near 0 converged"
    on_circle = f"nearest {on_rim} of {RIM_PLACES} places" if on_rim else f"none of {RIM_PLACES} places converged"
    where = f"{zero}; on the circle |s| = {rim_radius:.4g} 1/s {on_circle}"
    return Spectrum(distinct, False, f"{distinct.size} of {n}: {where}; by ARPACK")


def spectral_radius(e: Any) -> float:
    """Estimate of the spectral radius of a matrix e [1/s]: mean growth of a vector in a power iteration."""
    v, sizes = np.random.default_rng(1).standard_normal(e.shape[0]), []
    for _ in range(200):
        v = e @ (v / np.linalg.norm(v))
        sizes.append(np.linalg.norm(v))
    return float(np.exp(np.mean(np.log(sizes[100:]))))


def eigenvalues_near(e: Any, place: complex, latest: float = np.inf) -> np.ndarray:
    """Eigenvalues of a sparse matrix that are nearest to the complex number `place`, by ARPACK : complex[k].

    The result is empty or incomplete if ARPACK does not converge, and empty at the time limit `latest`, a time of the
    monotonic clock [s].
    """
    from scipy.sparse import eye_array
    from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs, splu

    kind = complex if isinstance(place, complex) else float
    e, start = e.astype(kind), np.random.default_rng(1).standard_normal(e.shape[0]).astype(kind)
    if time.monotonic() > latest:
        return np.zeros(0)
    factors = splu((e - place * eye_array(e.shape[0])).tocsc())

    def solve(v: np.ndarray) -> np.ndarray:
        if time.monotonic() > latest:
            raise TimeoutError
        return factors.solve(v.astype(kind))

    inverse = LinearOperator(e.shape, matvec=solve, dtype=kind)
    try:
        return eigs(e, ARPACK_COUNT, sigma=place, OPinv=inverse, ncv=3 * ARPACK_COUNT, maxiter=RESTARTS, v0=start,
                    return_eigenvectors=False)  # fmt: skip
    except ArpackNoConvergence as error:
        return error.eigenvalues
    except TimeoutError:
        return np.zeros(0)


def sort_eigenvalues(values: np.ndarray) -> np.ndarray:
    """Sort eigenvalues by modulus; real and imaginary parts below 1e-10 of the greatest modulus are set to zero."""
    values = np.asarray(values, dtype=complex)
    floor = ZERO_TOLERANCE * np.max(np.abs(values), initial=0.0)
    real, imaginary = (np.where(np.abs(part) <= floor, 0.0, part) for part in (values.real, values.imag))
    values = real + 1j * imaginary
    return values[np.lexsort((-values.imag, -values.real, np.round(np.abs(values), 12)))]

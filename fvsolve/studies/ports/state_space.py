"""Is a state space in floats positive real? Decided up to a stated tolerance; knows matrices, no case."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fvsolve.doors import COMPLEX, MATRIX, NUMBER, POSITIVE, SERIES, door, made
from fvsolve.errors import FvsolveError
from fvsolve.studies.sheet import Plain

TOLERANCE = 1e-9  # of Re H / |H|: what differences and floats leave undecided
DECADES = 1.0  # searched below the slowest and above the quickest pole, more where Re H changes its sign beyond
FARTHEST = 1e4  # beyond them a change of sign is rounding
GRID = 40  # frequencies a decade, besides those at which Re H can change its sign
NEXT = 100.0  # times the shift: that near to a pole on the axis Re H is not linear in Re s
BESIDE = np.concatenate([-np.geomspace(100.0, 0.01, 13), [0.0], np.geomspace(0.01, 100.0, 13)])  # shifts beside a pole
ROUNDING = 1e-13  # of the terms that H is the sum of
SHOWN = 1e-10  # a mode whose residue is less than this part of what B and C allow is hidden
DEFECT = 1e-7  # of the norm of A: no pole is known worse, defective ones included


class Transfer:
    """H(s) = D + C (s - A)^-1 B of one input and output, by a Schur form of the balanced A.

    a : float64[n, n]; b, c : float64[n]; d : float; error : relative one of A
    poles, residues : complex128[n] [1/s]; doubt : float64[n]  how far rounding and error may have moved a pole [1/s];
    seen : bool[n]  whether H shows it
    """

    @door(a=MATRIX, b=SERIES, c=SERIES, d=NUMBER, error=NUMBER)
    def __init__(self, a: np.ndarray, b: np.ndarray, c: np.ndarray, d: float, error: float = 0.0):
        from scipy.linalg import matrix_balance, schur

        sizes = (*np.shape(a), np.size(b), np.size(c))
        if len({*sizes}) > 1:
            said = f"A of {sizes[0]} x {sizes[1]}, {sizes[2]} numbers in B and {sizes[3]} in C"
            raise FvsolveError(f"{said}; wanted n x n, n and n")
        self.error = float(error)
        self.a, self.b, self.c, self.d = (np.asarray(x, float) for x in (a, b, c, d))
        if self.a.size:
            self.a, (scale, _) = matrix_balance(self.a, permute=False, separate=True)
            self.b, self.c = self.b / scale, self.c * scale
        self.t, q = schur(self.a, output="complex") if self.a.size else (self.a, self.a)
        self.left, self.right = self.c @ q, q.conj().T @ self.b
        self.poles, self.residues, self.doubt, self.seen = self._modes()

    def _modes(self) -> tuple[np.ndarray, ...]:
        from scipy.linalg import eig

        if not self.a.size:
            return np.zeros(0, complex), np.zeros(0, complex), np.zeros(0), np.zeros(0, bool)
        poles, left, right = eig(self.a, left=True, right=True)
        overlap = np.einsum("ij,ij->j", left.conj(), right)
        overlap[np.abs(overlap) < 1e-300] = 1e-300  # of a defective pole
        norm = np.linalg.norm(self.a, 2)
        moved = (10 * len(poles) * np.finfo(float).eps + self.error) * norm / np.abs(overlap)
        residues = (self.c @ right) * (left.conj().T @ self.b) / overlap
        most = np.linalg.norm(self.b) * np.linalg.norm(self.c) / np.abs(overlap)
        return poles, residues, np.minimum(moved, DEFECT * norm), np.abs(residues) > SHOWN * most

    def __call__(self, s: np.ndarray) -> np.ndarray:
        """H at complex numbers s : complex128[k]; infinite at a pole."""
        return self.measured(s)[0]

    @door(s=COMPLEX)
    def measured(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(H, by how much rounding and the error of A may have moved it) : complex128[k], float64[k]."""
        s = np.atleast_1d(np.asarray(s, complex))
        n = len(self.poles)
        x, diagonal = np.zeros((n, s.size), complex), np.diag(self.t)
        with np.errstate(divide="ignore", invalid="ignore"):
            for i in reversed(range(n)):
                x[i] = (self.right[i] + self.t[i, i + 1 :] @ x[i + 1 :]) / (s - diagonal[i])
            found = self.d + self.left @ x
            size = abs(self.d) + np.abs(self.left) @ np.abs(x)
        shown = np.isfinite(found)
        return np.where(shown, found, np.inf), np.where(shown, (ROUNDING + self.error) * size, np.inf)

    @door(s=COMPLEX)
    def angle(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(Re H / |H|, the cosine of the phase; its doubt) : float64[k] each; 1 and 0 at a pole and where H = 0."""
        value, doubt = self.measured(s)
        size = np.abs(value)
        shown = np.isfinite(size) & (size > 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(shown, value.real / size, 1.0), np.where(shown, doubt / size, 0.0)


@dataclass(frozen=True)
class Dip:
    """low < w < high [rad/s] in which Re H < 0, beyond doubt at `worst`: `real` is Re H there, `angle` Re H / |H|."""

    low: float
    high: float
    worst: float
    real: float
    angle: float


@dataclass(frozen=True)
class StateVerdict(Plain):
    """Whether H is positive real: True, False, or None where floats cannot tell.

    margin : least Re H / |H|, the cosine of the phase, found at `worst` [rad/s]; with poles on the axis, that on
    Re s = `shift` [1/s] carried on to the axis
    tolerance : what is within it of zero is undecided; low, high : frequencies that were searched [rad/s]
    unstable, axis : poles right of the axis and those that cannot be told from it [1/s]; hidden : right ones not in H
    """

    positive_real: bool | None
    reasons: tuple[str, ...]
    margin: float
    worst: float
    tolerance: float
    shift: float
    low: float
    high: float
    dips: tuple[Dip, ...]
    unstable: tuple[complex, ...]
    axis: tuple[complex, ...]
    hidden: tuple[complex, ...]

    also = ("reason", "answer")

    @property
    def reason(self) -> str:
        """All reasons in one line."""
        return "; ".join(self.reasons)

    @property
    def answer(self) -> str:
        """yes, no, or undecided within the tolerance."""
        return {True: "yes", False: "no", None: f"undecided within {self.tolerance:.0e}"}[self.positive_real]


@door(h=made(Transfer), tolerance=POSITIVE)
def state_positive_real(h: Transfer, tolerance: float = TOLERANCE) -> StateVerdict:
    """Whether H is positive real, from the sign of Re H between all frequencies at which it can change.

    Re H(jw) = 0 where jw is an eigenvalue of the Hamiltonian matrix of A, B, C, D (Boyd, Balakrishnan, Kabamba 1989),
    so that no band escapes between samples. Where poles lie on the axis Re H is taken a hair (`shift`) to the right
    of it, where a pole of higher order or with a residue that is not positive makes it negative.
    """
    size = np.abs(h.poles)
    reach = h.doubt + 1e-12 * size
    near = np.abs(h.poles.real) <= reach
    slow, quick = _span(h, size[size > reach])
    shift = float(max(4.0 * np.max(reach[near]), 1e-9 * slow)) if near.any() else 0.0
    w, low, high = frequencies(h, h.poles[near], shift, slow, quick)
    raw, doubt = h.angle(shift + 1j * w)
    zero = not np.any(h(shift + 1j * w))
    right = h.poles.real > reach
    unstable, hidden = h.poles[right & h.seen], h.poles[right & ~h.seen]
    dips = _dips(h, shift, w, _sure(raw, doubt), tolerance)
    margin, worst = (0.0, 0.0) if zero else _margin(h, near, shift, w, raw, doubt, (low <= w) & (w <= high))
    holds = False if len(unstable) or dips else True if margin > tolerance or zero else None
    return StateVerdict(
        holds, tuple(_words(holds, unstable, dips, hidden, margin, worst, tolerance, shift)), margin, worst, tolerance,
        shift, low, high, tuple(dips), _listed(unstable), _listed(h.poles[near]), _listed(hidden),
    )  # fmt: skip


def _margin(h, near, shift, w, raw, doubt, within) -> tuple[float, float]:
    """(least Re H / |H| beyond doubt, where), without what it owes to the shift; poles on the axis are left out."""
    angle = _sure(raw, doubt)
    if shift:
        within = within & (np.min(np.abs(w[:, None] - np.abs(h.poles.imag[near])), axis=1) > NEXT * shift)
        angle = _sure(2.0 * raw - h.angle(2.0 * shift + 1j * w)[0], 3.0 * doubt)
    k = int(np.argmin(np.where(within, angle, np.inf)))
    return float(angle[k]), float(w[k])


def _sure(angle: np.ndarray, doubt: np.ndarray) -> np.ndarray:
    return np.sign(angle) * np.maximum(np.abs(angle) - doubt, 0.0)


def _span(h: Transfer, size: np.ndarray) -> tuple[float, float]:
    """The slowest and the quickest rate of H [1/s]; where all poles are 0, the corner between residue and D."""
    if len(size):
        return float(size.min()), float(size.max())
    corner = abs(h.c @ h.b / h.d) if h.d else 0.0
    return (corner, corner) if corner > 0.0 else (1.0, 1.0)


def frequencies(h: Transfer, near: np.ndarray, shift: float, slow: float, quick: float):
    """(where to look at Re H so that no band is missed : float64[k] rising, from, to) [rad/s].

    near : poles on the axis, beside which it is looked at too, also below `from`
    """
    found = crossings(h.a - shift * np.eye(len(h.poles)), h.b, h.c, float(h.d))
    real = np.abs(found.imag[np.abs(found.real) <= 1e-6 * np.abs(found)])  # changes of sign, not only marks
    real = real[(slow / FARTHEST < real) & (real < quick * FARTHEST)]
    low = min(slow * 10.0**-DECADES, np.min(real, initial=np.inf) / 3.0)
    high = max(quick * 10.0**DECADES, np.max(real, initial=0.0) * 3.0)
    marks = np.concatenate([np.abs(h.poles.imag), np.abs(found.imag)])
    count = max(2, int(GRID * np.log10(high / low)))
    beside = (np.abs(near.imag)[:, None] + shift * BESIDE).ravel()
    parts = [np.geomspace(low, high, count), marks[(low < marks) & (marks < high)], beside[beside >= 0.0]]
    marks = np.unique(np.concatenate(parts))
    return np.unique(np.concatenate([marks, np.sqrt(marks[1:] * marks[:-1])])), float(low), float(high)


def crossings(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: float) -> np.ndarray:
    """Numbers among which are all jw at which Re H(jw) = 0 : complex128[k], not sorted.

    Eigenvalues of the Hamiltonian matrix; without a direct term, those of what is left of 1 / H when its pole at
    infinity s / CB is taken off: Re 1/H has the sign of Re H.
    """
    n = len(a)
    if n == 0:
        return np.zeros(0, complex)
    flow = np.linalg.norm(b) * np.linalg.norm(c)
    if abs(d) * np.linalg.norm(a) > 1e-13 * flow:
        first = a - np.outer(b, c) / (2.0 * d)
        matrix = np.block([[first, -np.outer(b, b) / (2.0 * d)], [np.outer(c, c) / (2.0 * d), -first.T]])
        return np.linalg.eigvals(matrix)
    gain = float(c @ b)
    if abs(gain) <= 1e-13 * flow:
        return np.zeros(0, complex)  # relative degree two or more: not positive real, and Re H < 0 or H = 0 far out
    inside = np.linalg.svd(c[None, :])[2][1:].T  # states that the output does not see
    follow = inside.T - np.outer(inside.T @ b, c) / gain
    return crossings(
        follow @ a @ inside, follow @ a @ b / gain, -(c @ a @ inside) / gain, -float(c @ a @ b) / gain**2
    )  # fmt: skip


def _dips(h, shift, w, angle, tolerance) -> list[Dip]:
    """Runs of frequencies where the angle is beyond the tolerance, their ends refined."""
    bad = angle < -tolerance
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bad, [False]]).astype(int)))
    found = []
    for first, beyond in zip(edges[0::2], edges[1::2], strict=True):
        worst = first + int(np.argmin(angle[first:beyond]))
        low = _edge(h, shift, w[first - 1], w[first]) if first else 0.0
        high = _edge(h, shift, w[beyond], w[beyond - 1]) if beyond < len(w) else np.inf
        found.append(Dip(low, high, float(w[worst]), float(h(shift + 1j * w[worst])[0].real), float(angle[worst])))
    return found


def _edge(h, shift, good: float, bad: float) -> float:
    """Where Re H changes its sign between two frequencies, by halving."""
    for _ in range(60):
        middle = 0.5 * (good + bad)
        if middle in (good, bad):
            break
        good, bad = (good, middle) if h(shift + 1j * middle)[0].real < 0.0 else (middle, bad)
    return float(bad)


def _listed(found: np.ndarray) -> tuple[complex, ...]:
    return tuple(complex(s) for s in sorted(found, key=lambda s: (-s.real, abs(s.imag), -s.imag)))


def _words(holds, unstable, dips, hidden, margin, worst, tolerance, shift) -> list[str]:
    said = []
    if len(unstable):
        said.append(f"{_poles(unstable)} in the right half plane, the first s = {_listed(unstable)[0]:.6g} 1/s")
    for dip in dips[:8]:
        high = f"< {dip.high:.9g}" if np.isfinite(dip.high) else "to infinity"
        said.append(f"Re H < 0 for {dip.low:.9g} < w {high} rad/s, least Re H / |H| = {dip.angle:.4g} "
                    f"at w = {dip.worst:.9g} rad/s")  # fmt: skip
    if len(dips) > 8:
        said.append(f"and in {len(dips) - 8} more bands")
    where = f"from Re s = {shift:.3g} 1/s on (poles on the axis)" if shift else "on the axis"
    if holds and worst == 0.0:
        said.append("H = 0")
    elif holds:
        said.append(f"no pole in the right half plane, Re H > 0 {where}: least {margin:.4g} |H| where it was searched, "
                    f"at w = {worst:.6g}; beyond it does not change its sign")  # fmt: skip
    elif holds is None:
        said.append(f"on the boundary: Re H >= -{tolerance:.0e} |H| at every w {where}, and within {tolerance:.0e} |H| "
                    f"of zero at w = {worst:.6g} ({margin:.1e}); a lossless system is such a one")  # fmt: skip
    if len(hidden):
        said.append(f"hidden: {_poles(hidden)} in the right half plane that H does not show, "
                    f"s = {_listed(hidden)[0]:.6g} 1/s")  # fmt: skip
    return said


def _poles(found) -> str:
    return "a pole" if len(found) == 1 else f"{len(found)} poles"

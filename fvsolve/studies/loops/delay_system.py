"""Linear systems with exact delays: x' = A x + B u + Bw w, y = C x + D u + Dw w, s = Cs x + Ds u + Dsw w.

Each channel has w(t) = s(t - tau) with its own delay tau [s]. The delays are closed by exp(-s tau) at each complex
frequency s, without any rational approximation.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

FIRST_PER_DECADE = 40  # frequencies per decade of the first grid of a winding number
STEEP = 0.5  # change of the phase between two frequencies above which the grid is refined [rad]
MOST_ROUNDS = 40  # of refinement
AXIS = 1e-9  # of the fastest rate: poles closer to the imaginary axis count as stable
FAR = 1e3  # ratio of the highest frequency to the fastest rate
CHEBYSHEV_POINTS = 48  # of each delay, for estimates of poles
NEWTON_TURNS = 30
ENDLESS = 10**6  # number of unstable poles of delays that grow at all high frequencies
NEAR = 0.05  # greatest relative distance of a pole from its estimate
POLE_TOLERANCE = 1e-12  # relative change of a pole at which Newton has converged


@dataclass(frozen=True, eq=False)
class DelaySystem:
    """System of the module docstring; b, d, ... : columns of u first, then of w; c, d : rows of y first, then of s.

    inputs, outputs : numbers of u and of y; delays : float64[k]  tau of each channel [s]
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    inputs: int
    outputs: int
    delays: np.ndarray

    @cached_property
    def schur(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(upper triangular T, C Q, Q* B) of the complex Schur form A = Q T Q*, after balancing."""
        from scipy.linalg import matrix_balance, schur

        if not self.a.size:
            return self.a.astype(complex), self.c.astype(complex), self.b.astype(complex)
        a, (scale, _) = matrix_balance(self.a, permute=False, separate=True)
        t, q = schur(a, output="complex")
        return t, (self.c * scale) @ q, q.conj().T @ (self.b / scale[:, None])

    @cached_property
    def rates(self) -> np.ndarray:
        """Eigenvalues of A, which cuts all delays [1/s]."""
        return np.diag(self.schur[0])

    def cut_response(self, s: np.ndarray) -> np.ndarray:
        """D + C (s - A)^-1 B with all delays cut : complex128[len(s), rows, columns]."""
        t, left, right = self.schur
        x = np.zeros((t.shape[0], s.size, right.shape[1]), complex)
        with np.errstate(divide="ignore", invalid="ignore"):
            for i in reversed(range(t.shape[0])):
                known = right[i] + np.tensordot(t[i, i + 1 :], x[i + 1 :], 1)
                x[i] = known / (s - t[i, i])[:, None]
            return self.d + np.moveaxis(np.tensordot(left, x, 1), 0, 1)

    def decay(self, s: np.ndarray) -> np.ndarray:
        """Factor exp(-s tau) of each delay : complex128[len(s), delays]."""
        return np.exp(-np.multiply.outer(s, self.delays))

    def response(self, s: np.ndarray) -> np.ndarray:
        """Transfer functions from u to y with all delays closed, at complex numbers s : complex128[len(s), y, u]."""
        cut, m, p = self.cut_response(s), self.inputs, self.outputs
        if not self.delays.size:
            return cut
        closed = np.eye(self.delays.size) - cut[:, p:, m:] * self.decay(s)[:, None, :]
        arriving = self.decay(s)[:, :, None] * np.linalg.solve(closed, cut[:, p:, :m])
        return cut[:, :p, :m] + cut[:, :p, m:] @ arriving

    def closed(self, gain: float = 1.0) -> DelaySystem:
        """System in which each input u is `gain` times the output y of the same number, without inputs and outputs."""
        m, p, n = self.inputs, self.outputs, self.a.shape[0]
        back = np.linalg.solve(np.eye(p) - gain * self.d[:p, :m], gain * np.hstack([self.c[:p], self.d[:p, m:]]))
        return replace(
            self, a=self.a + self.b[:, :m] @ back[:, :n], b=self.b[:, m:] + self.b[:, :m] @ back[:, n:],
            c=self.c[p:] + self.d[p:, :m] @ back[:, :n], d=self.d[p:, m:] + self.d[p:, :m] @ back[:, n:],
            inputs=0, outputs=0,
        )  # fmt: skip

    @property
    def fastest(self) -> float:
        """Greatest rate of states and of delays [1/s]; 1 without any."""
        sizes = np.concatenate([np.abs(self.rates), 1.0 / self.delays])
        return float(sizes.max(initial=0.0)) or 1.0

    @property
    def slowest(self) -> float:
        """Least rate of states and of delays that is not 0 [1/s]; 1 without any."""
        sizes = np.concatenate([np.abs(self.rates), 1.0 / self.delays])
        least = float(sizes[sizes > AXIS * self.fastest].min(initial=np.inf))
        return least if np.isfinite(least) else 1.0

    def unstable_count(self) -> int | None:
        """Number of poles in the right half plane, with all inputs zero, at most ENDLESS; None if it is undecided.

        Without delays these are eigenvalues. With delays it is the number of zeros of det(1 - P(s) E(s)), where P is
        the transfer matrix from w to s, and E = exp(-s tau). By the argument principle it is the number of unstable
        poles of P minus the winding number.
        """
        shift = AXIS * self.fastest
        own = int(np.sum(self.rates.real > shift))
        if not self.delays.size:
            return own
        winding = self.winding(shift)
        if winding is None:
            return ENDLESS
        return None if abs(winding - round(winding)) > 0.1 else own - round(winding)

    def loop_matrices(self, s: np.ndarray) -> np.ndarray:
        """P(s) E(s) of `unstable_count` : complex128[len(s), delays, delays]."""
        return self.cut_response(s)[:, self.outputs :, self.inputs :] * self.decay(s)[:, None, :]

    def winding(self, shift: float) -> float | None:
        """Winding number of det(1 - P E) along Re s = shift, upwards; None if the delays alone grow at high frequency.

        Beyond the last frequency P is constant, and the phase that remains follows from the eigenvalues of P E.
        """
        frequency = np.concatenate([[0.0], self.grid(shift)])
        value = self.determinant(shift + 1j * frequency)
        for _ in range(MOST_ROUNDS):
            steep = np.flatnonzero(np.abs(np.angle(value[1:] / value[:-1])) > STEEP)
            if not steep.size:
                break
            middle = 0.5 * (frequency[steep] + frequency[steep + 1])
            frequency = np.insert(frequency, steep + 1, middle)
            value = np.insert(value, steep + 1, self.determinant(shift + 1j * middle))
        turned = float(np.sum(np.angle(value[1:] / value[:-1])))
        rest = np.linalg.eigvals(self.loop_matrices(np.array([shift + 1j * frequency[-1]]))[0])
        if np.max(np.abs(rest)) >= 1.0:
            return None
        return (turned - float(np.sum(np.angle(1.0 - rest)))) / np.pi

    def determinant(self, s: np.ndarray) -> np.ndarray:
        """det(1 - P E) at complex numbers s : complex128[len(s)]."""
        return np.linalg.det(np.eye(self.delays.size) - self.loop_matrices(s))

    def grid(self, least: float) -> np.ndarray:
        """First frequencies of a winding number [rad/s]: logarithmic, at resonances, ten in each turn of a delay."""
        high = FAR * self.fastest
        count = int(FIRST_PER_DECADE * np.log10(high / least)) + 1
        turns = np.arange(0.0, 200.0 * np.pi, 0.2 * np.pi) / float(self.delays.max(initial=1e-300))
        parts = [np.geomspace(least, high, count), np.abs(self.rates.imag), turns]
        return np.unique(np.concatenate([part[(part > 0.0) & (part <= high)] for part in parts]))

    def step_response(self, times: np.ndarray) -> np.ndarray:
        """Outputs y after a step of the first input u from rest, at equal steps of time : float64[len(times), y].

        Within a step u is constant, and what arrives from delays is linear in time, as in the history between steps.
        """
        from scipy.linalg import expm

        n, h, m, p, k = self.a.shape[0], float(times[1] - times[0]), self.inputs, self.outputs, self.delays.size
        drive = np.hstack([self.b[:, :1], self.b[:, m:]])
        blocks = np.zeros((n + 2 * (1 + k), n + 2 * (1 + k)))
        blocks[:n, :n], blocks[:n, n : n + 1 + k] = self.a, drive
        blocks[n : n + 1 + k, n + 1 + k :] = np.eye(1 + k) / h
        power = expm(blocks * h)
        step, held, ramp = power[:n, :n], power[:n, n : n + 1 + k], power[:n, n + 1 + k :]
        x, sent, result = np.zeros(n), np.zeros((times.size, k)), np.zeros((times.size, p))
        late = self.delays / h
        before = np.zeros(1 + k)
        for i in range(times.size):
            place = i - late
            low = np.floor(place + 1e-9).astype(int)
            share = np.clip(place - low, 0.0, 1.0)
            known = [sent[np.clip(low + side, 0, max(i - 1, 0)), np.arange(k)] * (low + side >= 0) for side in (0, 1)]
            now = np.concatenate([[1.0], (1.0 - share) * known[0] + share * known[1]])
            if i > 0:
                x = step @ x + held @ before + ramp @ (now - before)
            columns = np.hstack([self.d[:, :1], self.d[:, m:]]) @ now + self.c @ x
            result[i], sent[i], before = columns[:p], columns[p:], now
        return result

    # poles --------------------------------------------------------------------------------------------------

    def poles(self, most: int) -> np.ndarray:
        """Poles with all inputs zero [1/s], by falling real part: all without delays, else at most `most` of them.

        With delays they are estimated by Chebyshev collocation of the delays, then solved by Newton's method, up to the
        size from which the collocation does not resolve them; poles farther out are farther left.
        """
        if not self.delays.size:
            return sorted_poles(np.linalg.eigvals(self.a).astype(complex))
        found: list[complex] = []
        estimates = self.collocated().rates
        for guess in estimates[np.argsort(np.abs(estimates))]:
            pole = self.newton(complex(guess))
            if pole is None or abs(pole - guess) > NEAR * abs(guess):  # beyond the resolution of the collocation
                break
            if all(abs(pole - other) > 1e-8 * (abs(pole) + self.slowest) for other in found):
                found.append(pole)
        return sorted_poles(np.array(found))[:most]

    def collocated(self) -> DelaySystem:
        """System without delays: each delay is a transport equation at Chebyshev points, with spectral accuracy."""
        k, n = CHEBYSHEV_POINTS, self.a.shape[0]
        theta = np.pi * np.arange(k + 1) / k
        place, weight = np.cos(theta), np.r_[2.0, np.ones(k - 1), 2.0] * (-1.0) ** np.arange(k + 1)
        slope = np.outer(weight, 1.0 / weight) / (place[:, None] - place[None, :] + np.eye(k + 1))
        slope -= np.diag(slope.sum(axis=1))
        channels = self.delays.size
        a = np.zeros((n + k * channels, n + k * channels))
        a[:n, :n] = self.a
        p, m = self.outputs, self.inputs
        for j, tau in enumerate(self.delays):
            own = n + k * j + np.arange(k)
            a[np.ix_(own, own)] = slope[1:, 1:] * 2.0 / tau
            entry = slope[1:, 0] * 2.0 / tau  # the value at the first point is what is sent
            a[own, :n] += np.outer(entry, self.c[p + j])
            for i in range(channels):
                last = n + k * i + k - 1
                a[own, last] += entry * self.d[p + j, m + i]
            a[:n, own[-1]] += self.b[:, m + j]
        none = np.zeros((a.shape[0], 0))
        return DelaySystem(a, none, none.T, np.zeros((0, 0)), 0, 0, np.zeros(0))

    def newton(self, s: complex) -> complex | None:
        """Pole near s [1/s] by Newton's method on det(s - A - B E (1 - D E)^-1 C); None without success."""
        m, p, start = self.inputs, self.outputs, s
        b, c, d = self.b[:, m:], self.c[p:], self.d[p:, m:]
        for _ in range(NEWTON_TURNS):
            decay = np.exp(-s * self.delays)
            # rows of states, then of w = E s : M = [[s - A, -B], [-E C, 1 - E D]], dM/ds = [[1, 0], [tau E C, tau E D]]
            matrix = np.block([[s * np.eye(len(self.a)) - self.a, -b],
                               [-decay[:, None] * c, np.eye(d.shape[0]) - decay[:, None] * d]])  # fmt: skip
            late = (self.delays * decay)[:, None]
            slope = np.block([[np.eye(len(self.a)), np.zeros(b.shape)], [late * c, late * d]])
            try:
                step = 1.0 / np.trace(np.linalg.solve(matrix, slope))
            except np.linalg.LinAlgError:
                return s
            s -= step
            if not np.isfinite(s) or abs(s - start) > 10.0 * (abs(start) + self.fastest):
                return None
            if abs(step) <= POLE_TOLERANCE * (abs(s) + self.slowest):
                return complex(s.real, 0.0) if abs(s.imag) <= 10.0 * POLE_TOLERANCE * abs(s) else s
        return None


def sorted_poles(poles: np.ndarray) -> np.ndarray:
    """Poles by falling real part, then by rising frequency, the one above the axis first."""
    digits = [[float(f"{part:.9g}") for part in values] for values in (poles.real, np.abs(poles.imag))]
    return poles[np.lexsort((-poles.imag, np.array(digits[1]), -np.array(digits[0])))]

"""Linear systems with exact delays: x' = A x + B u + Bw w, y = C x + D u + Dw w, s = Cs x + Ds u + Dsw w.

Each channel has w(t) = s(t - tau) with its own delay tau [s]. The delays are closed by exp(-s tau) at each complex
frequency s, without any rational approximation.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from fvsolve.studies.work_limit import DENSE_RATE, WorkLimit

FIRST_PER_DECADE = 40  # frequencies per decade of the first grid of a winding number
STEEP = 0.5  # change of the phase between two frequencies above which the grid is refined [rad]
MOST_ROUNDS = 40  # of refinement
AXIS = 1e-9  # of the fastest rate: poles closer to the imaginary axis count as stable
FAR = 1e3  # ratio of the highest frequency to the fastest rate
QUIET_PER_DECADE = 10  # frequencies per decade of the search for the last one of a winding number
SCALING_TURNS = 20  # of the scaling of a matrix
TURNS_POINTS = 200_000  # greatest number of frequencies for turns of delays
CHEBYSHEV_POINTS = 48  # of each delay, for estimates of poles
# least number of these points, and greatest size of the matrix with them
LEAST_POINTS, COLLOCATED_SIZE = 6, 1000
# beyond, only this multiple of the poles that are needed is estimated
MANY_STATES, RIGHTMOST = 200, 3
# frequencies that are solved one by one; greatest number of entries of an array of many
FEW, CHUNK = 4, 2_000_000
BLOCK = 48  # rows of a triangular matrix that are solved together
EIGENVALUE_OPERATIONS = 25.0  # over n^3
RESPONSE_RATE = 5e9  # operations in responses on one core of 2020 [1/s]
NEWTON_TURNS = 30
ENDLESS = 10**6  # number of unstable poles of delays that grow at all high frequencies
NEAR = 0.05  # greatest relative distance of a pole from its estimate
POLE_TOLERANCE = 1e-12  # relative change of a pole at which Newton has converged


FEWER_DELAYS = (
    "use fewer delays or shorter ones; with delay lines fewer lines, or cells in place of some of them, --set "
    "links.NAME.pipe_model=finite-volume"
)


@dataclass(frozen=True, eq=False)
class DelaySystem:
    """System of the module docstring; b, d, ... : columns of u first, then of w; c, d : rows of y first, then of s.

    inputs, outputs : numbers of u and of y; delays : float64[k]  tau of each channel [s]
    work : spends the estimated time of winding numbers and responses, which raise TooLarge above its limit
    """

    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    d: np.ndarray
    inputs: int
    outputs: int
    delays: np.ndarray
    work: WorkLimit = field(
        default_factory=lambda: WorkLimit("responses of a loop with delays", FEWER_DELAYS)
    )

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
        left = self.schur[1]
        with np.errstate(divide="ignore", invalid="ignore"):
            return self.d + np.moveaxis(
                np.tensordot(left, self.states_at(s, self.schur[2]), 1), 0, 1
            )

    def states_at(self, s: np.ndarray, right: np.ndarray) -> np.ndarray:
        """Solution (s - T)^-1 of a matrix, or of one for each s : complex128[states, len(s), columns]."""
        t = self.schur[0]
        n = t.shape[0]
        right = np.broadcast_to(
            right if right.ndim == 3 else right[:, None, :], (n, s.size, right.shape[-1])
        )
        x = np.zeros(right.shape, complex)
        if s.size <= FEW and 0 < n <= MANY_STATES:
            from scipy.linalg.lapack import ztrtrs

            for k, value in enumerate(s):
                matrix = -t
                matrix[np.diag_indices(n)] += value
                x[:, k], singular = ztrtrs(matrix, right[:, k])
                x[:, k] = np.inf if singular else x[:, k]
            return x
        flat = x.reshape(n, s.size * right.shape[-1])
        for end in range(n, 0, -BLOCK):  # products of matrices for most of the sum
            start = max(0, end - BLOCK)
            known = right[start:end] + (t[start:end, end:] @ flat[end:]).reshape(
                end - start, *right.shape[1:]
            )
            for i in reversed(range(start, end)):
                within = (t[i, i + 1 : end] @ flat[i + 1 : end]).reshape(right.shape[1:])
                x[i] = (known[i - start] + within) / (s - t[i, i])[:, None]
        return x

    def in_chunks(self, f: Callable[[np.ndarray], np.ndarray], s: np.ndarray) -> np.ndarray:
        """Values of f at complex numbers s, for so few at a time that arrays stay small; spends the time."""
        n, k = self.a.shape[0], self.delays.size
        each = n * (1 + k) + (1 + k) ** 2
        self.work.spend(s.size * (4.0 * n**2 * (1 + k) + 16.0 * k**3) / RESPONSE_RATE)
        return np.concatenate([f(part) for part in np.array_split(s, 1 + s.size * each // CHUNK)])

    def decay(self, s: np.ndarray) -> np.ndarray:
        """Factor exp(-s tau) of each delay : complex128[len(s), delays]."""
        return np.exp(-np.multiply.outer(s, self.delays))

    def response(self, s: np.ndarray) -> np.ndarray:
        """Transfer functions from u to y with all delays closed, at complex numbers s : complex128[len(s), y, u]."""
        return self.in_chunks(self.response_at_once, s)

    def response_at_once(self, s: np.ndarray) -> np.ndarray:
        """Transfer functions of `response`, with arrays for all s together."""
        cut = self.cut_response(s)
        m = self.inputs
        p = self.outputs
        if not self.delays.size:
            return cut
        closed = np.eye(self.delays.size) - cut[:, p:, m:] * self.decay(s)[:, None, :]
        arriving = self.decay(s)[:, :, None] * np.linalg.solve(closed, cut[:, p:, :m])
        return cut[:, :p, :m] + cut[:, :p, m:] @ arriving

    def closed(self, gain: float = 1.0) -> DelaySystem:
        """System in which each input u is `gain` times the output y of the same number, without inputs and outputs."""
        m = self.inputs
        p = self.outputs
        n = self.a.shape[0]
        back = np.linalg.solve(
            np.eye(p) - gain * self.d[:p, :m], gain * np.hstack([self.c[:p], self.d[:p, m:]])
        )
        return replace(
            self,
            a=self.a + self.b[:, :m] @ back[:, :n],
            b=self.b[:, m:] + self.b[:, :m] @ back[:, n:],
            c=self.c[p:] + self.d[p:, :m] @ back[:, :n],
            d=self.d[p:, m:] + self.d[p:, :m] @ back[:, n:],
            inputs=0,
            outputs=0,
        )

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

        Beyond the last frequency all eigenvalues of P E are within the unit circle, so that the phase that remains
        follows from them.
        """
        frequency = np.concatenate([[0.0], self.grid(shift, self.last_frequency(shift))])
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
        eye = np.eye(self.delays.size)
        return self.in_chunks(lambda part: np.linalg.det(eye - self.loop_matrices(part)), s)

    def last_frequency(self, shift: float) -> float:
        """Least frequency from which no delay can make an eigenvalue of P E as great as 1, on Re s = shift [rad/s].

        There a norm of P in scaled channels is below the middle of 1 and its limit, at sampled frequencies and at all
        resonances. Without such a frequency it is `FAR` times the fastest rate, where P is constant.
        """
        high = FAR * self.fastest
        count = int(QUIET_PER_DECADE * np.log10(high / self.slowest)) + 2
        grid = np.unique(
            np.concatenate([np.geomspace(self.slowest, high, count), np.abs(self.rates.imag)])
        )
        size = self.in_chunks(self.scaled_norms, shift + 1j * grid)
        loud = np.flatnonzero(size >= 0.5 * (1.0 + size[-1]))
        if size[-1] >= 1.0 or not loud.size:
            return high if size[-1] >= 1.0 else float(grid[0])
        return float(grid[min(loud[-1] + 1, grid.size - 1)])

    def scaled_norms(self, s: np.ndarray) -> np.ndarray:
        """2-norms of P at complex numbers s, each in channels scaled so that it is small : float64[len(s)].

        Row and column of each channel get equal sizes (Osborne 1960); such a scaling changes no eigenvalue of P E.
        """
        p = self.cut_response(s)[:, self.outputs :, self.inputs :]
        squares = np.abs(p) ** 2
        for i in list(range(self.delays.size)) * SCALING_TURNS:
            own = squares[:, i, i]
            row, column = squares[:, i].sum(axis=1) - own, squares[:, :, i].sum(axis=1) - own
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = np.sqrt(column / row)
            ratio = np.where(np.isfinite(ratio) & (ratio > 0.0), ratio, 1.0)[:, None]
            squares[:, i] *= ratio
            squares[:, :, i] /= ratio
        scaled, size = np.sqrt(squares) * np.exp(1j * np.angle(p)), np.full(s.size, np.inf)
        finite = np.isfinite(scaled).all(axis=(1, 2))  # P is infinite at a pole
        size[finite] = np.linalg.norm(scaled[finite], 2, axis=(1, 2))
        return size

    def grid(self, least: float, high: float) -> np.ndarray:
        """First frequencies of a winding number [rad/s]: logarithmic, at resonances, ten in each turn of a delay.

        least, high : range of frequencies [rad/s]; of turns at most `TURNS_POINTS` frequencies
        """
        high = max(high, 2.0 * least)
        count = int(FIRST_PER_DECADE * np.log10(high / least)) + 1
        turn = 0.2 * np.pi / float(self.delays.max(initial=1e-300))
        turns = turn * np.arange(1.0, min(high / turn, TURNS_POINTS) + 1.0)
        parts = [np.geomspace(least, high, count), np.abs(self.rates.imag), turns]
        return np.unique(np.concatenate([part[(part > 0.0) & (part <= high)] for part in parts]))

    def step_response(self, times: np.ndarray) -> np.ndarray:
        """Outputs y after a step of the first input u from rest, at equal steps of time : float64[len(times), y].

        Within a step u is constant, and what arrives from delays is linear in time, as in the history between steps.
        """
        from scipy.linalg import expm

        n = self.a.shape[0]
        h = float(times[1] - times[0])
        m = self.inputs
        p = self.outputs
        k = self.delays.size
        drive = np.hstack([self.b[:, :1], self.b[:, m:]])
        blocks = np.zeros((n + 2 * (1 + k), n + 2 * (1 + k)))
        blocks[:n, :n], blocks[:n, n : n + 1 + k] = self.a, drive
        blocks[n : n + 1 + k, n + 1 + k :] = np.eye(1 + k) / h
        power = expm(blocks * h)
        step = power[:n, :n]
        held = power[:n, n : n + 1 + k]
        ramp = power[:n, n + 1 + k :]
        x = np.zeros(n)
        sent = np.zeros((times.size, k))
        result = np.zeros((times.size, p))
        late = self.delays / h
        before = np.zeros(1 + k)
        for i in range(times.size):
            place = i - late
            low = np.floor(place + 1e-9).astype(int)
            share = np.clip(place - low, 0.0, 1.0)
            known = [
                sent[np.clip(low + side, 0, max(i - 1, 0)), np.arange(k)] * (low + side >= 0)
                for side in (0, 1)
            ]
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
        self.work.spend(EIGENVALUE_OPERATIONS * self.collocated_size**3 / DENSE_RATE)
        estimates = self.collocated_poles()
        if estimates.size > MANY_STATES:
            estimates = sorted_poles(estimates)[: RIGHTMOST * most]
        for guess in estimates[np.argsort(np.abs(estimates))]:
            pole = self.newton(complex(guess))
            # beyond the resolution of the collocation
            if pole is None or abs(pole - guess) > NEAR * abs(guess):
                break
            if all(abs(pole - other) > 1e-8 * (abs(pole) + self.slowest) for other in found):
                found.append(pole)
        return sorted_poles(np.array(found))[:most]

    def collocated_poles(self) -> np.ndarray:
        """Estimates of poles [1/s]: each delay is a transport equation at Chebyshev points, with spectral accuracy.

        All poles without delays; no estimates if there are too many delays.
        """
        return (
            np.linalg.eigvals(self.collocated())
            if self.collocation_points or not self.delays.size
            else np.zeros(0)
        )

    @property
    def collocated_size(self) -> int:
        """Number of rows of `collocated`."""
        return self.a.shape[0] + self.collocation_points * self.delays.size

    @property
    def collocation_points(self) -> int:
        """Number of Chebyshev points of each delay, so few that the matrix is not too large; 0 for too many delays."""
        points = min(
            CHEBYSHEV_POINTS, (COLLOCATED_SIZE - self.a.shape[0]) // max(1, self.delays.size)
        )
        return points if points >= LEAST_POINTS else 0

    def collocated(self) -> np.ndarray:
        """Matrix of the states and of the values at the Chebyshev points of all delays [1/s]."""
        k, n = self.collocation_points, self.a.shape[0]
        if not self.delays.size:
            return self.a
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
        return a

    def newton(self, s: complex) -> complex | None:
        """Pole near s [1/s] by Newton's method on f = det(s - A) det(1 - P E); None without success.

        f'/f = sum of 1 / (s - rates) + trace((1 - P E)^-1 (P T - P') E), with P' = -C (s - A)^-2 B and the delays T.
        """
        m = self.inputs
        p = self.outputs
        start = s
        left = self.schur[1][p:]
        right = self.schur[2][:, m:]
        d = self.d[p:, m:]
        for _ in range(NEWTON_TURNS):
            if np.any(self.rates == s):
                return s
            here, decay = np.array([s]), np.exp(-s * self.delays)
            x = self.states_at(here, right)
            p_here, slope = d + left @ x[:, 0], -left @ self.states_at(here, x)[:, 0]
            try:
                change = np.linalg.solve(
                    np.eye(d.shape[0]) - p_here * decay, (p_here * self.delays - slope) * decay
                )
                step = 1.0 / (np.sum(1.0 / (s - self.rates)) + np.trace(change))
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
    digits = [
        [float(f"{part:.9g}") for part in values] for values in (poles.real, np.abs(poles.imag))
    ]
    return poles[np.lexsort((-poles.imag, np.array(digits[1]), -np.array(digits[0])))]

"""Method of characteristics at Courant number 1 over a network whose lengths are multiples of a reach.

The network has a reservoir, junctions and a valve to a fixed pressure, under the linear density law. Friction is
`k |M|^(n-1) M` [Pa/m], integrated by the trapezoidal rule. The steady start is computed by the gradient method of
Todini and Pilati (1988).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass(frozen=True)
class Line:
    """Pipe with start and end node, length [m], diameter [m] and friction coefficient k for the mass flow [kg/s]."""

    start: str
    end: str
    length: float
    diameter: float
    friction: float


@dataclass(frozen=True)
class Network:
    """Network with the pressure `supply` [Pa] at `reservoir`, and a valve to the pressure `outside` [Pa] at `gate`.

    All nodes have the same elevation.
    """

    lines: list[Line]
    exponent: float
    wave_speed: float
    density: float
    reservoir: str
    supply: float
    gate: str
    outside: float

    def steady(self, demand: float) -> tuple[dict[str, float], Array]:
        """Pressures of the nodes [Pa] and mass flows of the pipes [kg/s] for an outflow `demand` [kg/s] at the gate."""
        names = sorted({n for a in self.lines for n in (a.start, a.end)} - {self.reservoir})
        to = np.zeros((len(self.lines), len(names)))
        fixed = np.zeros(len(self.lines))
        for i, line in enumerate(self.lines):
            for sign, place in ((1.0, line.start), (-1.0, line.end)):
                if place == self.reservoir:
                    fixed[i] += sign * self.supply
                else:
                    to[i, names.index(place)] += sign
        k = np.array([a.friction * a.length for a in self.lines])
        taken = np.array([demand if n == self.gate else 0.0 for n in names])
        m = np.full(len(k), demand / 2)
        for _ in range(200):  # dp = k |m|^(n-1) m linearised about m; balance to' m = -taken
            slope = np.maximum(self.exponent * k * np.abs(m) ** (self.exponent - 1), 1e-12)
            rest = m - k * np.abs(m) ** (self.exponent - 1) * m / slope + fixed / slope
            p = np.linalg.solve((to.T / slope) @ to, -taken - to.T @ rest)
            new = rest + (to @ p) / slope
            done, m = np.max(np.abs(new - m)) < 1e-13 * demand, new
            if done:
                break
        return dict(zip(names, p, strict=True)), m

    def gate_pressure(self, demand: float, opening: Callable[[float], float], reach: float, end: float):
        """Times [s] and pressure at the gate [Pa] for a valve that follows `opening` from t = 0.

        The start is steady with the outflow `demand` [kg/s].
        """
        pressures, flows = self.steady(demand)
        pressures[self.reservoir] = self.supply
        counts = [round(a.length / reach) for a in self.lines]
        first = np.concatenate([[0], np.cumsum([n + 1 for n in counts])])
        z, k, p, m = (np.empty(first[-1]) for _ in range(4))
        for i, a in enumerate(self.lines):
            here = slice(first[i], first[i + 1])
            z[here], k[here] = self.wave_speed / (math.pi / 4 * a.diameter**2), a.friction
            p[here] = np.linspace(pressures[a.start], pressures[a.end], counts[i] + 1)
            m[here] = flows[i]
        meets = {n: self._ends(n, first) for n in pressures}
        conductance = demand / math.sqrt(pressures[self.gate] - self.outside)
        steps, dt = round(end * self.wave_speed / reach), reach / self.wave_speed
        found, power = np.empty(steps + 1), self.exponent - 1
        found[0] = pressures[self.gate]
        half, plus, minus = k * reach / 2, np.empty_like(p), np.empty_like(p)
        for n in range(1, steps + 1):
            loss = half * np.abs(m) ** power * m
            plus[1:] = (p + z * m - loss)[:-1]  # characteristics from the left and from the right
            minus[:-1] = (p - z * m + loss)[1:]
            guess = m
            for _ in range(3):
                loss = half * np.abs(guess) ** power * guess
                m_new = (plus - minus - 2 * loss) / (2 * z)
                p_new = (plus + minus) / 2
                for place, (ins, outs) in meets.items():
                    brought = np.concatenate([plus[ins] - loss[ins], minus[outs] + loss[outs]])
                    admittance = 1 / np.concatenate([z[ins], z[outs]])
                    total = admittance.sum()
                    level = (admittance @ brought) / total
                    if place == self.reservoir:
                        level = self.supply
                    elif place == self.gate:
                        b = conductance * opening(n * dt) / total
                        closed = level - self.outside
                        root = (-b + math.sqrt(b * b + 4 * abs(closed))) / 2
                        level = self.outside + math.copysign(root * root, closed)
                    p_new[ins], p_new[outs] = level, level
                    m_new[ins] = (plus[ins] - loss[ins] - level) / z[ins]
                    m_new[outs] = (level - minus[outs] - loss[outs]) / z[outs]
                guess = m_new
            p, m = p_new, m_new
            found[n] = p[meets[self.gate][0][0]]
        return dt * np.arange(steps + 1), found

    def _ends(self, node: str, first: Array) -> tuple[list[int], list[int]]:
        """Indices of the points at which pipes end at a node, and at which pipes start there."""
        ins = [first[i + 1] - 1 for i, a in enumerate(self.lines) if a.end == node]
        return ins, [first[i] for i, a in enumerate(self.lines) if a.start == node]
